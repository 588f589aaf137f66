"""A reader gets `ReadOptions` and returns a `Recording`, which `to_frf` checks and converts to an FRF."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, argument, counted, did_you_mean, listing
from dovetail.frf import QUANTITIES, Frf, Quantity, check_size, unit_of
from dovetail.interfaces import About, Statement
from dovetail.measurement.frf_units import UnitMeaning, is_si, meaning_of_unit, read_unit
from dovetail.measurement.named_points import DOF, are_opposite
from dovetail.measurement.point_statements import End, PointStatement, without_points
from dovetail.measurement.statements import interpret

MOST_LINES = 1_000_000
"""Largest number of lines of an FRF."""
_COHERENCE_ROUNDING = 1e-4
"""Distance of a coherence beyond 0 or 1 that single precision and rounding in the file may cause."""
_HIGHEST_COHERENCE = 1.05
"""Largest value for a coherence of 1 from analysers that average or correct auto and cross spectra differently."""

_LONGEST_RUN, _LONGEST_PART = 20, 0.02
"""Number of lines, and part of all, with the same value above which this is reported."""


@dataclass(frozen=True)
class Recording:
    """One FRF as the file contains it, not yet checked.

    Parameters
    ----------
    where : str
        The file, and the set in it.
    label : str
        Label of the FRF.
    frequency : (n_freq,) array
        Hz.
    values : (n_freq,) array
        Complex, or real for an amplitude only; times `factor` they are SI.
    has_phase : bool
        False for an amplitude only.
    quantity : Quantity or None
        As given in the file.
    is_stated : bool
        False if the file is ambiguous, so that the caller must confirm or state `quantity`.
    coherence : (n_freq,) array or None
        Ordinary coherence.
    locate : callable
        Returns the place in the file of the line with an index, for messages.
    how_to_state_quantity : str
        How a file of this format states its quantity.
    note : str
        The file's comment on it.
    factor : float
        Converts the values to SI; negative if response and force point in opposite directions.
    unit : str
        The unit that the file states; empty if it states none.
    averages : int or None
    variance : (n_freq,) array or None
        E|error|^2 of each value, in the square of the values' unit.
    rotation, moment : bool
        Whether the response is a rotation instead of a displacement, and the excitation a moment instead of a force.
    response, force : str
        Names of the DOFs.
    taken : sequence of str
        Sentences on what each column or array is taken for; empty for formats without these.
    mentions : sequence of Statement
        Units in running text, which have to be settled by the caller if the file states none.
    half_unit : str
        The unit of the motion or of the load, if the file states one without the other.
    """

    where: str
    label: str
    frequency: NDArray[np.float64]
    values: NDArray[Any]
    has_phase: bool
    quantity: Quantity | None
    is_stated: bool
    coherence: NDArray[np.float64] | None
    locate: Callable[[int], str] = field(repr=False)
    how_to_state_quantity: str
    note: str = ""
    factor: float = 1.0
    unit: str = ""
    averages: int | None = None
    variance: NDArray[np.float64] | None = None
    rotation: bool = False
    moment: bool = False
    response: str = ""
    force: str = ""
    taken: Sequence[str] = ()
    mentions: Sequence[Statement] = ()
    half_unit: str = ""

    def to_frf(self, quantity: str | None, unit: str | None = None) -> Frf:
        """Check everything and return the FRF; a line at 0 Hz is left out.

        Parameters
        ----------
        quantity, unit : str or None
            As the caller states them; they must not contradict the file.

        Raises
        ------
        MeasurementError
            The first fault, with its place in the file.
        """
        if unit is not None:
            return self._with_unit(unit).to_frf(quantity)
        agreed = self._resolve_quantity(quantity)
        self._check_unit()
        first = 1 if self.frequency[0] == 0 else 0
        if self.frequency.size == first:
            raise MeasurementError(Fault(self.where, "there is no line but the one at 0 Hz."))
        self._check_finite(first)
        self._check_axis(first)
        self._check_amplitude(first)
        self._warn_of_repeated(first)
        factor = self.factor if self.has_phase else abs(self.factor)
        whole = {"frequency": self.frequency, "value": self.values, "variance": self.variance}
        used = {name: None if array is None else array[first:] for name, array in whole.items()}
        check_size(used, abs(factor), self.averages, lambda index: self.locate(first + index))
        return Frf(
            frequency=self.frequency[first:],
            values=np.asarray(self.values[first:] * factor, dtype=np.complex128),
            quantity=agreed,
            coherence=self._clip_coherence(first),
            has_phase=self.has_phase,
            label=self.label,
            note=self.note,
            averages=self.averages,
            variance=None if self.variance is None else self.variance[first:] * factor**2,
            rotation=self.rotation,
            moment=self.moment,
            has_unit=bool(self.unit),
            response=self.response,
            force=self.force,
            origin=self._origin(first),
        )

    def _origin(self, first: int) -> str:
        if not self.taken:
            return ""
        left_out = ", of which that at 0 Hz is left out" if first else ""
        return f"{counted(self.frequency.size, 'row')}{left_out}; {listing(self.taken)}."

    def with_dofs(self, response: str, force: str) -> Recording:
        """Return the recording with the caller's DOFs, if the file states none.

        If response and force point in opposite directions, the sign of the values is changed.

        Raises
        ------
        MeasurementError
            The names are not those of DOFs, or differ from those in the file.
        """
        for name, in_file in ((response, self.response), (force, self.force)):
            if not DOF.fullmatch(name):
                accepted = "a node with its direction, such as 3+x, tool:5-y or 7rz"
                raise MeasurementError(Fault("the argument dofs", f"'{name[:40]}' is not a DOF.", accepted))
            if in_file and in_file.lower().replace("+", "") != name.lower().replace("+", ""):
                raise self._contradiction(f"the DOF {in_file}", name)
        is_new = not (self.response and self.force) and are_opposite(response, force)
        return replace(self, response=response, force=force, factor=-self.factor if is_new else self.factor)

    def without_dofs(self) -> Recording:
        """Return the recording with unknown DOFs, and with the sign that the values have in the file."""
        is_turned = are_opposite(self.response, self.force)
        factor = -self.factor if is_turned else self.factor
        return replace(self, response="", force="", note=without_points(self.note), factor=factor)

    def _with_unit(self, label: str) -> Recording:
        """Return the recording with the caller's unit; a file that states another one is refused."""
        meaning = meaning_of_unit(label, "the argument unit")
        if not self.unit:
            self._check_half(label)
            return replace(
                self._check_against(meaning),
                mentions=(),
                half_unit="",
                quantity=meaning.quantity,
                is_stated=True,
                factor=self.factor * meaning.factor,
                rotation=meaning.rotation,
                moment=meaning.moment,
                unit=label,
            )
        if not math.isclose(abs(self.factor), meaning.factor, rel_tol=1e-6):
            raise self._contradiction(f"unit {self.unit}", label)
        return replace(self._check_against(meaning), mentions=())

    def _check_half(self, label: str) -> None:
        if self.half_unit:
            about: About = "load unit" if _is_load(self.half_unit) else "motion unit"
            interpret([Statement(about, self.half_unit, self.where), Statement("unit", label, "the argument unit")])

    def _check_unit(self) -> None:
        """Refuse an FRF whose unit the file only mentions, or states without that of the load."""
        remedy = "Give the unit of the values, such as `unit='g/N'`."
        for about, text, where, _ in self.mentions:
            if about == "disputed unit":
                problem = f"the unit is '{text[:40]}' by its label and in SI by set 164."
                raise MeasurementError(Fault(where, problem, remedy=remedy))
            if about == "unclear unit":
                raise MeasurementError(Fault(where, f"the unit '{text[:40]}' is not understood.", remedy=remedy))
        if self.unit:
            return
        if self.half_unit:
            half, other = ("load", "motion") if _is_load(self.half_unit) else ("motion", "load")
            problem = f"the {half} is in '{self.half_unit[:40]}', and the file does not give the unit of the {other}."
            raise MeasurementError(Fault(self.where, problem, remedy=remedy))
        for about, text, where, _ in self.mentions:
            if about == "unit" and not is_si(text):
                problem = f"'{text[:40]}' is mentioned, and no unit of the values is given."
                raise MeasurementError(Fault(where, problem, remedy=remedy))

    def _check_against(self, meaning: UnitMeaning) -> Recording:
        if self.quantity is not None and self.quantity != meaning.quantity:
            raise self._contradiction(self.quantity, f"a unit of {meaning.quantity}")
        if self.unit and (self.rotation, self.moment) != meaning.kind:
            unit = unit_of(meaning.quantity, rotation=meaning.rotation, moment=meaning.moment)
            raise self._contradiction(f"unit {self.unit}", unit)
        return self

    def _contradiction(self, contents: str, argument: str) -> MeasurementError:
        problem = f"the file says that it holds {contents}, the argument says {argument}."
        return MeasurementError(Fault(self.where, problem, remedy="Leave the argument out, or correct the file."))

    def _resolve_quantity(self, argument: str | None) -> Quantity:
        wanted = None if argument is None else parse_quantity(argument, "the argument quantity")
        if wanted is not None and self.quantity is not None and wanted != self.quantity:
            raise self._contradiction(self.quantity, wanted)
        agreed = wanted or (self.quantity if self.is_stated else None)
        if agreed is None:
            hint = "" if self.quantity is None else f" (perhaps {self.quantity}: it does not say over what)"
            raise MeasurementError(
                Fault(
                    self.where,
                    f"the file does not say which quantity it holds{hint}.",
                    f"a quantity of {', '.join(QUANTITIES)}, or {self.how_to_state_quantity}",
                    "Give it: `quantity='accelerance'` or `unit='g/N'`.",
                )
            )
        return agreed

    def _check_finite(self, first: int) -> None:
        for name, array in (
            ("frequency", self.frequency),
            ("value", self.values),
            ("coherence", self.coherence),
            ("variance", self.variance),
        ):
            if array is None:
                continue
            bad = np.flatnonzero(~np.isfinite(array[first:])) + first
            if bad.size:
                more = f" ({bad.size} such lines)" if bad.size > 1 else ""
                problem = f"the {name} is {array[bad[0]]}, which is not finite{more}."
                raise MeasurementError(Fault(self.locate(int(bad[0])), problem, remedy=_REMOVE))

    def _check_axis(self, first: int) -> None:
        if self.frequency[first] < 0:
            problem = f"the frequency {self.frequency[first]:.10g} Hz is negative."
            raise MeasurementError(Fault(self.locate(first), problem))
        still = np.flatnonzero(np.diff(self.frequency) <= 0)
        if still.size:
            before, after = self.frequency[still[0]], self.frequency[still[0] + 1]
            fault = "is repeated" if before == after else f"comes after {before:.10g} Hz"
            place, accepted = self.locate(int(still[0]) + 1), "frequencies that increase from line to line"
            raise MeasurementError(Fault(place, f"the frequency {after:.10g} Hz {fault}.", accepted))

    def _check_amplitude(self, first: int) -> None:
        if self.has_phase:
            return
        negative = np.flatnonzero(self.values[first:] < 0) + first
        if negative.size:
            problem = f"the amplitude {self.values[negative[0]]:.6g} is negative."
            accepted = "an amplitude of zero or more, or real and imaginary part"
            raise MeasurementError(Fault(self.locate(int(negative[0])), problem, accepted))

    def _warn_of_repeated(self, first: int) -> None:
        """Warn of many lines in a row with exactly the same value, such as those with which a file was filled up."""
        values = self.values[first:]
        ends = np.flatnonzero(np.append(np.diff(values) != 0.0, True))
        runs = np.diff(ends, prepend=-1)
        longest = int(runs.max())
        if max(_LONGEST_RUN, _LONGEST_PART * values.size) <= longest < values.size:
            start = first + int(ends[runs.argmax()]) - longest + 1
            problem = (
                f"{longest} lines in a row have the same value, {values[start - first]:.4g}: was the file filled up?"
            )
            warnings.warn(f"{self.locate(start)}: {problem}", stacklevel=4)

    def _clip_coherence(self, first: int) -> NDArray[np.float64] | None:
        if self.coherence is None:
            return None
        coherence = self.coherence[first:]
        outside = np.flatnonzero((coherence < -_COHERENCE_ROUNDING) | (coherence > _HIGHEST_COHERENCE))
        if outside.size:
            problem = f"the coherence {coherence[outside[0]]:.6g} is not between 0 and 1."
            raise MeasurementError(Fault(self.locate(int(outside[0]) + first), problem))
        if above := int(np.count_nonzero(coherence > 1 + _COHERENCE_ROUNDING)):
            lines = f"{above} of {coherence.size} lines, by up to {coherence.max() - 1:.2g}"
            warnings.warn(f"{self.where}: the coherence is above 1 at {lines}; it is taken as 1 there.", stacklevel=4)
        return np.clip(coherence, 0.0, 1.0)


def _is_load(unit: str) -> bool:
    reading = read_unit(unit)
    return reading is not None and reading.kind == "load"


_REMOVE = (
    "Remove these lines from the file: a measurement need not be evenly spaced. "
    "With NumPy: ok = np.isfinite(values), then frequency[ok] and values[ok]."
)


class PointFields(TypedDict):
    """Fields of an FRF that say where it was measured."""

    response: str
    force: str
    note: str


def point_fields(known: Mapping[str, str], statements: Sequence[PointStatement]) -> PointFields:
    """Return the DOFs and the note of a file with what its texts say of points.

    The name of a DOF becomes that of the response or of the force if the file gives none otherwise. Other statements
    become part of the note, so that they stay with the FRF.

    Parameters
    ----------
    known : mapping of str to str
        What the file has as ``response``, ``force`` and ``note``.
    statements : sequence of PointStatement
    """
    response, force, note = (known.get(name, "") for name in ("response", "force", "note"))
    ends: dict[End, str] = {"response": response, "force": force}
    clauses = list[str]()
    for one in statements:
        if one.end in ends and not ends[one.end] and DOF.fullmatch("".join(one.text.split())):
            ends[one.end] = one.text
        elif one.text not in ends.values() and one.clause not in (*clauses, *note.split("; ")):
            clauses.append(one.clause)
    whole = "; ".join(filter(None, (note, *clauses)))
    return PointFields(response=ends["response"], force=ends["force"], note=whole)


def parse_quantity(word: str, where: str) -> Quantity:
    """Return `word` as a quantity, or raise a MeasurementError at `where` that suggests the nearest spelling."""
    for quantity in QUANTITIES:
        if word == quantity:
            return quantity
    raise MeasurementError(
        Fault(where, f"{word[:80]!r} is not a quantity.", ", ".join(QUANTITIES), did_you_mean(word[:80], QUANTITIES))
    )


@dataclass(frozen=True)
class ReadOptions:
    """The selection of an FRF in a file, and the names of its fields there.

    Parameters
    ----------
    index : int or None
        Number of the FRF, from 1.
    response, force : str or None
        Names of the DOFs.
    names : mapping of str to str
        From a field of the FRF (``frequency``, ``values``, ``coherence``, ...) to its name in the file.
    columns : tuple of str
        The columns of a table, instead of its header.
    skip : tuple of str
        Names in the file that do not concern the values, as the caller says.
    """

    index: int | None = None
    response: str | None = None
    force: str | None = None
    names: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    columns: tuple[str, ...] = ()
    skip: tuple[str, ...] = ()

    @property
    def chooses(self) -> str:
        """The first argument that chooses one of several FRFs, as messages name it, or an empty text."""
        named = [(self.index, argument("index", self.index)), (self.response, argument("response", self.response))]
        named.append((self.force, argument("force", self.force)))
        return next((text for value, text in named if value is not None), "")
