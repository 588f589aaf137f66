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

    DOF ``2 * i`` is x of node ``i`` and DOF ``2 * i + 1`` its rz.

    Attributes
    ----------
    grounded : bool
        True for a part that does not move: whatever is connected to it is held.
    """

    kind: ClassVar[Kind] = "substructure"
    grounded: ClassVar[bool] = False

    @property
    @abstractmethod
    def nodes(self) -> tuple[Node, ...]:
        """The nodes, in the order of their DOFs."""

    @abstractmethod
    def matrices(self) -> StructuralMatrices | None:
        """Return the (d, d) matrices over all nodes' DOFs, or None for a part known by its FRFs only."""

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
        unit_loads = np.eye(matrices.size)[:, chosen]
        receptance: list[NDArray[np.complex128]] = [
            np.linalg.solve(matrices.dynamic_stiffness(line)[0], unit_loads)[chosen]
            for line in np.asarray(frequency, dtype=np.float64)[:, None]
        ]
        return np.stack(receptance)

    def dof_label(self, dof: int) -> str:
        """Name a DOF for a reader: its node's position and direction."""
        node = self.nodes[dof // len(DIRECTIONS)]
        return f"{node.position * 1e3:g} mm {DIRECTIONS[dof % len(DIRECTIONS)]}"
