"""What is usual for a network's training FRFs, learned from them and from held-out ones with noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.foreign.novelty import Basis, Novelty, strangeness
from dovetail.identification.network import Network

__all__ = ["learned"]

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
