"""Quick fits of a model to a measurement, either of them possibly changed, and how well the two then agree."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, FrfModel
from dovetail.frf import Frf, coherence_spectrum
from dovetail.inference.adequacy.perturbations import Perturbation, PerturbedResiduals, list_perturbations
from dovetail.inference.fitting import Fit
from dovetail.inference.fitting.lines import SearchLines, lines_represented
from dovetail.inference.posterior.likelihood import MarginalisedResiduals
from dovetail.problem import Problem
from dovetail.problem.definition import latin_hypercube
from dovetail.problem.least_squares import SumOfSquares, minimise
from dovetail.problem.observations import Observations
from dovetail.problem.residuals import Residual


@dataclass(frozen=True)
class Settings:
    """How the joint is fitted when measurement or model are changed."""

    tolerance: float = 0.1
    """Decrease of the sum of squares, per step, that ends a search."""
    steps: int = 40
    """Most steps of a search."""
    passes: int = 3
    """Fits of an amount together with the joint, the first of them of logarithms."""
    reweighted: int = 6
    """Largest number of times that the fit is repeated with weights from its own typical residual."""
    settled: float = 0.02
    """Decrease of the misfit below which these repetitions end."""
    hopeless: float = 1.0
    """Misfit above that of the unchanged model and measurement beyond which repetitions do not help any more."""
    candidates: int = 256
    """Random joints, of which those with the most similar FRFs are starts of a search."""
    starts: int = 3
    """Number of those starts."""
    error: float = 0.1
    """Relative error that every line is allowed, so that none dominates."""
    free: float = 100.0
    """Standard deviation of an unknown gain or power of the frequency, in logarithms: practically unconstrained."""
    tiny: float = 10.0
    """Ratio of measurement to model above which residuals count more. Peaks that are slightly misplaced stay below."""
    floor: float = 3.0
    """Standard deviations of random error below which a measured value is too uncertain for this ratio."""


_SETTINGS = Settings()

MOST_DELIVERED = 0.9
"""Share of the power at drive points that is delivered above which a sign or a phase is certainly wrong."""


@dataclass(frozen=True, eq=False)
class QuickFit:
    """A fit: the best parameters of the joint, and how well model and measurement agree with them.

    Parameters
    ----------
    theta : (p,) array
        SI.
    misfit : float
        Mean over the lines of log(1 + |residual|^2 / variance), which is 0.6 for noise. It grows with the logarithm of
        typical residuals, so that neither peaks nor antiresonances dominate. Where the model is less than a tenth of
        the measurement, the residual is multiplied by the measurement over ten times the model.
    coherence : float
        Mean coherence of model and measurement, over all lines of the measurement as far as those of the fit show it.
    residual : float
        Median over the lines of |residual| / |measured|.
    values : (n_lines,) complex array
        The model's FRFs.
    """

    theta: NDArray[np.float64]
    misfit: float
    coherence: float
    residual: float
    values: NDArray[np.complex128]


class QuickFits:
    """A measurement on few lines, among them those around each resonance, and fits to it.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        Its time limit is that of every fit, which ends within one step.

    Attributes
    ----------
    recorded : tuple of str
        Quantity in which each FRF was measured.
    is_active : bool
        Whether the measured structure delivers power, which no passive structure does; judged on all lines.
    """

    def __init__(self, problem: Problem, fit: Fit) -> None:
        target = problem.observations
        self.is_active = problem.power_delivered(fit.variance) > MOST_DELIVERED
        lines = SearchLines(target, fit.variance).few
        lines = lines[fit.used[lines] & (target.amplitude[lines] > 0.0)]  # an exact zero has no logarithm
        self.best = fit.theta
        self.problem = problem.at(lines)
        self.recorded = target.recorded_quantities
        self.relative = fit.variance[lines] / np.maximum(self.target.amplitude**2, fit.variance[lines])
        self._used = np.ones(len(lines), dtype=np.bool_)
        self._represented = lines_represented(target, lines)
        self._most = np.inf

    @property
    def lines(self) -> int:
        """Number of lines on which fits are compared."""
        return len(self.relative)

    @property
    def late(self) -> bool:
        """Whether the time is over."""
        return self.problem.limit.is_over

    @property
    def assembly(self) -> Assembly:
        """The described model on these lines."""
        return self.problem.assembly

    @property
    def target(self) -> Observations:
        """The measurement on these lines."""
        return self.problem.observations

    @cached_property
    def perturbations(self) -> tuple[Perturbation, ...]:
        """The deviations from the description that are tried."""
        return list_perturbations(self.assembly)

    def with_responses(self, numbers: Sequence[int]) -> QuickFits:
        """Return the fits of some of the responses alone."""
        counts, chosen = self.target.counts, np.isin(np.arange(len(self.target.frfs)), numbers)
        part = copy(self)
        frfs = tuple(self.target.frfs[number] for number in numbers)
        part.recorded = tuple(self.recorded[number] for number in numbers)
        responses = tuple(self.assembly.description.responses[number] for number in numbers)
        alone = self.assembly.with_description(replace(self.assembly.description, responses=responses))
        on_axes = alone.on(*(frf.frequency for frf in frfs))
        part.problem = Problem(on_axes, Observations(frfs), limit=self.problem.limit)
        part.relative = self.relative[np.repeat(chosen, counts)]
        part._used = self._used[np.repeat(chosen, counts)]
        part._represented = self._represented[np.repeat(chosen, counts)]
        part._most = np.inf
        return part

    @cached_property
    def unchanged(self) -> QuickFit:
        """The fit with nothing changed."""
        quick = self.fit(self.problem, self.starts)
        self._most = quick.misfit + _SETTINGS.hopeless
        return quick

    @cached_property
    def starts(self) -> list[NDArray[np.float64]]:
        """Parameters (p,) [SI] that may be right apart from a phase, or from gain and quantity."""
        return [self.best, self.shape, self.search(self.assembly, self.shape)]

    @cached_property
    def shape(self) -> NDArray[np.float64]:
        """(p,) parameters [SI] whose amplitudes fit best up to a gain and a power of the frequency."""
        residual = self._logarithms(self._amplitudes)
        axis = np.log(self.target.frequency)
        free = _SETTINGS.free * residual.weight * np.stack([np.ones_like(axis), axis - axis.mean()])
        problem = MarginalisedResiduals(self.problem.residuals(residual), free)
        starts = np.concatenate([self.assembly.to_unit(self.best)[np.newaxis], self._most_similar(problem)])
        return np.asarray(self.assembly.from_unit(self._lowest(problem, starts)))

    def search(self, model: FrfModel, *starts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameters (p,) [SI] whose amplitudes fit best with another model.

        The search begins at `starts` and at the random joints with the most similar amplitudes.
        """
        problem = self.problem.with_model(model).residuals(self._logarithms(self._amplitudes))
        points = np.concatenate([model.to_unit(np.array([self.best, *starts])), self._most_similar(problem)])
        return np.asarray(model.from_unit(self._lowest(problem, points)))

    def fit(self, problem: Problem, starts: Sequence[NDArray[np.float64]]) -> QuickFit:
        """Fit a model to measured FRFs: first to their logarithms, then to the values, weighted by typical residuals.

        Parameters
        ----------
        problem : Problem
            On these lines; model or measurement may be changed.
        starts : sequence of (p,) arrays
            SI.
        """
        target, positions = problem.observations, problem.to_unit(np.array(starts))
        position = self._lowest(problem.residuals(self._logarithms(target)), positions)
        best = self._trial(problem, problem.from_unit(position))
        for _ in range(_SETTINGS.reweighted if best.misfit < self._most else 0):
            misfit = problem.residuals(self._weighted(target, best.values))
            position = self._lowest(misfit, problem.to_unit(best.theta)[np.newaxis])
            before, now = best, self._trial(problem, problem.from_unit(position))
            best = min(before, now, key=lambda quick: quick.misfit)
            if now.misfit > before.misfit - _SETTINGS.settled or self.late:
                break
        return best

    def fit_freely(
        self, frfs: Sequence[Frf], starts: Sequence[NDArray[np.float64]], change: NDArray[np.complex128]
    ) -> tuple[QuickFit, float]:
        """Fit the joint together with an unknown amount of a change of the measurement's logarithms.

        In the first pass all lines count equally, which is robust. In the others they are weighted by noise and typical
        residuals, which is as precise as the measurement, but underestimates the amount where the model is wrong. The
        pass with the lowest misfit is returned.

        Parameters
        ----------
        frfs : sequence of Frf
        starts : sequence of (p,) arrays
            SI.
        change : (n_lines,) complex array
            What an amount of 1 adds to the logarithm of the measured values.

        Returns
        -------
        QuickFit
            With the measurement changed.
        float
            The amount.
        """
        amount = 0.0
        target, position = Observations(tuple(frfs)), self.assembly.to_unit(np.array(starts))
        residual: Residual = self._logarithms(target)
        ends: list[tuple[QuickFit, float]] = []
        for _ in range(_SETTINGS.passes):
            values = target.values[np.newaxis]
            direction = residual.jacobian(values, (change * values)[:, np.newaxis])[0]
            problem = MarginalisedResiduals(self.problem.residuals(residual), _SETTINGS.free * direction)
            position = self._lowest(problem, position)[np.newaxis]
            theta = self.assembly.from_unit(position[0])
            frf = self.values(theta)[np.newaxis]
            remaining = residual.of(frf)[0]
            step = -float(remaining @ direction[0] / (direction[0] @ direction[0]))
            amount += step
            changed = zip(target.frfs, target.split(target.values * np.exp(-step * change)), strict=True)
            target = Observations(tuple(replace(measured, values=values) for measured, values in changed))
            ends.append((self._judged(target, theta, frf[0]), amount))
            residual = self._weighted(target, frf[0])
        return min(ends, key=lambda end: end[0].misfit)

    def fit_amount(
        self, perturbation: Perturbation, theta: NDArray[np.float64], amount: float
    ) -> tuple[float, NDArray[np.float64]]:
        """Return the amount of a perturbation and the parameters (p,) [SI] that fit best together."""
        residual: Residual = self.residual()
        for _ in range(_SETTINGS.passes):
            problem = PerturbedResiduals(perturbation, residual, self.problem.limit)
            end = self._lowest(problem, problem.position(self.assembly.to_unit(theta), amount))
            amount, theta = problem.amount(end), self.assembly.from_unit(end[:-1])
            quick = self._trial(self.problem.with_model(perturbation.apply(amount)), theta)
            if quick.misfit > self._most:
                break
            residual = self._weighted(self.target, quick.values)
        return amount, theta

    def judged(self, theta: NDArray[np.float64], values: NDArray[np.complex128]) -> QuickFit:
        """Return how well values (n_lines,) agree with the unchanged measurement."""
        return self._judged(self.target, theta, values)

    def residual(self) -> LogRatio:
        """Return the logarithmic residuals of the unchanged measurement."""
        return self._logarithms(self.target)

    def values(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the FRFs (n_lines,) at parameters (p,) [SI]."""
        return self.problem.frf_at(theta)

    @property
    def _amplitudes(self) -> Observations:
        return Observations(tuple(replace(frf, values=np.abs(frf.values), has_phase=False) for frf in self.target.frfs))

    def _most_similar(self, problem: SumOfSquares) -> NDArray[np.float64]:
        """Return the points (n, p) with the smallest sums of squares among many random ones in the unit cube."""
        points = latin_hypercube(_SETTINGS.candidates, len(self.best), np.random.default_rng(0).spawn(1)[0])
        order = np.argsort(np.sum(problem.residuals(points) ** 2, axis=1))
        return np.asarray(points[order[: _SETTINGS.starts]])

    def _lowest(self, problem: SumOfSquares, starts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the end (p,) of the best of several searches."""
        minima = minimise(problem, starts, tolerance=_SETTINGS.tolerance, most_steps=_SETTINGS.steps)
        return np.asarray(minima.position[np.argmin(minima.cost)])

    def _logarithms(self, target: Observations) -> LogRatio:
        return LogRatio.against(target.values, self.relative, all(frf.has_phase for frf in target.frfs))

    def _variance(self, target: Observations) -> NDArray[np.float64]:
        return np.asarray(self.relative * target.amplitude**2)

    def _weighted(self, target: Observations, values: NDArray[np.complex128]) -> Residual:
        """Return residuals weighted by noise and by the typical relative deviation of values (n_lines,)."""
        variance, size = self._variance(target), np.abs(values) ** 2
        typical = float(np.median(np.maximum(target.squares(values) - variance, 0.0) / size))
        return target.weighted(variance + typical * size, self._used)

    def _trial(self, problem: Problem, theta: NDArray[np.float64]) -> QuickFit:
        return self._judged(problem.observations, theta, problem.frf_at(theta))

    def _judged(self, target: Observations, theta: NDArray[np.float64], values: NDArray[np.complex128]) -> QuickFit:
        measured = target.values
        variance = self._variance(target)
        least = np.maximum(_SETTINGS.tiny * np.abs(values), _SETTINGS.floor * np.sqrt(variance))
        squares = target.squares(values)
        residual = float(np.median(np.sqrt(squares) / target.amplitude))
        squares = squares * np.maximum(1.0, np.abs(measured) / least) ** 2
        misfit = float(np.mean(np.log1p(squares / variance)))
        pair = [measured, values]
        if not all(frf.has_phase for frf in target.frfs):
            pair = [np.abs(part).astype(complex) for part in pair]
        coherence = float(np.average(coherence_spectrum(*pair), weights=self._represented))
        return QuickFit(theta, misfit, coherence, residual, values)


@dataclass(frozen=True, eq=False)
class LogRatio(Residual):
    """Logarithm of the ratio of FRFs to measured ones: the real parts, then, with phases, the imaginary parts.

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
        """Return the residuals against measured values (f,) of a relative variance (f,), which is 1 for pure noise."""
        return LogRatio(values, 1.0 / np.hypot(_SETTINGS.error, np.sqrt(relative / 2.0)), has_phase)

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        return self.weighted(np.log(frf / self.measured))

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        return self.weighted(frf_jacobian / frf[:, np.newaxis])

    def weighted(self, logarithms: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the weighted residuals (..., m) of logarithms (..., f)."""
        if not self.has_phase:
            return np.asarray(logarithms.real * self.weight)
        return np.concatenate([logarithms.real * self.weight, logarithms.imag * self.weight], axis=-1)
