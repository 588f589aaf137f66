"""The recorded interface of the peers' problem "virtual point": nine channels and nine impacts around a point."""

import numpy as np

random, frequency = np.random.default_rng(2), np.arange(10.0, 500.0, 1.0)
residues = random.standard_normal((4, 6))
s = 2j * np.pi * frequency
truth = np.zeros((len(frequency), 6, 6), dtype=complex)
for shape, natural in zip(residues, (60.0, 150.0, 280.0, 410.0), strict=True):
    omega = 2 * np.pi * natural
    truth += (1.0 / (s**2 + 0.02 * omega * s + omega**2))[:, None, None] * np.outer(shape, shape)
positions = 0.05 * np.repeat([[1, 0, 0], [0, 1, 0], [0, 0, 1]], 3, axis=0)
directions = np.tile(np.eye(3), (3, 1))
rotated = np.cross(positions, directions)
motion = np.hstack([directions, rotated])  # of a channel by the six DOFs of the point
recorded = motion @ truth @ motion.T
noise = random.standard_normal((*recorded.shape, 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
recorded = recorded + 0.01 * np.abs(recorded) * noise


def relative_error(found: np.ndarray) -> float:
    """Return the median error of the FRFs of the point, over their median."""
    return round(float(np.median(np.abs(found - truth)) / np.median(np.abs(truth))), 4)
