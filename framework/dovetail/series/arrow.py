"""Systems of equations in the form of an arrow: a dense border of the shared unknowns, a block for each test.

The shared unknowns come first; each test's own unknowns are coupled to them and to one another only. The cost of all
operations grows linearly with the number of tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.randomize_then_optimize import solve_each

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ArrowMatrix:
    """A batch of n matrices of this form, which need not be symmetric.

    Parameters
    ----------
    border : (n, g, g) array
    right, below : list of (n, g, l_k) and (n, l_k, g) arrays
        Coupling of the shared unknowns and those of each test.
    blocks : list of (n, l_k, l_k) arrays
    """

    border: Array
    right: Sequence[Array]
    below: Sequence[Array]
    blocks: Sequence[Array]

    @staticmethod
    def added(diagonal: Array, additions: Sequence[Array], shared: int) -> ArrowMatrix:
        """Return a diagonal (n, d) plus a matrix (n, g + l_k, g + l_k) for each test."""
        border = sum(part[:, :shared, :shared] for part in additions) + _diagonal(diagonal[:, :shared])
        blocks, first = [], shared
        for part in additions:
            own = part[:, shared:, shared:]
            last = first + own.shape[1]
            blocks.append(own + _diagonal(diagonal[:, first:last]))
            first = last
        return ArrowMatrix(
            border,
            [part[:, :shared, shared:] for part in additions],
            [part[:, shared:, :shared] for part in additions],
            blocks,
        )

    def diagonal(self) -> Array:
        """Return the diagonals (n, d)."""
        return np.concatenate([np.einsum("nii->ni", part) for part in (self.border, *self.blocks)], axis=1)

    def plus(self, diagonal: Array) -> ArrowMatrix:
        """Return the matrices with a diagonal (n, d) added."""
        shared = self.border.shape[1]
        ends = np.cumsum([shared, *(block.shape[1] for block in self.blocks)])
        pairs = zip(self.blocks, np.split(diagonal[:, shared:], ends[1:-1] - shared, axis=1), strict=True)
        border = self.border + _diagonal(diagonal[:, :shared])
        return ArrowMatrix(border, self.right, self.below, [block + _diagonal(part) for block, part in pairs])

    @cached_property
    def _reduced(self) -> tuple[Array, list[Array]]:
        """Return the Schur complements (n, g, g), and block^-1 below (n, l_k, g) of each test."""
        solved = [solve_each(block, below) for block, below in zip(self.blocks, self.below, strict=True)]
        return self.border - sum(right @ part for right, part in zip(self.right, solved, strict=True)), solved

    def solve(self, vector: Array) -> Array:
        """Return the solutions (n, d) for right sides (n, d), 0 where a block or its Schur complement is singular."""
        shared = self.border.shape[1]
        schur, solved = self._reduced
        own = np.split(vector[:, shared:], np.cumsum([block.shape[1] for block in self.blocks])[:-1], axis=1)
        inner = [_solved(block, part) for block, part in zip(self.blocks, own, strict=True)]
        coupled = sum(_times(right, part) for right, part in zip(self.right, inner, strict=True))
        common = _solved(schur, vector[:, :shared] - coupled)
        return np.concatenate(
            [common, *(part - _times(one, common) for part, one in zip(inner, solved, strict=True))], axis=1
        )

    def log_determinant(self) -> Array:
        """Return the logarithms (n,) of the absolute determinants."""
        schur, _ = self._reduced
        parts = [np.linalg.slogdet(schur)[1], *(np.linalg.slogdet(block)[1] for block in self.blocks)]
        return np.asarray(np.sum(parts, axis=0))

    def times(self, vector: Array) -> Array:
        """Return the products (n, d) with vectors (n, d)."""
        shared = self.border.shape[1]
        common = vector[:, :shared]
        top, inner, first = _times(self.border, common), [], shared
        for right, below, block in zip(self.right, self.below, self.blocks, strict=True):
            part = vector[:, first : first + block.shape[1]]
            top = top + _times(right, part)
            inner.append(_times(below, common) + _times(block, part))
            first += block.shape[1]
        return np.concatenate([top, *inner], axis=1)

    def root(self) -> ArrowRoot:
        """Return the Cholesky factors of these matrices, which are symmetric and positive definite here."""
        inner = [np.asarray(np.linalg.cholesky(block), dtype=np.float64) for block in self.blocks]
        coupling = [
            np.swapaxes(np.asarray(np.linalg.solve(root, below), dtype=np.float64), 1, 2)
            for root, below in zip(inner, self.below, strict=True)
        ]
        schur = self.border - sum(part @ np.swapaxes(part, 1, 2) for part in coupling)
        return ArrowRoot(np.asarray(np.linalg.cholesky(schur), dtype=np.float64), coupling, inner)

    def shared_covariance(self) -> Array:
        """Return the part of the inverse that belongs to the shared unknowns (n, g, g)."""
        return np.asarray(np.linalg.inv(self._reduced[0]), dtype=np.float64)

    def variances(self) -> Array:
        """Return the diagonals (n, d) of the inverses."""
        shared, own = self.border.shape[1], [self.own_covariance(index) for index in range(len(self.blocks))]
        diagonals = [np.einsum("nii->ni", part)[:, shared:] for part in own]
        return np.concatenate([np.einsum("nii->ni", self.shared_covariance()), *diagonals], axis=1)

    def own_covariance(self, index: int) -> Array:
        """Return the part of the inverse (n, g + l, g + l) that belongs to the shared unknowns and those of a test."""
        schur, solved = self._reduced
        common, part = np.linalg.inv(schur), solved[index]
        cross = -common @ np.swapaxes(part, 1, 2)
        own = np.linalg.inv(self.blocks[index]) + part @ common @ np.swapaxes(part, 1, 2)
        return np.block([[common, cross], [np.swapaxes(cross, 1, 2), own]])


@dataclass(frozen=True, eq=False)
class ArrowRoot:
    """Roots L of a batch of symmetric matrices L L^T in the form of an arrow, the border last.

    Parameters
    ----------
    border : (n, g, g) array
        Triangular.
    coupling : list of (n, g, l_k) arrays
    blocks : list of (n, l_k, l_k) arrays
        Triangular.
    """

    border: Array
    coupling: Sequence[Array]
    blocks: Sequence[Array]

    @property
    def arrays(self) -> tuple[Array, ...]:
        """All arrays."""
        return (self.border, *self.coupling, *self.blocks)

    def at_rows(self, rows: NDArray[np.intp]) -> ArrowRoot:
        """Return copies of some of the roots."""
        coupling, blocks = ([one[rows] for one in part] for part in (self.coupling, self.blocks))
        return ArrowRoot(self.border[rows], coupling, blocks)

    def times(self, vector: Array) -> Array:
        """Return L v (n, d)."""
        own = self._own(vector)
        common = _times(self.border, vector[:, : self.border.shape[1]])
        common = common + sum(_times(part, one) for part, one in zip(self.coupling, own, strict=True))
        return np.concatenate(
            [common, *(_times(root, one) for root, one in zip(self.blocks, own, strict=True))], axis=1
        )

    def solve(self, vector: Array) -> Array:
        """Return L^-1 v (n, d)."""
        own = [_solved(root, one) for root, one in zip(self.blocks, self._own(vector), strict=True)]
        common = vector[:, : self.border.shape[1]]
        common = common - sum(_times(part, one) for part, one in zip(self.coupling, own, strict=True))
        return np.concatenate([_solved(self.border, common), *own], axis=1)

    def log_determinant(self) -> Array:
        """Return the logarithms (n,) of the determinants."""
        diagonals = [np.einsum("nii->ni", part) for part in (self.border, *self.blocks)]
        return np.asarray(np.sum(np.log(np.concatenate(diagonals, axis=1)), axis=1))

    def _own(self, vector: Array) -> list[Array]:
        ends = np.cumsum([self.border.shape[1], *(block.shape[1] for block in self.blocks)])
        return np.split(vector, ends[:-1], axis=1)[1:]


def arrow_vector(parts: Sequence[Array], shared: int) -> Array:
    """Return the sum (n, d) of vectors (n, g + l_k) of the tests."""
    common = sum(part[:, :shared] for part in parts)
    return np.concatenate([common, *(part[:, shared:] for part in parts)], axis=1)


def _diagonal(values: Array) -> Array:
    return values[:, :, np.newaxis] * np.eye(values.shape[1])


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[:, :, np.newaxis])[:, :, 0])


def _solved(matrices: Array, vectors: Array) -> Array:
    return solve_each(matrices, vectors[:, :, np.newaxis])[:, :, 0]
