"""A misfit from a few lines: near one place all FRFs are combinations of a few shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from dovetail.assembly import Assembly
from dovetail.identification.fitting.least_squares import Linear
from dovetail.identification.fitting.misfit import FrfMisfit, Weighted

__all__ = ["ReducedMisfit"]

_MOST_SHAPES = 200


class ReducedMisfit:
    """Residuals in a subspace, from the few lines that tell where in it they are.

    Parameters
    ----------
    assembly : Assembly
    residual : Weighted
        Of all lines.
    snapshots : (n, m) array
        Residuals of the whole FRF at places all over the region of interest, and other vectors that must be
        represented.
    origin : (m,) array
        Residuals from which differences are taken.
    tolerance : float
        Root of the mean square of what the subspace may leave of a snapshot.

    Notes
    -----
    A basis by singular value decomposition, its interpolation lines by pivoted QR (Drmac and Gugercin, A new selection
    operator for the discrete empirical interpolation method, 2016); for likelihoods this is known as reduced-order
    quadrature (Canizares et al., 2013). What lies outside the subspace does not depend on the parameters.
    """

    def __init__(
        self,
        assembly: Assembly,
        residual: Weighted,
        snapshots: NDArray[np.float64],
        origin: NDArray[np.float64],
        tolerance: float,
    ) -> None:
        basis = _basis(snapshots - origin, tolerance)
        pivots = qr(basis.T, mode="r", pivoting=True)[1][: basis.shape[1]]
        lines = np.unique(pivots // residual.parts)
        rows = (residual.parts * lines[:, np.newaxis] + np.arange(residual.parts)).ravel()
        self._misfit = FrfMisfit(assembly.on(assembly.frequency[lines]), residual.at(lines))
        self._to_subspace = np.linalg.pinv(basis[rows]).T
        self._basis = basis
        self._at_origin = origin @ basis
        self._origin_rows = origin[rows]
        self.outside = float(origin @ origin - self._at_origin @ self._at_origin)
        self.lines = lines

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, k) in the subspace; with `outside`, their squares sum to those of all lines."""
        return (self._misfit.residuals(fraction) - self._origin_rows) @ self._to_subspace + self._at_origin

    def linear(self, fraction: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives in the subspace."""
        found = self._misfit.linear(fraction)
        residuals = (found.residuals - self._origin_rows) @ self._to_subspace + self._at_origin
        slopes = found.slopes @ self._to_subspace
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ slopes.transpose(0, 2, 1))

    def projected(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return vectors (n, m) over all lines in the subspace, (n, k)."""
        return vectors @ self._basis


def _basis(vectors: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return an orthonormal basis (m, k) of the rows, by the eigenvectors of their Gram matrix."""
    squares, mixing = np.linalg.eigh(vectors @ vectors.T)
    left = np.cumsum(np.maximum(squares, 0.0))
    kept = np.flatnonzero(left > len(vectors) * tolerance**2)[-_MOST_SHAPES:]
    kept = kept if len(kept) else np.array([len(squares) - 1])
    return np.linalg.qr(vectors.T @ (mixing[:, kept] / np.sqrt(squares[kept])))[0]
