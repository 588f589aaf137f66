"""The contract of a substructure: its nodes, and its matrices or receptances."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, PluginError
from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.matrices import DIRECTIONS, SparseMatrices, StructuralMatrices


@dataclass(frozen=True)
class Node:
    """A point of a substructure with the DOFs x and rz.

    Parameters
    ----------
    label : str
    position : float
        Distance from the origin of the substructure [m], by which descriptions refer to the node.
    """

    label: str
    position: float


class SubstructureModel(Component):
    """A part with known dynamics.

    DOF ``2 * i`` is x of node ``i`` and DOF ``2 * i + 1`` its rz. Further DOFs of the matrices are inner DOFs, to which
    no joint and no response can attach.

    Attributes
    ----------
    grounded : bool
        True for a part that does not move.
    """

    kind: ClassVar[Kind] = "substructure"
    grounded: ClassVar[bool] = False

    @property
    def held(self) -> bool:
        """True for a part supported from outside the assembly, whose rigid-body motion is resisted."""
        return False

    def refined(self, factor: int) -> SubstructureModel | None:  # noqa: ARG002
        """Return the same part with a mesh `factor` times as fine, or None if it has no mesh."""
        return None

    def doubts(self, frequency: float) -> Sequence[str]:  # noqa: ARG002
        """Return warnings about this part for frequencies up to `frequency` [Hz]; by default none."""
        return ()

    @property
    def outline(self) -> Sequence[tuple[float, float, float, float]]:
        """The sections to draw, in order: start, stop, outer and inner diameter [m]; none by default."""
        return ()

    @property
    def absent_dofs(self) -> frozenset[int]:
        """DOFs of the nodes at which a part known by its FRFs has no receptance; none by default.

        A joint exerts no force on the part there, as on the rotation of a mass without rotary inertia.
        """
        return frozenset()

    @property
    def condensation_tolerance(self) -> float:
        """Relative error up to which matrices may be condensed on a reduced basis; 0, the default, is exact."""
        return 0.0

    @property
    @abstractmethod
    def nodes(self) -> tuple[Node, ...]:
        """The nodes, in the order of their DOFs."""

    @abstractmethod
    def matrices(self) -> StructuralMatrices | SparseMatrices | None:
        """Return the (d, d) matrices of the nodes' DOFs and the inner DOFs; None for a part with FRFs only."""

    def batched_matrices(self, options: Mapping[str, NDArray[np.float64]]) -> StructuralMatrices | None:  # noqa: ARG002
        """Return the matrices for many values of some options, or None, the default.

        It is called if options of the part are to be identified. Without it the part is constructed again for each
        value, which gives the same result and takes longer.

        Parameters
        ----------
        options : mapping of str to (n,) array
            In SI, by their path in the part's section, such as ``"material.young"`` or ``"sections.0.length"``; see
            ``ComponentConfig.with_options``. All others keep their values.

        Returns
        -------
        StructuralMatrices or None
            Of (n, d, d) arrays.
        """
        return None

    def receptance(self, frequency: NDArray[np.float64], dofs: Sequence[int]) -> NDArray[np.complex128]:
        """Return the receptance matrix between `dofs`.

        Parameters
        ----------
        frequency : (n_freq,) array
            Hz, positive.
        dofs : sequence of int
            n DOFs of the substructure.

        Returns
        -------
        (n_freq, n, n) complex array
            Displacement [m] or rotation [rad] per force [N] or moment [N m].
        """
        matrices = self.matrices()
        if matrices is None:
            problem = f"'{self.name}' has no matrices, so it must override 'receptance'."
            raise PluginError(Fault(f"substructure model '{self.name}'", problem))
        ports = np.asarray(dofs, dtype=np.intp)
        lines = np.asarray(frequency, dtype=np.float64)
        if isinstance(matrices, SparseMatrices):
            return np.stack([_sparse_receptance(matrices, float(line), ports) for line in lines])
        every = (matrices.M, matrices.K, matrices.C, matrices.D)
        filled = np.any([(matrix != 0).any(axis=0) for matrix in every], axis=0)
        active = np.union1d(np.flatnonzero(filled), ports)
        rows = np.searchsorted(active, ports)
        unit_loads = np.eye(len(active))[:, rows]
        receptance: list[NDArray[np.complex128]] = [
            np.linalg.solve(matrices.dynamic_stiffness(line)[0][np.ix_(active, active)], unit_loads)[rows]
            for line in lines[:, None]
        ]
        return np.stack(receptance)

    def dof_label(self, dof: int) -> str:
        """Return a label with the position and direction of a DOF."""
        node = self.nodes[dof // len(DIRECTIONS)]
        return f"{node.position * 1e3:g} mm {DIRECTIONS[dof % len(DIRECTIONS)]}"


def _sparse_receptance(matrices: SparseMatrices, frequency: float, ports: NDArray[np.intp]) -> NDArray[np.complex128]:
    """Solve for unit loads on the ports' DOFs at one frequency [Hz], leaving out DOFs without entries."""
    from scipy.sparse.linalg import splu

    Z = matrices.dynamic_stiffness(frequency)
    active = np.union1d(np.flatnonzero(np.diff(Z.indptr)), ports)
    rows = np.searchsorted(active, ports)
    loads = np.zeros((len(active), len(ports)), dtype=np.complex128)
    loads[rows, np.arange(len(ports))] = 1.0
    receptance: NDArray[np.complex128] = splu(Z[active][:, active].tocsc()).solve(loads)[rows]
    return receptance
