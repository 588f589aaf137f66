"""A part whose mass, stiffness and damping matrices come from a finite element program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import scipy  # loads a part of it when that is first used
from pydantic import Field, model_validator

from dovetail import (
    DIRECTIONS,
    PLANAR,
    ComponentConfig,
    Direction,
    DofTable,
    DovetailError,
    Fault,
    FileName,
    InUnit,
    PartNode,
    SparseMatrices,
    StructuralMatrices,
    SubstructureModel,
    is_rotation,
)
from dovetail_plugins.craig_bampton import ReducedPart, reduce_part
from dovetail_plugins.substructures.definiteness import check_definiteness, check_mass
from dovetail_plugins.substructures.imported_model import NAMES, ImportedModel, SourceFiles, import_model
from dovetail_plugins.substructures.matrix_remarks import check_stated_units, check_units_of_texts
from dovetail_plugins.substructures.rigid_motions import check_places

_WORD = r"^-?[^\s-].*$"
"""A word for a direction, after a minus if its sense is the opposite one."""
_OptionalFile = Annotated[str | None, FileName()]
_SMALL = 60
"""Number of DOFs up to which matrices are full, so that they are condensed for all frequencies at once."""
_PLANE, _IN_SPACE = 2, 6
"""Rigid-body motions of a bar that bends in a plane, as many as it has directions, and of a body in space."""
_LARGEST_SHIFT = 1e-3
"""Relative change of natural frequencies by a reduction above which there is a warning: about what a line resolves."""
_SECONDS = (1.0, 1e-3, 1e-6)
"""Units of time of finite element models."""


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


class MatrixNames(ComponentConfig):
    """Names of matrices in a file that has several which could be meant.

    Attributes
    ----------
    mass, stiffness, damping, structural_damping : str
        As in the file, such as KAA.
    """

    mass: str | None = None
    stiffness: str | None = None
    damping: str | None = None
    structural_damping: str | None = None


class Reduction(ComponentConfig):
    """Reduction to an interface and modes with the interface held (Craig, Bampton).

    Attributes
    ----------
    interface : list of str
        Nodes that are kept, for joints and responses.
    modes : int
        Number of modes that are kept, or
    up_to : float
        the frequency up to which they are kept [Hz].
    """

    interface: Annotated[tuple[str | int, ...], Field(min_length=1)]
    modes: Annotated[int | None, Field(ge=0, le=2000)] = None
    up_to: Annotated[float | None, Field(gt=0), InUnit("Hz")] = None

    @model_validator(mode="after")
    def _one_measure(self) -> Reduction:
        if (self.modes is None) == (self.up_to is None):
            raise ValueError("give either 'modes' or 'up_to'")
        return self


class Matrices(SubstructureModel):
    """Matrices M and K (optionally C and D) and a table that names their DOFs.

    Two directions of each node are used as x and rz, the displacement and the rotation in the plane in which the
    assembly vibrates, or with `axes` up to six in space. All other DOFs are inner ones, which move freely and are
    condensed.
    """

    name = "matrices"
    summary = "Imported mass, stiffness and damping matrices (NASTRAN, Abaqus, Ansys, NPZ, MAT), thousands of DOFs"
    references = (
        "R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA J. 6 (1968) 1313-1319",
    )

    class Config(ComponentConfig):
        """The files and the meaning of their numbers.

        Attributes
        ----------
        file : str
            File with M, K and, optionally, C, D and the table of DOFs.
        mass, stiffness, damping, structural_damping : str
            A file for each matrix, instead of `file`.
        names : section
            Names of the matrices in the files, if these are not the customary ones.
        dofs : str
            File with the table of DOFs: a CSV with node, direction and, optionally, position and row, or a file of the
            finite element program.
        coordinates : str
            File with the coordinates of the nodes.
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
        reduce : section
            Reduction to the nodes of an interface, instead of `nodes`, and some modes.
        tolerance : float
            Relative error of the condensation, verified with exact lines; 0 for a factorisation at every frequency.
        """

        alternatives = (
            (("file",), ("mass", "stiffness", "damping", "structural_damping")),
            (("loss_factor",), ("structural_damping",)),
            (("axes",), ("displacement", "rotation")),
            (("nodes",), ("reduce",)),
        )
        file: _OptionalFile = None
        mass: _OptionalFile = None
        stiffness: _OptionalFile = None
        damping: _OptionalFile = None
        structural_damping: _OptionalFile = None
        names: MatrixNames = MatrixNames()
        dofs: _OptionalFile = None
        coordinates: _OptionalFile = None
        displacement: Annotated[str, Field(pattern=_WORD)] = "x"
        rotation: Annotated[str, Field(pattern=_WORD)] = "rz"
        axes: dict[Direction, Annotated[str, Field(pattern=_WORD)]] = Field(default_factory=dict)
        nodes: tuple[str | int, ...] = ()
        units: FileUnits = FileUnits()
        loss_factor: Annotated[float, Field(ge=0, lt=1)] = 0.0
        reduce: Reduction | None = None
        tolerance: Annotated[float, Field(ge=0, le=1e-3)] = 1e-9

        @model_validator(mode="after")
        def _one_source(self) -> Matrices.Config:
            single = [option for option in NAMES.values() if getattr(self, option)]
            if bool(self.file) == bool(single):
                raise ValueError("give either 'file', or 'mass' and 'stiffness'")
            if single and not (self.mass and self.stiffness):
                raise ValueError("files of single matrices need 'mass' and 'stiffness'")
            if self.axes and {"displacement", "rotation"} & self.model_fields_set:
                raise ValueError("give either 'axes', or 'displacement' and 'rotation'")
            words = [word.lstrip("-") for word in self.axes.values()]
            if len(set(words)) < len(words):
                raise ValueError("two of 'axes' are the same direction of the table")
            if self.nodes and self.reduce:
                raise ValueError("'reduce' keeps the nodes of its 'interface', so leave out 'nodes'")
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
        model = import_model(self._files())
        self._table = model.table
        self._is_planar = not model.axes or bool({"displacement", "rotation"} & config.model_fields_set)
        self._is_planar = self._is_planar and not config.axes
        self._words = self._words_of(model)
        self._check_units(model)
        if not (self._is_planar or model.has_units or model.table.points is not None):
            problem = "there are no coordinates of the nodes, which a part in space needs."
            remedy = "Name a file of the model with 'coordinates' (nodes of the program's input), or a CSV with 'dofs'."
            raise DovetailError(Fault(model.table.where, problem, remedy=remedy))
        if config.loss_factor and "D" in model.matrices:
            raise DovetailError(
                Fault(model.where["D"], "both a matrix D and 'loss_factor' are given.", "one of the two")
            )
        self._labels = self._chosen(self._table)
        reached, motions = self._reached(model.matrices["K"].shape[0])
        check_definiteness(model.matrices, model.where, self._table.label, reached, motions)
        check_mass(model.matrices["M"], self._table.rows, self._table.directions, model.where["M"])
        self._place_warnings = self._check_places(model)
        self.reduced: ReducedPart | None = None
        self._matrices = self._arranged(model)

    def warnings(self, frequency: float) -> list[str]:
        """Report coordinates that do not fit, and a reduction that leaves out too much up to `frequency` [Hz]."""
        warnings = [*self._place_warnings]
        if self.reduced is None or (shift := self.reduced.largest_shift(frequency)) <= _LARGEST_SHIFT:
            return warnings
        kept, following = len(self.reduced.natural_frequencies), self.reduced.next_frequency
        text = f"reduced to {kept} modes, and the next one, with the interface held, is at {following:.4g} Hz: "
        if np.isinf(shift):
            return [*warnings, f"{text}above that the reduced part is wrong. Keep more modes by 'reduce.up_to'."]
        change = f"natural frequencies up to {frequency:.4g} Hz may change by {100 * shift:.2f} %"
        return [*warnings, f"{text}{change}. Keep more modes."]

    @cached_property
    def nodes(self) -> tuple[PartNode, ...]:
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
            PartNode(label, float(positions[label]), self._directions_of(label), points.get(label))
            for label in self._labels
        )

    def _words_of(self, model: ImportedModel) -> dict[Direction, str]:
        """Return the table's word for each direction, after a minus if its sense is the opposite one."""
        config = self.config
        if config.axes:
            return {direction: config.axes[direction] for direction in DIRECTIONS if direction in config.axes}
        if self._is_planar:
            return {"x": config.displacement, "rz": config.rotation}
        in_table = set(model.table.directions)
        return {direction: word for direction in DIRECTIONS if (word := model.axes.get(direction)) in in_table}

    def _directions_of(self, label: str) -> tuple[str, ...]:
        """Return the directions of a node: in space those that the table has."""
        if self._is_planar:
            return PLANAR
        named = self._named_dofs
        return tuple(direction for direction, word in self._words.items() if (label, word.lstrip("-")) in named)

    @cached_property
    def _named_dofs(self) -> set[tuple[str, str]]:
        """Node and direction of each DOF in the table."""
        return {*zip(self._table.nodes, self._table.directions, strict=True)}

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

    def _files(self) -> SourceFiles:
        """Return the files of the description."""
        config = self.config
        files = dict.fromkeys(NAMES, config.file) if config.file else {n: getattr(config, o) for n, o in NAMES.items()}
        names = {name: wanted for name, option in NAMES.items() if (wanted := getattr(config.names, option))}
        present = {name: file for name, file in files.items() if file}
        return SourceFiles(present, names, config.dofs, config.coordinates, are_separate=not config.file)

    def _check_units(self, model: ImportedModel) -> None:
        """Ask for the units of files that have none, and compare those that a text states.

        Raises
        ------
        DovetailError
            The units are missing, or stiffness and mass have no common unit of time.
        """
        where = model.where["K"]
        if "units" not in self.config.model_fields_set:
            check_stated_units(iter(model.texts))
            if not model.has_units:
                problem = "finite element models have no units of their own, and the description gives none."
                remedy = (
                    "For millimetres, tonnes and seconds give 'units: {length: 1 mm, mass: 1 t, stiffness: 1 N/mm}'."
                )
                raise DovetailError(Fault(where, problem, "'units' with length, mass and stiffness", remedy))
        units = self.config.units
        if "units" in self.config.model_fields_set:
            check_units_of_texts(iter(model.texts), {"length": units.length, "mass": units.mass})
        seconds = np.sqrt(units.mass / units.stiffness)
        if not model.has_units and not np.isclose(seconds, _SECONDS, rtol=1e-6).any():
            problem = f"with a unit of mass of {units.mass:g} kg and one of stiffness of {units.stiffness:g} N/m, "
            problem += f"the unit of time would be {seconds:.4g} s."
            remedy = "In a consistent system the unit of stiffness is that of mass over the square of that of time."
            raise DovetailError(Fault(where, problem, "1 s, 1 ms or 1 us", remedy))

    def _check_places(self, model: ImportedModel) -> tuple[str, ...]:
        """Return warnings about places of nodes and units; a plane part of a model in space has the model's axes."""
        words = model.axes if self._is_planar and self._table.points is not None else self._words
        units = self.config.units
        speed = units.length * float(np.sqrt(units.stiffness / units.mass))
        M, K = (model.matrices[name] for name in "MK")
        return check_places(M, K, self._table, words, model.where["K"], speed)

    def _reached(self, size: int) -> tuple[list[int], int]:
        """Return the rows of the nodes' DOFs, and the largest number of rigid-body motions of all DOFs."""
        used = {word.lstrip("-") for word in self._words.values()}
        table, labels = self._table, set(self._labels)
        rows = zip(table.nodes, table.directions, table.rows, strict=True)
        reached = [int(row) for node, direction, row in rows if direction in used and node in labels]
        directions = set(table.directions)
        if not self._is_planar or len(table.rows) < size or len(directions) > _PLANE:
            return reached, min(size, _IN_SPACE)
        return reached, min(size, _PLANE if directions <= used else _PLANE + 1)

    def _chosen(self, table: DofTable) -> tuple[str, ...]:
        """Return the nodes that have one of the directions: all, or those of the options `nodes` or `reduce`."""
        options = {"x": "displacement", "rz": "rotation"} if self._is_planar else {}
        wanted = {options.get(each, f"axes.{each}"): word.lstrip("-") for each, word in self._words.items()}
        directions = dict.fromkeys(table.directions)
        for option, word in wanted.items():
            is_needed = option != "rotation" or "rotation" in self.config.model_fields_set
            if word not in directions and is_needed:
                use = {"displacement": ", which is used as x", "rotation": ", which is used as rz"}.get(option, "")
                problem = f"no DOF has the direction '{word}'{use}, see '{option}'."
                raise DovetailError(Fault(table.where, problem, ", ".join(list(directions)[:12])))
        reached = [n for n, d in zip(table.nodes, table.directions, strict=True) if d in wanted.values()]
        labels = dict.fromkeys(reached)
        given = self.config.reduce.interface if self.config.reduce else self.config.nodes
        chosen = tuple(str(node) for node in given) or tuple(labels)
        for label in chosen:
            if label not in labels:
                some = ", ".join(list(labels)[:12]) + (f", and {len(labels) - 12} more" if len(labels) > 12 else "")
                raise DovetailError(Fault(table.where, f"there is no node '{label}' with these directions.", some))
        return tuple(dict.fromkeys(chosen))

    def _arranged(self, model: ImportedModel) -> StructuralMatrices | SparseMatrices:
        """Convert the matrices to SI, move the DOFs of the nodes to the front, and reduce the others."""
        units, arrangement = self.config.units, self._arrangement(model.matrices["K"].shape[0])
        seconds = 1.0 if model.has_units else float(np.sqrt(units.mass / units.stiffness))
        factor = {"M": units.mass, "K": units.stiffness, "C": units.stiffness * seconds, "D": units.stiffness}
        arranged = {n: factor[n] * (arrangement.T @ matrix @ arrangement) for n, matrix in model.matrices.items()}
        if reduce := self.config.reduce:
            size = self.node_dofs.size
            self.reduced = reduce_part(arranged, size, model.where["K"], modes=reduce.modes, up_to=reduce.up_to)
            arranged = {name: scipy.sparse.csc_array(matrix) for name, matrix in self.reduced.matrices.items()}
        if self.config.loss_factor:
            arranged["D"] = self.config.loss_factor * arranged["K"]
        if arranged["K"].shape[0] > _SMALL:
            return SparseMatrices(**arranged)
        small = StructuralMatrices(**{name: matrix.toarray() for name, matrix in arranged.items()})
        for matrix in (small.M, small.K, small.C, small.D):
            matrix.flags.writeable = False  # the same arrays are returned by each call
        return small

    def _arrangement(self, size: int) -> Any:
        """Return the sparse matrix (size, d) that maps the nodes' DOFs and the inner ones to those of the file."""
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
        return scipy.sparse.coo_array((values, (rows, columns)), shape=(size, first + len(inner))).tocsc()
