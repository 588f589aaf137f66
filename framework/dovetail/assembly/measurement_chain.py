"""The measurement chain of a response: the factor of its FRF by gain, sign, phase, delay and an exponential window."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.description.checked import ParameterEntry
from dovetail.frf import QUANTITIES, Quantity

_IN_FACTOR = ("gain", "phase", "delay", "window")
"""The parameters on which the factor depends."""


class Chain:
    """The factor by which a measurement chain multiplies an FRF, and its derivatives by the chain's parameters.

    Under a window of decay rate s, each time derivative is a factor of i omega + s instead of i omega.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    quantity : {"receptance", "mobility", "accelerance"}
        The measured quantity.
    entry : ParameterEntry
        The response's.
    theta : (n, n_chain) array
        Its parameters in SI.
    """

    def __init__(
        self, frequency: NDArray[np.float64], quantity: Quantity, entry: ParameterEntry, theta: NDArray[np.float64]
    ) -> None:
        sign = entry.fixed.get("sign", 1.0)
        self._names = [parameter.name for parameter in entry.parameters]
        self._omega = 2.0 * np.pi * frequency
        self._power = QUANTITIES.index(quantity)
        self._gain = self._column("gain", theta, 1.0)
        phase = self._column("phase", theta, 0.0)
        if (delay := self._column("delay", theta, 0.0)).any():
            phase = phase - self._omega * delay
        self._turned = (1.0 if np.isnan(sign) else sign) * np.exp(1j * phase)
        window = self._column("window", theta, 0.0)
        self._ratio = 1.0 + window / (1j * self._omega) if window.any() else np.ones((1, 1))

    @staticmethod
    def is_identity(entry: ParameterEntry) -> bool:
        """Return whether the factor is 1 whatever the parameters: those of a mass or a sensor do not act on it."""
        return not any(parameter.name in _IN_FACTOR for parameter in entry.parameters) and "sign" not in entry.fixed

    def _column(self, name: str, theta: NDArray[np.float64], otherwise: float) -> NDArray[np.float64]:
        """Return one of the parameters, (n, 1)."""
        if name not in self._names:
            return np.full((len(theta), 1), otherwise)
        return theta[:, [self._names.index(name)]]

    @cached_property
    def factor(self) -> NDArray[np.complex128]:
        """(n, n_freq), or (n, 1) if the same on all lines: gain, sign, phase, delay, and the effect of the window."""
        return np.asarray(self._gain * self._turned * self._ratio**self._power)

    def derivative(self, column: int) -> NDArray[np.complex128]:
        """Return the derivative of the factor by the parameter in a column of theta, (n, n_freq) or (n, 1)."""
        name = self._names[column]
        if name == "gain":
            return np.asarray(self._turned * self._ratio**self._power)
        if name == "phase":
            return 1j * self.factor
        if name == "delay":
            return np.asarray(-1j * self._omega * self._gain * self._turned * self._ratio**self._power)
        if name == "window":
            before = self._gain * self._turned * self._power * self._ratio ** (self._power - 1)
            return np.asarray(before / (1j * self._omega))
        return np.zeros_like(self.factor)


def chain_rule(derivatives: NDArray[Any], slopes: NDArray[np.float64]) -> NDArray[Any]:
    """Return derivatives by theta (n, ..., n_params, n_freq).

    Parameters
    ----------
    derivatives : (n, ..., n_values, n_freq) array
        By some values.
    slopes : (n, n_values, n_params) array
        Derivatives of these values by theta.
    """
    _, count, parameters = slopes.shape
    if count == parameters and (slopes == np.eye(count)).all():
        return derivatives
    depends = slopes.any(axis=0)
    if (depends.sum(axis=0) == 1).all():  # each parameter is the only source of one value
        values = np.argmax(depends, axis=0)
        factors = slopes[:, values, np.arange(parameters)]
        return derivatives[..., values, :] * factors.reshape(len(slopes), *(1,) * (derivatives.ndim - 3), parameters, 1)
    total = np.zeros((*derivatives.shape[:-2], parameters, derivatives.shape[-1]), dtype=derivatives.dtype)
    for value, column in np.argwhere(depends):
        slope = slopes[:, value, column].reshape(-1, *(1,) * (derivatives.ndim - 2))
        total[..., column, :] += slope * derivatives[..., value, :]
    return total
