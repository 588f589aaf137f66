"""Correction of a network's estimate by the assembly's FRF and Jacobian at the estimate.

A network sees an FRF through a few features, which blur its details. The assembly's FRF at the estimate can be compared
with the measured one line by line, and its Jacobian shows which parameters reduce the difference. A single Gauss-Newton
step is not reliable, since resonances move by more than their widths. So steps are computed with several degrees of
caution, and a second regressor learns from many examples how far to trust each of them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, uniform_filter1d

from dovetail.assembly import Assembly
from dovetail.frf import conversion
from dovetail.inference.posterior.likelihood import normal_density, normal_from_unit, unit_from_normal
from dovetail.interfaces import ComponentState, FittedRegressor, Regressor, TargetDistribution
from dovetail.network.preprocessing import TargetScaling, ZScore
from dovetail.parallel import cores, one_blas_thread
from dovetail.problem.random_error import FOURTH_DIFFERENCE

_CAUTIONS = (0.03, 0.3, 3.0, 30.0)
"""Degrees of caution: factors of the estimate's variance that is added to the random error of a line. For an average
of several lines the factor is divided by their number."""
_EDGE = 2.3
"""Largest normal quantile at which the model is linearised; closer to the ends of a range it hardly changes."""
_FARTHEST = 5.0
"""Normal quantile of a draw at the end of a range."""
_MOST_DEVIATIONS = 30.0
"""Limit of the whitened residuals."""
_NEIGHBOURS = 64
"""Lines over which the variance of the noise is averaged."""
_LEAST_VARIANCE, _LEAST_AMPLITUDE = 1e-8, 1e-30
"""Lower limits, which prevent divisions by zero."""
_ROWS = 64
"""FRFs whose Jacobians are in memory at a time, on each core."""
_STEPS, _FEWEST_LINES, _LARGEST_SMOOTHING = (4, 2), 250, 0.01
"""Candidate steps between lines. The first is used that keeps enough lines and with which the smoothing, a parabola
through as many lines on either side, changes three of four peaks by no more than this, in logarithms."""
_TRIALS = 100
"""Number of FRFs of this test."""
_BANDS = (64, 16)
"""Numbers of bands over which residuals are averaged, in addition to single lines. Averages are closer to linear in
the parameters than the flank of a resonance."""


@dataclass(frozen=True, eq=False)
class GaussNewtonFeatures:
    """Computes the features of the second regressor from cautious Gauss-Newton steps of the linearised model.

    Parameters
    ----------
    assembly : Assembly
    targets : TargetScaling
    step : int
        Every `step`-th line is used, averaged over its neighbours so that their information is kept.
    bands : tuple of int
        Numbers of bands over which residuals are averaged, in addition to single lines.
    """

    assembly: Assembly
    targets: TargetScaling
    step: int = 1
    bands: tuple[int, ...] = ()

    @staticmethod
    def for_assembly(assembly: Assembly, targets: TargetScaling) -> GaussNewtonFeatures:
        """Return the features on as few lines as the assembly's resonances allow."""
        fraction = np.random.default_rng(0).random((_TRIALS, len(assembly.parameters)))
        logarithms = _by_response(assembly.accelerance_amplitude(assembly.from_unit(fraction)), assembly)
        peaks, lines = scipy.signal.argrelmax(logarithms, axis=-1), logarithms.shape[-1]

        def keeps_peaks(step: int) -> bool:
            smoothing = np.abs(_averaged(logarithms, step) - logarithms)[peaks]
            return not len(smoothing) or bool(np.quantile(smoothing, 0.75) <= _LARGEST_SMOOTHING)

        step = next((step for step in _STEPS if lines >= step * _FEWEST_LINES and keeps_peaks(step)), 1)
        return GaussNewtonFeatures(
            assembly, targets, step, tuple(bands for bands in _BANDS if 2 * bands * step <= lines)
        )

    @cached_property
    def _thinned(self) -> Assembly:
        return self.assembly.on(self.assembly.frequency[:: self.step])

    def __call__(self, amplitude: NDArray[np.floating], before: TargetDistribution) -> NDArray[np.float32]:
        """Return the second regressor's features of FRFs and the current estimates.

        Parameters
        ----------
        amplitude : (n_samples, n_responses n_freq) array
            Of the accelerance [m/(N s^2)], all responses concatenated.
        before : TargetDistribution
            The current estimates.

        Returns
        -------
        (n_samples, n_features) float32 array
            For single lines and each number of bands, and for each caution: the corrected parameters, the correction,
            the remaining standard deviations and the residuals' mean square. Then the estimate, its standard deviations
            and the random error. Parameters are normal quantiles of the targets; deviations and squares are logarithms.
        """
        blocks = [slice(start, start + _ROWS) for start in range(0, len(amplitude), _ROWS)]

        def block_features(rows: slice) -> NDArray[np.float32]:
            return self._block_features(amplitude[rows], before.samples[rows])

        if len(blocks) == 1:
            return block_features(blocks[0])
        with one_blas_thread(), ThreadPoolExecutor(cores()) as pool:
            first = block_features(blocks[0])  # compiles the kernels
            return np.concatenate([first, *pool.map(block_features, blocks[1:])])

    def _block_features(self, amplitude: NDArray[np.floating], samples: NDArray[np.float64]) -> NDArray[np.float32]:
        means, factors = _gaussians(samples)
        at = np.clip(means, -_EDGE, _EDGE)
        modelled, jacobian = self._logarithms(at)
        logarithms = _by_response(amplitude, self.assembly)
        residuals = _averaged(logarithms, self.step)[..., :: self.step] - modelled
        variance = _noise_variance(logarithms)[..., :: self.step] * _variance_of_averages(self.step)
        features = _corrections(residuals, jacobian, variance, self.step, means, factors)
        for bands in self.bands:
            per_band = residuals.shape[2] / bands
            residual, slopes, scatter = (_over_bands(values, bands) for values in (residuals, jacobian, variance))
            features += _corrections(residual, slopes, scatter / per_band, self.step * per_band, means, factors)
        spreads = 0.5 * np.log(np.sum(factors**2, axis=2))
        noise = np.log(np.mean(variance, axis=(1, 2)))[:, np.newaxis]
        return np.concatenate([*features, means, at - means, spreads, noise], axis=1).astype(np.float32)

    def _logarithms(self, quantiles: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Return logarithms (n, n_responses, n_lines) of the model's amplitudes; derivatives (..., n_params)."""
        theta = self.targets.inverse(unit_from_normal(quantiles))
        slope = (self.targets.slope(theta) * normal_density(quantiles))[:, np.newaxis]
        logarithms, derivatives = [], []
        for assembly, response in zip(self._thinned.each_response, self.assembly.description.responses, strict=True):
            frf, jacobian = assembly.frf_jacobian(theta)
            amplitude = np.maximum(np.abs(frf), _LEAST_AMPLITUDE)
            to_accelerance = np.abs(conversion(assembly.frequency, response.quantity, "accelerance"))
            logarithms.append(np.log(amplitude * to_accelerance))
            relative = (frf / amplitude / amplitude)[..., np.newaxis]
            derivative = jacobian.real * relative.real + jacobian.imag * relative.imag
            derivatives.append((derivative * slope).astype(np.float32))
        return np.stack(logarithms, axis=1), np.stack(derivatives, axis=1)


def _by_response(amplitude: NDArray[np.floating], assembly: Assembly) -> NDArray[np.floating]:
    """Return logarithms (n, n_responses, n_freq) of amplitudes (n, n_responses n_freq)."""
    logarithms: NDArray[np.floating] = np.log(np.maximum(amplitude, _LEAST_AMPLITUDE))
    return logarithms.reshape(len(amplitude), -1, len(assembly.frequency))


def _averaged(logarithms: NDArray[np.floating], step: int) -> NDArray[np.floating]:
    """Replace each line (last axis) by the value of a parabola fitted to it and `step` lines on either side."""
    if step == 1:
        return logarithms
    return np.asarray(scipy.signal.savgol_filter(logarithms, 2 * step + 1, polyorder=2, axis=-1))


def _variance_of_averages(step: int) -> float:
    """Return the variance of white noise after `_averaged`, relative to the one before."""
    return 1.0 if step == 1 else float(np.sum(scipy.signal.savgol_coeffs(2 * step + 1, polyorder=2) ** 2))


def _gaussians(samples: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return means (n, t) of the draws' normal quantiles, and the Cholesky factors (n, t, t) of their covariances."""
    quantiles = np.clip(normal_from_unit(np.clip(samples, 0.0, 1.0)), -_FARTHEST, _FARTHEST)
    means = quantiles.mean(axis=1)
    centred = quantiles - means[:, np.newaxis]
    covariance = np.swapaxes(centred, 1, 2) @ centred / samples.shape[1]
    return means, np.linalg.cholesky(covariance + _LEAST_VARIANCE * np.eye(samples.shape[2]))


def _noise_variance(logarithms: NDArray[np.floating]) -> NDArray[np.floating]:
    """Estimate the variance of the noise of logarithms (..., n_freq) from differences of neighbouring lines."""
    differences = convolve1d(logarithms, FOURTH_DIFFERENCE, axis=-1, mode="mirror")
    return np.asarray(uniform_filter1d(differences**2, _NEIGHBOURS, axis=-1, mode="mirror") + _LEAST_VARIANCE)


def _over_bands(values: NDArray[np.floating], bands: int) -> NDArray[np.floating]:
    """Average values (n, n_responses, n_lines, ...) over bands of equally many lines, up to one."""
    starts = np.arange(bands) * values.shape[2] // bands
    lines = np.diff(starts, append=values.shape[2]).astype(values.dtype)
    means: NDArray[np.floating] = np.add.reduceat(values, starts, axis=2)
    means /= lines.reshape(-1, *[1] * (values.ndim - 3))
    return means


def _corrections(
    residuals: NDArray[np.floating],
    jacobian: NDArray[np.floating],
    variance: NDArray[np.floating],
    averaged: float,
    means: NDArray[np.float64],
    factors: NDArray[np.float64],
) -> list[NDArray[np.float64]]:
    """Return the features of each caution.

    `averaged` is the number of lines behind each residual. The estimate is a Gaussian with these means (n, t), and with
    Cholesky factors (n, t, t) of its covariance.
    """
    count, parameters = means.shape
    residuals, variance = residuals.reshape(count, -1), variance.reshape(count, -1)
    along = jacobian.reshape(count, -1, parameters) @ factors.astype(np.float32)
    spread = np.einsum("nlt,nlt->nl", along, along)
    features: list[NDArray[np.float64]] = []
    for caution in _CAUTIONS:
        weight = (1.0 / np.sqrt(variance + caution / averaged * spread)).astype(np.float32)
        scaled = np.clip(residuals * weight, -_MOST_DEVIATIONS, _MOST_DEVIATIONS).astype(np.float32)
        weighted = along * weight[..., np.newaxis]
        transposed = np.swapaxes(weighted, 1, 2)
        spreading = factors @ np.linalg.inv(np.eye(parameters) + transposed @ weighted)
        step = (spreading @ (transposed @ scaled[..., np.newaxis]))[..., 0]
        log_deviation = 0.5 * np.log(np.maximum(np.sum(spreading * factors, axis=2), _LEAST_VARIANCE))
        size = np.log(np.mean(scaled**2, axis=1, keepdims=True) + _LEAST_VARIANCE)
        features += [means + step, step, log_deviation, size]
    return features


@dataclass(frozen=True, eq=False)
class Correction:
    """A second regressor, and the computation of its features.

    Parameters
    ----------
    gauss_newton : GaussNewtonFeatures
    feature_scaling : ZScore
    regressor : FittedRegressor
    """

    gauss_newton: GaussNewtonFeatures
    feature_scaling: ZScore
    regressor: FittedRegressor

    def features(self, amplitude: NDArray[np.floating], before: TargetDistribution) -> NDArray[np.float32]:
        """Return the scaled features of FRFs (n_samples, n_responses n_freq) and the current estimates."""
        return self.feature_scaling.transform(self.gauss_newton(amplitude, before))


def correction_states(corrections: Sequence[Correction]) -> ComponentState:
    """Return the arrays and plain values of corrections as one state."""
    state: dict[str, Any] = {}
    for number, correction in enumerate(corrections):
        gauss_newton = correction.gauss_newton
        parts: dict[str, Mapping[str, Any]] = {
            "lines": {"step": gauss_newton.step, "bands": np.array(gauss_newton.bands, dtype=int)},
            "scaling": correction.feature_scaling.state(),
            "regressor": correction.regressor.state(),
        }
        state |= {f"{number}.{part}.{name}": value for part, values in parts.items() for name, value in values.items()}
    return state


def restore_corrections(
    state: ComponentState, assembly: Assembly, targets: TargetScaling, recipe: Regressor
) -> tuple[Correction, ...]:
    """Rebuild corrections from what `correction_states` returned.

    Raises
    ------
    ValueError
        As in `ZScore.restore`.
    """
    stored: defaultdict[str, defaultdict[str, dict[str, Any]]] = defaultdict(lambda: defaultdict(dict))
    for key, value in state.items():
        number, part, name = key.split(".", 2)
        stored[number][part][name] = value
    return tuple(_restored(stored[number], assembly, targets, recipe) for number in sorted(stored, key=int))


def _restored(
    stored: Mapping[str, Mapping[str, Any]], assembly: Assembly, targets: TargetScaling, recipe: Regressor
) -> Correction:
    step, bands = stored["lines"].get("step", 1), stored["lines"].get("bands", ())
    gauss_newton = GaussNewtonFeatures(assembly, targets, int(step), tuple(map(int, bands)))
    return Correction(gauss_newton, ZScore.restore(stored["scaling"]), recipe.restore(stored["regressor"]))
