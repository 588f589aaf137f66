"""Parameters fitted to the measured FRF itself: bounded least squares with exact sensitivities, from several starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError
from dovetail.frf import Frf
from dovetail.identification.provenance import provenance
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification
from dovetail.measurement import on_grid

__all__ = ["Refinement", "identify_from_range", "refine"]

_MODEL_ERROR = 0.005
"""Part of an FRF's own magnitude that no model is expected to reach: it keeps resonances from ruling the fit."""

_STARTS = 5
"""Latin hypercube points beside the starts that are given."""

_MOST_EVALUATIONS = 80


@dataclass(frozen=True, eq=False)
class Refinement:
    """The best of several fits.

    Parameters
    ----------
    theta : (n_params,) array
        SI, within the ranges.
    misfit : float
        Mean square of the residuals over their standard deviation: 1 where they are as small as expected.
    evaluations : int
        FRFs with their sensitivities that were computed, all starts together.
    """

    theta: NDArray[np.float64]
    misfit: float
    evaluations: int


def refine(assembly: Assembly, measured: Frf, starts: Sequence[NDArray[np.float64]] = (), seed: int = 0) -> Refinement:
    """Fit the parameters to a measured FRF.

    Parameters
    ----------
    assembly : Assembly
        With parameters to seek.
    measured : Frf
        On the assembly's frequencies.
    starts : sequence of (n_params,) arrays
        SI; what lies outside the ranges is brought to their ends. The middle of the ranges and some Latin hypercube
        points are tried as well.
    seed : int
        Of the Latin hypercube.

    Returns
    -------
    Refinement

    Notes
    -----
    Trust-region reflective least squares on the complex accelerance, or on its amplitude where there is no phase, in
    fractions of the ranges. Each line is weighted by its random error and half a per cent of its magnitude.
    """
    target = measured.to("accelerance")
    count = len(assembly.parameters)
    given = [np.clip(assembly.to_unit(np.maximum(start, 1e-300)), 0.0, 1.0) for start in starts]
    drawn = qmc.LatinHypercube(count, rng=np.random.default_rng(seed)).random(_STARTS)
    problem = _Problem(assembly, target)
    fits = [
        least_squares(
            problem.residuals,
            np.clip(start, 1e-6, 1.0 - 1e-6),
            problem.jacobian,
            bounds=(0.0, 1.0),
            x_scale="jac",
            max_nfev=_MOST_EVALUATIONS,
        )
        for start in (*given, np.full(count, 0.5), *drawn)
    ]
    best = min(fits, key=lambda fit: fit.cost)
    misfit = 2.0 * float(best.cost) / len(best.fun)
    return Refinement(assembly.from_unit(best.x), misfit, sum(int(fit.nfev) for fit in fits))


def identify_from_range(assembly: Assembly, measured: Frf) -> Identification:
    """Identify the joint from one measured FRF without a trained network.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf
        Of any quantity, without the accelerometer; it must cover the assembly's frequencies.

    Returns
    -------
    Identification
        With the method "refined".

    Raises
    ------
    MeasurementError
        The measurement does not cover the assembly's frequencies.
    ParameterError
        The assembly has nothing to identify.
    """
    if not assembly.parameters:
        raise ParameterError(Fault(assembly.name, "all parameters are known: there is nothing to identify."))
    on_axis = on_grid(measured, assembly.frequency)
    fitted = refine(assembly, on_axis, seed=assembly.description.identification.seed)
    origin = provenance(assembly, measured, None) | {"misfit": fitted.misfit}
    return reconstruct(assembly, fitted.theta, on_axis, method="refined", provenance=origin)


class _Problem:
    """Weighted residuals and their derivatives in fractions of the ranges."""

    def __init__(self, assembly: Assembly, target: Frf) -> None:
        self._assembly = assembly
        self._target = target
        variance = (_MODEL_ERROR * target.amplitude) ** 2 + _random_variance(target)
        self._weight = 1.0 / np.sqrt(np.maximum(variance, 1e-12 * variance.max()) / (2.0 if target.has_phase else 1.0))
        self._at: NDArray[np.float64] | None = None
        self._known: tuple[NDArray[np.complex128], NDArray[np.complex128]] | None = None

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        frf, _ = self._frf(fraction)
        if self._target.has_phase:
            return _split((frf - self._target.values) * self._weight)
        difference: NDArray[np.float64] = (np.abs(frf) - self._target.amplitude) * self._weight
        return difference

    def jacobian(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        frf, derivatives = self._frf(fraction)
        if self._target.has_phase:
            return _split(derivatives * self._weight[:, None])
        along: NDArray[np.float64] = (
            np.real(np.conj(frf)[:, None] * derivatives) / np.maximum(np.abs(frf), 1e-300)[:, None]
        )
        along *= self._weight[:, None]
        return along

    def _frf(self, fraction: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        if self._known is None or self._at is None or not np.array_equal(self._at, fraction):
            theta = self._assembly.from_unit(fraction)
            values, jacobian = self._assembly.frf_jacobian(theta)
            slopes = np.array(
                [
                    value * np.log(p.upper / p.lower) if p.scale == "log" else p.upper - p.lower
                    for p, value in zip(self._assembly.parameters, theta, strict=True)
                ]
            )
            quantity = self._assembly.description.response.quantity
            factor = Frf(self._target.frequency, np.ones_like(values), quantity).to("accelerance").values
            self._at, self._known = fraction.copy(), (values * factor, jacobian * factor[:, None] * slopes)
        return self._known


def _random_variance(frf: Frf) -> NDArray[np.float64]:
    """Return E|error|^2 of each line: as known, or from the scatter from line to line."""
    if (known := frf.random_variance) is not None:
        return np.where(np.isfinite(known), known, np.max(known[np.isfinite(known)], initial=0.0))
    second = np.diff(frf.values if frf.has_phase else frf.amplitude, 2)
    scale = float(np.median(np.abs(second)) ** 2 / 6.0) if second.size else 0.0
    return np.full(frf.frequency.size, scale)


def _split(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.concatenate([values.real, values.imag])
