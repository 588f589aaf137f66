"""A part whose mass, stiffness and damping matrices come from a finite element program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from dovetail import (
    DIRECTIONS,
    PLANAR,
    ComponentConfig,
    Direction,
    DovetailError,
    Fault,
    FileName,
    InUnit,
    Node,
    SparseMatrices,
    StructuralMatrices,
    SubstructureModel,
    is_rotation,
)
from dovetail_plugins.substructures.definiteness import check_definiteness
from dovetail_plugins.substructures.dof_table import DofTable, read_dof_table, table_in
from dovetail_plugins.substructures.matrix_files import matrix_in, read_archive, read_matrix_market, sound_matrix
from dovetail_plugins.substructures.matrix_remarks import check_stated_units, comments_of, texts_in

_WORD = r"^-?[^\s-].*$"
"""A word for a direction, after a minus if its sense is the opposite one."""
_OptionalFile = Annotated[str | None, FileName()]
_SMALL = 60
"""Number of DOFs up to which matrices are full, so that they are condensed for all frequencies at once."""
_PLANE, _IN_SPACE = 2, 6
"""Rigid-body motions of a bar that bends in a plane, as many as it has directions, and of a body in space."""
_MATRICES = {"M": "mass", "K": "stiffness", "C": "damping", "D": "structural_damping"}
"""Names in an archive, and the options for separate files."""


class FileUnits(ComponentConfig):
    """Units of the numbers in the files; rotations are in radians.

    Attributes
    ----------
    length : float
        Unit of positions, and of length in the entries of rotations [m].
    mass : float
        Unit of an entry of M between displacements [kg].
    stiffness : float
        Unit of an entry of K and D between displacements [N/m]; that of C is this times a second.
    """

    length: Annotated[float, Field(gt=0), InUnit("m")] = 1.0
    mass: Annotated[float, Field(gt=0), InUnit("kg")] = 1.0
    stiffness: Annotated[float, Field(gt=0), InUnit("N/m")] = 1.0


class Matrices(SubstructureModel):
    """Matrices M and K (optionally C and D) and a table that names their DOFs.

    Two directions of each node are used as x and rz, the displacement and the rotation in the plane in which the
    assembly vibrates, or with `axes` up to six in space. All other DOFs are inner ones, which move freely and are
    condensed.
    """

    name = "matrices"
    summary = "Imported mass, stiffness and damping matrices (NPZ, MAT, Matrix Market), thousands of DOFs"
    references = (
        "R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA J. 6 (1968) 1313-1319",
    )

    class Config(ComponentConfig):
        """The files and the meaning of their numbers.

        Attributes
        ----------
        file : str
            NPZ or MAT archive with M, K and, optionally, C, D and the table of DOFs.
        mass, stiffness, damping, structural_damping : str
            A Matrix Market file for each matrix, instead of `file`.
        dofs : str
            CSV with the table of DOFs: node, direction and, optionally, position and row.
        displacement, rotation : str
            The directions, named as in the table, that are x and rz; a preceding minus means the opposite sense.
        axes : mapping of directions to str
            Instead, for a part in space: the table's words for x, y, z, rx, ry and rz, or some of them.
        nodes : list of str
            Nodes for joints and responses; all by default.
        units : section
            Units of the numbers in the files.
        loss_factor : float
            Structural damping D = loss_factor K, instead of a matrix.
        tolerance : float
            Relative error of the condensation, verified with exact lines; 0 for a factorisation at every frequency.
        """

        alternatives = (
            (("file",), ("mass", "stiffness", "damping", "structural_damping")),
            (("loss_factor",), ("structural_damping",)),
            (("axes",), ("displacement", "rotation")),
        )
        file: _OptionalFile = None
        mass: _OptionalFile = None
        stiffness: _OptionalFile = None
        damping: _OptionalFile = None
        structural_damping: _OptionalFile = None
        dofs: _OptionalFile = None
        displacement: Annotated[str, Field(pattern=_WORD)] = "x"
        rotation: Annotated[str, Field(pattern=_WORD)] = "rz"
        axes: dict[Direction, Annotated[str, Field(pattern=_WORD)]] = Field(default_factory=dict)
        nodes: tuple[str | int, ...] = ()
        units: FileUnits = FileUnits()
        loss_factor: Annotated[float, Field(ge=0, lt=1)] = 0.0
        tolerance: Annotated[float, Field(ge=0, le=1e-3)] = 1e-9

        @model_validator(mode="after")
        def _one_source(self) -> Matrices.Config:
            single = [option for option in _MATRICES.values() if getattr(self, option)]
            if bool(self.file) == bool(single):
                raise ValueError("give either 'file', or 'mass' and 'stiffness'")
            if single and not (self.mass and self.stiffness and self.dofs):
                raise ValueError("files of single matrices need 'mass', 'stiffness' and the table 'dofs'")
            if self.axes and {"displacement", "rotation"} & self.model_fields_set:
                raise ValueError("give either 'axes', or 'displacement' and 'rotation'")
            words = [word.lstrip("-") for word in self.axes.values()]
            if len(set(words)) < len(words):
                raise ValueError("two of 'axes' are the same direction of the table")
            return self

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:
        """Return a free chain of three masses, with all nodes, and with only those at its ends."""
        springs = 1e6 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
        table: dict[str, Any] = {"nodes": ["1", "2", "3"], "directions": ["x"] * 3, "positions": [0.0, 0.1, 0.2]}
        np.savez(folder / "chain.npz", M=np.diag([0.2, 0.4, 0.2]), K=springs, **table)
        file = str(folder / "chain.npz")
        return {"file": file}, {"file": file, "nodes": ["1", "3"], "loss_factor": 0.02}

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        matrices, table, where = self._read()
        self._labels, self._table = self._chosen(table), table
        reached, motions = self._reached(matrices["K"].shape[0])
        check_definiteness(matrices, where, table.label, reached, motions)
        self._matrices = self._arranged(matrices)

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """The nodes for joints and responses, in the order of the table; at position 0 if it has no positions."""
        table, length = self._table, self.config.units.length
        positions, points = dict.fromkeys(table.nodes, 0.0), dict[str, tuple[float, float, float]]()
        if table.positions is not None:
            positions = dict(zip(table.nodes, table.positions * length, strict=True))
        if table.points is not None:
            points = {
                node: (x, y, z) for node, (x, y, z) in zip(table.nodes, (table.points * length).tolist(), strict=True)
            }
        return tuple(
            Node(label, float(positions[label]), self._directions_of(label), points.get(label))
            for label in self._labels
        )

    @cached_property
    def _words(self) -> dict[Direction, str]:
        """The table's word for each direction, after a minus if its sense is the opposite one."""
        if self.config.axes:
            return {direction: self.config.axes[direction] for direction in DIRECTIONS if direction in self.config.axes}
        return {"x": self.config.displacement, "rz": self.config.rotation}

    def _directions_of(self, label: str) -> tuple[str, ...]:
        """Return the directions of a node: in space those that the table has."""
        if not self.config.axes:
            return PLANAR
        pairs = {*zip(self._table.nodes, self._table.directions, strict=True)}
        return tuple(direction for direction, word in self._words.items() if (label, word.lstrip("-")) in pairs)

    @property
    def condensation_tolerance(self) -> float:
        """The option `tolerance`."""
        return float(self.config.tolerance)

    def matrices(self) -> StructuralMatrices | SparseMatrices:
        """Return the (d, d) matrices: the DOFs of the nodes, then the inner DOFs."""
        return self._matrices

    def dof_label(self, dof: int) -> str:
        """Name a DOF by its node and direction."""
        node, direction = self.node_dofs[dof]
        return f"node '{self._labels[node]}' {direction}"

    def _read(self) -> tuple[dict[str, Any], DofTable, dict[str, Any]]:
        """Return the matrices that are present, the table of DOFs, and the file of each matrix."""
        config, archive = self.config, {}
        if config.file:
            where = dict.fromkeys(_MATRICES, config.file)
            archive = read_archive(Path(config.file))
            values = {name: matrix_in(archive, name, config.file) for name in _MATRICES}
        else:
            where = {name: getattr(config, option) for name, option in _MATRICES.items()}
            values = {name: read_matrix_market(Path(file)) if file else None for name, file in where.items()}
        for name in ("M", "K"):
            if values[name] is None:
                names = ", ".join(sorted(archive)[:12]) or "nothing"
                raise DovetailError(Fault(config.file, f"there is no matrix '{name}'; there is: {names}."))
        if "units" not in config.model_fields_set:
            files = [file for file in where.values() if file]
            check_stated_units(
                texts_in(archive, config.file) if config.file else chain.from_iterable(map(comments_of, files))
            )
        matrices = {name: sound_matrix(name, value, where[name]) for name, value in values.items() if value is not None}
        _check_together(matrices, where)
        if config.loss_factor and "D" in matrices:
            raise DovetailError(Fault(where["D"], "both a matrix D and 'loss_factor' are given.", "one of the two"))
        size = matrices["K"].shape[0]
        table = read_dof_table(Path(config.dofs), size) if config.dofs else table_in(archive, config.file, size)
        if table is None:
            remedy = "Name a CSV file with 'dofs'."
            raise DovetailError(
                Fault(config.file, "there is no table of DOFs: no 'nodes', no 'directions'.", "", remedy)
            )
        return matrices, table, where

    def _reached(self, size: int) -> tuple[list[int], int]:
        """Return the rows of the nodes' DOFs, and the largest number of rigid-body motions of all DOFs."""
        used = {word.lstrip("-") for word in self._words.values()}
        table = self._table
        rows = zip(table.nodes, table.directions, table.rows, strict=True)
        reached = [int(row) for node, direction, row in rows if direction in used and node in self._labels]
        directions = set(table.directions)
        if self.config.axes or len(table.rows) < size or len(directions) > _PLANE:
            return reached, min(size, _IN_SPACE)
        return reached, min(size, _PLANE if directions <= used else _PLANE + 1)

    def _chosen(self, table: DofTable) -> tuple[str, ...]:
        """Return the nodes that have one of the directions: all, or those of the option `nodes`."""
        wanted = {option: str(getattr(self.config, option)).lstrip("-") for option in ("displacement", "rotation")}
        directions = dict.fromkeys(table.directions)
        if self.config.axes:
            wanted = {f"axes.{direction}": word.lstrip("-") for direction, word in self._words.items()}
        reached = [n for n, d in zip(table.nodes, table.directions, strict=True) if d in wanted.values()]
        for option, word in wanted.items() if self.config.axes else ():
            if word not in directions:
                listed = ", ".join(list(directions)[:12])
                raise DovetailError(Fault(table.where, f"no DOF has the direction '{word}', see '{option}'.", listed))
        if not self.config.axes and wanted["displacement"] not in directions:
            problem = f"no DOF has the direction '{wanted['displacement']}', which is used as x."
            raise DovetailError(Fault(table.where, problem, ", ".join(list(directions)[:12]), "Set 'displacement'."))
        if "rotation" in self.config.model_fields_set and wanted.get("rotation") not in directions:
            problem = f"no DOF has the direction '{wanted['rotation']}', which is used as rz."
            raise DovetailError(Fault(table.where, problem, ", ".join(list(directions)[:12]), "Set 'rotation'."))
        labels = tuple(dict.fromkeys(reached))
        chosen = tuple(str(node) for node in self.config.nodes) or labels
        for label in chosen:
            if label not in labels:
                some = ", ".join(labels[:12]) + (f", and {len(labels) - 12} more" if len(labels) > 12 else "")
                raise DovetailError(Fault(table.where, f"there is no node '{label}' with these directions.", some))
        return tuple(dict.fromkeys(chosen))

    def _arranged(self, matrices: dict[str, Any]) -> StructuralMatrices | SparseMatrices:
        """Convert the matrices to SI, and move x and rz of the nodes to the front."""
        units, arrangement = self.config.units, self._arrangement(matrices["K"].shape[0])
        factor = {"M": units.mass, "K": units.stiffness, "C": units.stiffness, "D": units.stiffness}
        arranged = {name: factor[name] * (arrangement.T @ matrix @ arrangement) for name, matrix in matrices.items()}
        if self.config.loss_factor:
            arranged["D"] = self.config.loss_factor * arranged["K"]
        if arrangement.shape[1] > _SMALL:
            return SparseMatrices(**arranged)
        small = StructuralMatrices(**{name: matrix.toarray() for name, matrix in arranged.items()})
        for matrix in (small.M, small.K, small.C, small.D):
            matrix.flags.writeable = False  # the same arrays are returned by each call
        return small

    def _arrangement(self, size: int) -> Any:
        """Return the sparse matrix (size, d) that maps the nodes' DOFs and the inner ones to those of the file."""
        from scipy.sparse import coo_array

        node_of = {label: index for index, label in enumerate(self._labels)}
        entries, dofs = list[tuple[int, int, float]](), self.node_dofs
        for axis, word in self._words.items():
            value = (-1.0 if word.startswith("-") else 1.0) * (self.config.units.length if is_rotation(axis) else 1.0)
            for node, direction, row in zip(self._table.nodes, self._table.directions, self._table.rows, strict=True):
                if direction == word.lstrip("-") and node in node_of:
                    (dof,) = dofs.among([node_of[node]], [axis])
                    entries.append((int(row), dof, value))
        inner = np.setdiff1d(np.arange(size), [row for row, _, _ in entries])
        first = dofs.size
        entries += [(int(row), first + index, 1.0) for index, row in enumerate(inner)]
        rows, columns, values = zip(*entries, strict=True)
        return coo_array((values, (rows, columns)), shape=(size, first + len(inner))).tocsc()


def _check_together(matrices: Mapping[str, Any], where: Mapping[str, Any]) -> None:
    """Raise a DovetailError if the matrices differ in size, or if a mass is negative."""
    size = matrices["K"].shape[0]
    for name, matrix in matrices.items():
        if matrix.shape[0] != size:
            raise DovetailError(Fault(where[name], f"{name} has {matrix.shape[0]} rows, K has {size}."))
    if (masses := matrices["M"].diagonal()).min() < 0:
        row = int(np.argmin(masses))
        raise DovetailError(Fault(where["M"], f"the mass of row {row + 1} is negative: {masses[row]:g}."))
