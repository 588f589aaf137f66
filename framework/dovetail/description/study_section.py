"""The section ``study:`` of a description: which options of the training to try, one by one or together."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from dovetail.description.sections import Section
from dovetail.documents.fault_list import FaultList
from dovetail.documents.validation import validate
from dovetail.units import InUnit

_OPTIONS = ("reducer", "regressor", "augmentation")


def _place(value: str) -> str:
    first, *steps = value.split(".")
    if first not in _OPTIONS or not all(step.isidentifier() or step.isdecimal() for step in steps):
        problem = f"'{value}' is not an option of the training, such as 'reducer.n_neighbors'"
        raise ValueError(f"{problem}: it must begin with {', '.join(_OPTIONS)}")
    return value


_Place = Annotated[str, AfterValidator(_place)]


class SearchRange(Section):
    """A range of numbers for an option; whole numbers if both ends are whole.

    Attributes
    ----------
    range : two numbers
        Lowest and highest.
    scale : 'linear' or 'log'
        Scale on which values are drawn.
    """

    range: tuple[int, int] | tuple[float, float]
    scale: Literal["linear", "log"] = "linear"

    @model_validator(mode="after")
    def _increasing(self) -> Self:
        if not self.range[0] < self.range[1]:
            raise ValueError("the range is empty")
        if self.scale == "log" and self.range[0] <= 0:
            raise ValueError("a range on a logarithmic scale must be positive")
        return self


_Tried = Annotated[tuple[Any, ...], Field(min_length=1)]


class SearchSection(Section):
    """A search over several options together.

    Attributes
    ----------
    trials : int
        Number of settings to try.
    options : section
        For each option, by its place in `identification`, a list of choices or a range.
    prune : bool
        Train on a quarter of the samples first, and drop settings that are then worse than the median of the others.
    """

    trials: Annotated[int, Field(ge=1, le=100_000)]
    options: Annotated[dict[_Place, _Tried | SearchRange], Field(min_length=1)]
    prune: bool = True


class StudySection(Section):
    """Which settings of the training ``dovetail study`` tries.

    Attributes
    ----------
    sweeps : section
        For each option, by its place in `identification` such as `reducer.n_neighbors`, the values to try while all
        others stay as described.
    search : section
        Options that are varied together.
    validation_fraction : float
        Share of the samples outside the test part on which settings are compared.
    lease : float
        Time without a heartbeat of its process after which a trial is repeated, at least 4 [s].
    """

    sweeps: dict[_Place, _Tried] = Field(default={})
    search: SearchSection | None = None
    validation_fraction: Annotated[float, Field(gt=0, lt=1)] = 0.2
    lease: Annotated[float, Field(ge=1), InUnit("s")] = 60.0

    @model_validator(mode="after")
    def _has_trials(self) -> Self:
        if not self.sweeps and self.search is None:
            raise ValueError("a study needs 'sweeps', a 'search', or both")
        return self


def read_study(faults: FaultList) -> StudySection | None:
    """Return the study of a description, or None if it has none or has faults there."""
    if faults.root.at(("study",)) is None:
        return None
    return validate(StudySection, ("study",), faults, "'study'")
