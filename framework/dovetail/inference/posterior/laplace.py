"""The Laplace approximation: the posterior as a Gaussian about its mode, within a tenth of a second; and its limits."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.alternating import Alternating
from dovetail.inference.posterior.distribution import Posterior, check_options
from dovetail.inference.posterior.likelihood import PosteriorResiduals, build_likelihood, unit_from_normal
from dovetail.inference.posterior.mode_search import likelihood_at_mode, maximise_posterior, starts_near
from dovetail.inference.posterior.model_error import TYPICAL, ModelError
from dovetail.inference.posterior.unknown_chain import UnknownChain
from dovetail.interfaces import Progress, silent
from dovetail.problem import Problem
from dovetail.problem.definition import halton


@dataclass(frozen=True)
class Settings:
    """How the mode is searched for, and the limits beyond which the approximation misleads."""

    tolerance: float = 1e-3
    """Decrease of the sum of squares in one step at which the search for the mode ends."""
    difference_step: float = 1e-2
    """Step of the second differences, in standard deviations; over this distance the valley is straight."""
    largest_bend: float = 0.3
    """Largest deviation of a parameter from a straight valley, in its standard deviations, for a reliable interval."""
    largest_newton_decrement: float = 0.5
    """Distance from the mode, in standard deviations, beyond which the search has not converged."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class LaplaceApproximation:
    """The Gaussian with the mode of the posterior and its curvature there.

    Parameters
    ----------
    mode : (d,) array
        z, normal quantiles of the fractions of the ranges.
    axes : (d, d) array
        Rows: the principal axes, each one standard deviation long.
    bend : (d,) array
        Deviation of each parameter from a straight valley at one standard deviation along all axes, over the
        parameter's standard deviation; 0 if the posterior is a Gaussian.
    newton_decrement : float
        Length of the Gauss-Newton step from `mode`, in standard deviations; 0 at a mode.
    """

    mode: NDArray[np.float64]
    axes: NDArray[np.float64]
    bend: NDArray[np.float64]
    newton_decrement: float

    @staticmethod
    def at(posterior: PosteriorResiduals, mode: NDArray[np.float64]) -> LaplaceApproximation:
        """Return the approximation at the posterior mode.

        Notes
        -----
        Along an axis v the residuals change by r'' s^2 / 2 in addition to their linear part. The parameters compensate
        the part of r'' in the tangent space, z'' = -K^+ r'': the parameter-effects curvature of Bates and Watts
        (Relative curvature measures of nonlinearity, 1980), which bends the valley.
        """
        there = posterior.linearise(mode[np.newaxis])
        tangent, triangle = np.linalg.qr(there.jacobian[0].T)
        _, sizes, directions = np.linalg.svd(triangle)
        axes = directions / sizes[:, np.newaxis]
        deviation = np.sqrt(np.sum(axes**2, axis=0))
        step = _SETTINGS.difference_step
        ahead, behind = (posterior.residuals(mode + sign * step * axes) for sign in (1.0, -1.0))
        second = (ahead + behind - 2.0 * there.residuals) / step**2
        bends = np.linalg.solve(triangle, (second @ tangent).T).T / 2.0
        bend = np.sqrt(np.sum(bends**2, axis=0)) / deviation
        return LaplaceApproximation(mode, axes, bend, float(np.linalg.norm(there.residuals[0] @ tangent)))

    def draw(self, count: int, seed: int) -> NDArray[np.float64]:
        """Return samples (count, d) of z, spread evenly (scrambled Halton points)."""
        points = halton(count, len(self.mode), np.random.default_rng([seed, 4]).spawn(1)[0])
        return np.asarray(self.mode + scipy.special.ndtri(points) @ self.axes)

    @property
    def unreliable(self) -> NDArray[np.bool_]:
        """(d,) whether the interval of each parameter misleads."""
        return (self.bend > _SETTINGS.largest_bend) | (self.newton_decrement > _SETTINGS.largest_newton_decrement)


def laplace_posterior(
    problem: Problem,
    fit: Fit,
    *,
    samples: int = 400,
    model_error: ModelError = TYPICAL,
    seed: int = 0,
    progress: Progress = silent,
) -> Posterior:
    """Approximate the posterior by a Gaussian, in coordinates in which the prior is a standard normal distribution.

    Parameters
    ----------
    problem, fit, model_error, seed, progress
        As in `sample_posterior`.
    samples : int
        Number of samples drawn from the Gaussian.

    Returns
    -------
    Posterior
        With the names of the `unreliable` parameters, along which the posterior is too curved for a Gaussian.

    Raises
    ------
    ParameterError
        An option is out of its range, or the fit is of another problem.
    """
    check_options(samples)
    fit.check_belongs_to(problem)
    progress("modes", 0, 1)
    chain = UnknownChain.of(problem, fit, model_error) if model_error.background else None
    if chain is not None:
        posterior = laplace_posterior(
            chain.problem, chain.fit, samples=samples, model_error=chain.model_error, seed=seed
        )
        return chain.without(posterior)
    began = time.perf_counter()
    likelihood, best = likelihood_at_mode(problem, fit, model_error)
    residuals = likelihood.posterior
    modes = maximise_posterior(residuals, starts_near(best), tolerance=_SETTINGS.tolerance)
    approximation = LaplaceApproximation.at(residuals, modes[0])
    z, weight = approximation.draw(samples, seed), np.full(samples, 1.0 / samples)
    if model_error.quantities:
        z, weight = half_about_the_fit(problem, fit, model_error, z, weight, seed)
    posterior = Posterior.from_fractions(
        problem.parameters,
        unit_from_normal(z),
        weight,
        model_error=model_error,
        searches=samples,
        lines=sum(likelihood.model.counts),
        seconds=time.perf_counter() - began,
    )
    mode = problem.from_unit(unit_from_normal(approximation.mode))
    pairs = zip(posterior.names, approximation.unreliable, strict=True)
    return replace(posterior, form="laplace", mode=mode, unreliable=tuple(name for name, failed in pairs if failed))


def half_about_the_fit(
    problem: Problem,
    fit: Fit,
    model_error: ModelError,
    z: NDArray[np.float64],
    weight: NDArray[np.float64],
    seed: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Replace half of the samples by those of the posterior given the FRFs of the best fit; both weigh the same.

    If a model has errors, they determine the posterior, and their shapes are known only roughly. Best fit and posterior
    then give two different answers, and neither is generally nearer to the truth. The second half are samples of the
    Laplace approximation for the best fit, with the same errors and the same prior.

    Parameters
    ----------
    problem, fit, model_error, seed
        As in `laplace_posterior`.
    z : (n, p) array
        Samples of the posterior, as normal quantiles of the fractions of the ranges.
    weight : (n,) array

    Returns
    -------
    z : (n, p) array
    weight : (n,) array
        Sums to 1. The two halves are `Alternating`.
    """
    target, values = problem.observations, problem.frf_at(fit.theta)
    pairs = zip(target.frfs, target.split(values), strict=True)
    fitted_frfs = [replace(frf, values=modelled if frf.has_phase else np.abs(modelled)) for frf, modelled in pairs]
    residuals = build_likelihood(problem.with_frfs(fitted_frfs), fit, model_error).posterior
    starts = starts_near(problem.to_unit(fit.theta))
    mode = maximise_posterior(residuals, starts, tolerance=_SETTINGS.tolerance)[0]
    both, halves, order = z.copy(), weight / weight.sum(), Alternating(len(z))
    both[order.about_fit] = LaplaceApproximation.at(residuals, mode).draw(int(order.about_fit.sum()), seed)
    halves[order.about_fit] = 1.0
    for half in (order.given_measurement, order.about_fit):
        halves[half] /= max(float(halves[half].sum()), np.finfo(float).tiny)
    return both, halves / halves.sum()
