"""The state of a watch: it takes one file after the other, and follows the parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.errors import Fault, ParameterError
from dovetail.monitoring.alarm import Detector, UsualDeviations, file_probability, log_evidence
from dovetail.monitoring.estimate import FileEstimate, KeptFile, estimate
from dovetail.monitoring.kalman import NEARBY_VARIANCE, Belief, RandomWalk, learn_walk
from dovetail.monitoring.reference import Reference
from dovetail.monitoring.residual_level import MeanResidual
from dovetail.problem.observations import Observations

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """Constants of the first files; chosen by their meaning, not on data."""

    first_step: float = 3e-3
    """Step of a random walk, in fractions of the range, before it is learned."""
    unsettled: float = 0.2
    """Part of the first files whose deviations are not used, since the parameters are hardly known before them."""
    contradicted: float = 1e-3
    """Probability of so much better a fit with other constants, below which a change has changed these too."""
    rounds: int = 2
    """How often the first files are taken again while the random walk is learned."""
    spare: int = 5
    """Files more than unknown numbers that the covariance of the deviations needs."""


_SETTINGS = Settings()


@dataclass(frozen=True)
class WatchOptions:
    """How a watch raises alarms.

    Parameters
    ----------
    false_alarms : float
        Rate at which alarms are raised though nothing has changed, per file.
    reference : int
        Number of files from which the steps of the random walk and the usual deviations are learned.

    Raises
    ------
    ParameterError
        One of them is out of its range.
    """

    false_alarms: float = 1e-3
    reference: int = 40

    def __post_init__(self) -> None:
        if not 1e-9 <= self.false_alarms <= 0.1:
            problem = f"{self.false_alarms:g} is not a rate of false alarms per file."
            raise ParameterError(Fault("false_alarms", problem, "from 1e-9 to 0.1"))
        if self.reference < 1:
            raise ParameterError(Fault("reference", f"{self.reference} is not a number of files.", "1 or more"))

    def check(self, parameters: int, free: int) -> None:
        """Make sure that there are enough files to learn from.

        Raises
        ------
        ParameterError
        """
        watched = parameters - free
        if not watched:
            problem = "every parameter is 'free': no file says anything about the next, so that nothing can change."
            remedy = "Give those that drift the role 'varying', and constant ones 'shared'."
            raise ParameterError(Fault("parameters", problem, remedy=remedy))
        least = int(np.ceil((watched + 1 + _SETTINGS.spare) / (1.0 - _SETTINGS.unsettled)))
        if self.reference < least:
            problem = f"{self.reference} files are too few to learn the deviations of {watched} parameters."
            raise ParameterError(Fault("reference", problem, f"{least} or more"))


@dataclass(frozen=True, eq=False)
class State:
    """What a watch knows after some files.

    Parameters
    ----------
    files : int
        Number of files.
    belief : Belief
        Of the parameters at the first test's covariates.
    walk : RandomWalk
    residual : MeanResidual
    usual : UsualDeviations or None
        Deviations of earlier files; None as long as the steps are learned.
    detector : Detector
    learning : tuple of KeptFile
        The files so far, as long as the steps are learned.
    """

    files: int
    belief: Belief
    walk: RandomWalk
    residual: MeanResidual
    usual: UsualDeviations | None
    detector: Detector
    learning: tuple[KeptFile, ...] = ()


@dataclass(frozen=True, eq=False)
class Step:
    """What one file adds.

    Parameters
    ----------
    state : State
        After the file.
    belief : Belief
        Of the parameters at the file's covariates.
    level : float
        Logarithm of the mean square of the new residual over the random error.
    level_deviation : float
        Of the level from those of earlier files, in their standard deviations; 0 for the first files.
    probability : float or None
        Of so large a deviation if nothing has changed; None for the first files.
    evidence : float
        Before it starts again after an alarm.
    alarm : bool
    change : (p,) array
        From the prediction, in fractions of the ranges.
    change_deviation : (p,) array
    """

    state: State
    belief: Belief
    level: float
    level_deviation: float
    probability: float | None
    evidence: float
    alarm: bool
    change: Array
    change_deviation: Array


@dataclass(frozen=True, eq=False)
class _Seen:
    """A file next to its prediction.

    Parameters
    ----------
    predicted : Belief
    fresh : FileEstimate
    level : float
    deviation : (d,) array
        From the prediction, in its standard deviations, and the level.
    """

    predicted: Belief
    fresh: FileEstimate
    level: float
    deviation: Array


class Tracker:
    """Follows the parameters from file to file.

    Parameters
    ----------
    reference : Reference
    options : WatchOptions

    Raises
    ------
    ParameterError
        There are too few files to learn from.
    """

    def __init__(self, reference: Reference, options: WatchOptions) -> None:
        self.reference, self.options = reference, options
        self._model = reference.model
        free = int(np.count_nonzero(self._model.is_free))
        options.check(len(reference.parameters), free)

    def start(self) -> State:
        """Return the state before the first file."""
        walk = self.reference.walk
        first = RandomWalk(walk.step * _SETTINGS.first_step, walk.is_free)
        residuals = len(self._model.line_of_residual)
        return State(
            0,
            Belief.about(self.reference.start),
            first,
            MeanResidual.none(residuals),
            None,
            Detector.new(),
        )

    def step(self, state: State, observations: Observations, covariates: dict[str, float]) -> Step:
        """Take one more file."""
        offset = self.reference.offset(covariates)
        seen = self._see(state, observations, offset)
        after = replace(
            state,
            files=state.files + 1,
            belief=seen.fresh.belief,
            residual=state.residual.with_file(seen.fresh.residuals),
        )
        usual = state.usual
        if usual is None:
            after = replace(after, learning=(*state.learning, KeptFile.of(observations, seen.fresh, offset)))
            if after.files == self.options.reference:
                after = self._learned(after)
            return self._made(state, after, seen, offset)
        statistic = usual.studentise(seen.deviation)
        detector = state.detector.with_file(log_evidence(*statistic))
        alarm = detector.evidence >= 1.0 / self.options.false_alarms
        if alarm:
            latest = self._anew(state, seen.predicted, observations, offset)
            seen = replace(seen, level=state.residual.level(latest.residuals, self._noise(latest)))
            residual = MeanResidual.none(len(latest.residuals)).with_file(latest.residuals)
            after = replace(after, belief=latest.belief, residual=residual, detector=Detector.new())
            after = replace(after, usual=usual.after_change())
        else:
            after = replace(after, usual=usual.with_file(seen.deviation), detector=detector)
        made = self._made(state, after, seen, offset)
        probability = file_probability(*statistic)
        return replace(made, probability=probability, evidence=detector.evidence, alarm=alarm)

    def _see(self, state: State, observations: Observations, offset: Array) -> _Seen:
        """Compare a file with its prediction."""
        predicted = state.walk.predict(state.belief)
        fresh = estimate(self._model, observations, predicted, offset, state.walk.noise_scale)
        level = state.residual.level(fresh.residuals, self._noise(fresh))
        innovation, factor = fresh.measurement.innovation(predicted, state.walk.noise_scale)
        whitened = scipy.linalg.solve_triangular(factor, innovation, lower=True)
        return _Seen(predicted, fresh, level, np.append(whitened, level))

    def _learned(self, state: State) -> State:
        """Return the state with the steps and the usual deviations of the first files, which are taken once more."""
        kept, walk, seen = state.learning, state.walk, list[_Seen]()
        files = [each.observations(self._model) for each in kept]
        for last in (False,) * _SETTINGS.rounds + (True,):
            after, seen = replace(self.start(), walk=walk), []
            for observations, each in zip(files, kept, strict=True):
                seen.append(self._see(after, observations, each.offset))
                residual = after.residual.with_file(seen[-1].fresh.residuals)
                after = replace(after, belief=seen[-1].fresh.belief, residual=residual)
            if not last:
                walk = learn_walk(self.start().belief, [one.fresh.measurement for one in seen], walk)
        settled = seen[int(_SETTINGS.unsettled * len(seen)) :]
        usual = UsualDeviations.of(np.array([one.deviation for one in settled]))
        return replace(after, files=state.files, usual=usual)

    def _anew(self, state: State, predicted: Belief, observations: Observations, offset: Array) -> FileEstimate:
        """Return what the file that raised an alarm says by itself: the level from which the next is predicted.

        If the file before was another measurement, such as one in another unit, the search from its parameters may end
        in a wrong minimum. Another search begins at the fit of the first test, and counts if its fit is clearly better.
        """
        found = self._nearby(state, predicted, observations, offset)
        first = Belief(self.reference.start, predicted.covariance)
        other = self._nearby(state, first, observations, offset)
        gain = found.measurement.squares - other.measurement.squares
        return other if gain > scipy.stats.chi2.isf(_SETTINGS.contradicted, len(first.mean)) else found

    def _nearby(self, state: State, predicted: Belief, observations: Observations, offset: Array) -> FileEstimate:
        """Return what a file says near a prediction; constants keep their values unless it contradicts them."""
        constant = ~(self._model.is_free | (state.walk.step > 0.0))
        scale = state.walk.noise_scale
        fresh = estimate(self._model, observations, self._reopened(predicted, ~constant), offset, scale)
        if constant.any():
            everything = self._reopened(predicted, np.ones_like(constant))
            freer = estimate(self._model, observations, everything, offset, scale)
            gain = fresh.measurement.squares - freer.measurement.squares
            if gain > scipy.stats.chi2.isf(_SETTINGS.contradicted, np.count_nonzero(constant)):
                return freer
        return fresh

    def _reopened(self, predicted: Belief, changed: NDArray[np.bool_]) -> Belief:
        """Return a prediction in which some parameters may have changed much."""
        return predicted.reset(changed & ~self._model.is_free, NEARBY_VARIANCE)

    def _made(self, before: State, after: State, seen: _Seen, offset: Array) -> Step:
        """Return a step without an alarm."""
        belief = Belief(np.clip(after.belief.mean + offset, 0.0, 1.0), after.belief.covariance)
        change = after.belief.mean - seen.predicted.mean
        deviation = np.sqrt(np.diag(after.belief.covariance) + np.diag(seen.predicted.covariance))
        usual = before.usual
        unusual = 0.0 if usual is None else usual.deviation_of_last(np.append(seen.deviation[:-1], seen.level))
        return Step(after, belief, seen.level, unusual, None, 0.0, False, change, deviation)

    def _noise(self, fresh: FileEstimate) -> Array:
        """Return the variance of each residual (m,) by the file's random error, over that of the first measurement."""
        ratio = np.where(self._model.used, fresh.variance / self._model.random_variance, 0.0)
        return np.asarray(ratio[self._model.line_of_residual])


def state_from(plain: dict[str, Any]) -> State:
    """Return the state from plain values with arrays, as `from_plain` returns them.

    Raises
    ------
    KeyError, TypeError
        Something is missing or has another type.
    """
    return State(
        int(plain["files"]),
        Belief(**plain["belief"]),
        RandomWalk(**plain["walk"]),
        MeanResidual(**plain["residual"]),
        None if plain["usual"] is None else UsualDeviations(**plain["usual"]),
        Detector(**plain["detector"]),
        tuple(KeptFile(**one) for one in plain["learning"]),
    )
