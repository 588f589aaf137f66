"""Measured parts whose nodes are virtual points, and how well their FRFs fit these."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dovetail import (
    DIRECTIONS,
    FLEXIBLE_MODES,
    ComponentConfig,
    Direction,
    DovetailError,
    Fault,
    InUnit,
    NodeDofs,
    ReceptanceMatrix,
    VirtualPoint,
    VirtualPoints,
)
from dovetail_plugins.substructures.channel_frfs import read_channel_frfs
from dovetail_plugins.substructures.channel_tables import ChannelTable, read_channels, read_impacts
from dovetail_plugins.substructures.contact_points import ContactPoints
from dovetail_plugins.substructures.receptance_files import KnownReceptance

_Length = Annotated[float, InUnit("m")]
_USUAL = (5e-4, 5.0)
"""Distances [m] of the farthest channel or impact from its point that are usual: a sensor's size to a machine's."""
_FAR = 1.0
"""Deviation of a channel from what the others say, over its size, from which there is a warning.

For 40 random structures with two points, 9 and 12 channels, it was at most 0.83 with 10 % noise, and with one reversed
channel at least 1.94, which was named in all of them."""


class PointSection(ComponentConfig):
    """A virtual point of the part.

    Attributes
    ----------
    at : three lengths
        Its coordinates, in the axes of the tables [m].
    group : str or int
        Channels and impacts around it have this number in the column 'Grouping'; its name by default, and all of them
        if it is the only point.
    directions : sequence of directions
        Motions of the point: some of x, y, z, rx, ry, rz, in this order.
    flexible : sequence of deformations
        Deformations of the interface that are estimated too, named as in pyFBS: ex, ey, ez (extension), tx, ty, tz
        (torsion), sxy, sxz, syz, syx, szx, szy (shear), bxy, bxz, byz, byx, bzx, bzy (bending). Joints act on them at
        `contacts` only.
    contacts : mapping of names to three lengths
        Nodes on the interface, such as its bolts, in the axes of the tables [m]. They move by the motion of the point
        and the deformations.
    contact_directions : sequence of directions
        In which contacts move: x, y and z by default. With rx, ry and rz they turn with the material there, by half the
        curl of the deformations.
    """

    at: tuple[_Length, _Length, _Length]
    group: str | int = ""
    directions: Annotated[tuple[Direction, ...], Field(min_length=1)] = DIRECTIONS
    flexible: tuple[str, ...] = ()
    contacts: Annotated[dict[str, tuple[_Length, _Length, _Length]], Field(default_factory=dict)]
    contact_directions: Annotated[tuple[Direction, ...], Field(min_length=1)] = DIRECTIONS[:3]

    @model_validator(mode="after")
    def _six_directions(self) -> PointSection:
        if self.contacts and self.directions != DIRECTIONS:
            raise ValueError("a point with 'contacts' has all six directions; leave 'directions' out")
        return self

    @model_validator(mode="after")
    def _known_modes(self) -> PointSection:
        for key, directions in (("directions", self.directions), ("contact_directions", self.contact_directions)):
            ordered = tuple(each for each in DIRECTIONS if each in directions)
            if directions != ordered:
                raise ValueError(f"'{key}' are different ones in their order; write {list(ordered)}")
        for number, mode in enumerate(self.flexible):
            if mode not in FLEXIBLE_MODES or mode in self.flexible[:number]:
                accepted = ", ".join(FLEXIBLE_MODES)
                raise ValueError(f"'{mode:.40}' is not a deformation, or is there twice; accepted: {accepted}")
        return self


@dataclass(frozen=True, eq=False)
class MeasuredInterface:
    """FRFs between channels and impacts, and their virtual points.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    values : (n_freq, n_channels, n_impacts) complex array
        Receptance.
    points : VirtualPoints
    contacts : ContactPoints, optional
        If joints act at other points of the interfaces.
    """

    frequency: NDArray[np.float64]
    values: NDArray[np.complex128]
    points: VirtualPoints
    contacts: ContactPoints | None = None

    def matrix(self, note: str) -> ReceptanceMatrix:
        """Return the receptance between the motions of the points or between `leaders`, as measured both ways."""
        if self.contacts is None:
            return ReceptanceMatrix(self.frequency, self.points.transformed(self.values), note)
        return ReceptanceMatrix(self.frequency, self.contacts.receptance(self.values), note)

    def known(self, matrix: ReceptanceMatrix) -> KnownReceptance:
        """Return the nodes with this receptance, that of `matrix`."""
        if self.contacts is not None:
            return KnownReceptance(matrix, self.contacts.nodes, self.contacts.leaders, self.contacts.by_leaders)
        return KnownReceptance.between(matrix, self.points.dofs, {n: p.point for n, p in self.points.points.items()})

    @property
    def names(self) -> list[str]:
        """Those of the rows of `matrix`, for messages."""
        if self.contacts is None:
            return [f"{node} {each}" for node, each in self.points.dofs]
        nodes = self.contacts.nodes
        dofs = NodeDofs.from_nodes(nodes)
        return [f"{nodes[dofs[dof][0]].label} {dofs[dof][1]}" for dof in self.contacts.leaders]

    def warnings(self, frequency: float) -> Sequence[str]:
        """Return warnings about unusual distances, and about the one that fits the others around its point worst.

        The deformation of the interface, noise, and a wrong position, direction or sign do that.

        Parameters
        ----------
        frequency : float
            Highest frequency that is looked at [Hz].
        """
        distant = (*self._unusual_distances(), *(self.contacts.distant() if self.contacts is not None else ()))
        deviations = self.points.suspects(self.values[self.frequency <= frequency])
        worst = max(deviations, key=lambda name: deviations[name], default="")
        if not worst or deviations[worst] < _FAR:
            return distant
        return (
            *distant,
            f"{worst} differs by {100 * deviations[worst]:.0f} % from what the others around its point say (median of "
            "the lines). Check its position, direction and sign, or add deformations with 'flexible'.",
        )

    def _unusual_distances(self) -> Iterator[str]:
        """Yield a warning about positions that are probably in another unit than the points."""
        for name, point in self.points.points.items():
            sides = ("channels", self.points.channels, point.channels), ("impacts", self.points.impacts, point.impacts)
            for noun, dofs, around in sides:
                distance = float(np.linalg.norm(dofs.positions[list(around)] - np.asarray(point.point), axis=1).max())
                if len(around) > 1 and not _USUAL[0] <= distance <= _USUAL[1]:
                    yield (
                        f"the {noun} around the point '{name}' are up to {1e3 * distance:.3g} mm from it. Are "
                        "the positions in the table in metres, or as 'unit_of_length' says, and is the point there?"
                    )


def read_interface(
    file: str,
    tables: tuple[str, str],
    sheets: tuple[str, str],
    points: Mapping[str, PointSection],
    unit_of_length: float,
    tolerance: float,
) -> MeasuredInterface:
    """Return the FRFs of channels and impacts around some points.

    Parameters
    ----------
    file : str
        With the FRFs.
    tables, sheets : (str, str)
        Files of channels and of impacts, and sheets in them.
    points : mapping of str to PointSection
    unit_of_length : float
        Of positions in the tables [m].
    tolerance : float
        Of `VirtualPoints`.

    Raises
    ------
    DovetailError
        A file cannot be used, or the channels or impacts around a point do not determine its motions.
    """
    channels = read_channels(tables[0], sheets[0], unit_of_length)
    impacts = read_impacts(tables[1], sheets[1], unit_of_length)
    chosen = {}
    for name, section in points.items():
        around, impact_rows = (_around(table, name, section, len(points) == 1) for table in (channels, impacts))
        x, y, z = section.at
        chosen[name] = VirtualPoint((x, y, z), around, impact_rows, tuple(section.directions), section.flexible)
    try:
        virtual = VirtualPoints(channels.dofs, impacts.dofs, chosen, tolerance)
    except DovetailError as error:
        fault = error.faults[0]
        raise DovetailError(Fault(f"point '{fault.where}'", fault.problem, fault.accepted, fault.remedy)) from None
    frequency, values = read_channel_frfs(file, channels, impacts)
    joined = {name: section.contacts for name, section in points.items()}
    directions = {name: section.contact_directions for name, section in points.items()}
    contacts = ContactPoints(virtual, joined, directions) if any(joined.values()) else None
    return MeasuredInterface(frequency, values, virtual, contacts)


def _around(table: ChannelTable, name: str, section: PointSection, is_only: bool) -> tuple[int, ...]:
    """Return the rows of a table that belong to a point."""
    group = str(section.group) if section.group != "" else name
    rows = table.rows_in_group(group)
    if rows:
        return rows
    if is_only and section.group == "":
        return tuple(range(len(table.names)))
    groups = ", ".join(dict.fromkeys(filter(None, table.groups))) or "no groups"
    problem = f"no row of {table.file} has the Grouping '{group}', as the point '{name}' needs."
    raise DovetailError(Fault(f"point '{name}'", problem, groups, "Name one with 'group'."))
