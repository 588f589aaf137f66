"""Noise and variability on training FRFs, so that the network learns what a measurement looks like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import AugmentationSection

__all__ = ["Augmentation"]

_DECADES = 3.0
"""Of additive noise, below the greatest level."""


@dataclass(frozen=True, eq=False)
class Augmentation:
    """Makes a noisy FRF of a clean one, another each time.

    Parameters
    ----------
    settings : AugmentationSection
        How much of what.
    frequency : (n_freq,) array
        Hz.
    deviation : float
        Standard deviation of all training amplitudes, the unit of additive noise [m/(N s^2)].
    """

    settings: AugmentationSection
    frequency: NDArray[np.float64]
    deviation: float

    @property
    def needs_phase(self) -> bool:
        """Whether the accelerance's phase is needed: a remaining accelerometer mass cannot be put on an amplitude."""
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
        amplitude = self._with_mass(accelerance, generator)
        rows = (len(amplitude), 1)
        amplitude = self._stretched(amplitude, generator)
        amplitude *= (1 + self.settings.gain * generator.standard_normal(rows)).astype(np.float32)
        self._multiply(amplitude, generator)
        self._add(amplitude, generator)
        self._spoil(amplitude, generator)
        return np.abs(amplitude, out=amplitude)

    def _with_mass(self, accelerance: NDArray[np.number], generator: np.random.Generator) -> NDArray[np.float32]:
        """Load the drive point with what is left of the accelerometer: A / (1 + m A)."""
        if not self.needs_phase:
            return accelerance.astype(np.float32)
        mass = self.settings.mass * generator.standard_normal((len(accelerance), 1))
        return np.asarray(np.abs(accelerance / (1 + mass * accelerance)), dtype=np.float32)

    def _stretched(self, amplitude: NDArray[np.float32], generator: np.random.Generator) -> NDArray[np.float32]:
        if self.settings.stretch == 0:
            return amplitude
        factors = 1 + self.settings.stretch * generator.standard_normal(len(amplitude))
        shifted = [
            np.interp(self.frequency / factor, self.frequency, row)
            for factor, row in zip(factors, amplitude, strict=True)
        ]
        return np.array(shifted, dtype=np.float32)

    def _multiply(self, amplitude: NDArray[np.float32], generator: np.random.Generator) -> None:
        if self.settings.multiplicative > 0:
            level = (self.settings.multiplicative * generator.random((len(amplitude), 1))).astype(np.float32)
            amplitude *= 1 + level * generator.standard_normal(amplitude.shape, dtype=np.float32)

    def _add(self, amplitude: NDArray[np.float32], generator: np.random.Generator) -> None:
        if self.settings.additive > 0:
            rows = (len(amplitude), 1)
            level = self.settings.additive * 10.0 ** (-_DECADES * generator.random(rows))
            level[generator.random(rows) < self.settings.clean] = 0.0
            noise = generator.standard_normal(amplitude.shape, dtype=np.float32)
            amplitude += (level * self.deviation).astype(np.float32) * noise

    def _spoil(self, amplitude: NDArray[np.float32], generator: np.random.Generator) -> None:
        if self.settings.bad_lines > 0:
            share = self.settings.bad_lines * generator.random((len(amplitude), 1))
            bad = generator.random(amplitude.shape, dtype=np.float32) < share
            amplitude[bad] *= 10.0 ** generator.uniform(-1.0, 1.0, np.count_nonzero(bad)).astype(np.float32)
