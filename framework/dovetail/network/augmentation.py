"""Noise and variability on training FRFs, so that the network learns what a measurement looks like.

`Augmentation` adds noise to clean FRFs. `NoisyFeatures` computes the features of all training FRFs for an epoch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.dataset import latin_hypercube
from dovetail.description import AugmentationSection
from dovetail.errors import DatasetError, Fault, FileError, MeasurementError
from dovetail.measurement import read_frf
from dovetail.network.pipeline import Pair
from dovetail.network.preprocessing import accelerances, log10p1
from dovetail.parallel import cores
from dovetail.problem.random_error import MeasuredNoise

TRAINING_TOLERANCE = 1e-7
"""Estimated relative error of interpolated FRFs in training; features have single precision."""

_LIKE = "identification.augmentation.like"

_NOISE_DECADES = 3.0
"""Decades of the level of additive noise below its largest value: from poor to good measurements."""

_NOISE_STREAM, _SAMPLE_STREAM = 2, 3
"""Separate the random numbers of the noise and of fresh samples from those of the split, which has the same seed."""

_ROWS = 512
"""FRFs in a block, each with its own generator, so that epochs are the same on any number of cores."""


def measured_noises(assembly: Assembly) -> list[MeasuredNoise | None]:
    """Read the measurements whose noise the description's `augmentation` names, one for each response.

    Raises
    ------
    MeasurementError, FileError
        A file does not contain exactly one FRF, or lies outside the band; or the number of files is neither 1 nor the
        number of responses.
    """
    settings, count = assembly.description.identification.augmentation, len(assembly.description.responses)
    if settings is None or not settings.like:
        return [None] * count
    files = (settings.like,) if isinstance(settings.like, str) else settings.like
    index = settings.like_index
    indices = index if isinstance(index, tuple) else (index,) * len(files)
    if len(files) not in (1, count) or len(indices) != len(files):
        problem = f"{len(files)} files and {len(indices)} indices were given for {count} responses."
        raise MeasurementError(Fault(_LIKE, problem, "one file for all responses or one for each, and an index each"))
    try:
        frfs = [read_frf(file, index=index) for file, index in zip(files, indices, strict=True)]
        noises = [MeasuredNoise.of(frf, assembly.frequency) for frf in frfs]
    except (MeasurementError, FileError) as error:
        fault = error.faults[0]
        remedy = "Choose one with 'like_index', from 1." if "choose one" in fault.problem else fault.remedy
        raise type(error)(Fault(f"{_LIKE}  {fault.where}", fault.problem, fault.accepted, remedy)) from None
    return [*noises] if len(noises) == count else [noises[0]] * count


@dataclass(frozen=True, eq=False)
class Augmentation:
    """Adds noise to clean FRFs, with new random numbers in each call.

    Parameters
    ----------
    settings : AugmentationSection
        Kinds and levels of noise.
    frequency : (n_freq,) array
        Hz.
    deviation : float
        Standard deviation of all training amplitudes, the unit of additive noise [m/(N s^2)].
    measured : MeasuredNoise, optional
        Noise of a measurement.
    """

    settings: AugmentationSection
    frequency: NDArray[np.float64]
    deviation: float
    measured: MeasuredNoise | None = None

    @property
    def needs_phase(self) -> bool:
        """Whether the accelerance's phase is needed: a remaining sensor mass cannot be added to an amplitude."""
        return self.settings.mass > 0

    def __call__(self, accelerance: NDArray[np.number], generator: np.random.Generator) -> NDArray[np.float32]:
        """Return amplitudes with noise.

        Parameters
        ----------
        accelerance : (n_samples, n_freq) array
            Amplitude, or complex where `needs_phase`.
        generator : numpy.random.Generator

        Returns
        -------
        (n_samples, n_freq) float32 array
            m/(N s^2), not negative.
        """
        amplitude = self._add_sensor_mass(accelerance, generator)
        rows = (len(amplitude), 1)
        amplitude = self._stretch(amplitude, generator)
        amplitude *= (1 + self.settings.gain * generator.standard_normal(rows)).astype(np.float32)
        self._add_noise(amplitude, generator)
        if self.measured is not None:
            level = 10.0 ** (self.settings.like_decades * (generator.random(rows) - 0.5))
            self.measured.add(amplitude, level.astype(np.float32), generator)
        self._disturb_lines(amplitude, generator)
        return np.abs(amplitude, out=amplitude)

    def _add_sensor_mass(self, accelerance: NDArray[np.number], generator: np.random.Generator) -> NDArray[np.float32]:
        """Load the drive point with the remaining mass m of the accelerometer: A / (1 + m A)."""
        if not self.needs_phase:
            return accelerance.astype(np.float32)
        mass = self.settings.mass * generator.standard_normal((len(accelerance), 1))
        return np.asarray(np.abs(accelerance / (1 + mass * accelerance)), dtype=np.float32)

    def _stretch(self, amplitude: NDArray[np.float32], generator: np.random.Generator) -> NDArray[np.float32]:
        if self.settings.stretch == 0:
            return amplitude
        factors = 1 + self.settings.stretch * generator.standard_normal(len(amplitude))
        stretched = [
            np.interp(self.frequency / factor, self.frequency, row)
            for factor, row in zip(factors, amplitude, strict=True)
        ]
        return np.array(stretched, dtype=np.float32)

    def _add_noise(self, amplitude: NDArray[np.float32], generator: np.random.Generator) -> None:
        """Add multiplicative and additive noise, in place."""
        multiplicative = self._multiplicative_level(len(amplitude), generator)
        if self.settings.circular > 0:
            additive = self._additive_level(len(amplitude), generator)
            deviation = np.sqrt(np.square(multiplicative * amplitude) + np.square(additive))
            is_circular = generator.random((len(amplitude), 1)) < self.settings.circular
            in_phase, quadrature = _normal_pairs(amplitude.shape, generator)
            in_phase *= deviation * np.where(is_circular, np.float32(np.sqrt(0.5)), np.float32(1.0))
            quadrature *= deviation * np.where(is_circular, np.float32(np.sqrt(0.5)), np.float32(0.0))
            amplitude += in_phase
            np.sqrt(np.square(amplitude, out=amplitude) + np.square(quadrature, out=quadrature), out=amplitude)
            return
        if self.settings.multiplicative > 0:
            amplitude *= 1 + multiplicative * generator.standard_normal(amplitude.shape, dtype=np.float32)
        if self.settings.additive > 0:
            additive = self._additive_level(len(amplitude), generator)
            amplitude += additive * generator.standard_normal(amplitude.shape, dtype=np.float32)

    def _multiplicative_level(self, rows: int, generator: np.random.Generator) -> NDArray[np.float32]:
        """Draw each row's standard deviation (rows, 1) over the amplitude."""
        if self.settings.multiplicative == 0:
            return np.zeros((rows, 1), np.float32)
        drawn, decades = generator.random((rows, 1)), self.settings.multiplicative_decades
        level = self.settings.multiplicative * (10.0 ** (-decades * drawn) if decades else drawn)
        return np.asarray(level, dtype=np.float32)

    def _additive_level(self, rows: int, generator: np.random.Generator) -> NDArray[np.float32]:
        """Draw each row's standard deviation (rows, 1) [m/(N s^2)]."""
        if self.settings.additive == 0:
            return np.zeros((rows, 1), np.float32)
        level = self.settings.additive * 10.0 ** (-_NOISE_DECADES * generator.random((rows, 1)))
        level[generator.random((rows, 1)) < self.settings.clean] = 0.0
        return (level * self.deviation).astype(np.float32)

    def _disturb_lines(self, amplitude: NDArray[np.float32], generator: np.random.Generator) -> None:
        if self.settings.bad_lines > 0:
            share = self.settings.bad_lines * generator.random((len(amplitude), 1))
            bad = generator.random(amplitude.shape, dtype=np.float32) < share
            amplitude[bad] *= 10.0 ** generator.uniform(-1.0, 1.0, np.count_nonzero(bad)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class NoisyFeatures:
    """Features of the training FRFs with noise, as a function of the epoch.

    Parameters
    ----------
    assembly : Assembly
        Its description's `augmentation` specifies the noise, and its seed determines every epoch.
    clean : (n_samples, n_responses n_freq) float32 or complex64 array
        Accelerance without noise, amplitudes or with phases, all responses concatenated. Fresh samples replace them.
    theta : (n_samples, n_params) array
        SI.
    augmentations : sequence of Augmentation
        One for each response, whose noise is independent of the others'.
    """

    assembly: Assembly
    clean: NDArray[np.number]
    theta: NDArray[np.float64]
    augmentations: Sequence[Augmentation]

    @classmethod
    def from_samples(cls, assembly: Assembly, clean: NDArray[np.number], theta: NDArray[np.float64]) -> Self:
        """Scale the noise by the standard deviation of each response's amplitudes in the training samples.

        Raises
        ------
        DatasetError
            A remaining mass needs phases, but `clean` has none and the samples are not fresh.
        MeasurementError, FileError
            As in `measured_noises`.
        """
        settings = assembly.description.identification.augmentation
        assert settings is not None
        responses = np.split(clean, len(assembly.description.responses), axis=1)
        augmentations = [
            Augmentation(settings, assembly.frequency, _deviation(response), measured)
            for response, measured in zip(responses, measured_noises(assembly), strict=True)
        ]
        if augmentations[0].needs_phase and not settings.fresh and not np.iscomplexobj(clean):
            problem = "the remaining mass at the drive point needs phases, but the dataset has only amplitudes."
            remedy = "Generate it with `storage='complex'`, or set 'fresh: true', or 'mass: 0'."
            raise DatasetError(Fault("identification.augmentation", problem, remedy=remedy))
        return cls(assembly, clean, theta, augmentations)

    @property
    def fresh(self) -> bool:
        """Whether every epoch draws new samples from the engine."""
        return self.augmentations[0].settings.fresh

    @property
    def seed(self) -> int:
        """The seed of all random numbers."""
        return self.assembly.description.identification.seed

    @property
    def reuse(self) -> int:
        """Average number of times that a fresh sample is used."""
        return self.augmentations[0].settings.reuse

    @property
    def copies(self) -> int:
        """Number of different epochs if the reduction is slow."""
        return self.augmentations[0].settings.copies

    def __call__(self, epoch: int, count: int | None = None) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return features (n_samples, n_responses n_freq) and parameters (n_samples, n_params) of an epoch.

        There are `count` fresh samples, by default as many as training samples.
        """
        return self._noisy_epoch(epoch, count, log10p1)

    def amplitudes(self, epoch: int, count: int) -> Pair:
        """Return amplitudes (n_samples, n_responses n_freq) [m/(N s^2)] of fresh samples, and their parameters."""
        return self._noisy_epoch(epoch, count, np.positive)

    def _noisy_epoch(
        self, epoch: int, count: int | None, write: Callable[..., object]
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return noisy amplitudes, transformed by `write`, and the parameters."""
        theta, seed = self.theta, self.seed
        if self.fresh:
            theta = latin_hypercube(self.assembly, count or len(theta), (seed, _SAMPLE_STREAM, epoch))
        features = np.empty((len(theta), self.clean.shape[1]), dtype=np.float32)

        def fill(block: int, clean: NDArray[np.number]) -> None:
            generator = np.random.default_rng([seed, _NOISE_STREAM, epoch, block])
            noisy = with_noise(clean, self.augmentations, generator)
            write(noisy, out=features[block * _ROWS : block * _ROWS + len(noisy)])

        with ThreadPoolExecutor(cores()) as pool:
            for future in [pool.submit(fill, block, clean) for block, clean in enumerate(self._clean_blocks(theta))]:
                future.result()
        return features, theta

    def _clean_blocks(self, theta: NDArray[np.float64]) -> Iterator[NDArray[np.number]]:
        """Yield the clean FRFs of the samples, block by block."""
        for start in range(0, len(theta), _ROWS):
            rows = slice(start, start + _ROWS)
            if not self.fresh:
                yield self.clean[rows]
            else:
                yield accelerances(self._source, theta[rows], phase=self.augmentations[0].needs_phase)

    @cached_property
    def _source(self) -> Assembly:
        """The assembly that computes fresh samples."""
        return self.assembly.interpolated(TRAINING_TOLERANCE)


def with_noise(
    clean: NDArray[np.number], augmentations: Sequence[Augmentation], generator: np.random.Generator
) -> NDArray[np.float32]:
    """Return amplitudes with noise (n, n_responses n_freq); that of each response is independent of the others'."""
    pairs = zip(augmentations, np.split(clean, len(augmentations), axis=1), strict=True)
    return np.concatenate([augmentation(response, generator) for augmentation, response in pairs], axis=1)


def _normal_pairs(
    shape: tuple[int, ...], generator: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return two arrays of normal draws in single precision, by the method of Box and Muller.

    It takes a third of the time of `Generator.standard_normal`. No draw exceeds 5.8.
    """
    radius, angle = (generator.random(shape, dtype=np.float32) for _ in range(2))
    np.subtract(np.float32(1.0), radius, out=radius)
    np.log(radius, out=radius)
    radius *= np.float32(-2.0)
    np.sqrt(radius, out=radius)
    angle *= np.float32(2.0 * np.pi)
    quadrature = radius * np.sin(angle)
    radius *= np.cos(angle, out=angle)
    return radius, quadrature


def _deviation(accelerance: NDArray[np.number]) -> float:
    """Return the standard deviation of all amplitudes, without copying them if they are stored as amplitudes."""
    amplitude = np.abs(accelerance) if np.iscomplexobj(accelerance) else accelerance
    return float(np.std(amplitude, dtype=np.float64))
