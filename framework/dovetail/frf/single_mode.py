"""A single resonance with a smooth background, fitted to a measured FRF with its uncertainty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from dovetail.frf.frequency_response import Frf, conversion

_POWERS = -2.0, 0.0, 2.0, 4.0
"""Powers of the frequency in the receptance of resonances outside the band: a free body for those below, and the first
terms of a series for those above."""
UNKNOWNS = 12
"""Number of unknowns of a modal fit: frequency, damping, height, phase and four complex numbers of the background."""
_FREQUENCIES = 0.5, 2.0
"""Natural frequencies over the first and the last line, between which a resonance may lie."""
_RATIOS = 1e-7, 0.9
"""Damping ratios between which it may lie."""


class SingleMode:
    """A resonance with a background, fitted to an FRF.

    Parameters
    ----------
    frf : Frf
    variance : (n_freq,) array
        E|random error|^2.
    used : (n_freq,) bool array

    Attributes
    ----------
    features : (4,) array
        Logarithms of natural frequency, damping ratio and height, and the phase [rad].
    covariance : (4, 4) array
        Of the features.
    background : (n_freq,) complex array
        In the quantity of the FRF.
    background_error : float
        Root mean square of its standard deviation.
    misfit : float
        Root mean square of the residual that noise does not explain, relative to the amplitude.
    """

    def __init__(
        self, frf: Frf, variance: NDArray[np.float64], used: NDArray[np.bool_], start: tuple[float, float]
    ) -> None:
        self._frequency, self._to_quantity = frf.frequency[used], conversion(frf.frequency, "receptance", frf.quantity)
        self._deviation = np.sqrt(variance[used] / 2.0)
        self._values, self._used = frf.values[used], used
        self._shapes = background_shapes(frf)
        lower, upper = self._frequency[0] * _FREQUENCIES[0], self._frequency[-1] * _FREQUENCIES[1]
        bounds = np.log([[lower, _RATIOS[0]], [upper, _RATIOS[1]]])
        logarithms = least_squares(
            lambda logs: self._project(logs)[0],
            np.clip(start, bounds[0] + 1e-9, bounds[1] - 1e-9),
            x_scale=[np.exp(start[1]), 1.0],
            bounds=(bounds[0], bounds[1]),
        ).x
        residuals, coefficients = self._project(logarithms)
        freedom = len(residuals) - 2 - len(coefficients)
        self.cost, self.freedom = float(residuals @ residuals), freedom
        height = complex(*coefficients[:2])
        size = max(abs(height), np.finfo(float).tiny)
        self.features = np.array([*logarithms, np.log(size), np.angle(height)])
        self.background = np.asarray((coefficients[2::2] + 1j * coefficients[3::2]) @ self._shapes)
        excess = (self.cost - freedom) / max(1, len(residuals)) * 2.0 * self._deviation**2
        self.misfit = float(np.sqrt(max(0.0, excess.mean()) / np.mean(np.abs(self._values) ** 2)))
        self._set_uncertainty(logarithms, height, max(1.0, self.cost / max(1, freedom)))

    @property
    def is_within_band(self) -> bool:
        """Whether the resonance lies between the first and the last line."""
        return bool(self._frequency[0] < np.exp(self.features[0]) < self._frequency[-1])

    def _columns(self, logs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the effects (m, k) of height and background, each with its phase, over the noise."""
        natural, ratio = np.exp(logs)
        resonance = natural**2 / (natural**2 - self._frequency**2 + 2j * ratio * natural * self._frequency)
        shapes = [self._to_quantity[self._used] * resonance, *self._shapes[:, self._used]]
        return np.array([_reals(turn * shape / self._deviation) for shape in shapes for turn in (1.0, 1j)]).T

    def _project(self, logs: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals (m,) and the best coefficients (k,) for a natural frequency and a damping ratio."""
        columns, measured = self._columns(logs), _reals(self._values / self._deviation)
        sizes = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
        coefficients = np.linalg.lstsq(columns / sizes, measured, rcond=1e-12)[0] / sizes
        return measured - columns @ coefficients, coefficients

    def _set_uncertainty(self, logs: NDArray[np.float64], height: complex, factor: float) -> None:
        columns, step = self._columns(logs), 1e-6 * np.diag([np.exp(logs[1]), 1.0])
        scaled = columns[:, :2] @ np.array([height.real, height.imag])
        ahead = [self._columns(logs + one)[:, :2] @ np.array([height.real, height.imag]) for one in step]
        along = [(shifted - scaled) / one.max() for shifted, one in zip(ahead, step, strict=True)]
        turned = columns[:, :2] @ np.array([-height.imag, height.real])
        jacobian = np.column_stack([*along, scaled, turned, columns[:, 2:]])
        sizes = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
        covariance = factor * np.linalg.pinv((jacobian / sizes).T @ (jacobian / sizes), hermitian=True)
        covariance /= np.outer(sizes, sizes)
        misfit = self.misfit * np.array([np.exp(logs[1]), 1.0, 1.0, 1.0])  # a misfit turns and moves a resonance too
        self.covariance = covariance[:4, :4] + np.diag(misfit**2)
        background = covariance[4::2, 4::2] + covariance[5::2, 5::2]
        variances = np.einsum("kf,kl,lf->f", self._shapes.real, background, self._shapes.real)
        self.background_error = float(np.sqrt(variances.mean()))


def background_shapes(frf: Frf) -> NDArray[np.complex128]:
    """Return the contributions (4, n_freq) of resonances outside the band: powers of the frequency in the receptance.

    They are orthogonal, and their root mean square is the median amplitude of the FRF.
    """
    powers = (frf.frequency / frf.frequency[-1]) ** np.array([_POWERS]).T
    columns = powers * np.abs(conversion(frf.frequency, "receptance", frf.quantity))
    orthogonal = np.linalg.qr((columns / np.linalg.norm(columns, axis=1, keepdims=True)).T)[0].T
    return np.asarray(np.sqrt(len(frf.frequency)) * float(np.median(frf.amplitude)) * orthogonal, dtype=np.complex128)


def _reals(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.concatenate([values.real, values.imag])
