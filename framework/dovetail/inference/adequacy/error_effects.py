"""The effects of errors of a model on the residuals of a fit, and on its resonance peaks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.frf.resonance_peaks import PairedPeaks, PeakPair, counterpart, pair_peaks, resonance_peaks
from dovetail.frf.resonances import fit_resonances
from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.frequency_average import weigh
from dovetail.inference.posterior.likelihood import MarginalisedResiduals
from dovetail.inference.posterior.model_error import ModelError, error_shapes
from dovetail.problem import Problem
from dovetail.problem.definition import WithPrior
from dovetail.problem.least_squares import minimise
from dovetail.problem.residuals import FrfResiduals, Residual


@dataclass(frozen=True)
class Settings:
    """Which peaks count, and when a fit with errors ends."""

    fewest_peaks: int = 2
    """Peaks needed to limit the error of natural frequencies; the parameters can move a single one into place."""
    dense: float = 2.0
    """Lines within the half-power width of a peak from which its height is reliable."""
    tolerance: float = 0.05
    """Decrease of the sum of squares in one step that ends a fit."""
    steps: int = 60
    """Most steps of a fit."""


_SETTINGS = Settings()


class ErrorEffects:
    """A measurement with a fit to it, its residuals, and the effects of errors of the model on them.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        Of the same measurement.
    """

    def __init__(self, problem: Problem, fit: Fit) -> None:
        self.problem, self.model, self.target, self._fit = problem, problem.model, problem.observations, fit
        self.fraction = problem.to_unit(fit.theta)

    @cached_property
    def values(self) -> NDArray[np.complex128]:
        """The model's FRFs at the fit (n_lines,)."""
        return self.problem.frf_at(self.problem.from_unit(self.fraction))

    def residual(self, values: NDArray[np.complex128], size: ModelError) -> tuple[NDArray[np.intp], Residual]:
        """Return the lines that residuals need, and the residuals; other errors are added to their random error."""
        return weigh(self.target, self._fit.variance, self._fit.used, values, size)

    def shapes(self, values: NDArray[np.complex128], size: ModelError) -> dict[str, NDArray[np.complex128]]:
        """Return the changes of the model's FRFs by its errors, by kind."""
        return error_shapes(self.target.frfs, self.target.split(values), size)

    def peak_differences(self) -> tuple[float, float | None, float]:
        """Return how far peaks of measurement and model are from each other, and their error of heights (rms).

        The first distance is relative to the frequency, less the spacing of lines. The second includes that; None if
        a measured peak has no counterpart, or a resonance of the model no peak, as strongly damped ones. The error of
        heights is the logarithm of the ratio of corresponding peaks, where lines are dense enough: residuals do not
        show it for a peak that is off by more than its width.
        """
        values = self.target.split(self.values)
        pairs, unmatched = list[PeakPair](), 0
        for frf, modelled in zip(self.target.frfs, values, strict=True):
            paired, others = pair_peaks(frf, replace(frf, values=modelled))
            pairs, unmatched = pairs + paired, unmatched + others
        poles = fit_resonances(self.target.frfs, values).poles
        with_pole = pairs if len(poles) else []
        nearest = [int(np.argmin(np.abs(poles.real - pair.modelled))) for pair in with_pole]
        axis = self.target.frequency
        inside = int(np.count_nonzero((poles.real > axis.min()) & (poles.real < axis.max())))
        unmatched += max(0, inside - len(set(nearest)))
        matched = unmatched <= 0 and len(pairs) >= _SETTINGS.fewest_peaks
        heights = [
            pair.log_ratio
            for pair, pole in zip(with_pole, poles[nearest], strict=True)
            if 2.0 * pole.imag >= _SETTINGS.dense * pair.line_spacing
        ]
        distance = _rms([pair.distance for pair in pairs]) if matched else None
        return _rms([pair.clear_distance for pair in pairs]), distance, _rms(heights)

    def refit(self, size: ModelError) -> NDArray[np.float64]:
        """Return the fractions (p,) that fit best when errors of this size are allowed, starting from the fit."""
        values = self.values
        lines, residual = self.residual(values, size)
        shapes = np.concatenate(list(self.shapes(values, size).values()))
        errors = residual.jacobian(values[np.newaxis, lines], shapes[np.newaxis, :, lines])[0]
        model = self.model if len(lines) == len(values) else self.model.at(lines)
        misfit = MarginalisedResiduals(FrfResiduals(model, residual), errors)
        problem = WithPrior(misfit, self.problem.parameters)
        minima = minimise(problem, self.fraction[np.newaxis], tolerance=_SETTINGS.tolerance, most_steps=_SETTINGS.steps)
        return np.asarray(minima.position[0])

    def typical_ratio(self) -> float:
        """Return the median of |log(measured / fitted amplitude)|.

        It complements the error of magnitude, which is relative to the fitted FRF and therefore never exceeds 1 where
        that is much too large.
        """
        measured, modelled = self.target.amplitude, np.abs(self.values)
        clear = (measured > 0.0) & (modelled > 0.0)
        return float(np.median(np.abs(np.log(measured[clear] / modelled[clear])))) if clear.any() else 0.0

    @property
    def peaks(self) -> list[PairedPeaks]:
        """The resonance peaks of measurement and model at each response."""
        pairs = zip(self.target.frfs, self.target.split(self.values), strict=True)
        return [PairedPeaks(resonance_peaks(frf), resonance_peaks(replace(frf, values=own))) for frf, own in pairs]


def distance_of_lost_peaks(responses: Sequence[PairedPeaks]) -> float:
    """Return how far the measured peaks are from the model's nearest (rms), if most of them have no counterpart.

    Such a model does not show which of its resonances is which of the measurement. 0 if most have a counterpart, or if
    all peaks of the model have one: then it merely lacks resonances.
    """
    with_model = [peaks for peaks in responses if len(peaks.modelled)]
    pairs = [(peak, peaks) for peaks in with_model for peak in peaks.measured.tolist()]
    distances = [float(np.abs(peaks.modelled - peak).min()) / peak for peak, peaks in pairs]
    paired = sum(counterpart(peak, peaks.measured, peaks.modelled) is not None for peak, peaks in pairs)
    is_lost = 2 * paired < len(distances) and paired < sum(len(peaks.modelled) for peaks in responses)
    return _rms(distances) if is_lost else 0.0


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else 0.0
