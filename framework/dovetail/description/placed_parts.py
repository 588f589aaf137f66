"""Where a part lies in the assembly: its origin, the directions of its axes, and the end from which it is described."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, field_validator, model_validator

from dovetail.interfaces import (
    DIRECTIONS,
    ComponentConfig,
    Coordinates,
    Direction,
    PartNode,
    SparseMatrices,
    StructuralMatrices,
    SubstructureModel,
    are_perpendicular,
    cross_matrix,
    exact_rotation,
    six_directions,
)
from dovetail.units import InUnit, to_si

_TURNED_BACK = np.diag([1.0, -1.0, -1.0])
"""Half a turn about x: the axis runs the other way, x stays, and rotations about z change their sign."""

_WHOLE_TURN = 2.0 * np.pi * (1.0 + 1e-9)


def _as_vector(value: object, accepted: str = "x, y, z") -> object:
    """Return the unit vector of a direction such as '-z'; anything else as it is."""
    if not isinstance(value, str):
        return value
    axis, sense = value.strip().removeprefix("-").removeprefix("+"), -1.0 if value.strip().startswith("-") else 1.0
    if axis not in DIRECTIONS[:3]:
        raise ValueError(f"'{value:.40}' is not a direction; accepted: {accepted}, -x, -y, -z, or three numbers")
    return tuple(sense * (axis == other) for other in DIRECTIONS[:3])


def _as_direction(value: object) -> object:
    """Return a unit vector for three numbers and for an axis with a sense; the names of DOFs as they are."""
    if isinstance(value, str) and value.strip() in DIRECTIONS:
        return value.strip()
    vector = _as_vector(value, ", ".join(DIRECTIONS))
    if not isinstance(vector, (list, tuple)) or len(vector) != 3:
        raise ValueError(f"{value!r:.40} is not a direction; accepted: {', '.join(DIRECTIONS)}, or three numbers")
    numbers = np.array([to_si(number, "1") for number in vector])
    if not np.linalg.norm(numbers) > 0.0:
        raise ValueError("this direction has no length")
    return tuple((numbers / np.linalg.norm(numbers)).tolist())


def direction_text(direction: str | tuple[float, float, float]) -> str:
    """Return a direction in words: ``"x"`` or ``"(0.6, 0.8, 0)"``."""
    return direction if isinstance(direction, str) else f"({', '.join(f'{part:.4g}' for part in direction)})"


def direction_name(direction: str | tuple[float, float, float]) -> str:
    """Return the words of a direction, ``"-y"`` for the unit vector against an axis."""
    if isinstance(direction, str) or max(map(abs, direction)) < 1.0:
        return direction_text(direction)
    axis = np.argmax(np.abs(direction))
    return ("-" if direction[axis] < 0.0 else "") + DIRECTIONS[axis]


Vector = Annotated[tuple[float, float, float], BeforeValidator(lambda value: _as_vector(value))]
"""A direction: three numbers, or the name of an axis with its sense."""
MovingDirection = Annotated[Direction | tuple[float, float, float], BeforeValidator(_as_direction)]
"""A direction of a DOF or, between the axes, of a displacement."""
Length = Annotated[float, InUnit("m")]


class TurnSection(ComponentConfig):
    """A rotation about an axis of the assembly through its origin.

    Attributes
    ----------
    about : direction
        'x', 'y', 'z', one of these with a minus, or three numbers.
    angle : float
        By the right-hand rule [rad].
    """

    about: Vector
    angle: Annotated[float, InUnit("rad")]

    @field_validator("angle")
    @classmethod
    def _within_a_turn(cls, angle: float) -> float:
        if abs(angle) > _WHOLE_TURN:
            raise ValueError(f"{angle:g} rad is more than a whole turn; were {angle:g} deg meant?")
        return angle

    @property
    def rotation(self) -> NDArray[np.float64]:
        """The rotation (3, 3), by Rodrigues' formula."""
        cross = cross_matrix(np.asarray(self.about) / np.linalg.norm(self.about))
        return exact_rotation(np.eye(3) + np.sin(self.angle) * cross + (1.0 - np.cos(self.angle)) * cross @ cross)


def turned(turns: Sequence[TurnSection]) -> NDArray[np.float64]:
    """Return the rotation (3, 3) of rotations one after the other."""
    rotation = np.eye(3)
    for turn in turns:
        rotation = turn.rotation @ rotation
    return exact_rotation(rotation)


class PlaceSection(ComponentConfig):
    """Where a part lies in the assembly.

    Without directions its axes are those of the assembly; positions along the part then run along -y.

    Attributes
    ----------
    origin : three lengths
        Of the part's own origin, in the assembly [m].
    along : direction
        In which positions along the part increase.
    across : direction
        Of the part's x, perpendicular to `along`; the assembly's x by default, if it is perpendicular.
    rotate : sequence of rotations
        Instead of `along` and `across`: rotations one after the other, each as {about: z, angle: 90 deg}.
    """

    origin: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    along: Vector | None = None
    across: Vector | None = None
    rotate: tuple[TurnSection, ...] = ()

    @model_validator(mode="after")
    def _one_orientation(self) -> PlaceSection:
        if self.rotate and (self.along or self.across):
            raise ValueError("give either 'rotate', or 'along' and 'across'")
        if self.across and not self.along:
            raise ValueError("'across' needs 'along', the direction of the part's own axis")
        given = [("along", self.along), ("across", self.across)]
        given += [(f"rotate.{number}.about", turn.about) for number, turn in enumerate(self.rotate)]
        for name, vector in given:
            if vector is not None and not np.linalg.norm(vector) > 0.0:
                raise ValueError(f"'{name}' has no length")
        if self.along and not are_perpendicular(*self._along_and_across()):
            if self.across:
                raise ValueError("'along' and 'across' are not perpendicular")
            raise ValueError("say with 'across' where the part's x points, perpendicular to 'along'")
        return self

    def _along_and_across(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        along, across = np.asarray(self.along), np.asarray(self.across or (1.0, 0.0, 0.0))
        return along / np.linalg.norm(along), across / np.linalg.norm(across)

    @property
    def rotation(self) -> NDArray[np.float64]:
        """The part's axes in the assembly, in columns (3, 3)."""
        if self.along:
            along, across = self._along_and_across()
            return exact_rotation(np.column_stack([across, -along, np.cross(across, -along)]))
        return turned(self.rotate)


class OrientationSection(ComponentConfig):
    """How a part lies in the assembly.

    Attributes
    ----------
    reversed : bool
        Whether its axis runs against that of the assembly, since it is described from its other end. Positions stay
        its own; rotations are counted along the assembly's axis, in responses and forces too.
    place : section
        Its origin and the directions of its axes, for structures in space.
    """

    reversed: Annotated[bool, Field(strict=True)] = False
    place: PlaceSection | None = None

    @property
    def placement(self) -> Placement | None:
        """The placement; None for a part that is not reversed and has no place of its own."""
        if self.place is None and not self.reversed:
            return None
        place = self.place or PlaceSection()
        rotation = place.rotation @ _TURNED_BACK if self.reversed else place.rotation
        return Placement(rotation, np.asarray(place.origin), self.reversed, in_space=self.place is not None)


@dataclass(frozen=True, eq=False)
class Placement:
    """A place and an orientation in the assembly.

    Parameters
    ----------
    rotation : (3, 3) array
        The part's axes in the assembly, in columns.
    origin : (3,) array
        Of the part, in the assembly [m].
    reversed : bool
        Whether it is described from its other end.
    in_space : bool
        Whether its place in the assembly is known.
    """

    rotation: NDArray[np.float64]
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    reversed: bool = False
    in_space: bool = True

    def problem(self, nodes: Sequence[PartNode]) -> str:
        """Return why nodes cannot be placed so, or an empty text."""
        for node in nodes:
            if self._directions(node) is None:
                words = ", ".join(node.directions)
                return (
                    f"its node '{node.label}' moves only in {words}, and so turned these are not along axes of the "
                    "assembly. Turn it by right angles, or use a part that moves in all directions."
                )
        return ""

    def _directions(self, node: PartNode) -> tuple[str, ...] | None:
        """Return the directions of a node in the assembly, or None if they are not those of axes."""
        moved = np.abs(six_directions(self.rotation)[:, _axes(node.directions)]).max(axis=1) > 0.0
        return tuple(np.array(DIRECTIONS)[moved].tolist()) if moved.sum() == len(node.directions) else None

    def node(self, node: PartNode) -> PartNode:
        """Return a node as it lies in the assembly; its position along the part stays."""
        directions = self._directions(node)
        assert directions is not None
        point = tuple((self.origin + self.rotation @ np.asarray(node.coordinates)).tolist())
        return PartNode(node.label, node.position, directions, point, node.carrier)

    def coordinates(self, nodes: Sequence[PartNode]) -> Coordinates:
        """Return the nodes' own DOFs by those in the assembly."""
        blocks = []
        for node in nodes:
            if node.carrier is not None:
                continue
            directions = self._directions(node)
            assert directions is not None
            blocks.append(six_directions(self.rotation)[np.ix_(_axes(directions), _axes(node.directions))].T)
        return Coordinates.node_by_node(blocks)


def _axes(directions: Sequence[str]) -> list[int]:
    return [DIRECTIONS.index(direction) for direction in directions]


class PlacedPart(SubstructureModel):
    """A part as it lies in the assembly: its DOFs are along the assembly's axes.

    Parameters
    ----------
    part : SubstructureModel
        Its nodes keep their positions along it.
    placement : Placement
    """

    summary = "A part with a place and an orientation of its own"

    def __init__(self, part: SubstructureModel, placement: Placement) -> None:
        super().__init__()
        self.name, self.grounded = part.name, part.grounded  # type: ignore[misc]  # of this part, for messages
        self._part, self._placement = part, placement

    @property
    def in_space(self) -> bool:
        """Whether its place in the assembly is known."""
        return self._placement.in_space

    @property
    def held(self) -> bool:
        """That of the part."""
        return self._part.held

    @cached_property
    def absent_dofs(self) -> frozenset[int]:
        """Those of the part."""
        absent, L = self._part.absent_dofs, self._coordinates.L
        return frozenset(int(dof) for dof in np.flatnonzero((L[sorted(absent)] != 0.0).any(axis=0)))

    @cached_property
    def constraints(self) -> NDArray[np.float64]:
        """Those of the part, for its DOFs along the assembly's axes."""
        return np.asarray(self._part.constraints @ self._coordinates.L)

    @property
    def outline(self) -> Sequence[tuple[float, float, float, float]]:
        """That of the part, along its own axis."""
        return self._part.outline

    @property
    def condensation_tolerance(self) -> float:
        """That of the part."""
        return self._part.condensation_tolerance

    @cached_property
    def nodes(self) -> tuple[PartNode, ...]:
        """Those of the part, with their directions and points in the assembly."""
        return tuple(map(self._placement.node, self._part.nodes))

    @cached_property
    def _coordinates(self) -> Coordinates:
        return self._placement.coordinates(self._part.nodes)

    def matrices(self) -> StructuralMatrices | SparseMatrices | None:
        """Return the part's matrices (d, d) along the assembly's axes."""
        matrices = self._part.matrices()
        return None if matrices is None else self._coordinates.transformed(matrices)

    def batched_matrices(self, options: Mapping[str, NDArray[np.float64]]) -> StructuralMatrices | None:
        """Return those of the part (n, d, d) along the assembly's axes."""
        matrices = self._part.batched_matrices(options)
        return None if matrices is None else self._coordinates.transformed(matrices)

    def receptance(self, frequency: NDArray[np.float64], dofs: Sequence[int]) -> NDArray[np.complex128]:
        """Return the part's receptance (n_freq, n, n) along the assembly's axes."""
        L = self._coordinates.L
        own = [dof for dof in self._coordinates.dofs_of(list(dofs)) if dof not in self._part.absent_dofs]
        chosen = L[np.ix_(own, list(dofs))]
        return np.asarray(chosen.T @ self._part.receptance(frequency, own) @ chosen)

    def dof_label(self, dof: int) -> str:
        """Return the label of a DOF: that of the part, if it is one of its own."""
        own = self._coordinates.dofs_of([dof])
        return self._part.dof_label(own[0]) if len(own) == 1 else super().dof_label(dof)


def placed(part: SubstructureModel, placement: Placement | None) -> SubstructureModel:
    """Return a part as it lies in the assembly."""
    return part if placement is None else PlacedPart(part, placement)
