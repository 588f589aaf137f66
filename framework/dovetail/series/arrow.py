"""Systems of equations in the form of an arrow: a dense border of the shared unknowns, a block for each test.

The shared unknowns come first; each test's own unknowns are coupled to them and to one another only. The cost of all
operations grows linearly with the number of tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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

    def _reduced(self) -> tuple[Array, list[Array]]:
        """Return the Schur complements (n, g, g), and block^-1 below (n, l_k, g) of each test."""
        solved = [
            np.asarray(np.linalg.solve(block, below), dtype=np.float64)
            for block, below in zip(self.blocks, self.below, strict=True)
        ]
        return self.border - sum(right @ part for right, part in zip(self.right, solved, strict=True)), solved

    def solve(self, vector: Array) -> Array:
        """Return the solutions (n, d) for right sides (n, d)."""
        shared = self.border.shape[1]
        schur, solved = self._reduced()
        own = np.split(vector[:, shared:], np.cumsum([block.shape[1] for block in self.blocks])[:-1], axis=1)
        inner = [_solved(block, part) for block, part in zip(self.blocks, own, strict=True)]
        coupled = sum(_times(right, part) for right, part in zip(self.right, inner, strict=True))
        common = _solved(schur, vector[:, :shared] - coupled)
        return np.concatenate(
            [common, *(part - _times(one, common) for part, one in zip(inner, solved, strict=True))], axis=1
        )

    def log_determinant(self) -> Array:
        """Return the logarithms (n,) of the absolute determinants."""
        schur, _ = self._reduced()
        parts = [np.linalg.slogdet(schur)[1], *(np.linalg.slogdet(block)[1] for block in self.blocks)]
        return np.asarray(np.sum(parts, axis=0))

    def quadratic(self, vector: Array) -> Array:
        """Return v^T A^-1 v (n,)."""
        return np.asarray(np.sum(vector * self.solve(vector), axis=1))

    def times_root(self, normal: Array) -> Array:
        """Return draws (n, d) with these matrices, symmetric here, as covariance, from standard normal ones (n, d)."""
        shared = self.border.shape[1]
        schur, _ = self._reduced()
        common = _times(np.asarray(np.linalg.cholesky(schur), dtype=np.float64), normal[:, :shared])
        inner, first = [], shared
        for right, block in zip(self.right, self.blocks, strict=True):
            last = first + block.shape[1]
            root = np.asarray(np.linalg.cholesky(block), dtype=np.float64)
            inner.append(_times(root, normal[:, first:last]))
            common = common + _times(right, _solved(np.swapaxes(root, 1, 2), normal[:, first:last]))
            first = last
        return np.concatenate([common, *inner], axis=1)

    def shared_covariance(self) -> Array:
        """Return the part of the inverse that belongs to the shared unknowns (n, g, g)."""
        return np.asarray(np.linalg.inv(self._reduced()[0]), dtype=np.float64)

    def own_covariance(self, index: int) -> Array:
        """Return the part of the inverse (n, g + l, g + l) that belongs to the shared unknowns and those of a test."""
        schur, solved = self._reduced()
        common, part = np.linalg.inv(schur), solved[index]
        cross = -common @ np.swapaxes(part, 1, 2)
        own = np.linalg.inv(self.blocks[index]) + part @ common @ np.swapaxes(part, 1, 2)
        return np.block([[common, cross], [np.swapaxes(cross, 1, 2), own]])

    def row(self, index: int) -> ArrowMatrix:
        """Return one of the matrices, as a batch of one."""
        rows = slice(index, index + 1)
        right, below, blocks = ([one[rows] for one in part] for part in (self.right, self.below, self.blocks))
        return ArrowMatrix(self.border[rows], right, below, blocks)


def arrow_vector(parts: Sequence[Array], shared: int) -> Array:
    """Return the sum (n, d) of vectors (n, g + l_k) of the tests."""
    common = sum(part[:, :shared] for part in parts)
    return np.concatenate([common, *(part[:, shared:] for part in parts)], axis=1)


def _diagonal(values: Array) -> Array:
    return values[:, :, np.newaxis] * np.eye(values.shape[1])


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[:, :, np.newaxis])[:, :, 0])


def _solved(matrices: Array, vectors: Array) -> Array:
    return np.asarray(np.linalg.solve(matrices, vectors[:, :, np.newaxis])[:, :, 0])
