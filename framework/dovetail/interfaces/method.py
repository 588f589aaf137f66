"""The contract of a method of identification: from measured FRFs and a model of them to parameters."""

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

__all__ = ["Estimate", "IdentificationMethod", "IdentificationProblem"]


TAKEN_NAMES = ("network", "refined", "multistart", "posterior", "rigid")
"""What ``--method`` and ``compare`` call Dovetail's own; a plugin's method of that name could not be asked for."""

_OF_IDENTIFY = "assembly measured method weights phase progress seed model_error cause_seconds"
TAKEN_OPTIONS = frozenset(_OF_IDENTIFY.split())
"""What `identify` takes itself; an option of that name would not reach a plugin's method, or be taken for it."""


@dataclass(frozen=True, eq=False)
class IdentificationProblem:
    """What is to be identified, and from what.

    Parameters
    ----------
    parameters : tuple of Parameter
        Names, units, ranges, scales and priors; `Parameter.from_unit` and `to_unit` map fractions of a range.
    measured : tuple of Frf
        One for each response, on its lines within the band, in the response's quantity.
    variance : (n_lines,) array
        E|error|^2 of each measured value, known or estimated from the scatter from line to line.
    frf : callable
        From parameters (n, n_params) [SI] to the model's FRFs (n, n_lines), complex, where each was measured.
    frf_jacobian : callable
        From parameters (n, n_params) to these FRFs and their derivatives (n, n_lines, n_params) per SI unit.

    Notes
    -----
    The lines of a second response stand behind those of the first, in `variance` and in what the callables return.
    """

    parameters: tuple[Parameter, ...]
    measured: tuple[Frf, ...]
    variance: NDArray[np.float64]
    frf: Callable[[NDArray[np.float64]], NDArray[np.complex128]]
    frf_jacobian: Callable[[NDArray[np.float64]], tuple[NDArray[np.complex128], NDArray[np.complex128]]]

    @property
    def values(self) -> NDArray[np.complex128]:
        """The measured values (n_lines,), one response behind the other."""
        return np.concatenate([frf.values for frf in self.measured])

    def difference(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the model's FRFs at parameters (n, n_params) [SI] less the measured ones, (n, n_lines).

        Where a measurement is an amplitude alone (`Frf.has_phase`) it is the difference of amplitudes.
        """
        model = self.frf(theta)
        has_phase = np.concatenate([np.full(len(frf.frequency), frf.has_phase) for frf in self.measured])
        return np.where(has_phase, model, np.abs(model)) - self.values


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a method found.

    Parameters
    ----------
    theta : (n_params,) array
        SI, within the ranges.
    samples : (n, n_params) array, optional
        SI, within the ranges, of equal weight: how far each parameter is known. Intervals and verdicts are taken from
        them; without them the table has none.
    """

    theta: NDArray[np.float64]
    samples: NDArray[np.float64] | None = None


class IdentificationMethod(Component):
    """A method of identification; its options are those of `identify` and of ``identification: {method: ...}``."""

    kind: ClassVar[Kind] = "method"

    @abstractmethod
    def identify(self, problem: IdentificationProblem, *, seed: int, progress: Progress = silent) -> Estimate:
        """Identify the parameters; the same problem and seed give the same estimate.

        Dovetail judges the estimate like those of its own methods: residuals, adequacy, causes of a misfit.
        """
