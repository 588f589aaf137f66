"""How far a measurement lies from the FRFs that a network was trained on.

Three statistics grow with this distance. Their limits, at several levels of noise, are values that hardly any FRF of
the same assembly exceeds, among those that were not used for training.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from itertools import chain
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from dovetail.assembly import Assembly
from dovetail.frf import Frf, conversion
from dovetail.inference.adequacy import Adequacy
from dovetail.inference.fitting.whiteness import find_deviating_bands
from dovetail.meanwhile import in_parts
from dovetail.measurement import noisy_frf
from dovetail.network.pipeline import Network
from dovetail.network.preprocessing import log10p1
from dovetail.problem.random_error import random_error_variance


@dataclass(frozen=True)
class Settings:
    """Data from which the statistics are learned, and tuning constants of their computation."""

    training_frfs: int = 600
    """Largest number of FRFs from which the principal components are taken: 25 for each component."""
    samples_per_held_out: int = 40
    """Training samples for each held-out FRF, which costs the computation of seven FRFs and six predictions."""
    held_out_frfs: tuple[int, int] = (40, 400)
    """Smallest and largest number of held-out FRFs, from which the limits are taken."""
    exceeding: float = 1.0 / 400.0
    """Fraction of such FRFs that exceed a limit."""
    tail: float = 0.2
    """Upper fraction of the values to which the exponential tail is fitted."""
    components: int = 24
    """Largest number of principal components."""
    noise_levels: tuple[float, ...] = (0.003, 0.01, 0.02, 0.05, 0.1, 0.2)
    """Standard deviations of the noise, over that of the FRF."""
    largest_square: float = 9.0
    """Limit of the square of a line's distance: a sharp resonance is never reproduced exactly."""
    least_variance: float = 1e-6
    """Smallest variance of a feature, so that none has infinite weight."""
    clear: float = 3.0
    """Standard deviations of noise above which the logarithms of amplitudes are compared."""
    smoothed_lines: int = 5
    """Lines over which amplitudes are averaged, so that noise does not hide a plateau."""
    near_maximum: float = 0.75
    """Ratio to the largest amplitude above which a line may belong to a plateau."""


_SETTINGS = Settings()

_NOISE_STREAM = 2
"""Separates the random numbers of the noise from others with the same seed."""

_REASONS = (
    "It differs from every FRF that the network was trained on.",
    "More of its lines are close to the largest amplitude than in any FRF that the network was trained on.",
    "The FRF of the network's estimate differs from it more than usual.",
)


@dataclass(frozen=True, eq=False)
class PrincipalComponents:
    """Principal components of the training features, log10(amplitude + 1).

    Parameters
    ----------
    mean : (n_freq,) array
    components : (k, n_freq) array
        Orthonormal.
    variance : (k,) array
        Of the training features along each.
    rest : (n_freq,) array
        Variance of the features of held-out FRFs that the components do not represent.
    """

    mean: NDArray[np.float64]
    components: NDArray[np.float64]
    variance: NDArray[np.float64]
    rest: NDArray[np.float64]

    @classmethod
    def fit(cls, amplitude: NDArray[np.floating], held_out: NDArray[np.floating]) -> Self:
        """Take the components from training amplitudes (n, n_freq), the rest from held-out ones (m, n_freq)."""
        from sklearn.utils.extmath import randomized_svd

        features = log10p1(amplitude).astype(np.float64)
        mean = features.mean(axis=0)
        count = min(_SETTINGS.components, min(features.shape) - 1)
        _, size, components = randomized_svd(features - mean, count, random_state=0)
        others = log10p1(held_out) - mean
        rest = np.mean((others - (others @ components.T) @ components) ** 2, axis=0)
        variance = size**2 / len(features)
        return cls(mean, components, variance + _SETTINGS.least_variance, rest + _SETTINGS.least_variance)

    def residuals(self, amplitude: NDArray[np.float64], variance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of each line (n_freq,) from the best combination of components, in standard deviations.

        Parameters
        ----------
        amplitude : (n_freq,) array
        variance : (n_freq,) array
            E|random error|^2 of the complex values.
        """
        derivative = 1.0 / ((1.0 + amplitude) * np.log(10.0))
        drowned = amplitude**2 < 4.0 * variance  # where noise also raises the amplitude
        weight = 1.0 / (derivative**2 * variance * np.where(drowned, 1.5, 0.5) + self.rest)
        features = log10p1(amplitude) - self.mean
        matrix = (self.components * weight) @ self.components.T + np.diag(1.0 / self.variance)
        scores = np.linalg.solve(matrix, self.components @ (weight * features))
        return np.asarray((features - scores @ self.components) * np.sqrt(weight))


@dataclass(frozen=True, eq=False)
class Novelty:
    """The training FRFs of a network, and the limits of each statistic for similar FRFs.

    Parameters
    ----------
    basis : PrincipalComponents
    levels : (n,) array
        Increasing levels of noise, over the standard deviation of the amplitudes.
    limits : (n, 3) array
        Values of the three statistics at each level that one in 400 held-out FRFs exceeds.
    """

    basis: PrincipalComponents
    levels: NDArray[np.float64]
    limits: NDArray[np.float64]

    def check(self, measured: Frf, reconstructed: NDArray[np.float64]) -> Adequacy:
        """Judge whether a measurement differs from all FRFs that the network was trained on.

        Parameters
        ----------
        measured : Frf
            On the assembly's frequencies.
        reconstructed : (n_freq,) array
            Amplitude of the accelerance at the network's estimate.
        """
        statistics, noise_level, residuals = _statistics(self.basis, measured, reconstructed)
        level = np.log(np.clip(noise_level, self.levels[0], self.levels[-1]))
        limits = [float(np.interp(level, np.log(self.levels), column)) for column in self.limits.T]
        ratios = statistics / limits
        if ratios.max() <= 1.0:
            return Adequacy("not judged")
        reasons = tuple(text for text, ratio in zip(_REASONS, ratios.tolist(), strict=True) if ratio > 1.0)
        bands = find_deviating_bands(measured.frequency, residuals[:, np.newaxis]) if ratios[0] > 1.0 else ()
        return Adequacy("does not fit", reasons=reasons, bands=bands)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that `restore` needs."""
        arrays = {name: getattr(self.basis, name) for name in _BASIS_ARRAYS}
        return {**arrays, "levels": self.levels, "limits": self.limits}

    @classmethod
    def restore(cls, state: Mapping[str, Any]) -> Self:
        """Rebuild a `Novelty` from its `state`.

        Raises
        ------
        ValueError
            The arrays do not fit each other or are not finite.
        """
        arrays = {name: np.asarray(state[name], dtype=np.float64) for name in (*_BASIS_ARRAYS, "levels", "limits")}
        width, count, levels = arrays["mean"].size, arrays["variance"].size, arrays["levels"].size
        shapes = {"mean": (width,), "components": (count, width), "variance": (count,), "rest": (width,)}
        shapes |= {"levels": (levels,), "limits": (levels, len(_REASONS))}
        if any(arrays[name].shape != shape for name, shape in shapes.items()) or not levels:
            raise ValueError("arrays of inconsistent shapes")
        if not all(np.isfinite(array).all() for array in arrays.values()):
            raise ValueError("values that are not finite")
        basis = PrincipalComponents(*(arrays[name] for name in _BASIS_ARRAYS))
        return cls(basis, arrays["levels"], arrays["limits"])


_BASIS_ARRAYS = tuple(field.name for field in fields(PrincipalComponents))


def _share_near_maximum(amplitude: NDArray[np.float64]) -> float:
    """Return the share of lines (n_freq,) with almost the largest amplitude; it is large if a peak is clipped."""
    smooth = uniform_filter1d(amplitude, _SETTINGS.smoothed_lines, mode="nearest")
    return float(np.mean(smooth > _SETTINGS.near_maximum * smooth.max()))


def _statistics(
    basis: PrincipalComponents, measured: Frf, reconstructed: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Compare a measurement with the training FRFs.

    Returns
    -------
    statistics : (3,) array
        Mean squared distance from the principal components, over noise and residual variance; share of the lines that
        are close to the largest amplitude; mean difference of the logarithms of measured and reconstructed amplitude.
    noise_level : float
        Standard deviation of the noise, over that of the amplitudes.
    residuals : (n_freq,) array
        Distance of each line, in standard deviations.
    """
    frf = measured.to("accelerance")
    factor = np.abs(conversion(frf.frequency, measured.quantity, "accelerance"))
    variance = factor**2 * random_error_variance(measured)  # of the measured quantity, whose floor is even over lines
    residuals = basis.residuals(frf.amplitude, variance)
    distance = np.mean(np.minimum(residuals**2, _SETTINGS.largest_square))
    clear = frf.amplitude > _SETTINGS.clear * np.sqrt(variance)
    floor = np.finfo(float).tiny
    differences = np.abs(np.log(frf.amplitude[clear]) - np.log(np.maximum(reconstructed[clear], floor)))
    disagreement = np.mean(np.minimum(differences, 1.0)) if clear.any() else 1.0
    noise_level = float(np.sqrt(np.mean(variance)) / max(frf.amplitude.std(), floor))
    return np.array([distance, _share_near_maximum(frf.amplitude), disagreement]), noise_level, residuals


def learn_novelty(
    assembly: Assembly,
    network: Network,
    amplitude: NDArray[np.floating],
    held_out: NDArray[np.float64],
    samples: int,
    seed: int,
) -> Novelty:
    """Learn the limits of the statistics for FRFs like the training FRFs.

    Parameters
    ----------
    assembly : Assembly
    network : Network
        Trained.
    amplitude : (n, n_freq) array
        Training FRFs: 600 for the principal components, and further ones for the residual variance.
    held_out : (m, n_params) array
        Parameter vectors that the network was not trained on, SI; one for each 40 of `samples` is used, from the first.
    samples : int
        Number of training samples.
    seed : int
    """
    least, most = _SETTINGS.held_out_frfs
    values = assembly.frf(held_out[: min(max(samples // _SETTINGS.samples_per_held_out, least), most)])
    quantity = assembly.description.response.quantity
    clean = [Frf(assembly.frequency, frf, quantity).to("accelerance") for frf in values]
    others = amplitude[_SETTINGS.training_frfs :]  # limits need FRFs other than those of `rest`
    others = others if len(others) >= len(clean) else np.stack([frf.amplitude for frf in clean])
    basis = PrincipalComponents.fit(amplitude[: _SETTINGS.training_frfs], others)
    near_maximum = _limit(np.array([_share_near_maximum(row) for row in amplitude.astype(np.float64)]))

    def learned(numbers: NDArray[np.intp]) -> list[tuple[float, list[float]]]:
        predict = partial(_predicted_amplitudes, assembly, network)
        return [_level_and_limits(basis, predict, clean, number, seed) for number in numbers.tolist()]

    parts = in_parts(learned, len(_SETTINGS.noise_levels), 1)
    levels, limits = zip(*chain.from_iterable(parts), strict=True)
    return Novelty(basis, np.maximum.accumulate(np.array(levels)), np.maximum(limits, [0.0, near_maximum, 0.0]))


def _level_and_limits(
    basis: PrincipalComponents,
    predict: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    clean: Sequence[Frf],
    number: int,
    seed: int,
) -> tuple[float, list[float]]:
    """Return the level of noise with a number, over the amplitudes' deviation, and the statistics' limits with it.

    `predict` takes amplitudes (n, n_freq) of noisy FRFs to those at the network's estimates.
    """
    generator = np.random.default_rng([seed, _NOISE_STREAM, number])
    noisy = [noisy_frf(frf, _SETTINGS.noise_levels[number], generator) for frf in clean]
    predicted = predict(np.stack([frf.amplitude for frf in noisy]))
    compared = [_statistics(basis, frf, amplitude) for frf, amplitude in zip(noisy, predicted, strict=True)]
    statistics, levels, _ = zip(*compared, strict=True)
    return float(np.median(levels)), [_limit(column) for column in np.array(statistics).T]


def _predicted_amplitudes(assembly: Assembly, network: Network, measured: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the amplitudes (n, n_freq) at a network's estimates from measured ones; 0 where it has no estimate."""
    predicted = network.predict(measured)
    finite = np.isfinite(predicted).all(axis=1)  # far from its training data the network may have no finite estimate
    amplitudes = np.zeros((len(predicted), len(assembly.frequency)))
    amplitudes[finite] = assembly.accelerance_amplitude(predicted[finite]) if finite.any() else 0.0
    amplitudes[~np.isfinite(amplitudes)] = 0.0
    return amplitudes


def _limit(values: NDArray[np.float64]) -> float:
    """Return the value that one in 400 exceeds, from an exponential tail of the logarithms; at least the maximum."""
    logs = np.log(np.maximum(values, np.finfo(float).tiny))
    threshold = np.quantile(logs, 1.0 - _SETTINGS.tail)
    excess = float(np.mean(logs[logs >= threshold] - threshold))
    return float(np.exp(max(logs.max(), threshold + excess * np.log(_SETTINGS.tail / _SETTINGS.exceeding))))
