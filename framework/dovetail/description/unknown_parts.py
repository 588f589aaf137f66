"""Substructures with options to identify, which the synthesis treats as joints, since they depend on parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from dovetail.description.checked import JointEntry, Tie
from dovetail.description.parameter_sections import StatedParameters, steps_of
from dovetail.description.reversed_parts import ReversedPart, opposite_rotations
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Item, Path, replace_item, replace_value
from dovetail.documents.validation import number_unit
from dovetail.errors import DovetailError, PluginError, listing
from dovetail.interfaces import (
    JointModel,
    Parameter,
    Port,
    SparseMatrices,
    StructuralMatrices,
    SubstructureModel,
    plugin_errors,
)
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection
from dovetail.synthesis.condensation import inverted_receptance, substructure_matrices
from dovetail.units import format_quantity

_NEAR = 0.9
"""Lower end, over the value, of the range within which matrices are differentiated by an option without a range."""
_LONGEST_CHAIN = 20
"""Largest number of ties that are followed from one to the next; a circle of them has no end."""
_MOST_DOFS = 600
"""Largest number of DOFs of a part with unknown options, whose matrices are computed again for each FRF."""
_MOST_CORNERS = 64
"""Largest number of corners of the ranges at which a part is tried."""


class UnknownPart(JointModel):
    """A substructure as a function of some of its options: a joint with all its nodes as a port.

    Parameters
    ----------
    part : SubstructureModel
        With the middles of the ranges as options.
    parameters : sequence of Parameter
        The options that are sought or follow others, named by their path in the section.
    reversed : bool
        Whether its axis runs against the assembly's, so that its rotations have the opposite sign.
    """

    kind = "substructure"  # for messages
    summary = "A substructure with unknown options"

    def __init__(self, part: SubstructureModel, parameters: Sequence[Parameter], *, reversed: bool = False) -> None:
        super().__init__()
        self.name = part.name  # type: ignore[misc]  # for messages
        self.part, self.reversed = part, reversed
        self._parameters = tuple(parameters)
        with plugin_errors(part, f"substructure model '{part.name}'"):
            matrices = substructure_matrices(part)
        self.has_matrices = matrices is not None
        self._internal = 0 if matrices is None else matrices.size - 2 * len(part.nodes)
        self._latest: tuple[NDArray[np.float64], StructuralMatrices] | None = None

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The options, in the order of the description."""
        return self._parameters

    @cached_property
    def ports(self) -> tuple[Port, ...]:
        """All nodes."""
        return (Port("nodes", len(self.part.nodes)),)

    @property
    def internal_dofs(self) -> int:
        """Number of the part's inner DOFs."""
        return self._internal

    def refined(self, factor: int) -> UnknownPart | None:
        """Return the same part with a finer mesh and the same options, or None if the model has no mesh."""
        finer = self.part.refined(factor)
        return None if finer is None else type(self)(finer, self._parameters, reversed=self.reversed)

    def made_with(self, options: Mapping[str, float]) -> SubstructureModel:
        """Return the part with other values of some options, by their paths in the section.

        Raises
        ------
        ValueError
            The part's options do not allow them.
        """
        changed = self.part.config.with_options(options)
        return type(self.part)(type(changed).model_validate(changed.model_dump(by_alias=True, exclude_unset=True)))

    def _each(self, theta: NDArray[np.float64]) -> Iterator[SubstructureModel]:
        """Yield the part with the options of each row."""
        names = [parameter.name for parameter in self._parameters]
        return (self.made_with(dict(zip(names, values, strict=True))) for values in theta.tolist())

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the part's matrices (n, d, d), computed in one batch if the model can do that.

        Those of a single parameter vector are cached, since an FRF and its derivatives need the same ones.
        """
        latest = self._latest
        if latest is not None and np.array_equal(latest[0], theta):
            return latest[1]
        matrices = self._made(theta) if self._parameters else _dense(substructure_matrices(self.part))
        if self.reversed:
            matrices = opposite_rotations(matrices, len(self.part.nodes))
        matrices = _for_each(matrices, len(theta))
        if len(theta) == 1:
            self._latest = theta.copy(), matrices
        return matrices

    def _made(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        options = {parameter.name: theta[:, column] for column, parameter in enumerate(self._parameters)}
        with plugin_errors(self.part, f"substructure model '{self.part.name}'"):
            batch = self.part.batched_matrices(options)
            if batch is not None:
                return _for_each(batch, len(theta))
            single = [_dense(substructure_matrices(part)) for part in self._each(theta)]
            if other := next((one.size for one in single if one.size != self.size), None):
                problem = f"it has {other} DOFs with some values of these options and {self.size} in their middle"
                raise PluginError(f"{problem}; their number must not depend on an option that is sought.")
        return StructuralMatrices(*(np.stack([getattr(one, name) for one in single]) for name in "MKCD"))


class UnknownReceptance(UnknownPart):
    """An `UnknownPart` that is known by its FRFs only."""

    _used: tuple[int, ...] | None = None

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:  # noqa: ARG002
        """Raise an error, since there are none."""
        raise DovetailError(f"substructure model '{self.part.name}' has no matrices, so the assembly has none either.")

    def dynamic_stiffness(self, frequency: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the inverse of the receptance between the DOFs in use (n, n_freq, d, d), zero at the others."""
        dofs = range(self.size) if self._used is None else self._used
        stiffness = np.zeros((len(theta), len(frequency), self.size, self.size), dtype=np.complex128)
        with plugin_errors(self.part, f"substructure model '{self.part.name}'"):
            for row, part in enumerate(self._each(theta)):
                turned = ReversedPart(part) if self.reversed else part
                stiffness[row][:, np.array(dofs)[:, None], dofs] = inverted_receptance(turned, dofs, frequency)
        return stiffness

    def between(self, dofs: Sequence[int]) -> UnknownReceptance:
        """Return the same part between some of its DOFs only, so that less of its receptance is inverted."""
        part = UnknownReceptance(self.part, self._parameters, reversed=self.reversed)
        part._used = tuple(dofs)
        return part


@dataclass(frozen=True)
class UnknownOptions:
    """The options of a substructure that its section does not state as numbers.

    Parameters
    ----------
    stated : StatedParameters
        By their path in the section, such as ``material.young``.
    sections : mapping of Path to Item
        Their entries in the description, by their path there.
    """

    stated: StatedParameters
    sections: Mapping[Path, Item]

    def restore(self, faults: FaultList) -> None:
        """Put their entries back into the description's tree."""
        for path, item in self.sections.items():
            faults.root = replace_item(faults.root, path, item)


def take_unknown_options(name: str, faults: FaultList, registry: Registry) -> UnknownOptions:
    """Read the sought options of a substructure, and replace them in the tree by the middles of their ranges.

    Parameters
    ----------
    name : str
        Of the substructure.
    faults : FaultList
        With the description's tree.
    registry : Registry
    """
    path: Path = ("substructures", name)
    stated, sections = StatedParameters({}, needs_range=True), dict[Path, Item]()
    section, config = faults.root.at(path), _config_of(name, faults, registry)
    if section is None or config is None:
        return UnknownOptions(stated, sections)
    middles = {}
    for steps, item in _sections_within(section, ()):
        unit = number_unit(config, steps)
        if unit is None:
            continue
        place, option = (*path, *steps), ".".join(map(str, steps))
        stated.known[option] = Parameter(option, unit, 0.0, 1.0)
        stated.read(place, option, item, faults)
        middle = _middle(item, stated.known[option], faults)
        if option in stated.ties:
            middle = _check_followed(stated.ties[option], unit, middle, place, faults, registry)
        if middle is not None and _follows_number(stated, option, faults):
            del stated.ties[option]
            stated.fixed[option] = middle
        if middle and (option in stated.ties or option in stated.fixed):
            ends = sorted((_NEAR * middle, middle / _NEAR))
            stated.known[option] = Parameter(option, unit, ends[0], ends[1])
        sections[place], middles[place] = item, middle
    for place, middle in middles.items():
        option = ".".join(map(str, place[len(path) :]))
        faults.root = replace_value(faults.root, place, stated.known[option].lower if middle is None else middle)
    return UnknownOptions(stated, sections)


def _config_of(name: str, faults: FaultList, registry: Registry) -> type[BaseModel] | None:
    """Return the options' class of a substructure's model, or None if there is no such model."""
    section = faults.root.at(("substructures", name))
    model = section.entries.get("model") if section is not None else None
    if model is None or not isinstance(model.item.value, str):
        return None
    try:
        return registry.find("substructure", model.item.value).component.Config
    except PluginError:  # reported where the part is read
        return None


def _check_followed(
    tie: Tie, unit: str, middle: float | None, place: Path, faults: FaultList, registry: Registry
) -> float | None:
    """Return the middle of an option that follows another one; if it cannot, report a fault and return None."""
    config = _config_of(tie.owner, faults, registry)
    other = number_unit(config, steps_of(tie.parameter)) if config is not None else None
    name = f"{tie.owner}.{tie.parameter}"
    if other is not None and other != unit:
        faults.add((*place, "same_as"), f"'{name}' is in {other}, and a quantity in {unit} is wanted.")
        return None
    if middle is None:
        faults.add((*place, "same_as"), f"'{name}' has no value or range in the description.")
    return middle


def _sections_within(item: Item, steps: Path) -> Iterator[tuple[Path, Item]]:
    """Yield all mappings within an item, with their paths relative to it."""
    children: Iterator[tuple[str | int, Item]] = iter(())
    if item.is_mapping:
        children = ((key, entry.item) for key, entry in item.entries.items())
    elif isinstance(item.value, tuple):
        children = iter(enumerate(item.value))
    for step, child in children:
        if child.is_mapping:
            yield (*steps, step), child
        yield from _sections_within(child, (*steps, step))


def _middle(item: Item | None, parameter: Parameter, faults: FaultList, depth: int = 0) -> float | None:
    """Return a parameter's value, or the middle of its range, from its entry; None if the entry has neither."""
    if item is None or depth > _LONGEST_CHAIN:
        return None
    stated = StatedParameters({parameter.name: parameter})
    alone = FaultList()
    alone.root = item
    stated.read((), parameter.name, item, alone)
    if parameter.name in stated.fixed:
        return stated.fixed[parameter.name]
    if parameter.name in stated.ties:
        tie = stated.ties[parameter.name]
        other = _middle(_followed_item(tie, faults), parameter, faults, depth + 1)
        return None if other is None else tie.ratio * other
    return float(stated.known[parameter.name].from_unit(np.array(0.5)))


def _followed_item(tie: Tie, faults: FaultList) -> Item | None:
    """Return the description's entry of the parameter that another one follows."""
    steps = steps_of(tie.parameter)
    option = faults.root.at(("substructures", tie.owner, *steps))
    return option if option is not None else faults.root.at(("joints", tie.owner, "parameters", *steps))


def _follows_number(stated: StatedParameters, option: str, faults: FaultList) -> bool:
    """Return whether an option follows one that the description states as a number."""
    other = _followed_item(stated.ties[option], faults) if option in stated.ties else None
    return other is not None and not other.is_mapping


def add_unknown_part(
    name: str, part: SubstructureModel, stated: StatedParameters, faults: FaultList, *, reversed: bool = False
) -> JointEntry | None:
    """Return the entry of a substructure with unknown options; if its ranges are impossible, add a fault, return None.

    Parameters
    ----------
    name : str
        Of the substructure.
    part : SubstructureModel
        With the middles of the ranges as options.
    stated : StatedParameters
    faults : FaultList
    reversed : bool
        Whether the part is reversed.
    """
    with plugin_errors(part, f"substructure '{name}' ({part.name})"):
        kind = UnknownReceptance if part.matrices() is None else UnknownPart
    model = kind(part, tuple(stated.known.values()), reversed=reversed)
    if model.size > _MOST_DOFS:
        problem = (
            f"its options cannot be sought: it has {model.size} DOFs, and its matrices are made anew for each FRF."
        )
        faults.add(("substructures", name), problem, f"{_MOST_DOFS} DOFs or fewer", key=True)
        return None
    for sought in _corners(stated):
        ties = {option: tie for option, tie in stated.ties.items() if tie.owner == name and tie.parameter in sought}
        corner = {**sought, **{option: tie.ratio * sought[tie.parameter] for option, tie in ties.items()}}
        if problem := objection(model, corner):
            faults.add(("substructures", name, *steps_of(next(iter(corner)))), problem)
            return None
    connection = Connection(model, (Attachment(name, tuple(range(len(part.nodes)))),))
    return JointEntry(connection=connection, **stated.entry)


def _corners(stated: StatedParameters) -> Iterator[dict[str, float]]:
    """Yield both ends of each sought option alone, then corners of the ranges of all of them."""
    sought = [p for name, p in stated.known.items() if name not in stated.fixed and name not in stated.ties]
    for parameter in sought:
        yield from ({parameter.name: end} for end in (parameter.lower, parameter.upper))
    corners = np.random.default_rng(0).random((_MOST_CORNERS, len(sought))) < 0.5
    for upper in np.unique(corners, axis=0) if len(sought) > 1 else ():
        yield {p.name: p.upper if high else p.lower for p, high in zip(sought, upper, strict=True)}


def objection(model: UnknownPart, options: Mapping[str, float]) -> str:
    """Return a sentence that says why a part cannot have some options, or an empty text if it can."""
    units = {parameter.name: parameter.unit for parameter in model.parameters}
    said = [format_quantity(value, units[option]) for option, value in options.items()]
    where = f"{said[0]} there"
    if len(said) > 1:
        where = listing((f"{option} = {value}" for option, value in zip(options, said, strict=True)), 20)
    try:
        part = model.made_with(options)
    except ValidationError as error:
        reason = error.errors()[0]["msg"].removeprefix("Value error, ").replace("Input should", "it must")
        return f"the part cannot have {where}: {reason}."
    except (Exception, SystemExit) as error:  # a plugin's constructor may raise anything
        return f"the part cannot have {where}: {type(error).__name__}: {error}"
    if [node.label for node in part.nodes] != [node.label for node in model.part.nodes]:
        return f"with {where} the part has other nodes, so that joints cannot attach to the same ones."
    return ""


def _dense(matrices: StructuralMatrices | SparseMatrices | None) -> StructuralMatrices:
    assert matrices is not None
    if isinstance(matrices, StructuralMatrices):
        return matrices
    return StructuralMatrices(*(getattr(matrices, name).toarray() for name in "MKCD"))


def _for_each(batch: StructuralMatrices, count: int) -> StructuralMatrices:
    """Return matrices (n, d, d), repeating those that do not depend on the options."""
    shape = (count, batch.size, batch.size)
    if batch.K.shape == shape:
        return batch
    return StructuralMatrices(*(np.broadcast_to(getattr(batch, name), shape) for name in "MKCD"))
