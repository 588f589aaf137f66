"""Whether the residuals of a fit are noise, and whether the measurement itself is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.identification.fitting import Fit
from dovetail.identification.fitting.least_squares import without
from dovetail.identification.fitting.observations import Observations
from dovetail.identification.fitting.residuals import ModelFrfs
from dovetail.identification.fitting.whiteness import NOISE_ALARM, has_size_of_noise, is_white, log_improbability

__all__ = ["is_noise", "shows_structure"]


def is_noise(assembly: Assembly, target: Observations, fit: Fit) -> bool:
    """Return whether the residuals of a fit are noise: no larger, and not correlated along the frequency axis."""
    if fit.discrepancy:
        return False
    frf, jacobian = ModelFrfs.of(assembly).linearise(fit.theta[np.newaxis])
    weighted = target.weighted(fit.variance, fit.used)
    residuals = weighted.of(frf)[0]
    of_responses = target.by_line(without(residuals, weighted.jacobian(frf, jacobian)[0]))
    squares, lines = sum(float(np.sum(block**2)) for block in of_responses), int(np.count_nonzero(fit.used))
    if not has_size_of_noise(squares, fit.degrees_of_freedom, lines, variance_known=fit.variance_known):
        return False
    return all(is_white(_scaled_to_scatter(block)) for block in of_responses)


def shows_structure(target: Observations, fit: Fit, *, fits: bool) -> bool:
    """Return whether a measurement shows more than noise.

    Mere noise is as large as its variance, or the same on all lines if that is unknown, and white. A resonance that is
    hidden in it may still show as an improvement by a fit. It may lie on any line, and the best of them fits by chance.

    Parameters
    ----------
    target : Observations
    fit : Fit
    fits : bool
        Whether its residuals are noise.
    """
    if fit.variance_assumed:
        return True
    variance = fit.variance if target.variance_known else _even_variance(target)
    weighted = target.weighted(variance, fit.used)
    values = weighted.of(np.zeros((1, len(variance)), dtype=np.complex128))[0]
    of_responses = target.by_line(values)
    squares, lines = sum(float(np.sum(block**2)) for block in of_responses), int(np.count_nonzero(fit.used))
    known = target.variance_known
    if not has_size_of_noise(squares, len(values), lines, variance_known=known) or not all(map(is_white, of_responses)):
        return True
    explained = squares - fit.chi_squared * fit.degrees_of_freedom
    return fits and known and log_improbability(explained, len(fit.theta)) > np.log10(max(1, lines) / NOISE_ALARM)


def _even_variance(target: Observations) -> NDArray[np.float64]:
    """Return E|error|^2 (n_lines,) if a measurement is noise of the same size on all lines, from the median."""
    levels = [float(np.median(frf.amplitude)) ** 2 / np.log(2.0) for frf in target.frfs]
    return np.repeat(np.maximum(levels, np.finfo(float).tiny), target.counts)


def _scaled_to_scatter(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return residuals (n_freq, n), scaled down where their scatter from line to line exceeds the random error."""
    scatter = float(np.mean(np.diff(residuals, axis=0) ** 2)) / 2.0 if len(residuals) > 1 else 1.0
    return np.asarray(residuals / np.sqrt(max(1.0, scatter)))
