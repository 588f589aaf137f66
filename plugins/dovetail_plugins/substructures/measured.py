"""A part that is known by its measured receptance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dovetail import (
    ComponentConfig,
    Direction,
    DovetailError,
    Fault,
    FileName,
    InUnit,
    PartNode,
    ReceptanceMatrix,
    StructuralMatrices,
    SubstructureModel,
    write_receptance,
)
from dovetail_plugins.substructures.measured_checks import check_drive_points, matrix_warnings, reciprocal
from dovetail_plugins.substructures.receptance_files import (
    KnownReceptance,
    from_archive,
    from_sets,
    receptance_matrix,
)
from dovetail_plugins.substructures.virtual_interfaces import MeasuredInterface, PointSection, read_interface

_Length = Annotated[float, InUnit("m")]
_OptionalFile = Annotated[str, FileName()]


class MeasuredFrf(ComponentConfig):
    """An FRF in the file, and its DOFs.

    Attributes
    ----------
    set : int
        Number of the set in the UFF file, from 1.
    response : str
        Node of the measured displacement.
    force : str
        Node of the force.
    direction : direction
        Of the motion: x, y, z, rx, ry or rz.
    force_direction : direction
        Of the load; that of the motion by default.
    """

    set: Annotated[int, Field(ge=1)]
    response: str
    force: str
    direction: Direction = "x"
    force_direction: Direction | None = None


class Measured(SubstructureModel):
    """A part with measured FRFs between its nodes, such as the flange of a spindle, or between virtual points.

    Without a table, `frfs` or `points`, the file contains x and rz of one point, as ``dovetail spindle`` writes it. In
    a plane, no moment acts on nodes without a measured rotation. In space, nodes move in the measured directions only.

    With `points`, least squares give the motions of each point from the channels around it, and from the impacts its
    loads (a virtual point transformation). The interface is rigid there, but for the deformations in `flexible`.
    Joints at the `contacts` of a point act on its motion and on its deformations.
    """

    name = "measured"
    summary = "Part known by its measured receptance at one point or between several, or at virtual points"
    references = (
        "M. V. van der Seijs, D. D. van den Bosch, D. J. Rixen, D. de Klerk, An improved methodology for the virtual "
        "point transformation of measured frequency response functions in dynamic substructuring, COMPDYN 2013",
    )

    class Config(ComponentConfig):
        """The file with the FRFs, and its contents.

        Attributes
        ----------
        file : str
            NPZ archive with 'frequency' and 'receptance' (n_freq, n, n) and, unless it is x and rz of one point,
            'nodes', 'directions' and 'positions' (or 'point_x', 'point_y', 'point_z') of the n DOFs; or a UFF file. For
            virtual points: an archive with 'frequency' and 'frfs' (n_freq, n_channels, n_impacts), or a UFF file with
            the names of channels and impacts as DOFs.
        nodes : mapping
            Nodes of a UFF file and their positions, or three coordinates each.
        frfs : list
            FRFs of a UFF file, at least one for each pair of DOFs; the mirrored ones follow by reciprocity.
        ignore_dofs : bool
            Whether the DOFs in the UFF file are wrong, and are not compared with `frfs`.
        points : mapping
            Virtual points, from `channels` and `impacts` around them.
        channels, impacts : str
            Tables (CSV or XLSX) as pyFBS has them: Name, Quantity, Grouping, Position_1 to _3, Direction_1 to _3, and
            optionally Weight.
        channel_sheet, impact_sheet : str
            Sheets of a workbook; by default those whose names begin with 'Channels' and 'Impacts'.
        unit_of_length : float
            Of positions in the tables [m].
        tolerance : float
            Singular value of the least squares, over the largest one, below which a motion is left out.
        """

        alternatives = ((("nodes",), ("points",)), (("frfs",), ("points",)))
        file: Annotated[str, FileName()]
        nodes: Annotated[dict[str, _Length | tuple[_Length, _Length, _Length]], Field(default_factory=dict)]
        frfs: tuple[MeasuredFrf, ...] = ()
        ignore_dofs: bool = False
        points: Annotated[dict[str, PointSection], Field(default_factory=dict)]
        channels: _OptionalFile = ""
        impacts: _OptionalFile = ""
        channel_sheet: str = ""
        impact_sheet: str = ""
        unit_of_length: Annotated[float, Field(gt=0), InUnit("m")] = 1.0
        tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-6

        @model_validator(mode="after")
        def _nodes_of_frfs(self) -> Measured.Config:
            if bool(self.nodes) != bool(self.frfs):
                raise ValueError("give both 'nodes' and 'frfs' for a UFF file, and neither for an archive")
            if self.ignore_dofs and not self.frfs:
                raise ValueError("'ignore_dofs' is for the sets of a UFF file: list them in 'frfs'")
            for frf in self.frfs:
                for node in (frf.response, frf.force):
                    if node not in self.nodes:
                        raise ValueError(f"set {frf.set} is at '{node}', which is not among the nodes")
            virtual = ("channels", "impacts", "channel_sheet", "impact_sheet", "unit_of_length", "tolerance")
            changed = [name for name in virtual if getattr(self, name) != type(self).model_fields[name].default]
            if self.points and not (self.channels and self.impacts):
                raise ValueError("virtual points need the tables 'channels' and 'impacts'")
            if not self.points and changed:
                raise ValueError(f"'{changed[0]}' is for virtual points: list them in 'points'")
            if self.points and self.frfs:
                raise ValueError("give either 'points', or 'nodes' and 'frfs'")
            names = [*self.points, *(name for point in self.points.values() for name in point.contacts)]
            if twice := [name for name in names if names.count(name) > 1]:
                raise ValueError(f"two nodes have the name '{twice[0]:.40}'")
            return self

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:
        """Return a file with the receptance of a rigid body on a lossy spring in x and in rz."""
        frequency = np.linspace(10.0, 2500.0, 2000)
        inertia = (2.0 * np.pi * frequency) ** 2
        values = np.zeros((len(frequency), 2, 2), dtype=np.complex128)
        values[:, 0, 0] = 1.0 / (1e7 * (1.0 + 0.05j) - 0.3 * inertia)
        values[:, 1, 1] = 1.0 / (1e4 * (1.0 + 0.05j) - 1e-4 * inertia)
        write_receptance(ReceptanceMatrix(frequency, values), folder / "part.npz")
        return ({"file": str(folder / "part.npz")},)

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self._interface = self._read_interface() if config.points else None
        self._known = self._read(config)

    def _read_interface(self) -> MeasuredInterface:
        config = self.config
        tables, sheets = (config.channels, config.impacts), (config.channel_sheet, config.impact_sheet)
        return read_interface(config.file, tables, sheets, config.points, config.unit_of_length, config.tolerance)

    def _read(self, config: Config) -> KnownReceptance:
        if self._interface is not None:
            return self._between_points(self._interface)
        if not config.frfs:
            return from_archive(config.file)
        ends = [
            (frf.set, (frf.response, frf.direction), (frf.force, frf.force_direction or frf.direction))
            for frf in config.frfs
        ]
        return from_sets(config.file, config.nodes, ends, ignore_dofs=config.ignore_dofs)

    def _between_points(self, interface: MeasuredInterface) -> KnownReceptance:
        """Return the receptance between the virtual points; a fault also names the channel that fits worst."""
        file, names = self.config.file, interface.names
        raw = interface.matrix(Path(file).name)
        try:
            matrix = reciprocal(receptance_matrix(raw.frequency, raw.values, file), names, file)
            check_drive_points(matrix, names, file, most=0.5)
        except DovetailError as error:
            (fault,) = error.faults
            worst = " ".join(interface.warnings(np.inf))
            remedy = f"{worst[:1].upper()}{worst[1:]}" or fault.remedy
            raise DovetailError(Fault(fault.where, fault.problem, fault.accepted, remedy)) from None
        return interface.known(matrix)

    @property
    def nodes(self) -> tuple[PartNode, ...]:
        """The measured points."""
        return self._known.nodes

    @property
    def absent_dofs(self) -> frozenset[int]:
        """The DOFs that were not measured."""
        every = frozenset(range(self.node_dofs.size))
        return every - set(self._known.dofs) if self._known.motion is None else frozenset()

    @property
    def constraints(self) -> NDArray[np.float64]:
        """What the interfaces' modes leave no freedom to, if joints act at contacts of theirs."""
        contacts = None if self._interface is None else self._interface.contacts
        return super().constraints if contacts is None else contacts.constraints

    def warnings(self, frequency: float) -> Sequence[str]:
        """Return warnings about channels that do not fit the others, about reciprocity and about power."""
        wanted = self._known.matrix.frequency <= frequency
        if not wanted.any():
            return ()
        names = [f"{self.nodes[node].label} {each}" for node, each in map(self.node_dofs.__getitem__, self._known.dofs)]
        if self._interface is None:
            return (*matrix_warnings(self._known.matrix.values[wanted], names),)
        values = self._interface.matrix("").values[wanted]
        return (*self._interface.warnings(frequency), *matrix_warnings(values, names))

    def matrices(self) -> StructuralMatrices | None:
        """Return None: a measurement has no matrices."""
        return None

    def receptance(self, frequency: NDArray[np.float64], dofs: Sequence[int]) -> NDArray[np.complex128]:
        """Return the measured receptance between `dofs`, interpolated to the lines."""
        values = self._known.matrix.at(frequency)
        if self._known.motion is not None:
            motion = self._known.motion[list(dofs)]
            return np.asarray(motion @ values @ motion.T)
        chosen = np.array([self._known.dofs.index(int(dof)) for dof in dofs], dtype=np.intp)
        part: NDArray[np.complex128] = values[:, chosen[:, None], chosen]
        return part
