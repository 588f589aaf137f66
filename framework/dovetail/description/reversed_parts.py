"""Parts that are described from their other end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, overload

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray
from pydantic import Field

from dovetail.interfaces import ComponentConfig, Node, SparseMatrices, StructuralMatrices, SubstructureModel


class OrientationSection(ComponentConfig):
    """How a part lies in the assembly.

    Attributes
    ----------
    reversed : bool
        Whether its axis runs against that of the assembly, since it is described from its other end. Positions stay
        its own; rotations are counted along the assembly's axis, in responses and forces too.
    """

    reversed: Annotated[bool, Field(strict=True)] = False


class ReversedPart(SubstructureModel):
    """A part with its rotations counted along the axis of the assembly, against which its own axis runs.

    Parameters
    ----------
    part : SubstructureModel
        Its nodes keep their positions.
    """

    summary = "A part that is described from its other end"

    def __init__(self, part: SubstructureModel) -> None:
        super().__init__()
        self.name, self.grounded = part.name, part.grounded  # type: ignore[misc]  # of this part, for messages
        self._part = part

    @property
    def held(self) -> bool:
        """That of the part."""
        return self._part.held

    @property
    def absent_dofs(self) -> frozenset[int]:
        """Those of the part."""
        return self._part.absent_dofs

    @property
    def condensation_tolerance(self) -> float:
        """That of the part."""
        return self._part.condensation_tolerance

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Those of the part."""
        return self._part.nodes

    def matrices(self) -> StructuralMatrices | SparseMatrices | None:
        """Return the part's matrices (d, d), with the rows and columns of rotations negated."""
        matrices = self._part.matrices()
        return None if matrices is None else opposite_rotations(matrices, len(self.nodes))

    def batched_matrices(self, options: Mapping[str, NDArray[np.float64]]) -> StructuralMatrices | None:
        """Return those of the part (n, d, d), with the rows and columns of rotations negated."""
        matrices = self._part.batched_matrices(options)
        return None if matrices is None else opposite_rotations(matrices, len(self.nodes))

    def receptance(self, frequency: NDArray[np.float64], dofs: Sequence[int]) -> NDArray[np.complex128]:
        """Return the part's receptance (n_freq, n, n), with the rows and columns of rotations negated."""
        signs = rotation_signs(len(self.nodes), 2 * len(self.nodes))[list(dofs)]
        return np.asarray(self._part.receptance(frequency, dofs)) * np.outer(signs, signs)

    def dof_label(self, dof: int) -> str:
        """Return the part's label of a DOF."""
        return self._part.dof_label(dof)


def rotation_signs(nodes: int, size: int) -> NDArray[np.float64]:
    """Return -1 for each rotation of the nodes, and 1 for every other DOF, (size,)."""
    signs = np.ones(size)
    signs[1 : 2 * nodes : 2] = -1.0
    return signs


@overload
def opposite_rotations(matrices: StructuralMatrices, nodes: int) -> StructuralMatrices: ...
@overload
def opposite_rotations(matrices: SparseMatrices, nodes: int) -> SparseMatrices: ...
def opposite_rotations(
    matrices: StructuralMatrices | SparseMatrices, nodes: int
) -> StructuralMatrices | SparseMatrices:
    """Return the matrices (..., d, d) of a part with the opposite sign of the rotations of its nodes."""
    signs = rotation_signs(nodes, matrices.size)
    if isinstance(matrices, SparseMatrices):
        turn = scipy.sparse.diags_array(signs, format="csc")
        return SparseMatrices(*(turn @ getattr(matrices, name) @ turn for name in "MKCD"))
    both = np.outer(signs, signs)
    return StructuralMatrices(*(getattr(matrices, name) * both for name in "MKCD"))
