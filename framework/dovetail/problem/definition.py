"""The problem that an identification solves: measured FRFs, and their model as a function of the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.interfaces import Parameter
from dovetail.problem.observations import Observations
from dovetail.problem.residuals import FrfResiduals, ModelFrfs, Residual


@dataclass(frozen=True, eq=False)
class Problem:
    """Observations, and an assembly whose parameters are to be identified from them.

    It is made once for a measurement; what fits, samples, judges or searches for causes takes it as a whole.

    Parameters
    ----------
    assembly : Assembly
        On the lines of each observed FRF. Its parameters have priors: uniform or normal over their ranges.
    observations : Observations
        In the quantities of the assembly's responses, with their random error as far as it is known.
    unweighted : Observations, optional
        The same with their own random error, if the variance of `observations` represents weights of the user.
    """

    assembly: Assembly
    observations: Observations
    unweighted: Observations | None = None

    @staticmethod
    def of(assembly: Assembly, measured: Frf | Sequence[Frf]) -> Problem:
        """Return the problem of one measured FRF, or of one for each response, in any quantities.

        Raises
        ------
        MeasurementError
            There are more or fewer than responses.
        """
        return Problem(assembly, Observations.of(assembly, measured))

    @cached_property
    def model(self) -> ModelFrfs:
        """The FRFs of all responses as functions of the parameters."""
        return ModelFrfs.of(self.assembly)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The unknown parameters."""
        return self.assembly.parameters

    @property
    def judged(self) -> Problem:
        """The problem by which the model is judged: with the random error of the measurement, whatever the weights."""
        return self if self.unweighted is None else Problem(self.assembly, self.unweighted)

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions of the ranges (..., p) to SI values."""
        return self.assembly.from_unit(fraction)

    def to_unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map SI values (..., p) to fractions of the ranges."""
        return self.assembly.to_unit(theta)

    def values(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the model's FRFs (n_lines,) at one parameter vector (p,) [SI]."""
        return np.asarray(self.model.frf(theta[np.newaxis])[0])

    def residuals(self, residual: Residual) -> FrfResiduals:
        """Return residuals against the observations as functions of the parameters."""
        return FrfResiduals(self.model, residual)

    def weighted(self, variance: NDArray[np.float64], used: NDArray[np.bool_] | None = None) -> FrfResiduals:
        """Return the residuals over the standard deviation of each line (n_lines,), of the lines `used`."""
        used = np.ones(len(variance), dtype=np.bool_) if used is None else used
        return self.residuals(self.observations.weighted(variance, used))

    def at(self, lines: NDArray[np.intp]) -> Problem:
        """Return the problem with some of the lines only (increasing indices), at least one of each response."""
        observations = self.observations.at(lines)
        return Problem(self.assembly.on(*(frf.frequency for frf in observations.frfs)), observations)

    def with_frfs(self, frfs: Sequence[Frf]) -> Problem:
        """Return the problem with other measured values on the same lines."""
        return Problem(self.assembly, Observations(tuple(frfs)))

    def with_assembly(self, assembly: Assembly) -> Problem:
        """Return the problem of the same observations with another model."""
        return replace(self, assembly=assembly)
