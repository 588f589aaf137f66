"""Likelihood and prior: residuals with random error and marginalised errors of the model, and normal coordinates.

Errors of the model widen the covariance of the residuals. `MarginalisedResiduals` are scaled so that it is 1 again.
`ReducedResiduals` are their coordinates in a subspace, computed from the few lines that determine them.

Both prior and measurement are written as residuals, in coordinates in which the prior is standard normal: a coordinate
z is the normal quantile of a parameter's fraction of its range.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.special import ndtr, ndtri

from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.frequency_average import needs_average, unshaped_deviation, weigh
from dovetail.inference.posterior.model_error import ModelError, error_shapes
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation, SumOfSquares
from dovetail.problem.modal_observations import ModalProblem
from dovetail.problem.observations import Observations, StackedResiduals
from dovetail.problem.part_quantities import quantity_derivatives
from dovetail.problem.residuals import FrfResiduals, ModelFrfs, Residual, Weighted


@dataclass(frozen=True)
class Settings:
    """How far parts may be off, and how accurately residuals are represented in a subspace."""

    most_off: float = 0.3
    """Largest deviation of a quantity of a known part, as the logarithm of the ratio to its described value."""
    tolerance: float = 1e-3
    """Root mean square of the part of a residual vector outside the subspace; its noise is 1."""
    most_shapes: int = 200
    """Largest number of vectors of the basis."""
    least_error: float = 1e-9
    """Variance of an error of the model along a direction of the residuals, whose noise is 1, below which it is left
    out: it changes chi-squared by less than that part."""
    least_amplitude: float = 1e-3
    """Smallest amplitude, over the largest of the response, by which FRFs are divided."""


_SETTINGS = Settings()

PRIOR_PRECISION = 12.0
"""Inverse prior variance of a fraction, a quantile of the parameter's prior, which is uniform from 0 to 1."""

Z_LIMIT = 8.0
"""Largest coordinate z: in double precision it is the end of a parameter's range."""

_BLOCK = 64
"""Number of samples whose residuals are in memory at a time."""


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Residuals of a measurement, and the errors of the model that correlate them.

    Parameters
    ----------
    target : Observations
        In the quantities of the responses.
    variance : (n_lines,) array
        E|error|^2 of each line.
    model : ModelFrfs
        On the lines that the residuals need.
    residual : Residual
        Whitened; averaged over neighbouring lines if the model's errors need that.
    by_line : StackedResiduals or None
        The same residuals if they are of single lines, else None.
    errors : (k, m) array
        Change of the residuals by one standard deviation of each error of the model.
    """

    target: Observations
    variance: NDArray[np.float64]
    model: ModelFrfs
    residual: Residual
    by_line: StackedResiduals[Weighted] | None
    errors: NDArray[np.float64]

    @property
    def misfit(self) -> FrfResiduals:
        """The residuals as functions of the parameters."""
        return FrfResiduals(self.model, self.residual)

    @cached_property
    def marginalised(self) -> MarginalisedResiduals:
        """The residuals with the model's errors marginalised."""
        return MarginalisedResiduals(self.misfit, self.errors)

    @property
    def posterior(self) -> PosteriorResiduals:
        """The residuals with the model's errors marginalised, and those of the prior."""
        return PosteriorResiduals(self.marginalised)

    def frf(self, fraction: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the model's FRFs (n, f) at fractions of the ranges (n, p)."""
        return self.model.frf(self.model.assemblies[0].from_unit(fraction))

    def log(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log-likelihood (n,), up to a constant, at fractions of the ranges (n, p)."""
        blocks = [fraction[first : first + _BLOCK] for first in range(0, max(1, len(fraction)), _BLOCK)]
        squares = [self.marginalised.squares(self.misfit.residuals(block)) for block in blocks]
        return np.asarray(-np.concatenate(squares) / 2.0)

    @cached_property
    def log_constant(self) -> float:
        """What `log` leaves out: the normalisation of the random errors and of the errors of the model."""
        assert isinstance(self.residual, StackedResiduals)
        inner = np.linalg.slogdet(np.eye(len(self.errors)) + self.errors @ self.errors.T)[1]
        return float(self.residual.log_scale - inner / 2.0)


def build_likelihood(problem: Problem, fit: Fit, model_error: ModelError) -> Likelihood:
    """Weight a measurement by its random error and by the errors that the model is allowed.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        Of the same measurement. Its random error and the lines that it left out are used.
    model_error : ModelError
    """
    if isinstance(problem, ModalProblem):
        table, variance = problem.observations, problem.observations.variance_with(model_error.sizes_of_modes)
        differences, no_errors = table.weighted(variance, fit.used), np.zeros((0, len(variance)))
        return Likelihood(table, variance, problem.model, differences, None, no_errors)
    target, values = problem.observations, problem.frf_at(fit.theta)
    shapes = error_shapes(target.frfs, target.split(values), model_error)
    lines, residual = weigh(target, fit.variance, fit.used, values, model_error)

    def added(changes: NDArray[np.complex128]) -> NDArray[np.float64]:
        return np.asarray(residual.jacobian(values[np.newaxis, lines], changes[np.newaxis])[0])

    errors = added(np.concatenate(list(shapes.values()))[:, lines])
    if model_error.quantities:
        displaced = errors[: len(shapes["natural_frequency"])]  # the first kind
        displaced = model_error.quantities / model_error.natural_frequency * displaced
        part_derivatives = added(quantity_derivatives(problem.assembly, fit.theta, lines))
        errors = np.concatenate([errors, _scaled_to_errors(part_derivatives, displaced)])
    variance = fit.variance + unshaped_deviation(target, values, model_error) ** 2
    by_line = None if needs_average(model_error) else target.weighted(variance, fit.used)
    return Likelihood(target, variance, problem.model.at(lines), residual, by_line, errors)


def _scaled_to_errors(derivatives: NDArray[np.float64], errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale derivatives by quantities of parts (k, m) so that each is as large as errors (n, m) are together."""
    wanted = max(float(np.linalg.norm(errors)), np.finfo(float).tiny)
    sizes = np.linalg.norm(derivatives, axis=1, keepdims=True)
    return np.asarray(wanted / np.maximum(sizes, wanted / _SETTINGS.most_off) * derivatives)


def marginalised_squares(residuals: NDArray[np.float64], errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return r^T (1 + E^T E)^-1 r for residuals (n, m) and errors of the model E (k, m), (n,)."""
    along = residuals @ errors.T
    inner = np.linalg.solve(np.eye(len(errors)) + errors @ errors.T, along.T).T
    return np.asarray(squared_norms(residuals) - np.einsum("nk,nk->n", along, inner))


def squared_norms(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sums of squares (n,) of vectors (n, k)."""
    return np.asarray(np.einsum("nk,nk->n", vectors, vectors))


class MarginalisedResiduals(SumOfSquares):
    """Residuals with the model's errors marginalised: scaled so that their widened covariance is 1 again.

    Parameters
    ----------
    misfit : FrfResiduals
    errors : (k, m) array
        Change of the residuals by one standard deviation of each error of the model.
    weight : float
        Factor of residuals and errors.

    Notes
    -----
    Their squares sum to `marginalised_squares`. With ``E E^T = V L V^T`` and ``R = (1 + L)^(1/2)``, the factor is
    ``(1 + E^T E)^(-1/2) = 1 - E^T V (R + R^2)^(-1) V^T E``. Many errors act along few directions of the residuals,
    the rows of ``V^T E``; those with a negligible L are left out.
    """

    def __init__(self, misfit: FrfResiduals, errors: NDArray[np.float64], weight: float = 1.0) -> None:
        self._misfit, self._weight, self.limit = misfit, weight, misfit.limit
        squares, mixing = np.linalg.eigh(errors @ errors.T)
        kept = squares > _SETTINGS.least_error
        self._squares, self._errors = squares[kept], mixing[:, kept].T @ errors

    def weighted(self, factor: float, least_error: float = 0.0) -> MarginalisedResiduals:
        """Return the same residuals times a factor, without errors whose variance is then smaller than the least."""
        other = copy(self)
        other._weight = factor * self._weight
        kept = other._weight**2 * self._squares > least_error
        other._squares, other._errors = self._squares[kept], self._errors[kept]
        return other

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m)."""
        return self.scaled(self._misfit.residuals(fraction))

    def linearise(self, fraction: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives."""
        return self._misfit.linearise(fraction, self.scaled)

    def squares(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sums of squares (n,) of the scaled ones of residuals (n, m) of the measurement."""
        weight = self._weight**2
        along = residuals @ self._errors.T * np.sqrt(weight / (1.0 + weight * self._squares))
        return np.asarray(weight * (squared_norms(residuals) - squared_norms(along)))

    def scaled(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) of the measurement, or changes of them, with the model's errors marginalised."""
        weight = self._weight**2
        root = np.sqrt(1.0 + weight * self._squares)
        scaled = residuals @ self._errors.T * (-weight / (root * (1.0 + root))) @ self._errors
        scaled += residuals
        scaled *= self._weight
        return np.asarray(scaled)


class ReducedResiduals(SumOfSquares):
    """Coordinates of marginalised residuals in a subspace, computed from the few lines that determine them.

    Parameters
    ----------
    likelihood : Likelihood
        Residuals of all lines of all responses.
    snapshots : (n, f) complex array
        FRFs at points all over the region of interest, on the lines of the likelihood's model.
    origin : (f,) complex array
        The FRF from which differences are taken.

    Notes
    -----
    The basis of their differences is that of a singular value decomposition, and its interpolation lines follow from
    pivoted QR (Drmac and Gugercin, A new selection operator for the discrete empirical interpolation method, 2016); for
    likelihoods this is known as reduced-order quadrature (Canizares et al., 2013). Its vectors are scaled as the
    residuals are, and these span the subspace. The part of the residuals outside it does not depend on the parameters.
    Averages over lines are linear in an FRF with phase, so that the lines that determine the FRF suffice; averages of
    amplitudes need all lines.
    """

    def __init__(
        self, likelihood: Likelihood, snapshots: NDArray[np.complex128], origin: NDArray[np.complex128]
    ) -> None:
        at_origin = likelihood.residual.of(origin[np.newaxis])[0]
        differences = likelihood.residual.of(snapshots) - at_origin
        if likelihood.by_line is not None:
            few = _few_lines(likelihood, likelihood.by_line, _basis(differences), at_origin)
        elif all(frf.has_phase for frf in likelihood.target.frfs):
            few = _few_lines_of_averages(likelihood, differences, snapshots - origin, origin)
        else:
            basis = _basis(differences)
            few = _FewLines(likelihood.model, likelihood.residual, at_origin, basis, basis.T)
        self.lines = sum(few.model.counts)
        self._misfit = FrfResiduals(few.model, few.residual)
        self.limit = self._misfit.limit
        basis, mixing = np.linalg.qr(likelihood.marginalised.scaled(few.vectors).T)
        scaled = likelihood.marginalised.scaled(at_origin[np.newaxis])[0]
        self._to_subspace: NDArray[np.float64] = few.to_vectors @ mixing.T
        self._at_origin = scaled @ basis
        self._origin_rows = few.origin
        self.outside = float(scaled @ scaled - self._at_origin @ self._at_origin)

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, k) in the subspace; with `outside`, their squares sum to `marginalised_squares`."""
        return self._reduced(self._misfit.residuals(fraction))

    def linearise(self, fraction: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives in the subspace."""
        linear = self._misfit.linearise(fraction)
        return Linearisation(self._reduced(linear.residuals), linear.jacobian @ self._to_subspace)

    def _reduced(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = (residuals - self._origin_rows)[:, np.newaxis]  # each alone: the last bits do not depend on the batch
        return np.asarray((rows @ self._to_subspace)[:, 0] + self._at_origin)


class _FewLines(NamedTuple):
    """How residuals (m,) of all lines follow from those of few.

    `residual` are q residuals of a `model` on few lines, `origin` (q,) those of the origin. The product of their
    difference with `to_vectors` (q, k) gives the coefficients of k `vectors` (k, m) in the residuals of all lines.
    """

    model: ModelFrfs
    residual: Residual
    origin: NDArray[np.float64]
    to_vectors: NDArray[np.float64]
    vectors: NDArray[np.float64]


def _few_lines(
    likelihood: Likelihood,
    by_line: StackedResiduals[Weighted],
    basis: NDArray[np.float64],
    origin: NDArray[np.float64],
) -> _FewLines:
    """Return the lines whose residuals determine the coordinates in a basis best."""
    lines = by_line.lines_of(_pivots(basis))
    rows = by_line.residuals_of(lines)
    to_vectors = np.asarray(np.linalg.pinv(basis[rows]).T)
    return _FewLines(likelihood.model.at(lines), by_line.at(lines), origin[rows], to_vectors, basis.T)


def _few_lines_of_averages(
    likelihood: Likelihood,
    differences: NDArray[np.float64],
    frf_differences: NDArray[np.complex128],
    origin: NDArray[np.complex128],
) -> _FewLines:
    """Return the lines that determine the FRF, and the changes of the averages with the vectors of its basis.

    FRFs are scaled so that their differences (n, f) are as large as those of the residuals (n, m).
    """
    magnitudes = np.split(np.abs(origin), np.cumsum(likelihood.model.counts)[:-1])
    amplitude = np.concatenate([np.maximum(one, _SETTINGS.least_amplitude * one.max()) for one in magnitudes])
    gain = np.linalg.norm(differences) / max(float(np.linalg.norm(frf_differences / amplitude)), np.finfo(float).tiny)
    scale = amplitude / gain
    line_basis = _basis(_values_over(scale).of(frf_differences))
    lines = np.unique(_pivots(line_basis) // 2)
    rows = np.stack([2 * lines, 2 * lines + 1], axis=1).ravel()
    vectors = np.ascontiguousarray(line_basis.T).view(np.complex128) * scale
    added = likelihood.residual.jacobian(origin[np.newaxis], vectors[np.newaxis])[0]
    to_vectors, on_few = np.asarray(np.linalg.pinv(line_basis[rows]).T), _values_over(scale[lines])
    return _FewLines(likelihood.model.at(lines), on_few, on_few.of(origin[np.newaxis, lines])[0], to_vectors, added)


def _values_over(scale: NDArray[np.float64]) -> Weighted:
    """Return real and imaginary parts of FRFs over a scale (n_lines,), as residuals."""
    return Weighted(np.zeros(len(scale), dtype=np.complex128), 2.0 * scale**2, 1.0 / scale, has_phase=True)


def _pivots(basis: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.asarray(qr(basis.T, mode="r", pivoting=True)[1][: basis.shape[1]])


def _basis(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an orthonormal basis (m, k) of the rows, by the eigenvectors of their Gram matrix."""
    squares, mixing = np.linalg.eigh(vectors @ vectors.T)
    missing = np.cumsum(np.maximum(squares, 0.0))
    kept = np.flatnonzero(missing > len(vectors) * _SETTINGS.tolerance**2)[-_SETTINGS.most_shapes :]
    kept = kept if len(kept) else np.array([len(squares) - 1])
    return np.linalg.qr(vectors.T @ (mixing[:, kept] / np.sqrt(squares[kept])))[0]


@dataclass(frozen=True, eq=False)
class PosteriorResiduals:
    """Residuals of prior and measurement, ``[z, r]``. Half their sum of squares is the negative log density of z.

    Parameters
    ----------
    misfit : SumOfSquares
        Of p fractions of the ranges, over which the prior is uniform.
    """

    misfit: SumOfSquares

    def residuals(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, p + m) at z (n, p)."""
        return np.concatenate([z, self.misfit.residuals(unit_from_normal(z))], axis=1)

    def linearise(self, z: NDArray[np.float64]) -> Linearisation:
        """Return residuals (n, p + m) and their derivatives (n, p, p + m) at z (n, p)."""
        misfit = self.misfit.linearise(unit_from_normal(z))
        density = normal_density(z)
        size = z.shape[1]
        jacobian = np.empty((len(z), size, size + misfit.residuals.shape[1]))
        jacobian[:, :, :size] = np.eye(size)
        np.multiply(misfit.jacobian, density[:, :, np.newaxis], out=jacobian[:, :, size:])
        return Linearisation(np.concatenate([z, misfit.residuals], axis=1), jacobian)


def normal_from_unit(fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal quantiles z of fractions of the ranges."""
    return np.asarray(np.clip(ndtri(fraction), -Z_LIMIT, Z_LIMIT))


def unit_from_normal(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fractions of the ranges of normal quantiles z."""
    return np.asarray(ndtr(z))


def normal_density(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives of the fractions of the ranges by their normal quantiles z."""
    return np.asarray(np.exp(-(z**2) / 2.0) / np.sqrt(2.0 * np.pi))
