"""The contract of a method of identification, which estimates parameters from measured FRFs and a model of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Generic

import numpy as np
from numpy.typing import NDArray
from typing_extensions import TypeVar

from dovetail.frf import Frf
from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.joint import Parameter
from dovetail.interfaces.progress import NO_LIMIT, Progress, TimeLimit, silent

RESERVED_NAMES = ("rigid",)
"""Words for `compare` that name no method."""

_OF_IDENTIFY = "assembly measured method weights phase progress seed model model_error cause_seconds start"
RESERVED_OPTIONS = frozenset(_OF_IDENTIFY.split())
"""Parameters of `identify`; an option of a method must not have one of these names."""


class IdentificationProblem(ABC):
    """The parameters to identify, the measurement and its model.

    Attributes
    ----------
    starts : tuple of (n_params,) arrays
        Values [SI] from which a search may start: those of the user, and a trained network's estimate.
    network : callable or None
        Returns the `Estimate` of a trained network for this measurement, if there is one.
    limit : TimeLimit
        The time that the identification has. A method may ask `limit.is_over` between steps, end early with the best
        parameters so far, and report with `limit.leave_out` what is missing.

    Notes
    -----
    The lines of all responses are concatenated, in `values`, `variance` and the results of the methods.
    """

    starts: tuple[NDArray[np.float64], ...] = ()
    network: Callable[[], Estimate] | None = None
    limit: TimeLimit = NO_LIMIT

    @property
    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Names, units, ranges, scales and priors; `Parameter.from_unit` and `to_unit` map fractions of a range."""

    @property
    @abstractmethod
    def measured(self) -> tuple[Frf, ...]:
        """One FRF for each response, on its lines within the band, in the response's quantity; or none."""

    @property
    @abstractmethod
    def variance(self) -> NDArray[np.float64]:
        """(n_lines,) E|error|^2 of each measured value, known or estimated from the scatter from line to line."""

    @abstractmethod
    def frf(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the model's FRFs (n, n_lines) on the measured lines at parameters (n, n_params) [SI]."""

    @abstractmethod
    def frf_jacobian(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return these FRFs and their derivatives (n, n_lines, n_params) per SI unit."""

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


ProblemType = TypeVar("ProblemType", bound=IdentificationProblem, default=Any)
"""The kind of problem that a method takes; in an identification it is a `dovetail.Problem`."""


class IdentificationMethod(Component, Generic[ProblemType]):
    """A method of identification; its options are those of `identify` and of ``identification: {method: ...}``.

    Attributes
    ----------
    fits_lines : bool
        Whether the method compares the model with the measured lines. Otherwise its estimate is the result as it is,
        and is not judged by residuals.
    fits_modes : bool
        Whether the method also identifies from a table of natural frequencies. The problem then has no `measured` FRFs;
        its `values`, `variance` and model are the numbers of the table.
    uses_starts : bool
        Whether it starts from `IdentificationProblem.starts`; only then does `identify` accept ``start``.
    gives_posterior : bool
        Whether `sample` returns the posterior, once the estimate is judged.
    refits_with_errors : bool
        Whether a fit that allows for the errors of the model takes the place of the estimate where the estimate does
        not reach the noise.
    """

    kind: ClassVar[Kind] = "method"
    fits_lines: ClassVar[bool] = True
    fits_modes: ClassVar[bool] = False
    uses_starts: ClassVar[bool] = False
    gives_posterior: ClassVar[bool] = False
    refits_with_errors: ClassVar[bool] = False

    @property
    def evaluations(self) -> tuple[float, float] | None:
        """How long `identify`, with what follows until `sample`, and `sample` usually take; the forecast is made of it.

        The unit is the time of computing all FRFs and their derivatives once. None where it is not known.
        """
        return None

    @abstractmethod
    def identify(self, problem: ProblemType, *, seed: int, progress: Progress = silent) -> Estimate:
        """Estimate the parameters; the same problem and seed give the same estimate.

        Dovetail judges the estimate: residuals, adequacy, causes of a misfit. What `dovetail.refine` and
        `dovetail.multistart` return is an estimate too.
        """

    def sample(self, problem: ProblemType, judged: Any, *, seed: int, progress: Progress = silent) -> Any:
        """Return the posterior once the estimate is judged, where `gives_posterior`.

        Parameters
        ----------
        problem : Problem
        judged : dovetail.JudgedFit
            The fit, the errors that the model turned out to have, and whether the numbers can be trusted.
        seed : int
        progress : Progress

        Returns
        -------
        dovetail.Posterior
        """
        raise NotImplementedError
