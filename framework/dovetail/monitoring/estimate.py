"""The estimate from one file: a few Gauss-Newton steps from the prediction, with the exact Jacobian."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.monitoring.kalman import Belief, LinearMeasurement
from dovetail.problem import Problem
from dovetail.problem.observations import Observations
from dovetail.problem.residuals import FrfResiduals

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """Constants of the iteration."""

    steps: int = 12
    """Largest number of steps, with those that are halved since they make the fit worse; two are usually enough."""
    tolerance: float = 0.02
    """Largest change of a position in its standard deviations that ends the iteration."""


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

    def scaled_residuals(self, observations: Observations, values: NDArray[np.complex128]) -> Array:
        """Return differences from the model (m,) over the random error of the first measurement."""
        return np.asarray(observations.weighted(self.random_variance, self.used).of(values[np.newaxis])[0])


@dataclass(frozen=True, eq=False)
class FileEstimate:
    """What one file says.

    Parameters
    ----------
    measurement : LinearMeasurement
    residuals : (m,) array
        Differences from the model at the estimate, over the random error of the first measurement.
    variance : (n_lines,) array
        E|error|^2 of the file.
    """

    measurement: LinearMeasurement
    residuals: Array
    variance: Array


@dataclass(frozen=True, eq=False)
class KeptFile:
    """The values of a file, from which it can be linearised elsewhere.

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

    def linearise(self, model: FileModel, mean: Array) -> LinearMeasurement:
        """Return the file linearised at positions (p,) less the offset."""
        known = model.problem.observations
        values, variances = (known.split(each) for each in (self.values @ [1.0, 1j], self.variance))
        parts = zip(known.frfs, values, variances, strict=True)
        frfs = (
            replace(frf, values=own if frf.has_phase else own.real, variance=variance, coherence=None, averages=None)
            for frf, own, variance in parts
        )
        position = np.clip(mean + self.offset, 0.0, 1.0)
        total = self.variance + model.model_variance
        misfit = FrfResiduals(model.problem.model, Observations(tuple(frfs)).weighted(total, model.used))
        linear = misfit.linearise(position[np.newaxis])
        share = (self.variance / total)[model.line_of_residual]
        measurement = _linear_measurement(model, linear.residuals[0], linear.jacobian[0], position, share)
        return measurement.shifted(self.offset)


def estimate(model: FileModel, observations: Observations, prior: Belief, offset: Array) -> FileEstimate:
    """Return what a file says about the parameters, linearised at their most probable values.

    Parameters
    ----------
    model : FileModel
    observations : Observations
    prior : Belief
        Of the positions less the offset.
    offset : (p,) array
        By which laws move the positions at the file's covariates.
    """
    start = np.clip(prior.mean + offset, 0.0, 1.0)
    variance = observations.variance(model.values(start))
    total = variance + model.model_variance
    misfit = FrfResiduals(model.problem.model, observations.weighted(total, model.used))
    share = (variance / total)[model.line_of_residual]
    position = before = start
    limit, belief = np.inf, prior
    for _ in range(_SETTINGS.steps):
        linear = misfit.linearise(position[np.newaxis])
        cost = float(np.sum(linear.residuals[0] ** 2))
        if cost > limit:
            position = (position + before) / 2.0
            continue
        measurement = _linear_measurement(model, linear.residuals[0], linear.jacobian[0], position, share)
        belief = measurement.shifted(offset).update(prior)
        limit = cost + prior.pull(position - offset)  # a step that the prior asks for may raise the misfit so far
        before, position = position, np.clip(belief.mean + offset, 0.0, 1.0)
        if np.max(np.abs(position - before) / np.maximum(belief.deviation(), 1e-12)) < _SETTINGS.tolerance:
            break
    residuals = model.scaled_residuals(observations, model.values(position))
    return FileEstimate(measurement, residuals, variance)


def _linear_measurement(
    model: FileModel, residuals: Array, jacobian: Array, position: Array, share: Array
) -> LinearMeasurement:
    """Return a linearised file; free parameters come first in the triangle, so that later rows do not have them."""
    order = np.argsort(~model.is_free, kind="stable")
    tangent, triangle = np.linalg.qr(jacobian[order].T)
    root = np.empty_like(triangle)
    root[:, order] = triangle
    noise = tangent.T @ (share[:, np.newaxis] * tangent)
    target = root @ position - tangent.T @ residuals
    return LinearMeasurement(root, target, noise, int(np.count_nonzero(model.is_free)), float(residuals @ residuals))
