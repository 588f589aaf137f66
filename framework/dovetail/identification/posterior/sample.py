"""The posterior of an assembly's parameters from one measured FRF and its best fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting import Fit
from dovetail.identification.posterior.likelihood import check_options, likelihood
from dovetail.identification.posterior.model_error import MODEL_ERROR
from dovetail.identification.posterior.modes import search_modes
from dovetail.identification.posterior.posterior import Posterior
from dovetail.identification.posterior.sampling import draw

__all__ = ["sample_posterior"]


def sample_posterior(
    assembly: Assembly,
    measured: Frf | Sequence[Frf],
    fit: Fit,
    *,
    samples: int = 400,
    model_error: float = MODEL_ERROR,
    seed: int = 0,
) -> Posterior:
    """Draw samples of the parameters given a measured FRF, or one for each response.

    Parameters
    ----------
    assembly : Assembly
        Its ranges are the prior: uniform on the parameters' scales.
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies.
    fit : Fit
        Of the same measurement. Its random error and the lines it left out are taken over, and so is the part of the
        FRF by which it found the model to be off: neighbouring lines are off alike, so many of them count as one.
    samples : int
        Searches, each of which gives one sample.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed, 0 for a model that
        is exact; errors of damping, magnitude and phase are in proportion (`model_errors`). It cannot be told from the
        measurement, since the parameters follow it.
    seed : int

    Returns
    -------
    Posterior

    Raises
    ------
    ParameterError
        An option is out of its range.
    """
    check_options(samples, model_error)
    given = likelihood(assembly, measured, fit, model_error)
    best, random = assembly.to_unit(fit.theta), np.random.default_rng([seed, 3])
    modes = search_modes(assembly, given.target, given.variance, given.residual, given.errors, best, random)
    drawn = draw(assembly, given.residual, modes, fit.information, given.errors, count=samples, seed=seed)
    return Posterior.of(
        assembly,
        drawn.fraction,
        drawn.weight,
        model_error=model_error,
        drawn=round(len(drawn.weight) / max(drawn.reached, 1.0 / samples)),
        lines=drawn.lines,
        seconds=drawn.seconds,
    )
