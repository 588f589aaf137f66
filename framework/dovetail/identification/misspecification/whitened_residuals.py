"""Residuals of a measurement, white if the joint, random error and small errors of the model explain it.

The errors of the model are further unknowns of the fit, with a normal distribution. Marginalised, they widen the
covariance of the residuals, and `Whitening` scales the residuals to covariance 1 again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting.fit import Fit
from dovetail.identification.fitting.least_squares import minimise
from dovetail.identification.fitting.residuals import FrfResiduals, Weighted
from dovetail.identification.posterior.model_error import MODEL_ERROR, hat_functions

__all__ = ["WhitenedResiduals", "Whitening", "small_errors", "whiten_residuals"]


@dataclass(frozen=True)
class Settings:
    """What the model is allowed to err by, and how closely it is fitted."""

    uncompensated: float = 0.6
    """Part of a model's error that remains once the joint's parameters have compensated for what they can."""
    magnitude_ratio: float = 2.0
    """Relative error of magnitude and phase over that of natural frequencies."""
    other_error: float = 0.002
    """Error of each line over its magnitude, of all kinds that `small_errors` does not have."""
    tolerance: float = 0.02
    """Decrease of the sum of squares at which the fit ends: far below 1, the effect of a parameter's deviation."""
    most_steps: int = 60
    """Steps of the fit; it starts at the best fit and needs few."""
    rank: float = 1e-7
    """Singular value over the largest below which the parameters have no further direction."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class WhitenedResiduals:
    """Whitened residuals of the joint that fits best.

    Parameters
    ----------
    theta : (n_params,) array
        SI; the joint.
    values : (n_freq,) array
        Its FRF.
    whitening : Whitening
        From FRFs to whitened residuals against the measurement.
    residuals : (m,) array
        Of `values`, projected onto the complement of `tangent`.
    tangent : (m, k) array
        Orthonormal basis of the changes of residuals that the joint's parameters can make.
    errors : (n_errors, m) array
        What one standard deviation of each error of the model adds to the residuals, projected likewise.
    """

    theta: NDArray[np.float64]
    values: NDArray[np.complex128]
    whitening: Whitening
    residuals: NDArray[np.float64]
    tangent: NDArray[np.float64]
    errors: NDArray[np.float64]

    @property
    def by_line(self) -> NDArray[np.float64]:
        """(n_freq, n) residuals line by line: two of each where there is a phase."""
        return self.residuals.reshape(len(self.values), -1)

    def project(self, changes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return what changes of the FRF (k, n_freq) add to the residuals (k, m), less what the joint can make."""
        return _without(self.whitening.jacobian(self.values[np.newaxis], changes[np.newaxis])[0], self.tangent)


def whiten_residuals(assembly: Assembly, target: Frf, fit: Fit, model_error: float = MODEL_ERROR) -> WhitenedResiduals:
    """Fit once more, with the errors of the model as further unknowns, and return the residuals.

    Parameters
    ----------
    assembly : Assembly
    target : Frf
        In the quantity of the assembly's response, on its frequencies.
    fit : Fit
        Of the same measurement; its random error and the lines it left out are used.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed.
    """
    values = assembly.frf(fit.theta)
    variance = fit.variance + (_SETTINGS.other_error * np.abs(values)) ** 2
    weighted = Weighted.against(target, variance, ~np.isin(target.frequency, fit.ignored))
    errors = small_errors(assembly.frequency, values, _SETTINGS.uncompensated * model_error)
    whitening = Whitening.against(weighted, weighted.jacobian(values[np.newaxis], errors[np.newaxis])[0])
    problem = FrfResiduals(assembly, whitening)
    start = assembly.to_unit(fit.theta)[np.newaxis]
    position = minimise(problem, start, tolerance=_SETTINGS.tolerance, most_steps=_SETTINGS.most_steps).position
    linear = problem.linearise(position)
    tangent = _tangent(linear.jacobian[0], linear.gradient[0], position[0])
    theta = assembly.from_unit(position[0])
    values = assembly.frf(theta)
    in_residuals = whitening.jacobian(values[np.newaxis], errors[np.newaxis])[0]
    residuals = _without(linear.residuals, tangent)[0]
    return WhitenedResiduals(theta, values, whitening, residuals, tangent, _without(in_residuals, tangent))


def _tangent(
    jacobian: NDArray[np.float64], gradient: NDArray[np.float64], position: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return an orthonormal basis (m, k) of the rows of those parameters that no end of a range holds back."""
    free = jacobian[~(((position <= 0.0) & (gradient > 0.0)) | ((position >= 1.0) & (gradient < 0.0)))]
    length = np.linalg.norm(free, axis=1)
    free = free[length > 0.0] / length[length > 0.0, np.newaxis]
    basis, size, _ = np.linalg.svd(free.T, full_matrices=False)
    return basis[:, size > _SETTINGS.rank * np.max(size, initial=0.0)]


def _without(residuals: NDArray[np.float64], tangent: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(residuals - (residuals @ tangent) @ tangent.T)


@dataclass(frozen=True, eq=False)
class Whitening:
    """Residuals of FRFs scaled to covariance 1, where errors of the model add to random error.

    Parameters
    ----------
    weighted : Weighted
        White if the model is exact.
    directions : (m, k) array
        Orthonormal basis of what the errors add to these residuals.
    factors : (k,) array
        From 0 to 1; by which the residuals' component along each direction is multiplied.
    """

    weighted: Weighted
    directions: NDArray[np.float64]
    factors: NDArray[np.float64]

    @staticmethod
    def against(weighted: Weighted, errors: NDArray[np.float64]) -> Whitening:
        """Return the whitening for errors (k, m), each of one standard deviation."""
        directions, size, _ = np.linalg.svd(errors.T, full_matrices=False)
        return Whitening(weighted, directions, 1.0 / np.sqrt(1.0 + size**2))

    def of(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        return self._scale(self.weighted.of(values))

    def jacobian(self, values: NDArray[np.complex128], of_values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        return self._scale(self.weighted.jacobian(values, of_values))

    def _scale(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(residuals + ((residuals @ self.directions) * (self.factors - 1.0)) @ self.directions.T)


def small_errors(
    frequency: NDArray[np.float64], values: NDArray[np.complex128], level: float
) -> NDArray[np.complex128]:
    """Return what one standard deviation of each small error of the model adds to an FRF.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    values : (n_freq,) complex array
        The FRF.
    level : float
        Relative error of natural frequencies; twice as much for magnitude and phase.

    Returns
    -------
    (n_errors, n_freq) complex array
        The frequency axis stretched, the magnitude and the phase changed, each by a hat function around one of six
        equally spaced frequencies: neighbouring resonances err alike, distant ones independently.

    Notes
    -----
    The posterior allows a model larger errors, and each resonance one of its own, since its intervals must cover
    everything that can mislead about the joint. Here such errors would hide what the joint cannot explain.
    """
    if level == 0.0 or len(frequency) < 2:
        return np.zeros((0, len(frequency)), dtype=np.complex128)
    stretch = level * frequency * np.gradient(values, frequency)
    scale = _SETTINGS.magnitude_ratio * level * values
    return np.concatenate([hat_functions(frequency) * error for error in (stretch, scale, 1j * scale)])
