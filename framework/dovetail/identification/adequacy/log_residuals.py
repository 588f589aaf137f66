"""Residuals of the complex logarithm: relative errors of amplitudes and errors of phases, line by line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["LogRatio"]

_ERROR = 0.1
"""Relative error that every line is allowed, so that none dominates."""


@dataclass(frozen=True, eq=False)
class LogRatio:
    """Logarithms of the ratio of FRFs to measured ones: their real parts, then the phases where there are any.

    Parameters
    ----------
    measured : (f,) complex array
    weight : (f,) array
    has_phase : bool
    """

    measured: NDArray[np.complex128]
    weight: NDArray[np.float64]
    has_phase: bool

    @staticmethod
    def against(values: NDArray[np.complex128], relative: NDArray[np.float64], has_phase: bool) -> LogRatio:
        """Return the residuals against measured values (f,) with a relative variance (f,), 1 where all is noise."""
        floor = np.maximum(np.abs(values), np.finfo(float).tiny)
        return LogRatio(
            np.where(np.abs(values) > 0.0, values, floor), 1.0 / np.hypot(_ERROR, np.sqrt(relative / 2.0)), has_phase
        )

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        return self.weighted(np.log(frf / self.measured))

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        return self.weighted(frf_jacobian / frf[:, np.newaxis])

    def weighted(self, logarithms: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (..., m) that logarithms (..., f) are."""
        if not self.has_phase:
            return np.asarray(logarithms.real * self.weight)
        return np.concatenate([logarithms.real * self.weight, logarithms.imag * self.weight], axis=-1)
