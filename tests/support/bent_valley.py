"""A posterior whose mass lies along a bent, narrow valley."""

from __future__ import annotations

import numpy as np

from dovetail.problem.least_squares import Linearisation


class Bow:
    """A bent, narrow valley: the second coordinate follows the square of the first, to a hundredth."""

    def residuals(self, z):
        return np.concatenate([z, (z[:, 1:] - z[:, :1] ** 2 + 1.0) / 0.01], axis=1)

    def linearise(self, z):
        jacobian = np.zeros((len(z), 2, 3))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
        jacobian[:, 0, 2], jacobian[:, 1, 2] = -2.0 * z[:, 0] / 0.01, 1.0 / 0.01
        return Linearisation(self.residuals(z), jacobian)
