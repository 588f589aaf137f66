"""The contract of a substructure: nodes, and matrices or an FRF."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.matrices import DIRECTIONS, StructuralMatrices
from dovetail.interfaces.sparse_matrices import SparseMatrices

__all__ = ["Node", "SubstructureModel"]


@dataclass(frozen=True)
class Node:
    """A point of a substructure with the DOFs x and rz.

    Parameters
    ----------
    label : str
    position : float
        Distance from the substructure's own origin [m]; descriptions address nodes by it.
    """

    label: str
    position: float


class SubstructureModel(Component):
    """A part whose dynamics are known.

    DOF ``2 * i`` is x of node ``i`` and DOF ``2 * i + 1`` its rz. What matrices have beyond the nodes' DOFs are inner
    DOFs, which no joint and no response can reach.

    Attributes
    ----------
    grounded : bool
        True for a part that does not move: whatever is connected to it is held.
    """

    kind: ClassVar[Kind] = "substructure"
    grounded: ClassVar[bool] = False

    @property
    def held(self) -> bool:
        """True for a part that something outside the assembly holds, so that moving it as a whole takes effort."""
        return False

    def refined(self, factor: int) -> SubstructureModel | None:  # noqa: ARG002
        """Return the same part with a mesh `factor` times as fine, or None where there is no mesh to refine."""
        return None

    @property
    def absent_dofs(self) -> frozenset[int]:
        """DOFs of the nodes that a part known by its FRFs has no receptance at: no force acts there; none by default.

        What a joint does there the part does not feel, as at a mass without rotary inertia.
        """
        return frozenset()

    @property
    def condensation_tolerance(self) -> float:
        """Relative error up to which matrices may be condensed on a reduced basis; 0, the default, for exactly."""
        return 0.0

    @property
    @abstractmethod
    def nodes(self) -> tuple[Node, ...]:
        """The nodes, in the order of their DOFs."""

    @abstractmethod
    def matrices(self) -> StructuralMatrices | SparseMatrices | None:
        """Return the (d, d) matrices over the nodes' DOFs and the inner ones; None for a part known by FRFs only."""

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
            raise NotImplementedError(f"'{self.name}' has no matrices, so it has to give its own receptance.")
        chosen = np.asarray(dofs, dtype=np.intp)
        lines = np.asarray(frequency, dtype=np.float64)
        if isinstance(matrices, SparseMatrices):
            return np.stack([_sparse_receptance(matrices, float(line), chosen) for line in lines])
        filled = np.logical_or.reduce([(part != 0).any(axis=0) for part in (matrices.M, matrices.K)])
        active = np.union1d(np.flatnonzero(filled), chosen)
        places = np.searchsorted(active, chosen)
        unit_loads = np.eye(len(active))[:, places]
        receptance: list[NDArray[np.complex128]] = [
            np.linalg.solve(matrices.dynamic_stiffness(line)[0][np.ix_(active, active)], unit_loads)[places]
            for line in lines[:, None]
        ]
        return np.stack(receptance)

    def dof_label(self, dof: int) -> str:
        """Name a DOF for a reader: its node's position and direction."""
        node = self.nodes[dof // len(DIRECTIONS)]
        return f"{node.position * 1e3:g} mm {DIRECTIONS[dof % len(DIRECTIONS)]}"


def _sparse_receptance(matrices: SparseMatrices, frequency: float, chosen: NDArray[np.intp]) -> NDArray[np.complex128]:
    """Solve for unit loads on the chosen DOFs at one frequency [Hz]; DOFs without any entry stay out."""
    from scipy.sparse.linalg import splu

    Z = matrices.dynamic_stiffness(frequency)
    active = np.union1d(np.flatnonzero(np.diff(Z.indptr)), chosen)
    loads = np.zeros((len(active), len(chosen)), dtype=np.complex128)
    places = np.searchsorted(active, chosen)
    loads[places, np.arange(len(chosen))] = 1.0
    solved: NDArray[np.complex128] = splu(Z[active][:, active].tocsc()).solve(loads)[places]
    return solved
