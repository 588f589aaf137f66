"""What is left of a measurement when the joint, the model's own small errors and the noise have had their part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting.fit import Fit
from dovetail.identification.fitting.levenberg_marquardt import minimise
from dovetail.identification.fitting.residuals import FrfMisfit, Weighted
from dovetail.identification.posterior.model_error import MODEL_ERROR, hats

__all__ = ["Remainder", "Tolerant", "remainder", "small_errors"]

_LEFT_OVER = 0.6
"""Part of a model's error that is left when the joint's parameters have followed it."""
_UNMODELLED = 0.002
"""Part of each line's magnitude that the model may miss in other ways than by the errors that are reckoned with."""
_TOLERANCE, _MOST_STEPS = 0.02, 60
_FAINT = 1e-7
"""Part of the largest singular value from which the parameters have no further direction."""


@dataclass(frozen=True, eq=False)
class Remainder:
    """What neither the joint nor noise nor small errors of the model explain, white if nothing is.

    Parameters
    ----------
    theta : (n_params,) array
        SI; the joint that explains the most.
    values : (n_freq,) array
        Its FRF.
    residual : Tolerant
        By which FRFs are compared with the measurement.
    residuals : (m,) array
        Those of `values`, without the directions that the joint can follow.
    followed : (m, k) array
        Orthonormal; the directions that the joint can follow.
    errors : (n_errors, m) array
        What one standard deviation of each reckoned error adds, without those directions.
    """

    theta: NDArray[np.float64]
    values: NDArray[np.complex128]
    residual: Tolerant
    residuals: NDArray[np.float64]
    followed: NDArray[np.float64]
    errors: NDArray[np.float64]

    @property
    def lines(self) -> NDArray[np.float64]:
        """(n_freq, parts) residuals line by line."""
        return self.residuals.reshape(-1, self.residual.parts)

    def effect(self, of_values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return what changes of the FRF (k, n_freq) do to the residuals (k, m) that the joint cannot follow."""
        slopes = self.residual.slopes(self.values[np.newaxis], of_values[np.newaxis])[0]
        return _without(slopes, self.followed)


def remainder(assembly: Assembly, target: Frf, fit: Fit, model_error: float = MODEL_ERROR) -> Remainder:
    """Fit once more, with the errors of the model as further unknowns, and return what is left.

    Parameters
    ----------
    assembly : Assembly
    target : Frf
        In the quantity of the assembly's response, on its frequencies.
    fit : Fit
        Of the same measurement; its random error and the lines it left out are taken over.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed.
    """
    best = assembly.to_unit(fit.theta)
    values = assembly.frf(fit.theta)
    used = ~np.isin(target.frequency, fit.ignored)
    variance = fit.variance + (_UNMODELLED * np.abs(values)) ** 2
    plain = Weighted.against(target, variance, used)
    errors = small_errors(assembly.frequency, values, _LEFT_OVER * model_error)
    residual = Tolerant.towards(plain, plain.slopes(values[np.newaxis], errors[np.newaxis])[0])
    problem = FrfMisfit(assembly, residual)
    position = minimise(problem, best[np.newaxis], tolerance=_TOLERANCE, most_steps=_MOST_STEPS).position
    at = problem.linear(position)
    followed = _followed(at.slopes[0], at.gradient[0], position[0])
    theta = assembly.from_unit(position[0])
    values = assembly.frf(theta)
    effects = residual.slopes(values[np.newaxis], errors[np.newaxis])[0]
    left = _without(at.residuals, followed)[0]
    return Remainder(theta, values, residual, left, followed, _without(effects, followed))


def _followed(
    slopes: NDArray[np.float64], gradient: NDArray[np.float64], position: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return an orthonormal basis (m, k) of what the parameters that no end of a range holds can follow."""
    free = slopes[~(((position <= 0.0) & (gradient > 0.0)) | ((position >= 1.0) & (gradient < 0.0)))]
    length = np.linalg.norm(free, axis=1)
    free = free[length > 0.0] / length[length > 0.0, np.newaxis]
    if not len(free):
        return np.zeros((slopes.shape[1], 0))
    basis, size, _ = np.linalg.svd(free.T, full_matrices=False)
    return basis[:, size > _FAINT * size[0]]


def _without(residuals: NDArray[np.float64], followed: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(residuals - (residuals @ followed) @ followed.T)


@dataclass(frozen=True, eq=False)
class Tolerant:
    """Residuals made white for a model that errs: what its errors may do to them counts little.

    Parameters
    ----------
    residual : Residual
        White where the model does not err.
    basis : (m, k) array
        Orthonormal; what the errors can do to the residuals.
    shrunk : (k,) array
        By which the residuals' part along each is multiplied, from 0 to 1.
    """

    residual: Weighted
    basis: NDArray[np.float64]
    shrunk: NDArray[np.float64]

    @staticmethod
    def towards(residual: Weighted, errors: NDArray[np.float64]) -> Tolerant:
        """Return the residuals for errors (k, m), each of one standard deviation."""
        if not len(errors):
            return Tolerant(residual, np.zeros((errors.shape[1], 0)), np.zeros(0))
        basis, size, _ = np.linalg.svd(errors.T, full_matrices=False)
        return Tolerant(residual, basis, 1.0 / np.sqrt(1.0 + size**2))

    @property
    def parts(self) -> int:
        """Residuals of each line: 2 where there is a phase."""
        return self.residual.parts

    def of(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        return self._white(self.residual.of(values))

    def slopes(self, values: NDArray[np.complex128], of_values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        return self._white(self.residual.slopes(values, of_values))

    def _white(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(residuals + ((residuals @ self.basis) * (self.shrunk - 1.0)) @ self.basis.T)


_MAGNITUDE = 2.0
"""Relative error of magnitude and phase over that of natural frequencies."""


def small_errors(
    frequency: NDArray[np.float64], values: NDArray[np.complex128], level: float
) -> NDArray[np.complex128]:
    """Return what one standard deviation of each error adds to an FRF.

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
        equally spaced frequencies: neighbouring resonances err alike, distant ones on their own.

    Notes
    -----
    The posterior allows a model more than that, and each resonance on its own, since its intervals must hold all that a
    joint can be mistaken for; here what a joint cannot follow is looked for, and such errors would hide it.
    """
    if level == 0.0 or len(frequency) < 2:
        return np.zeros((0, len(frequency)), dtype=np.complex128)
    stretched = level * frequency * np.gradient(values, frequency)
    off = _MAGNITUDE * level * values
    return np.concatenate([hats(frequency) * size for size in (stretched, off, 1j * off)])
