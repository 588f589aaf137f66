"""A part that is known by its measured receptance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dovetail import (
    ComponentConfig,
    FileName,
    InUnit,
    Node,
    ReceptanceMatrix,
    StructuralMatrices,
    SubstructureModel,
    write_receptance,
)
from dovetail_plugins.substructures.receptance_files import KnownReceptance, from_archive, from_sets


class MeasuredFrf(ComponentConfig):
    """An FRF in the file, and its nodes.

    Attributes
    ----------
    set : int
        Number of the set in the UFF file, from 1.
    response : str
        Node of the measured displacement.
    force : str
        Node of the force.
    """

    set: Annotated[int, Field(ge=1)]
    response: str
    force: str


class Measured(SubstructureModel):
    """A part with measured FRFs between its nodes, such as the flange of a spindle.

    Without a table or `frfs`, the file contains x and rz of one point, as ``dovetail spindle`` writes it. No moment
    acts on nodes without a measured rotation.
    """

    name = "measured"
    summary = "Part known by its measured receptance at one point or between several"

    class Config(ComponentConfig):
        """The file with the receptance, and its contents.

        Attributes
        ----------
        file : str
            NPZ archive with 'frequency' and 'receptance' (n_freq, n, n) and, unless it is x and rz of one point,
            'nodes', 'directions' ('x' or 'rz') and 'positions' of the n DOFs; or a UFF file.
        nodes : mapping
            Nodes of a UFF file and their positions.
        frfs : list
            FRFs of a UFF file, at least one for each pair of nodes; the mirrored ones follow by reciprocity.
        ignore_dofs : bool
            Whether the DOFs in the UFF file are wrong, and are not compared with `frfs`.
        """

        file: Annotated[str, FileName()]
        nodes: Annotated[dict[str, Annotated[float, InUnit("m")]], Field(default_factory=dict)]
        frfs: tuple[MeasuredFrf, ...] = ()
        ignore_dofs: bool = False

        @model_validator(mode="after")
        def _nodes_of_frfs(self) -> Measured.Config:
            if bool(self.nodes) != bool(self.frfs):
                raise ValueError("give both 'nodes' and 'frfs' for a UFF file, and neither for an archive")
            for frf in self.frfs:
                for node in (frf.response, frf.force):
                    if node not in self.nodes:
                        raise ValueError(f"set {frf.set} is at '{node}', which is not among the nodes")
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
        self._known: KnownReceptance = (
            from_sets(
                config.file,
                config.nodes,
                [(frf.set, frf.response, frf.force) for frf in config.frfs],
                ignore_dofs=config.ignore_dofs,
            )
            if config.frfs
            else from_archive(config.file)
        )

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """The measured points."""
        return tuple(Node(label, position) for label, position in self._known.nodes.items())

    @property
    def absent_dofs(self) -> frozenset[int]:
        """The DOFs that were not measured."""
        return frozenset(range(2 * len(self.nodes))) - set(self._known.dofs)

    def matrices(self) -> StructuralMatrices | None:
        """Return None: a measurement has no matrices."""
        return None

    def receptance(self, frequency: NDArray[np.float64], dofs: Sequence[int]) -> NDArray[np.complex128]:
        """Return the measured receptance between `dofs`, interpolated to the lines."""
        chosen = np.array([self._known.dofs.index(int(dof)) for dof in dofs], dtype=np.intp)
        part: NDArray[np.complex128] = self._known.matrix.at(frequency)[:, chosen[:, None], chosen]
        return part
