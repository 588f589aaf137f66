"""A validated description: the components and numbers of which an assembly is made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from dovetail.description.fingerprints import fingerprint
from dovetail.description.placed_parts import PlacedPart, Placement, direction_text
from dovetail.description.sections import AugmentationSection, CorrectionSection
from dovetail.description.study_section import StudySection
from dovetail.frf import Frf, Quantity
from dovetail.interfaces import (
    ROTATIONS,
    IdentificationMethod,
    NodeDofs,
    Parameter,
    Reducer,
    Regressor,
    SubstructureModel,
)
from dovetail.synthesis import Connection, Point
from dovetail.units import format_quantity

SHARED = "calibration"
"""Owner of the parameters that the chains of all responses share, and their key in a description."""


@dataclass(frozen=True)
class Tie:
    """What a parameter is tied to: it is another one, times a ratio.

    Parameters
    ----------
    owner, parameter : str
        The joint, substructure or response of the other one, and its name there.
    ratio : float
    """

    owner: str
    parameter: str
    ratio: float = 1.0


@dataclass(frozen=True, kw_only=True)
class ParameterEntry:
    """The parameters of a joint, of a substructure or of a response, and what is known of them.

    Parameters
    ----------
    parameters : tuple of Parameter
        All of them, in the order of the model, with the description's ranges and scales.
    fixed : mapping of str to float
        SI values of the known ones, which are not identified.
    ties : mapping of str to Tie
        Those that are tied to others.
    """

    parameters: tuple[Parameter, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    ties: Mapping[str, Tie] = field(default_factory=dict)

    @property
    def identified(self) -> tuple[Parameter, ...]:
        """Those that are identified."""
        return tuple(p for p in self.parameters if p.name not in self.fixed and p.name not in self.ties)


@dataclass(frozen=True, kw_only=True)
class JointEntry(ParameterEntry):
    """A joint of a description, or a substructure with unknown options, which depends on parameters as a joint does.

    Parameters
    ----------
    connection : Connection
    structural_damping : float or None
        Frequency [Hz] at which its structural damping equals the viscous damping of its dampers; None: viscous.
    """

    connection: Connection
    structural_damping: float | None = None


@dataclass(frozen=True)
class Place:
    """A DOF: a node of a substructure and a direction.

    Parameters
    ----------
    substructure : str
    node : int
    direction : str or three floats
        In the assembly: x, y, z, rx, ry or rz, or a unit vector.
    dofs : NodeDofs
        The DOFs of the substructure's nodes.
    """

    substructure: str
    node: int
    direction: str | tuple[float, float, float]
    dofs: NodeDofs = field(repr=False, compare=False)

    @property
    def rotation(self) -> bool:
        """Whether it is a rotation, by a moment, instead of a displacement, by a force."""
        return self.direction in ROTATIONS

    @property
    def directions(self) -> tuple[str, ...]:
        """The directions in which the node moves there."""
        if isinstance(self.direction, str):
            return (self.direction,)
        return tuple(name for name, weight in zip("xyz", self.direction, strict=True) if weight)

    @property
    def terms(self) -> tuple[tuple[float, Point], ...]:
        """The DOFs of which it is the sum, each with its weight."""
        weights = (1.0,) if isinstance(self.direction, str) else tuple(filter(None, self.direction))
        terms = self.dofs.terms(self.node, dict(zip(self.directions, weights, strict=True)))
        return tuple((weight, (self.substructure, dof)) for weight, dof in terms)

    @property
    def point(self) -> Point:
        """The substructure and the number of the DOF there; of a sum, that with the largest weight."""
        return max(self.terms, key=lambda term: abs(term[0]))[1]


_Place = TypeVar("_Place", bound=Place)


@dataclass(frozen=True)
class Response(Place):
    """Where motion is measured, the quantity of the FRF, and where the force acts: at the same DOF by default."""

    quantity: Quantity
    name: str = field(default="response", compare=False)
    force: Place | None = None

    @property
    def force_point(self) -> Point:
        """The substructure and the number of the DOF where the force acts."""
        return self.point if self.force is None else self.force.point

    @property
    def force_terms(self) -> tuple[tuple[float, Point], ...]:
        """The DOFs on which the force acts, each with its share."""
        return self.terms if self.force is None else self.force.terms

    @property
    def moment(self) -> bool:
        """Whether a moment acts instead of a force."""
        return (self.force or self).rotation

    def frf(self, frequency: NDArray[np.float64], values: NDArray[np.complex128], **fields: Any) -> Frf:
        """Return values (n_freq,) at frequencies (n_freq,) [Hz] as an FRF of this response."""
        return Frf(frequency, values, self.quantity, rotation=self.rotation, moment=self.moment, **fields)

    @property
    def is_drive_point(self) -> bool:
        """Whether the force acts where the motion is measured."""
        return self.force_terms == self.terms


@dataclass(frozen=True)
class IdentificationSettings:
    """Settings of the network's training, and the method of a plugin if the description names one."""

    samples: int
    seed: int
    test_fraction: float
    features: Literal["log10p1"]
    reducer: Reducer
    regressor: Regressor
    augmentation: AugmentationSection | None = None
    correction: CorrectionSection | None = None
    method: IdentificationMethod | None = None


def resolve(entries: Mapping[str, ParameterEntry], tie: Tie) -> Tie:
    """Return the tie to the known or identified parameter at the end of a chain of ties."""
    while (further := entries[tie.owner].ties.get(tie.parameter)) is not None:
        tie = Tie(further.owner, further.parameter, tie.ratio * further.ratio)
    return tie


@dataclass(frozen=True)
class Description:
    """A description without faults.

    Parameters
    ----------
    name : str
    source : str
        Its file, or ``<dict>``.
    text : str
        The whole description as JSON, which is YAML too, with `extends` resolved. To read it gives this description.
    frequency : (n_freq,) array
        Hz.
    substructures : mapping of str to SubstructureModel
    joints : mapping of str to JointEntry
    responses : tuple of Response
        At least one.
    unknown_parts : mapping of str to JointEntry
        The substructures with unknown options. In `substructures` they have the middle of the ranges.
    calibrations : mapping of str to ParameterEntry
        Parameters of the measurement chains, by the response's name; `SHARED` for those of all responses.
    sensors : tuple of Place
        The nodes with a sensor in the measurements of all responses.
    left_out : tuple of (float, float)
        Hz; between these ends nothing is compared.
    identification : IdentificationSettings
    study : StudySection or None
    files : mapping of tuple to str
        The files that options of components name, by the places of these options in the text.
    placements : mapping of str to Placement
        How substructures lie in the assembly, if their axes are not those of the assembly; `substructures` has them
        as they are described.
    """

    name: str
    source: str
    text: str
    frequency: NDArray[np.float64]
    substructures: Mapping[str, SubstructureModel]
    joints: Mapping[str, JointEntry]
    responses: tuple[Response, ...]
    identification: IdentificationSettings
    unknown_parts: Mapping[str, JointEntry] = field(default_factory=dict)
    calibrations: Mapping[str, ParameterEntry] = field(default_factory=dict)
    sensors: tuple[Place, ...] = ()
    left_out: tuple[tuple[float, float], ...] = ()
    study: StudySection | None = None
    files: Mapping[tuple[str | int, ...], str] = field(default_factory=dict)
    placements: Mapping[str, Placement] = field(default_factory=dict)

    @cached_property
    def placed_parts(self) -> Mapping[str, SubstructureModel]:
        """The substructures as they lie in the assembly, with DOFs along its axes."""
        moved = {name: PlacedPart(self.substructures[name], placement) for name, placement in self.placements.items()}
        return {**self.substructures, **moved}

    def moved(self, place: _Place, substructure: str, node: int) -> _Place:
        """Return the same direction at another node."""
        dofs = self.placed_parts[substructure].node_dofs
        return replace(place, substructure=substructure, node=node, dofs=dofs)

    @property
    def response(self) -> Response:
        """The first response, whose FRF `Assembly.frf` gives."""
        return self.responses[0]

    def chain_of(self, response: Response) -> ParameterEntry:
        """Return the parameters of the measurement chain of a response."""
        return self.calibrations.get(response.name, ParameterEntry())

    @property
    def response_labels(self) -> tuple[str, ...]:
        """The position of each response in words: ``"tool, 10 mm"``; with its name where others are there, too."""
        labels = [self._label(response) for response in self.responses]
        pairs = zip(labels, self.responses, strict=True)
        return tuple(label if labels.count(label) == 1 else f"{label}, {response.name}" for label, response in pairs)

    @property
    def identified_parameters(self) -> tuple[tuple[str, str], ...]:
        """Owner (a joint, part or response) and name of each unknown, in the order of ``Assembly.parameters``."""
        return tuple((name, parameter.name) for name, entry in self.entries.items() for parameter in entry.identified)

    @property
    def entries(self) -> Mapping[str, ParameterEntry]:
        """All that has parameters: joints, substructures with unknown options, and calibrations, by their names."""
        return {**self.joints, **self.unknown_parts, **self.calibrations}

    def _label(self, response: Response) -> str:
        if response.force is None or response.is_drive_point:
            return self._place_label(response)
        return f"{self._place_label(response)}, force at {self._place_label(response.force)}"

    def _place_label(self, place: Place) -> str:
        is_plain = place.direction == "x" and place.dofs.directions[place.node] in (("x",), ("x", "rz"))
        return f"{self.point_label(place)}{'' if is_plain else f', {direction_text(place.direction)}'}"

    def point_label(self, place: Place) -> str:
        """Return the point of a DOF in words: ``"tool, 10 mm"``."""
        nodes = self.substructures[place.substructure].nodes
        node = nodes[place.node]
        unique = sum(other.position == node.position for other in nodes) == 1
        position = format_quantity(node.position, "m") if unique else f"node {node.label}"
        return f"{place.substructure}, {position}"

    def at(self, index: int) -> Description:
        """Return the description with one of its responses only, also in its text."""
        whole = json.loads(self.text)
        if "responses" in whole:
            section = whole["responses"][index]
            whole = {"response" if key == "responses" else key: value for key, value in whole.items()}
            whole["response"] = {"name": self.responses[index].name, **section} if self.calibrations else section
        if self.sensors:
            nodes = {name: part.nodes for name, part in self.substructures.items()}
            places = [
                {"at": s.substructure, "position": f"node {nodes[s.substructure][s.node].label}"} for s in self.sensors
            ]
            whole["calibration"] = {**whole["calibration"], "at": places}
        return replace(self, text=_as_json(whole), responses=(self.responses[index],))

    def with_range(self, owner: str, parameter: str, lower: float, upper: float) -> Description:
        """Return the description with another range of one of its parameters, whose text stays as it is."""

        def changed(entries: Mapping[str, Any]) -> dict[str, Any]:
            if owner not in entries:
                return dict(entries)
            declared = entries[owner].parameters
            ranges = tuple(replace(p, lower=lower, upper=upper) if p.name == parameter else p for p in declared)
            return {**entries, owner: replace(entries[owner], parameters=ranges)}

        joints, parts, chains = map(changed, (self.joints, self.unknown_parts, self.calibrations))
        return replace(self, joints=joints, unknown_parts=parts, calibrations=chains)

    def with_known(self, known: Mapping[tuple[str, str], float]) -> Description:
        """Return the description with known values [SI] of some parameters, by owner and name, also in its text."""
        whole = json.loads(self.text)

        def changed(entries: Mapping[str, Any]) -> dict[str, Any]:
            fixed = {owner: {name: value for (of, name), value in known.items() if of == owner} for owner in entries}
            return {owner: replace(entry, fixed={**entry.fixed, **fixed[owner]}) for owner, entry in entries.items()}

        for (owner, name), value in known.items():
            unit = next(parameter.unit for parameter in self.entries[owner].parameters if parameter.name == name)
            section, last = self._section_of(whole, owner, name)
            section[last] = {"value": format_quantity(value, unit, 9)}
        joints, parts, chains = map(changed, (self.joints, self.unknown_parts, self.calibrations))
        return replace(self, text=_as_json(whole), joints=joints, unknown_parts=parts, calibrations=chains)

    def _section_of(self, whole: dict[str, Any], owner: str, name: str) -> tuple[Any, str | int]:
        """Return the section of the text that defines a parameter, and its key there."""
        if owner in self.joints:
            return whole["joints"][owner].setdefault("parameters", {}), name
        if owner in self.calibrations:
            names = [*(response.name for response in self.responses), owner]  # the last is of all responses
            sections = [*whole.get("responses", [whole.get("response")]), whole]
            return sections[names.index(owner)]["calibration"], name
        section = whole["substructures"][owner]
        *steps, last = (int(step) if step.isdecimal() else step for step in name.split("."))
        for step in steps:
            section = section[step]
        return section, last

    @property
    def unknown_signs(self) -> tuple[str, ...]:
        """The responses whose sign is determined from the measurement."""
        chains = self.calibrations.items()
        return tuple(name for name, chain in chains if name != SHARED and np.isnan(chain.fixed.get("sign", 1.0)))

    @property
    def unknown_gains(self) -> tuple[str, ...]:
        """The identified parameters that are gains of measurement chains, by name."""
        chains = self.calibrations.items()
        return tuple(f"{name}.gain" for name, chain in chains if any(p.name == "gain" for p in chain.identified))

    def with_signs(self, signs: Mapping[str, float]) -> Description:
        """Return the description with known signs of some responses, by name; its text is unchanged."""
        chains = dict(self.calibrations)
        for name, sign in signs.items():
            chains[name] = replace(chains[name], fixed={**chains[name].fixed, "sign": sign})
        return replace(self, calibrations=chains)

    @property
    def known_parts(self) -> Mapping[str, SubstructureModel]:
        """The substructures without unknown options."""
        return {name: part for name, part in self.substructures.items() if name not in self.unknown_parts}

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all that determines the FRFs: frequency, substructures, joints and responses."""
        return fingerprint(self.text)

    def with_identification(self, section: Mapping[str, object], **settings: Any) -> Description:
        """Return the description with other settings of the training.

        Parameters
        ----------
        section : mapping
            Keys of the `identification` section as in the text.
        **settings
            The values of the same keys in `IdentificationSettings`.
        """
        whole = json.loads(self.text)
        whole["identification"] = {**(whole.get("identification") or {}), **section}
        return replace(self, text=_as_json(whole), identification=replace(self.identification, **settings))


def _as_json(whole: Mapping[str, Any]) -> str:
    return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False)
