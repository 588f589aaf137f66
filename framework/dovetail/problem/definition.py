"""The problem that an identification solves: measured FRFs, and their model as a function of the parameters."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, FrfModel, ParameterScales
from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.frf.frequency_response import same_axes
from dovetail.interfaces import NO_LIMIT, Estimate, IdentificationProblem, Parameter, Scale, TimeLimit
from dovetail.measurement.roles import power_balance
from dovetail.problem.least_squares import Linearisation, SumOfSquares
from dovetail.problem.observations import Observations
from dovetail.problem.residuals import FrfResiduals, ModelFrfs, Residual

_AT_END = 1e-6
"""Part of the range within which a value is at its end; more digits than any measurement distinguishes."""


@dataclass(frozen=True, eq=False)
class Problem(IdentificationProblem):
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
    starts : tuple of (n_params,) arrays
    network : callable, optional
        As in `IdentificationProblem`.
    changed : FrfModel, optional
        The model to compare instead of the assembly, with the same parameters.
    limit : TimeLimit
        The time for whatever is done with the problem, or with one that is derived from it.

    Raises
    ------
    MeasurementError
        The lines of an observed FRF are not those of the assembly.
    """

    assembly: Assembly
    observations: Observations
    unweighted: Observations | None = None
    starts: tuple[NDArray[np.float64], ...] = ()
    network: Callable[[], Estimate] | None = None
    changed: FrfModel | None = None
    limit: TimeLimit = NO_LIMIT

    def __post_init__(self) -> None:
        for observations in filter(None, (self.observations, self.unweighted)):
            for frf, response in zip(observations.frfs, self.assembly.each_response, strict=False):
                if not same_axes([frf.frequency], [response.frequency]):
                    raise MeasurementError(_other_lines(frf, response))

    @staticmethod
    def of(assembly: Assembly, measured: Frf | Sequence[Frf], unweighted: Frf | Sequence[Frf] | None = None) -> Problem:
        """Return the problem of one measured FRF, or of one for each response, in any quantities.

        Parameters
        ----------
        assembly : Assembly
            On the lines of each measured FRF, as from ``assembly.on(measured.frequency)``.
        measured : Frf or sequence of Frf
        unweighted : Frf or sequence of Frf, optional
            The same with their own random error, if the variance of `measured` represents weights.

        Raises
        ------
        MeasurementError
            There are more or fewer than responses, or their lines are not those of the assembly.
        """
        description = assembly.description
        own = None if unweighted is None else Observations.of(description, unweighted)
        return Problem(assembly, Observations.of(description, measured), own)

    @cached_property
    def model(self) -> ModelFrfs:
        """The FRFs of all responses as functions of the parameters."""
        return ModelFrfs.of(self.changed or self.assembly, self.limit)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The unknown parameters."""
        return self.assembly.parameters

    @property
    def judged(self) -> Problem:
        """The problem by which the model is judged: with the random error of the measurement, whatever the weights."""
        if self.unweighted is None:
            return self
        return Problem(self.assembly, self.unweighted, changed=self.changed, limit=self.limit)

    @property
    def each_response(self) -> tuple[Problem, ...]:
        """The problem of each response by itself, with all parameters."""
        if len(self.measured) == 1:
            return (self,)
        first, *further = self.assembly.each_response
        pairs = zip((first.at(0), *further), self.measured, strict=True)
        return tuple(Problem(alone, Observations((frf,))) for alone, frf in pairs)

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions of the ranges (..., p) to SI values."""
        return self.assembly.from_unit(fraction)

    def to_unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map SI values (..., p) to fractions of the ranges."""
        return self.assembly.to_unit(theta)

    @property
    def measured(self) -> tuple[Frf, ...]:
        """The observed FRFs in the quantities of the responses; none of a table of natural frequencies."""
        return self.observations.frfs

    @property
    def values(self) -> NDArray[np.complex128]:
        """The measured values of all responses, concatenated, or the numbers of the table."""
        return self.observations.values

    @cached_property
    def variance(self) -> NDArray[np.float64]:
        """(n_lines,) E|error|^2 of each measured value, known or estimated from the scatter from line to line."""
        return self.observations.variance()

    def power_delivered(self, variance: NDArray[np.float64]) -> float:
        """Return the share of the power at drive points that the structure delivers; a passive one only takes power up.

        Parameters
        ----------
        variance : (n_lines,) array
            Of all measured values.

        Returns
        -------
        float
            From 0 to 1, by the values that clearly exceed the random error. 0 if none does, and without drive points or
            phases, or where unknowns of the measurement chain turn the phase.
        """
        target, description = self.observations, self.assembly.description
        if description.calibrations:
            return 0.0
        responses = zip(target.frfs, description.responses, target.split(variance), strict=True)
        balances = [power_balance(frf, errors) for frf, response, errors in responses if response.is_drive_point]
        delivered, total = np.sum(balances, axis=0) if balances else (0.0, 0.0)
        return float(delivered / total) if total else 0.0

    def freedom(self, fraction: NDArray[np.float64], _linear: Linearisation) -> float:
        """Return the degrees of freedom of a fit (p,), with its residuals linearised."""
        return self.observations.residual_count(np.ones(len(self.values), dtype=np.bool_)) - len(fraction)

    def frf(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the model's FRFs (n, n_lines) at parameters (n, p) [SI]."""
        return self.model.frf(theta)

    def frf_jacobian(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return these FRFs and their derivatives (n, n_lines, p)."""
        return self.model.frf_jacobian(theta)

    def frf_at(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the model's FRFs (n_lines,) at one parameter vector (p,) [SI]."""
        return np.asarray(self.model.frf(theta[np.newaxis])[0])

    def residuals(self, residual: Residual) -> FrfResiduals:
        """Return residuals against the observations as functions of the parameters."""
        return FrfResiduals(self.model, residual)

    def logarithms(self, variance: NDArray[np.float64]) -> FrfResiduals:
        """Return the residuals of the amplitudes' logarithms, whose errors have a variance (n_lines,)."""
        return self.residuals(self.observations.logarithms(variance))

    def weighted(self, variance: NDArray[np.float64], used: NDArray[np.bool_] | None = None) -> FrfResiduals:
        """Return the residuals over the standard deviation of each line (n_lines,), of the lines `used`."""
        used = np.ones(len(variance), dtype=np.bool_) if used is None else used
        return self.residuals(self.observations.weighted(variance, used))

    def at(self, lines: NDArray[np.intp]) -> Problem:
        """Return the problem with some of the lines only (increasing indices), at least one of each response."""
        observations = self.observations.at(lines)
        axes = [frf.frequency for frf in observations.frfs]
        changed = None if self.changed is None else self.changed.on(*axes, chosen=True)
        return Problem(self.assembly.on(*axes, chosen=True), observations, changed=changed, limit=self.limit)

    def with_frfs(self, frfs: Sequence[Frf]) -> Problem:
        """Return the problem with other measured values on the same lines."""
        return Problem(self.assembly, Observations(tuple(frfs)), changed=self.changed, limit=self.limit)

    def with_assembly(self, assembly: Assembly) -> Problem:
        """Return the problem of the same observations with another model."""
        return replace(self, assembly=assembly, changed=None)

    def within(self, limit: TimeLimit) -> Problem:
        """Return the problem with another time limit."""
        return replace(self, limit=limit)

    def with_model(self, model: FrfModel) -> Problem:
        """Return the problem of the same observations with the FRFs of another model of the same parameters."""
        return replace(self, changed=model)


def _other_lines(frf: Frf, response: FrfModel) -> Fault:
    """Say that an FRF is on other lines than its response."""
    measured, described = (
        f"{len(axis)} lines from {axis[0]:.6g} to {axis[-1]:.6g} Hz" for axis in (frf.frequency, response.frequency)
    )
    problem = f"the measured FRF has {measured}, and the assembly '{response.description.name}' has {described}"
    if measured == described:
        problem += ", but between these they differ"
    remedy = "Take 'assembly.on(measured.frequency)', with one axis for each response, or 'dovetail.identify'."
    return Fault(frf.label or "measured", f"{problem}.", "the same lines", remedy)


class WithPrior(SumOfSquares):
    """Residuals of a measurement, followed by those of normal priors: the parameters' deviations from the means.

    Parameters
    ----------
    misfit : SumOfSquares
        Of fractions of the ranges.
    parameters : sequence of Parameter
    """

    def __init__(self, misfit: SumOfSquares, parameters: Sequence[Parameter]) -> None:
        self._misfit, self.limit = misfit, misfit.limit
        self._normal = [(column, p) for column, p in enumerate(parameters) if p.prior == "normal"]

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at fractions (n, p) of the ranges."""
        residuals = self._misfit.residuals(fraction)
        return np.concatenate([residuals, self._prior(fraction)[0]], axis=1) if self._normal else residuals

    def linearise(self, fraction: NDArray[np.float64]) -> Linearisation:
        """Return residuals and their derivatives at fractions (n, p) of the ranges."""
        linear = self._misfit.linearise(fraction)
        if not self._normal:
            return linear
        deviations, jacobian = self._prior(fraction)
        residuals = np.concatenate([linear.residuals, deviations], axis=1)
        return Linearisation(residuals, np.concatenate([linear.jacobian, jacobian], axis=2))

    def _prior(self, fraction: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        deviations = np.empty((len(fraction), len(self._normal)))
        jacobian = np.zeros((*fraction.shape, len(self._normal)))
        for row, (column, parameter) in enumerate(self._normal):
            deviations[:, row], jacobian[:, column, row] = parameter.normal_residual(fraction[:, column])
        return deviations, jacobian


def values_at(parameters: Sequence[Parameter], fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return SI values (..., p) at fractions of the ranges (..., p)."""
    return ParameterScales(parameters).from_unit(fraction)


def latin_hypercube(count: int, size: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return random points (count, size) in the unit cube, one in each of `count` slices of every coordinate.

    As by `scipy.stats.qmc.LatinHypercube`, whose module takes half a second to load and draws from a spawned generator.
    """
    within = random.uniform(size=(count, size))
    slices = np.tile(np.arange(1, count + 1), (size, 1))
    for fractions in slices:
        random.shuffle(fractions)
    return np.asarray((slices.T - within) / count)


def halton(count: int, size: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return points (count, size) of a randomised Halton sequence in the unit cube.

    As by `scipy.stats.qmc.Halton`, likewise.

    References
    ----------
    A. B. Owen, A randomized Halton algorithm in R (2017), arXiv:1706.02808.
    """
    return np.stack([_van_der_corput(count, base, random) for base in itertools.islice(_primes(), size)], axis=1)


def _van_der_corput(count: int, base: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return numbers (count,) from 0 to 1 with the digits of 0, 1, 2, ... in reverse order, permuted, to 54 bits."""
    points, numbers = np.zeros(count), np.arange(count)
    for place in range(1, math.ceil(54 / math.log2(base))):
        digits = np.arange(base)
        random.shuffle(digits)
        points += digits[numbers % base] * float(base) ** -place
        numbers //= base
    return points


def _primes() -> Iterator[int]:
    return (number for number in itertools.count(2) if all(number % n for n in range(2, math.isqrt(number) + 1)))


def fractions_within(parameters: Sequence[Parameter], theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fractions (..., p) of SI values, those outside of their ranges brought to the nearest end."""
    lower, upper = np.transpose([(parameter.lower, parameter.upper) for parameter in parameters])
    return np.clip(ParameterScales(parameters).to_unit(np.clip(theta, lower, upper)), 0.0, 1.0)


def bounds_reached(parameters: Sequence[Parameter], fraction: NDArray[np.float64]) -> dict[str, str]:
    """Return the parameters at a bound of their range, and at which, from fractions (n_params,) of the ranges."""
    values = [float(p.from_unit(part)) for p, part in zip(parameters, fraction, strict=True)]
    pairs = zip(parameters, values, strict=True)
    ends = {p.name: end_reached(value, p.lower, p.upper, p.scale) for p, value in pairs}
    return {name: end for name, end in ends.items() if end}


def end_reached(value: float, lower: float, upper: float, scale: Scale) -> str:
    """Return the end of a range, "lower" or "upper", at which a value is within rounding; empty if at neither.

    A value is at an end that it equals in the four digits that are shown, or within a millionth of the range.
    """
    shown, low, high = (f"{number:.4g}" for number in (value, lower, upper))
    with np.errstate(divide="ignore", invalid="ignore"):
        place = float(Parameter("value", "1", lower, upper, scale).to_unit(np.array(value)))
    if abs(place) <= _AT_END or (shown == low != high):
        return "lower"
    return "upper" if abs(place - 1.0) <= _AT_END or (shown == high != low) else ""
