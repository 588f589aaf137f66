"""Whether the noise of a measurement is that of a network's training.

Whatever its level, a network's intervals are right for noise as in its training only. FRFs of its own draws with such
noise show how rough a measurement may be, and how far from the answer's FRF.
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
from dovetail.frf import Frf
from dovetail.network.augmentation import Augmentation, NoisyFeatures, with_noise
from dovetail.network.preprocessing import accelerance_amplitudes, accelerances, log10p1
from dovetail.problem.random_error import FOURTH_DIFFERENCE


@dataclass(frozen=True)
class Settings:
    """How noise is compared.

    The values were chosen on an oscillator, two masses and a beam on two springs (600 to 797 lines) with noise of up to
    1 %, and tested on the bolted lap beam (2451 lines) and the block of the tests.
    """

    draws: int = 32
    """Of the network, with whose FRFs the measurement is compared; with 200, which take six times as long, as many."""
    excess: float = 1.25
    """Ratio to the largest of them from which noise is no longer that of the training."""
    bands: int = 8
    """Parts of the frequency axis, in each of which the roughness is taken."""
    band_lines: int = 20
    """Fewest lines of a band: the roughness of fewer scatters too much."""
    least_noise: float = 1e-3
    """Noise over the amplitude that matters to no network."""
    scaling_frfs: int = 400
    """FRFs from which the standard deviation is taken that is the unit of additive noise."""
    smoothed_lines: int = 5
    """Lines over which residuals are averaged, so that noise does not hide a bias."""


_SETTINGS = Settings()

_TOO_FAR = (
    "The FRF of the network's answer is {:.1f} times as far from the measurement as from any training FRF: the "
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
        """Take it from the description of an assembly.

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
        self, measured: Sequence[Frf], answer: NDArray[np.float64], draws: NDArray[np.float64]
    ) -> tuple[str, ...]:
        """Return a warning if the network does not know the noise of measurements.

        Parameters
        ----------
        measured : sequence of Frf
            One for each response, on the assembly's frequencies.
        answer : (n_params,) array
            SI.
        draws : (n, n_params) array
            Of the network, SI; 32 are used, some of them again if there are fewer.
        """
        if len(self.assembly.frequency) < 2 * len(FOURTH_DIFFERENCE):
            return ()
        rows = np.arange(_SETTINGS.draws) % len(draws)
        known = self._features(self._noisy(draws[rows]))
        features = self._features(accelerance_amplitudes(measured))
        expected = self._features(self.assembly.accelerance_amplitude(answer[np.newaxis]))
        rougher = _ratios(_roughness(known), _roughness(features))
        if rougher.max() > _SETTINGS.excess:
            response, band = divmod(int(np.argmax(rougher)), rougher.shape[1])
            return (self._too_noisy(float(rougher.max()), measured[response], band, rougher.shape[1]),)
        farther = float(_ratios(_distances(known - expected), _distances(features - expected)).max())
        return (_TOO_FAR.format(farther),) if farther > _SETTINGS.excess else ()

    def _noisy(self, theta: NDArray[np.float64]) -> NDArray[Any]:
        """Return amplitudes of FRFs (n, n_responses n_freq) with noise as in the training, the same at each call."""
        needs_phase = any(noise.needs_phase for noise in self.augmentations)
        clean = accelerances(self.assembly, theta, phase=needs_phase)
        generator = np.random.default_rng(self.assembly.description.identification.seed)
        return with_noise(clean, self.augmentations, generator) if self.augmentations else clean

    def _features(self, amplitude: NDArray[Any]) -> NDArray[np.float64]:
        """Return what a network sees, response by response (n, n_responses, n_freq)."""
        rows = log10p1(amplitude).astype(np.float64)
        return rows.reshape(len(rows), len(self.assembly.description.responses), -1)

    def _too_noisy(self, ratio: float, measured: Frf, band: int, bands: int) -> str:
        low, high = np.array_split(measured.frequency, bands)[band][[0, -1]]
        known = f"{ratio:.1f} times the largest in its training" if self.augmentations else "its training had none"
        return (
            f"The network does not know such noise (from {low:.6g} to {high:.6g} Hz: {known}): the intervals may be "
            "too narrow. Train with noise like this measurement's by 'augmentation: {like: FILE}', or with a higher "
            "level; or use the method 'posterior'."
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
