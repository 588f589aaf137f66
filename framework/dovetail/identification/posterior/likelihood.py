"""The likelihood of a measured FRF: its random error and the errors of the model, marginalised, on all lines or few.

Errors of the model widen the covariance of the residuals. `MarginalisedResiduals` scales them to covariance 1 again,
`ReducedResiduals` does so within a subspace, from the few lines that determine where in it they are.
"""

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
from dovetail.identification.fitting.least_squares import Linearisation, SumOfSquares
from dovetail.identification.fitting.observations import Observations, difference
from dovetail.identification.fitting.residuals import FrfResiduals, ModelFrfs, StackedResiduals, Weighted
from dovetail.identification.posterior.model_error import correlation_length, model_errors

__all__ = [
    "Likelihood",
    "MarginalisedResiduals",
    "ReducedResiduals",
    "build_likelihood",
    "check_options",
    "marginalised_squares",
]


@dataclass(frozen=True)
class ReductionSettings:
    """How well the subspace of a reduced misfit represents residuals."""

    tolerance: float = 1e-3
    """Root of the mean square of what the subspace may miss of a residual vector, whose noise is 1."""
    error_multiple: float = 3.0
    """Standard deviations up to which the model's errors are represented as well as the residual vectors."""
    most_shapes: int = 200
    """Vectors of the basis at most."""


_SETTINGS = ReductionSettings()


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Residuals of all lines, and how they err together.

    Parameters
    ----------
    target : Observations
        In the quantities of the responses.
    variance : (n_lines,) array
        E|error|^2 of each line: the random error, and the discrepancy that the fit showed beyond it.
    residual : Weighted or StackedResiduals
        Over the standard deviation of both.
    lines : int
        How many of them count.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.
    """

    target: Observations
    variance: NDArray[np.float64]
    residual: Weighted | StackedResiduals[Weighted]
    lines: int
    errors: NDArray[np.float64]


def build_likelihood(assembly: Assembly, measured: Frf | Sequence[Frf], fit: Fit, model_error: float) -> Likelihood:
    """Weight a measurement by the errors that its best fit shows.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf or sequence of Frf
        One for each response, on its frequencies in the assembly.
    fit : Fit
        Of the same measurement. Its random error, the lines that it left out and its discrepancy are used. The
        discrepancy is correlated between neighbouring lines, so that many of them count as one.
    model_error : float
        Standard deviation of the relative error of natural frequencies.
    """
    target = Observations.of(assembly, measured)
    values = ModelFrfs.of(assembly).frf(fit.theta[np.newaxis])[0]
    discrepancy = (fit.discrepancy * np.abs(values)) ** 2
    if fit.discrepancy:
        deviations = target.split(np.sqrt(fit.variance + discrepancy))
        responses = zip(target.frfs, target.split(values), deviations, strict=True)
        lengths = [correlation_length(difference(frf, fitted) / sd) for frf, fitted, sd in responses]
        discrepancy = discrepancy * np.repeat(lengths, target.counts)
    residual = target.weighted(fit.variance + discrepancy, fit.used)
    axes = [frf.frequency for frf in target.frfs]
    errors = model_errors(axes, target.split(values), model_error)
    in_residuals = residual.jacobian(values[np.newaxis], errors[np.newaxis])[0]
    return Likelihood(target, fit.variance + discrepancy, residual, int(np.count_nonzero(fit.used)), in_residuals)


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


def marginalised_squares(residuals: NDArray[np.float64], errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return r^T (1 + E^T E)^-1 r for residuals (n, m) and errors of the model E (k, m), (n,)."""
    along = residuals @ errors.T
    inner = np.linalg.solve(np.eye(len(errors)) + errors @ errors.T, along.T).T
    return np.asarray(np.einsum("nm,nm->n", residuals, residuals) - np.einsum("nk,nk->n", along, inner))


class MarginalisedResiduals:
    """Residuals with the model's errors marginalised: scaled so that their widened covariance is 1 again.

    Parameters
    ----------
    misfit : SumOfSquares
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.

    Notes
    -----
    Their squares sum to `marginalised_squares`: ``(1 + E^T E)^(-1/2)`` is 1 but in the directions of the errors.
    """

    def __init__(self, misfit: SumOfSquares, errors: NDArray[np.float64]) -> None:
        self._misfit = misfit
        _, sizes, self._directions = np.linalg.svd(errors, full_matrices=False)
        self._reduction = 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m)."""
        return self._scaled(self._misfit.residuals(fraction))

    def linearise(self, fraction: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives."""
        linear = self._misfit.linearise(fraction)
        return Linearisation(self._scaled(linear.residuals), self._scaled(linear.jacobian))

    def _scaled(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(residuals - (residuals @ self._directions.T * self._reduction) @ self._directions)


class ReducedResiduals:
    """Marginalised residuals in a subspace, from the few lines that determine where in it they are.

    Parameters
    ----------
    assembly : Assembly
    residual : Weighted or StackedResiduals
        Of all lines of all responses.
    snapshots : (n, m) array
        Residuals of the whole FRF at points all over the region of interest.
    origin : (m,) array
        Residuals from which differences are taken.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.

    Notes
    -----
    A basis by singular value decomposition, its interpolation lines by pivoted QR (Drmac and Gugercin, A new selection
    operator for the discrete empirical interpolation method, 2016); for likelihoods this is known as reduced-order
    quadrature (Canizares et al., 2013). What lies outside the subspace does not depend on the parameters.
    """

    def __init__(
        self,
        assembly: Assembly,
        residual: Weighted | StackedResiduals[Weighted],
        snapshots: NDArray[np.float64],
        origin: NDArray[np.float64],
        errors: NDArray[np.float64],
    ) -> None:
        basis = _basis(np.concatenate([snapshots - origin, _SETTINGS.error_multiple * errors]))
        pivots = qr(basis.T, mode="r", pivoting=True)[1][: basis.shape[1]]
        lines = residual.lines_of(pivots)
        rows = residual.residuals_of(lines)
        on_lines = ModelFrfs.of(assembly).at(lines)
        for response in on_lines.assemblies:
            response.engine.threads = 1  # so little work is done before others have begun
        self._misfit = FrfResiduals(on_lines, residual.at(lines))
        scaled = _inverse_square_root(np.eye(basis.shape[1]) + (errors @ basis).T @ (errors @ basis))
        self._to_subspace = np.linalg.pinv(basis[rows]).T @ scaled
        self._at_origin = origin @ basis @ scaled
        self._origin_rows = origin[rows]
        self.outside = float(origin @ origin - np.sum((origin @ basis) ** 2))
        self.lines = lines

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, k) in the subspace; with `outside`, their squares sum to `marginalised_squares`."""
        return self._reduced(self._misfit.residuals(fraction))

    def linearise(self, fraction: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives in the subspace."""
        linear = self._misfit.linearise(fraction)
        return Linearisation(self._reduced(linear.residuals), linear.jacobian @ self._to_subspace)

    def _reduced(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        return (residuals - self._origin_rows) @ self._to_subspace + self._at_origin


def _inverse_square_root(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.T)


def _basis(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an orthonormal basis (m, k) of the rows, by the eigenvectors of their Gram matrix."""
    squares, mixing = np.linalg.eigh(vectors @ vectors.T)
    missing = np.cumsum(np.maximum(squares, 0.0))
    kept = np.flatnonzero(missing > len(vectors) * _SETTINGS.tolerance**2)[-_SETTINGS.most_shapes :]
    kept = kept if len(kept) else np.array([len(squares) - 1])
    return np.linalg.qr(vectors.T @ (mixing[:, kept] / np.sqrt(squares[kept])))[0]
