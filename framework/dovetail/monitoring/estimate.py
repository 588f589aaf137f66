"""The estimate from one file: a few Gauss-Newton steps from the prediction, with the exact Jacobian."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.monitoring.kalman import Belief, LinearMeasurement
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation, SumOfSquares, minimise
from dovetail.problem.observations import Observations
from dovetail.problem.residuals import FrfResiduals

Array = NDArray[np.float64]

_LEAST_VARIANCE = 1e-16
"""Of a position; rounding errors are as large."""


@dataclass(frozen=True)
class Settings:
    """Constants of the search for the most probable parameters."""

    tolerance: float = 1e-2
    """Decrease of the sum of squares in one step that ends it."""
    steps: int = 40
    """Largest number of steps; after a small change three are enough."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class FileModel:
    """The model on the lines of the files, compiled once, and how lines are weighted.

    Parameters
    ----------
    problem : Problem
        Of the measurement by which the watch was set up.
    model_variance : (n_lines,) array
        Square of the model's error there; it only lowers the weight of lines.
    random_variance : (n_lines,) array
        E|error|^2 of that measurement.
    used : (n_lines,) bool array
        Lines that count.
    is_free : (p,) bool array
        Parameters of which the earlier files say nothing.
    """

    problem: Problem
    model_variance: Array
    random_variance: Array
    used: NDArray[np.bool_]
    is_free: NDArray[np.bool_]

    @cached_property
    def line_of_residual(self) -> NDArray[np.intp]:
        """(m,) the line of each residual."""
        frfs = self.problem.measured
        each = np.repeat([2 if frf.has_phase else 1 for frf in frfs], [len(frf.frequency) for frf in frfs])
        return np.repeat(np.arange(len(each)), each)

    def values(self, position: Array) -> NDArray[np.complex128]:
        """Return the model's FRFs (n_lines,) at a position (p,)."""
        return self.problem.frf_at(self.problem.from_unit(position))

    def misfit(self, observations: Observations, variance: Array) -> FrfResiduals:
        """Return the residuals of a file with a random error (n_lines,), as functions of the positions."""
        weighted = observations.weighted(variance + self.model_variance, self.used)
        return FrfResiduals(self.problem.model, weighted)

    def scaled_residuals(self, observations: Observations, values: NDArray[np.complex128]) -> Array:
        """Return differences from the model (m,) over the random error of the first measurement."""
        return np.asarray(observations.weighted(self.random_variance, self.used).of(values[np.newaxis])[0])


@dataclass(frozen=True, eq=False)
class FileEstimate:
    """What one file says.

    Parameters
    ----------
    measurement : LinearMeasurement
        Of the positions less the offset.
    belief : Belief
        Of the same, after the file.
    residuals : (m,) array
        Differences from the model at the most probable parameters, over the random error of the first measurement.
    variance : (n_lines,) array
        E|error|^2 of the file.
    """

    measurement: LinearMeasurement
    belief: Belief
    residuals: Array
    variance: Array


@dataclass(frozen=True, eq=False)
class KeptFile:
    """The values of one of the first files, from which it is estimated again when the random walk is known.

    Parameters
    ----------
    values : (n_lines, 2) array
        Real and imaginary parts; the latter are 0 where there is no phase.
    variance : (n_lines,) array
        E|error|^2.
    offset : (p,) array
        By which laws move the positions at the file's covariates.
    """

    values: Array
    variance: Array
    offset: Array

    @staticmethod
    def of(observations: Observations, found: FileEstimate, offset: Array) -> KeptFile:
        """Keep the values of a file."""
        values = observations.values
        return KeptFile(np.stack([np.real(values), np.imag(values)], axis=1), found.variance, offset)

    def observations(self, model: FileModel) -> Observations:
        """Return the values and their random error as observations."""
        known = model.problem.observations
        values, variances = (known.split(each) for each in (self.values @ [1.0, 1j], self.variance))
        parts = zip(known.frfs, values, variances, strict=True)
        frfs = (
            replace(frf, values=own if frf.has_phase else own.real, variance=variance, coherence=None, averages=None)
            for frf, own, variance in parts
        )
        return Observations(tuple(frfs))


class WithBelief(SumOfSquares):
    """Residuals of a measurement, followed by the deviations from a belief.

    Parameters
    ----------
    misfit : SumOfSquares
        Of positions.
    belief : Belief
    weight : float
        Factor of the deviations: the standard deviation of the measurement's residuals by random errors.
    """

    def __init__(self, misfit: SumOfSquares, belief: Belief, weight: float = 1.0) -> None:
        self._misfit, self._mean = misfit, belief.mean
        size = len(belief.mean)
        factor = np.linalg.cholesky(belief.covariance + np.eye(size) * _LEAST_VARIANCE)
        self._root = weight * np.linalg.inv(factor)

    def residuals(self, position: Array) -> Array:
        """Return residuals (n, m) at positions (n, p)."""
        return np.concatenate([self._misfit.residuals(position), (position - self._mean) @ self._root.T], axis=1)

    def linearise(self, position: Array) -> Linearisation:
        """Return residuals and their derivatives at positions (n, p)."""
        linear = self._misfit.linearise(position)
        deviations = (position - self._mean) @ self._root.T
        jacobian = np.broadcast_to(self._root.T, (len(position), *self._root.shape))
        return Linearisation(
            np.concatenate([linear.residuals, deviations], axis=1), np.concatenate([linear.jacobian, jacobian], axis=2)
        )


def most_probable(misfit: SumOfSquares, belief: Belief, start: Array, weight: float = 1.0) -> Array:
    """Return the positions (p,) within the ranges that fit a measurement and a belief best."""
    problem = WithBelief(misfit, belief, weight)
    minima = minimise(problem, start[np.newaxis], tolerance=_SETTINGS.tolerance, most_steps=_SETTINGS.steps)
    return np.asarray(minima.position[0])


def estimate(
    model: FileModel, observations: Observations, prior: Belief, offset: Array, noise_scale: float = 1.0
) -> FileEstimate:
    """Return what a file says about the parameters, linearised at their most probable values.

    Parameters
    ----------
    model : FileModel
    observations : Observations
    prior : Belief
        Of the positions less the offset.
    offset : (p,) array
        By which laws move the positions at the file's covariates.
    noise_scale : float
        Standard deviation of the scatter of the files over that of their random errors.
    """
    start = np.clip(prior.mean + offset, 0.0, 1.0)
    variance = observations.variance(model.values(start))
    misfit = model.misfit(observations, variance)
    weight = noise_scale * float(np.sqrt(np.mean(variance[model.used] / (variance + model.model_variance)[model.used])))
    position = most_probable(misfit, Belief(prior.mean + offset, prior.covariance), start, weight)
    measurement = _linearised(model, misfit, variance, position)
    covariance = measurement.update(prior, noise_scale).covariance
    residuals = model.scaled_residuals(observations, model.values(position))
    return FileEstimate(measurement.shifted(offset), Belief(position - offset, covariance), residuals, variance)


def _linearised(model: FileModel, misfit: FrfResiduals, variance: Array, position: Array) -> LinearMeasurement:
    """Return a linearised file; free parameters come first in the triangle, so that later rows do not have them."""
    linear = misfit.linearise(position[np.newaxis])
    residuals, jacobian = linear.residuals[0], linear.jacobian[0]
    share = (variance / (variance + model.model_variance))[model.line_of_residual]
    order = np.argsort(~model.is_free, kind="stable")
    tangent, triangle = np.linalg.qr(jacobian[order].T)
    root = np.empty_like(triangle)
    root[:, order] = triangle
    noise = tangent.T @ (share[:, np.newaxis] * tangent)
    target = root @ position - tangent.T @ residuals
    return LinearMeasurement(root, target, noise, int(np.count_nonzero(model.is_free)), float(residuals @ residuals))
