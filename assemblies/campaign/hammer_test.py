"""An impact test as the analyser records it: a hammer's force and an accelerometer's signal, made from an accelerance.

The force is a half-sine pulse. Its Fourier transform is known in closed form, so both signals are made line by line:
transform of the pulse x anti-alias filter x accelerance, and back to time. That is the linear system's own response
if the block is long enough for it to die away. It is simulated over four blocks and cut to the first, so that what
has not died away by the end of the record is cut off there, as in a laboratory: the leakage is physical.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["HammerTest"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HammerTest:
    """Settings of the analyser, the hammer and the sensors.

    Parameters
    ----------
    rate : float
        Samples per second.
    samples : int
        Samples of one record.
    impacts : int
    peak, duration : float
        N and s; the half-sine pulse of a light hammer with a steel tip.
    scatter : float
        Relative standard deviation of peak and duration from impact to impact.
    before : float
        Seconds recorded before the impact.
    force_noise, acceleration_noise : float
        Standard deviation of one sample's noise: N and m/s^2.
    force_step, acceleration_step : float
        Resolution of the record, N and m/s^2: far below the noise.
    blocks : int
        How many records long the simulation is.
    """

    rate: float = 25600.0
    samples: int = 16384
    impacts: int = 10
    peak: float = 80.0
    duration: float = 0.1e-3
    scatter: float = 0.1
    before: float = 10e-3
    force_noise: float = 0.01
    acceleration_noise: float = 0.01
    force_step: float = 0.002
    acceleration_step: float = 0.002
    blocks: int = 4

    @property
    def step(self) -> float:
        """Hz between the lines of the simulation."""
        return self.rate / (self.blocks * self.samples)

    def records(self, accelerance: NDArray[np.complex128], seed: int) -> tuple[Array, Array]:
        """Simulate the impacts of one test.

        Parameters
        ----------
        accelerance : (n_freq,) complex array
            m/(N s^2) at `step`, 2 `step`, ... up to half the sampling rate.
        seed : int
            Of the scatter of the impacts and of the noise.

        Returns
        -------
        force, acceleration : (impacts, samples) arrays
            N and m/s^2.
        """
        random = np.random.default_rng(seed)
        frequency = self.step * np.arange(self.blocks * self.samples // 2 + 1)
        static = accelerance[0].real  # a free body at rest: the inverse of a mass; a held one: nothing
        whole = np.concatenate([[static], accelerance])
        force = np.empty((self.impacts, self.samples))
        acceleration = np.empty_like(force)
        for impact in range(self.impacts):
            spectrum = self._pulse(frequency, random) * anti_alias(frequency, self.rate)
            force[impact] = self._signal(spectrum)
            acceleration[impact] = self._signal(spectrum * whole)
        force += self.force_noise * random.standard_normal(force.shape)
        acceleration += self.acceleration_noise * random.standard_normal(acceleration.shape)
        return rounded(force, self.force_step), rounded(acceleration, self.acceleration_step)

    def _pulse(self, frequency: Array, random: np.random.Generator) -> NDArray[np.complex128]:
        """Return the Fourier transform [N s] of one impact's half-sine pulse."""
        peak, duration = (
            mean * (1.0 + self.scatter * random.uniform(-1.7, 1.7)) for mean in (self.peak, self.duration)
        )
        start = self.before + random.uniform(0.0, 1.0) / self.rate
        turns = frequency * duration
        shape = np.pi / 4.0 * np.ones_like(turns)
        regular = np.abs(turns - 0.5) > 1e-9
        shape[regular] = np.cos(np.pi * turns[regular]) / (1.0 - 4.0 * turns[regular] ** 2)
        return 2.0 / np.pi * peak * duration * shape * np.exp(-2j * np.pi * frequency * (start + duration / 2.0))

    def _signal(self, spectrum: NDArray[np.complex128]) -> Array:
        signal: Array = np.fft.irfft(spectrum, self.blocks * self.samples) * self.rate
        return signal[: self.samples]


def anti_alias(frequency: Array, rate: float) -> Array:
    """Return the analyser's filter, the same in both channels: 1 up to 0.41 of the rate, 0 from half of it."""
    share = np.clip((frequency / rate - 0.41) / 0.09, 0.0, 1.0)
    return 0.5 * (1.0 + np.cos(np.pi * share))


def rounded(signal: Array, step: float) -> Array:
    """Return the samples as the analyser's converter gives them."""
    return np.round(signal / step) * step
