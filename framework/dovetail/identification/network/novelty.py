"""How far a measurement lies from what a network was trained on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting.random_error import estimated_variance, known_variance
from dovetail.identification.misspecification.clipping import share_at_top
from dovetail.identification.misspecification.frequency_bands import off_bands
from dovetail.identification.misspecification.result import Foreign
from dovetail.identification.network.network import Network
from dovetail.identification.network.preprocessing import log10p1

__all__ = ["Basis", "Novelty", "Strangeness", "learned"]

_COMPONENTS = 24
_MOST_OF_A_LINE = 9.0
"""Square of a line's distance that counts as much as any larger one: a sharp resonance is never met exactly."""
_LEAST_VARIANCE = 1e-6
_CLEAR = 3.0
"""Standard deviations of noise above which an amplitude tells its logarithm."""


@dataclass(frozen=True)
class Strangeness:
    """How strange an FRF is, in three ways; each grows with strangeness.

    Parameters
    ----------
    level : float
        Of the noise, over the standard deviation of the amplitudes.
    distance : float
        Mean squared distance from the training FRFs' principal components, over noise and what these leave.
    at_top : float
        Share of the lines that are nearly as high as the highest.
    disagreement : float
        Mean difference of the logarithms of measured and reconstructed amplitude.
    """

    level: float
    distance: float
    at_top: float
    disagreement: float


@dataclass(frozen=True, eq=False)
class Basis:
    """Principal components of the training features, log10(amplitude + 1).

    Parameters
    ----------
    mean : (n_freq,) array
    components : (k, n_freq) array
        Orthonormal.
    variance : (k,) array
        Of the training features along each.
    rest : (n_freq,) array
        Variance that they leave of features that they were not fitted to.
    """

    mean: NDArray[np.float64]
    components: NDArray[np.float64]
    variance: NDArray[np.float64]
    rest: NDArray[np.float64]

    @classmethod
    def fit(cls, amplitude: NDArray[np.floating], held_out: NDArray[np.floating]) -> Self:
        """Take the components from training amplitudes (n, n_freq), and the rest from others (m, n_freq)."""
        from sklearn.utils.extmath import randomized_svd

        features = log10p1(amplitude).astype(np.float64)
        mean = features.mean(axis=0)
        count = min(_COMPONENTS, min(features.shape) - 1)
        _, size, components = randomized_svd(features - mean, count, random_state=0)
        others = log10p1(held_out) - mean
        rest = np.mean((others - (others @ components.T) @ components) ** 2, axis=0)
        return cls(mean, components, size**2 / len(features) + _LEAST_VARIANCE, rest + _LEAST_VARIANCE)

    def residuals(self, amplitude: NDArray[np.float64], variance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far each line (n_freq,) is from the nearest FRF of the components, in standard deviations.

        Parameters
        ----------
        amplitude : (n_freq,) array
        variance : (n_freq,) array
            E|random error|^2 of the complex values.
        """
        slope = 1.0 / ((1.0 + amplitude) * np.log(10.0))
        drowned = amplitude**2 < 4.0 * variance  # where noise also raises the amplitude
        weight = 1.0 / (slope**2 * variance * np.where(drowned, 1.5, 0.5) + self.rest)
        features = log10p1(amplitude) - self.mean
        matrix = (self.components * weight) @ self.components.T + np.diag(1.0 / self.variance)
        scores = np.linalg.solve(matrix, self.components @ (weight * features))
        return np.asarray((features - scores @ self.components) * np.sqrt(weight))


@dataclass(frozen=True, eq=False)
class Novelty:
    """What is usual for the FRFs that a network was trained on, and how much of each strangeness is still usual.

    Parameters
    ----------
    basis : Basis
    levels : (n,) array
        Increasing levels of noise, over the standard deviation of the amplitudes.
    limits : (n, 3) array
        At each, the `distance`, `at_top` and `disagreement` that joints it was not trained on hardly exceed.
    """

    basis: Basis
    levels: NDArray[np.float64]
    limits: NDArray[np.float64]

    def examine(self, measured: Frf, reconstructed: NDArray[np.float64]) -> Foreign:
        """Say whether a measurement is unlike all that the network was trained on.

        Parameters
        ----------
        measured : Frf
            On the assembly's frequencies.
        reconstructed : (n_freq,) array
            Amplitude of the accelerance that belongs to the network's answer.
        """
        found, lines = strangeness(self.basis, measured, reconstructed)
        at = np.log(np.clip(found.level, self.levels[0], self.levels[-1]))
        usual = [float(np.interp(at, np.log(self.levels), column)) for column in self.limits.T]
        over = np.array([found.distance, found.at_top, found.disagreement]) / usual
        if over.max() <= 1.0:
            return Foreign(False, float(over.max()))
        reasons = tuple(text for text, one in zip(_REASONS, over.tolist(), strict=True) if one > 1.0)
        looks = "It looks as if it were cut off (an overloaded channel?)." if over[1] > 1.0 else ""
        bands = off_bands(measured.frequency, lines[:, np.newaxis]) if over[0] > 1.0 else ()
        return Foreign(True, float(over.max()), looks, reasons, bands)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that `restore` needs."""
        of_basis = {field.name: getattr(self.basis, field.name) for field in fields(Basis)}
        return {**of_basis, "levels": self.levels, "limits": self.limits}

    @classmethod
    def restore(cls, state: Mapping[str, Any]) -> Self:
        """Return what `state` was taken from.

        Raises
        ------
        ValueError
            The arrays do not fit each other or are not finite.
        """
        arrays = {name: np.asarray(state[name], dtype=np.float64) for name in (*_ARRAYS, "levels", "limits")}
        width, count, levels = arrays["mean"].size, arrays["variance"].size, arrays["levels"].size
        shapes = {"mean": (width,), "components": (count, width), "variance": (count,), "rest": (width,)}
        shapes |= {"levels": (levels,), "limits": (levels, len(_REASONS))}
        if any(arrays[name].shape != shape for name, shape in shapes.items()) or not levels:
            raise ValueError("arrays of unlike shapes")
        if not all(np.isfinite(one).all() for one in arrays.values()):
            raise ValueError("values that are not finite")
        return cls(Basis(*(arrays[name] for name in _ARRAYS)), arrays["levels"], arrays["limits"])


_ARRAYS = tuple(field.name for field in fields(Basis))

_REASONS = (
    "It is unlike every FRF that the network was trained on.",
    "More of its lines are nearly as high as the highest than in any FRF that the network was trained on.",
    "The FRF of the network's answer is further from it than is usual.",
)


def strangeness(
    basis: Basis, measured: Frf, reconstructed: NDArray[np.float64]
) -> tuple[Strangeness, NDArray[np.float64]]:
    """Return how strange a measurement is, and by how many standard deviations in each line (n_freq,)."""
    frf = measured.to("accelerance")
    known = known_variance(frf)
    variance = estimated_variance(frf) if known is None else known
    lines = basis.residuals(frf.amplitude, variance)
    clear = frf.amplitude > _CLEAR * np.sqrt(variance)
    apart = np.abs(np.log(frf.amplitude[clear]) - np.log(np.maximum(reconstructed[clear], np.finfo(float).tiny)))
    return (
        Strangeness(
            level=float(np.sqrt(np.mean(variance)) / max(frf.amplitude.std(), np.finfo(float).tiny)),
            distance=float(np.mean(np.minimum(lines**2, _MOST_OF_A_LINE))),
            at_top=share_at_top(frf.amplitude),
            disagreement=float(np.mean(np.minimum(apart, 1.0))) if clear.any() else 1.0,
        ),
        lines,
    )


_MOST_TRAINING, _MOST_HELD_OUT = 3000, 400
_LEVELS = (0.003, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Standard deviation of the noise, over that of the FRF."""
_NOISE_STREAM = 2
"""Keeps the noise's random numbers apart from others of the same seed."""


def learned(
    assembly: Assembly, network: Network, amplitude: NDArray[np.floating], held_out: NDArray[np.float64], seed: int
) -> Novelty:
    """Learn what is usual.

    Parameters
    ----------
    assembly : Assembly
    network : Network
        Trained.
    amplitude : (n, n_freq) array
        Training FRFs; the first 3000 are enough.
    held_out : (m, n_params) array
        Joints that the network was not trained on, SI; the first 400 are used.
    seed : int
    """
    values = assembly.frf(held_out[:_MOST_HELD_OUT])
    quantity = assembly.description.response.quantity
    clean = [Frf(assembly.frequency, one, quantity).to("accelerance").values for one in values]
    basis = Basis.fit(amplitude[:_MOST_TRAINING], np.abs(clean))
    generator = np.random.default_rng([seed, _NOISE_STREAM])
    levels, limits = [], []
    for level in _LEVELS:
        noisy = [_with_noise(Frf(assembly.frequency, one, "accelerance"), level, generator) for one in clean]
        predicted = network.predict(np.stack([one.amplitude for one in noisy]))
        answers = assembly.accelerance_amplitude(predicted)
        found = [strangeness(basis, one, answer)[0] for one, answer in zip(noisy, answers.astype(float), strict=True)]
        levels.append(float(np.median([one.level for one in found])))
        limits.append([max(getattr(one, name) for one in found) for name in ("distance", "at_top", "disagreement")])
    return Novelty(basis, np.maximum.accumulate(np.array(levels)), np.array(limits))


def _with_noise(frf: Frf, level: float, generator: np.random.Generator) -> Frf:
    normal = generator.standard_normal((2, len(frf.values)))
    deviation = level * frf.values.std()
    noise = deviation * (normal[0] + 1j * normal[1]) / np.sqrt(2.0)
    return Frf(frf.frequency, frf.values + noise, frf.quantity, variance=np.full(len(frf.frequency), deviation**2))
