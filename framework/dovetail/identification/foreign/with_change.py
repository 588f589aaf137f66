"""The joint and the amount of a change sought together: each alone would be led astray by the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.fitting.least_squares import Linear
from dovetail.identification.fitting.misfit import FrfMisfit, Residual
from dovetail.identification.foreign.changes import Change

__all__ = ["WithChange"]

_STEP = 1e-5
"""Part of the range of the amount by which derivatives are taken."""


class WithChange:
    """Residuals by the joint's fractions of the ranges and, last, the place of the amount between its ends.

    Parameters
    ----------
    change : Change
    residual : Residual
        Against the measurement.
    """

    def __init__(self, change: Change, residual: Residual) -> None:
        self._change = change
        self._residual = residual

    def position(self, fraction: NDArray[np.float64], amount: float) -> NDArray[np.float64]:
        """Return the place (1, p + 1) of a joint (p,) and an amount."""
        return np.append(fraction, (amount - self._change.least) / self._width)[np.newaxis]

    def amount(self, position: NDArray[np.float64]) -> float:
        """Return the amount at a place (p + 1,)."""
        return float(self._change.least + self._width * position[-1])

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at places (n, p + 1)."""
        return np.concatenate([self._misfit(self.amount(one)).residuals(one[np.newaxis, :-1]) for one in position])

    def linear(self, position: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives at places (n, p + 1)."""
        each = [self._linear(one) for one in position]
        residuals, slopes = (np.stack(parts) for parts in zip(*each, strict=True))
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ np.swapaxes(slopes, 1, 2))

    def _linear(self, position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        fraction, amount = position[np.newaxis, :-1], self.amount(position)
        step = -_STEP if position[-1] > 0.5 else _STEP
        here = self._misfit(amount).linear(fraction)
        ahead = self._misfit(amount + step * self._width).residuals(fraction)
        return here.residuals[0], np.concatenate([here.slopes[0], (ahead - here.residuals) / step])

    def _misfit(self, amount: float) -> FrfMisfit:
        return FrfMisfit(self._change.altered(amount), self._residual)

    @property
    def _width(self) -> float:
        return self._change.most - self._change.least
