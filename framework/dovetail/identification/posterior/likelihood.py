"""What a measured FRF weighs against the FRFs of the model: its random error, and the errors of the model itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError
from dovetail.frf import Frf
from dovetail.identification.fitting import Fit
from dovetail.identification.fitting.levenberg_marquardt import Linear, SumOfSquares
from dovetail.identification.fitting.observations import Measured, missed
from dovetail.identification.fitting.residuals import FrfMisfit, Frfs, SideBySide, Weighted
from dovetail.identification.posterior.model_error import correlation_length, model_errors

__all__ = ["Likelihood", "ReducedMisfit", "WithErrors", "check_options", "likelihood", "squares_with_errors"]


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Residuals of all lines, and how they err together.

    Parameters
    ----------
    target : Measured
        In the quantities of the responses.
    variance : (n_lines,) array
        E|error|^2 of each line: random, and what the fit left beyond it.
    residual : Weighted or SideBySide
        Over the random error, and over what the fit left beyond it.
    lines : int
        How many of them count.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.
    """

    target: Measured
    variance: NDArray[np.float64]
    residual: Weighted | SideBySide[Weighted]
    lines: int
    errors: NDArray[np.float64]


def likelihood(assembly: Assembly, measured: Frf | Sequence[Frf], fit: Fit, model_error: float) -> Likelihood:
    """Weigh a measurement by what its best fit tells.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies.
    fit : Fit
        Of the same measurement. Its random error and the lines it left out are taken over, and so is the part of the
        FRF by which it found the model to be off: neighbouring lines are off alike, so many of them count as one.
    model_error : float
        Standard deviation of the relative error of natural frequencies.
    """
    target = Measured.of(assembly, measured)
    values = Frfs.of(assembly).frf(fit.theta[np.newaxis])[0]
    off = (fit.discrepancy * np.abs(values)) ** 2
    if fit.discrepancy:
        deviation = target.split(np.sqrt(fit.variance + off))
        each = zip(target.frfs, target.split(values), deviation, target.split(off), strict=True)
        off = np.concatenate([part * correlation_length(missed(frf, own) / size) for frf, own, size, part in each])
    residual = target.weighted(fit.variance + off, fit.used)
    errors = model_errors(assembly.frequency, target.split(values), model_error)
    with_errors = residual.slopes(values[np.newaxis], errors[np.newaxis])[0]
    return Likelihood(target, fit.variance + off, residual, int(np.count_nonzero(fit.used)), with_errors)


def check_options(samples: int, model_error: float) -> None:
    """Make sure that there are samples, and that the error of the model is one.

    Raises
    ------
    ParameterError
    """
    if samples < 1:
        raise ParameterError(Fault("samples", f"{samples} samples are none.", "1 or more"))
    if not (np.isfinite(model_error) and 0.0 <= model_error < 1.0):
        raise ParameterError(Fault("model_error", f"{model_error:g} is no relative error.", "from 0 to 1"))


_MOST_SHAPES = 200
_SAFELY = 3.0
"""Standard deviations of the errors of the model that are represented as well as the snapshots."""


class ReducedMisfit:
    """Residuals in a subspace, from the few lines that tell where in it they are.

    Parameters
    ----------
    assembly : Assembly
    residual : Weighted or SideBySide
        Of all lines of all responses.
    snapshots : (n, m) array
        Residuals of the whole FRF at places all over the region of interest, and other vectors that must be
        represented.
    origin : (m,) array
        Residuals from which differences are taken.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.
    tolerance : float
        Root of the mean square of what the subspace may leave of a snapshot.

    Notes
    -----
    A basis by singular value decomposition, its interpolation lines by pivoted QR (Drmac and Gugercin, A new selection
    operator for the discrete empirical interpolation method, 2016); for likelihoods this is known as reduced-order
    quadrature (Canizares et al., 2013). What lies outside the subspace does not depend on the parameters. Errors of
    the model widen the covariance of the residuals in their directions; here the residuals are scaled so that it is 1
    again.
    """

    def __init__(
        self,
        assembly: Assembly,
        residual: Weighted | SideBySide[Weighted],
        snapshots: NDArray[np.float64],
        origin: NDArray[np.float64],
        errors: NDArray[np.float64],
        tolerance: float,
    ) -> None:
        basis = _basis(np.concatenate([snapshots - origin, _SAFELY * errors]), tolerance)
        pivots = qr(basis.T, mode="r", pivoting=True)[1][: basis.shape[1]]
        lines = residual.lines_of(pivots)
        rows = residual.residuals_of(lines)
        on_lines = Frfs.of(assembly).at(lines)
        for one in on_lines.assemblies:
            one.engine.threads = 1  # so little work is done before others have begun
        self._misfit = FrfMisfit(on_lines, residual.at(lines))
        scaled = _inverse_root(np.eye(basis.shape[1]) + (errors @ basis).T @ (errors @ basis))
        self._to_subspace = np.linalg.pinv(basis[rows]).T @ scaled
        self._at_origin = origin @ basis @ scaled
        self._origin_rows = origin[rows]
        self.outside = float(origin @ origin - np.sum((origin @ basis) ** 2))
        self.lines = lines

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, k) in the subspace; with `outside`, their squares sum to `squares_with_errors`."""
        return (self._misfit.residuals(fraction) - self._origin_rows) @ self._to_subspace + self._at_origin

    def linear(self, fraction: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives in the subspace."""
        found = self._misfit.linear(fraction)
        residuals = (found.residuals - self._origin_rows) @ self._to_subspace + self._at_origin
        slopes = found.slopes @ self._to_subspace
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ slopes.transpose(0, 2, 1))


class WithErrors:
    """Residuals whose covariance errors of the model have widened, scaled so that it is 1 again.

    Parameters
    ----------
    misfit : SumOfSquares
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.

    Notes
    -----
    Their squares sum to `squares_with_errors`: ``(1 + E^T E)^(-1/2)`` is 1 but in the directions of the errors.
    """

    def __init__(self, misfit: SumOfSquares, errors: NDArray[np.float64]) -> None:
        self._misfit = misfit
        _, sizes, self._directions = np.linalg.svd(errors, full_matrices=False)
        self._lost = 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m)."""
        return self._scaled(self._misfit.residuals(fraction))

    def linear(self, fraction: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives."""
        found = self._misfit.linear(fraction)
        residuals, slopes = self._scaled(found.residuals), self._scaled(found.slopes)
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ slopes.transpose(0, 2, 1))

    def _scaled(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(residuals - (residuals @ self._directions.T * self._lost) @ self._directions)


def squares_with_errors(residuals: NDArray[np.float64], errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return r^T (1 + E^T E)^-1 r for residuals (n, m) and errors of the model E (k, m), (n,)."""
    along = residuals @ errors.T
    inner = np.linalg.solve(np.eye(len(errors)) + errors @ errors.T, along.T).T
    return np.asarray(np.einsum("nm,nm->n", residuals, residuals) - np.einsum("nk,nk->n", along, inner))


def _inverse_root(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.T)


def _basis(vectors: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return an orthonormal basis (m, k) of the rows, by the eigenvectors of their Gram matrix."""
    squares, mixing = np.linalg.eigh(vectors @ vectors.T)
    left = np.cumsum(np.maximum(squares, 0.0))
    kept = np.flatnonzero(left > len(vectors) * tolerance**2)[-_MOST_SHAPES:]
    kept = kept if len(kept) else np.array([len(squares) - 1])
    return np.linalg.qr(vectors.T @ (mixing[:, kept] / np.sqrt(squares[kept])))[0]
