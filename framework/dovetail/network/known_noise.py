"""Comparison of a measurement's noise with the noise of a network's training.

A network's intervals are valid only for the kind of noise it was trained with. FRFs of posterior draws with training
noise show how rough a measurement may be, and how far from the FRF of the estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, uniform_filter1d

from dovetail.assembly import Assembly
from dovetail.dataset import complex_accelerance, latin_hypercube
from dovetail.network.augmentation import Augmentation, NoisyFeatures, with_noise
from dovetail.network.preprocessing import accelerances, log10p1
from dovetail.problem.random_error import FOURTH_DIFFERENCE


@dataclass(frozen=True)
class Settings:
    """Tuning constants of the comparison.

    The values were chosen on an oscillator, two masses and a beam on two springs (600 to 797 lines) with noise of up to
    1 %, and tested on the bolted lap beam (2451 lines) and the block of the tests.
    """

    draws: int = 32
    """Number of the network's draws that are compared with the measurement; 200 take six times as long and change
    nothing."""
    excess: float = 1.25
    """Ratio to the largest value of the draws above which the noise differs from that of the training."""
    bands: int = 8
    """Number of bands in which the roughness is computed."""
    band_lines: int = 20
    """Smallest number of lines of a band, so that the roughness does not scatter too much."""
    least_noise: float = 1e-3
    """Noise-to-amplitude ratio that is negligible for every network."""
    scaling_frfs: int = 400
    """Number of FRFs for the standard deviation that scales the additive noise."""
    smoothed_lines: int = 5
    """Lines over which residuals are averaged, so that noise does not hide a bias."""


_SETTINGS = Settings()

_TOO_FAR = (
    "The FRF of the network's estimate is {:.1f} times as far from the measurement as from any training FRF: the "
    "measurement is smoothed, or has errors that the training FRFs do not have. The intervals may be too narrow: use "
    "the method 'posterior'."
)


@dataclass(frozen=True, eq=False)
class KnownNoise:
    """The noise of a network's training.

    Parameters
    ----------
    assembly : Assembly
    augmentations : sequence of Augmentation
        One for each response; empty if there was no noise.
    """

    assembly: Assembly
    augmentations: Sequence[Augmentation]

    @classmethod
    def from_description(cls, assembly: Assembly) -> Self:
        """Read the noise from the description of an assembly.

        Raises
        ------
        MeasurementError, FileError
            A file that the description's `augmentation` names cannot be used.
        """
        settings = assembly.description.identification
        if settings.augmentation is None:
            return cls(assembly, ())
        theta = latin_hypercube(assembly, _SETTINGS.scaling_frfs, settings.seed)
        return cls(
            assembly, NoisyFeatures.from_samples(assembly, complex_accelerance(assembly, theta), theta).augmentations
        )

    def warnings(
        self, measured: NDArray[np.float64], answer: NDArray[np.float64], draws: NDArray[np.float64]
    ) -> tuple[str, ...]:
        """Return a warning if the noise of a measurement differs from that of the training.

        Parameters
        ----------
        measured : (1, n_responses n_freq) array
            Amplitudes of the accelerance on the assembly's frequencies.
        answer : (n_params,) array
            SI.
        draws : (n, n_params) array
            Posterior draws of the network, SI; 32 are used, repeated if there are fewer.
        """
        if len(self.assembly.frequency) < 2 * len(FOURTH_DIFFERENCE):
            return ()
        rows = np.arange(_SETTINGS.draws) % len(draws)
        known = self._features(self._noisy(draws[rows]))
        features = self._features(measured)
        expected = self._features(self.assembly.accelerance_amplitude(answer[np.newaxis]))
        rougher = _ratios(_roughness(known), _roughness(features))
        if rougher.max() > _SETTINGS.excess:
            response, band = divmod(int(np.argmax(rougher)), rougher.shape[1])
            return (self._too_noisy(float(rougher.max()), response, band, rougher.shape[1]),)
        farther = float(_ratios(_distances(known - expected), _distances(features - expected)).max())
        return (_TOO_FAR.format(farther),) if farther > _SETTINGS.excess else ()

    def _noisy(self, theta: NDArray[np.float64]) -> NDArray[Any]:
        """Return amplitudes of FRFs (n, n_responses n_freq) with training noise, the same in each call."""
        needs_phase = any(noise.needs_phase for noise in self.augmentations)
        clean = accelerances(self.assembly, theta, phase=needs_phase)
        generator = np.random.default_rng(self.assembly.description.identification.seed)
        return with_noise(clean, self.augmentations, generator) if self.augmentations else clean

    def _features(self, amplitude: NDArray[Any]) -> NDArray[np.float64]:
        """Return the network's features by response (n, n_responses, n_freq)."""
        rows = log10p1(amplitude).astype(np.float64)
        return rows.reshape(len(rows), len(self.assembly.description.responses), -1)

    def _too_noisy(self, ratio: float, response: int, band: int, bands: int) -> str:
        frequency = self.assembly.each_response[response].frequency
        low, high = np.array_split(frequency, bands)[band][[0, -1]]
        known = f"{ratio:.1f} times the largest in the training" if self.augmentations else "the training had none"
        return (
            f"The noise differs from that of the network's training (from {low:.6g} to {high:.6g} Hz: {known}): the "
            "intervals may be too narrow. Train with noise like this measurement's by 'augmentation: {like: FILE}', or "
            "with a higher level; or use the method 'posterior'."
        )


def _roughness(features: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the scatter from line to line (n, n_responses, bands) of features (n, n_responses, n_freq)."""
    bands = max(1, min(_SETTINGS.bands, features.shape[2] // _SETTINGS.band_lines))
    squares = convolve1d(features, FOURTH_DIFFERENCE, axis=2, mode="nearest") ** 2
    means = [part.mean(axis=2) for part in np.array_split(squares, bands, axis=2)]
    return np.asarray(np.sqrt(np.stack(means, axis=2)))


def _distances(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return root mean square and largest value (n, n_responses, 2) of smoothed residuals (n, n_responses, n_freq)."""
    smooth = uniform_filter1d(residuals, _SETTINGS.smoothed_lines, axis=2, mode="nearest")
    return np.stack([np.sqrt(np.mean(smooth**2, axis=2)), np.abs(smooth).max(axis=2)], axis=2)


def _ratios(known: NDArray[np.float64], measured: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ratio of a measurement's statistics (1, ...) to the largest of the known ones (n, ...)."""
    return np.asarray(measured[0] / np.maximum(known.max(axis=0), _SETTINGS.least_noise / np.log(10.0)))
