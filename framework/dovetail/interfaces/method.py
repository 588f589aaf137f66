"""The contract of a method of identification, which estimates parameters from measured FRFs and a model of them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.frf import Frf
from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.joint import Parameter
from dovetail.interfaces.progress import Progress, silent

TAKEN_NAMES = ("network", "refined", "multistart", "posterior", "rigid")
"""Names of Dovetail's methods; a plugin's method must not have one of them."""

_OF_IDENTIFY = "assembly measured method weights phase progress seed model_error cause_seconds"
TAKEN_OPTIONS = frozenset(_OF_IDENTIFY.split())
"""Parameters of `identify`; an option of a plugin's method must not have one of these names."""


@dataclass(frozen=True, eq=False)
class IdentificationProblem:
    """The parameters to identify, the measurement and its model.

    Parameters
    ----------
    parameters : tuple of Parameter
        Names, units, ranges, scales and priors; `Parameter.from_unit` and `to_unit` map fractions of a range.
    measured : tuple of Frf
        One for each response, on its lines within the band, in the response's quantity.
    variance : (n_lines,) array
        E|error|^2 of each measured value, known or estimated from the scatter from line to line.
    frf : callable
        From parameters (n, n_params) [SI] to the model's complex FRFs (n, n_lines) on the measured lines.
    frf_jacobian : callable
        From parameters (n, n_params) to these FRFs and their derivatives (n, n_lines, n_params) per SI unit.

    Notes
    -----
    The lines of all responses are concatenated, in `variance` and in the results of the callables.
    """

    parameters: tuple[Parameter, ...]
    measured: tuple[Frf, ...]
    variance: NDArray[np.float64]
    frf: Callable[[NDArray[np.float64]], NDArray[np.complex128]]
    frf_jacobian: Callable[[NDArray[np.float64]], tuple[NDArray[np.complex128], NDArray[np.complex128]]]

    @property
    def values(self) -> NDArray[np.complex128]:
        """The measured values (n_lines,) of all responses, concatenated."""
        return np.concatenate([frf.values for frf in self.measured])

    def difference(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the model's FRFs at parameters (n, n_params) [SI] minus the measured ones, (n, n_lines).

        For a measurement without a phase (`Frf.has_phase`) it is the difference of amplitudes.
        """
        model = self.frf(theta)
        has_phase = np.concatenate([np.full(len(frf.frequency), frf.has_phase) for frf in self.measured])
        return np.where(has_phase, model, np.abs(model)) - self.values


@dataclass(frozen=True, eq=False)
class Estimate:
    """The estimate of a method.

    Parameters
    ----------
    theta : (n_params,) array
        SI, within the ranges.
    samples : (n, n_params) array, optional
        SI, within the ranges: posterior samples of equal weight. Intervals and verdicts are computed from them; without
        them the table has none.
    """

    theta: NDArray[np.float64]
    samples: NDArray[np.float64] | None = None


class IdentificationMethod(Component):
    """A method of identification; its options are those of `identify` and of ``identification: {method: ...}``."""

    kind: ClassVar[Kind] = "method"

    @abstractmethod
    def identify(self, problem: IdentificationProblem, *, seed: int, progress: Progress = silent) -> Estimate:
        """Estimate the parameters; the same problem and seed give the same estimate.

        Dovetail judges the estimate like those of its own methods: residuals, adequacy, causes of a misfit.
        """
