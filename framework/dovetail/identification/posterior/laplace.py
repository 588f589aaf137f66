"""The posterior as a Gaussian at its most probable place, in a tenth of a second, and where that misleads."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting import Fit
from dovetail.identification.fitting.residuals import FrfMisfit
from dovetail.identification.posterior.likelihood import WithErrors, check_options, likelihood
from dovetail.identification.posterior.mode_search import climb
from dovetail.identification.posterior.model_error import MODEL_ERROR
from dovetail.identification.posterior.posterior import Posterior
from dovetail.identification.posterior.prior import PriorAndData, fraction_of, quantile_of

__all__ = ["Gaussian", "laplace_posterior"]

_INNERMOST = 0.01
"""Part of the ranges at their ends where the search does not start: there the coordinates run away."""
_TOLERANCE, _MOST_STEPS = 1e-3, 100
_NEAR = 1e-2
"""Part of a standard deviation over which second derivatives are taken; the valley is straight so far."""
_MOST_BENT = 0.3
"""Standard deviations that a parameter may be bent off before its interval misleads."""
_ARRIVED = 0.5
"""Standard deviations from the place that the search should have reached, beyond which it has not."""


@dataclass(frozen=True, eq=False)
class Gaussian:
    """The Gaussian whose density has the same place and the same curvature as the posterior there.

    Parameters
    ----------
    mode : (d,) array
        z, normal quantiles of the fractions of the ranges.
    axes : (d, d) array
        Rows: a standard deviation along each principal axis.
    bend : (d,) array
        How far a standard deviation along all axes bends each parameter off its straight course, in parts of the
        parameter's own standard deviation: 0 where the posterior is a Gaussian.
    missed : float
        How far the mode is from where the derivatives at it say that it should be, in standard deviations.
    """

    mode: NDArray[np.float64]
    axes: NDArray[np.float64]
    bend: NDArray[np.float64]
    missed: float

    @staticmethod
    def at(problem: PriorAndData, mode: NDArray[np.float64]) -> Gaussian:
        """Return the Gaussian at the most probable place.

        Notes
        -----
        Along an axis v the residuals change by r'' s^2 / 2 beside their linear part. The part of r'' in the tangent
        is made up for by the parameters, z'' = -K^+ r'': the parameter-effects curvature of Bates and Watts
        (Relative curvature measures of nonlinearity, 1980), which bends the valley.
        """
        residuals, slopes = problem.linear(mode[np.newaxis])
        tangent, triangle = np.linalg.qr(slopes[0].T)
        _, sizes, directions = np.linalg.svd(triangle)
        axes = directions / sizes[:, np.newaxis]
        deviation = np.sqrt(np.sum(axes**2, axis=0))
        ahead, behind = (problem.residuals(mode + sign * _NEAR * axes) for sign in (1.0, -1.0))
        second = (ahead + behind - 2.0 * residuals) / _NEAR**2
        bent = np.linalg.solve(triangle, (second @ tangent).T).T / 2.0
        bend = np.sqrt(np.sum(bent**2, axis=0)) / deviation
        return Gaussian(mode, axes, bend, float(np.linalg.norm(residuals[0] @ tangent)))

    def draw(self, count: int, seed: int) -> NDArray[np.float64]:
        """Return samples (count, d) of z, spread evenly (scrambled Halton points)."""
        points = qmc.Halton(len(self.mode), rng=np.random.default_rng([seed, 4])).random(count)
        return np.asarray(self.mode + norm.ppf(points) @ self.axes)

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """(d,) whether the interval of each parameter misleads."""
        return (self.bend > _MOST_BENT) | (self.missed > _ARRIVED)


def laplace_posterior(
    assembly: Assembly,
    measured: Frf | Sequence[Frf],
    fit: Fit,
    *,
    samples: int = 400,
    model_error: float = MODEL_ERROR,
    seed: int = 0,
) -> Posterior:
    """Take the posterior for a Gaussian in the coordinates in which the prior is one.

    Parameters
    ----------
    assembly : Assembly
        Its ranges are the prior: uniform on the parameters' scales.
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies.
    fit : Fit
        Of the same measurement.
    samples : int
        Drawn from the Gaussian.
    model_error : float
        As in `sample_posterior`.
    seed : int

    Returns
    -------
    Posterior
        With the parameters whose interval is not to be trusted, `doubtful`: the Gaussian is straight where the
        posterior is bent.

    Raises
    ------
    ParameterError
        An option is out of its range.
    """
    check_options(samples, model_error)
    began = time.perf_counter()
    given = likelihood(assembly, measured, fit, model_error)
    misfit = FrfMisfit(assembly, given.residual)
    problem = PriorAndData(WithErrors(misfit, given.errors) if len(given.errors) else misfit)
    start = np.clip(assembly.to_unit(fit.theta), _INNERMOST, 1.0 - _INNERMOST)
    modes, _ = climb(problem, quantile_of(start)[np.newaxis], tolerance=_TOLERANCE, most_steps=_MOST_STEPS)
    gaussian = Gaussian.at(problem, modes[0])
    names = [parameter.name for parameter in assembly.parameters]
    return Posterior.of(
        assembly,
        fraction_of(gaussian.draw(samples, seed)),
        np.full(samples, 1.0 / samples),
        model_error=model_error,
        drawn=samples,
        lines=given.lines,
        seconds=time.perf_counter() - began,
        form="laplace",
        mode=assembly.from_unit(fraction_of(gaussian.mode)),
        doubtful=tuple(name for name, doubt in zip(names, gaussian.doubtful, strict=True) if doubt),
    )
