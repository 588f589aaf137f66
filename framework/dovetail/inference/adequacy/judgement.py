"""The judgement of a fit: to the noise, or with errors of the model of some size, and what would explain them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, Importance, Note, ParameterError, listing
from dovetail.inference.adequacy.causes import CAUSE_SECONDS, find_causes
from dovetail.inference.adequacy.error_effects import ErrorEffects
from dovetail.inference.adequacy.found_errors import find_errors
from dovetail.inference.adequacy.modal_errors import assess_modes
from dovetail.inference.adequacy.model_error_size import (
    FitWithError,
    fit_with_error,
)
from dovetail.inference.adequacy.quick_fits import MOST_DELIVERED
from dovetail.inference.adequacy.verdict import (
    GOOD,
    NO_TIME,
    NOTHING_SHOWN,
    ROUGH,
    TOO_FEW_VALUES,
    Adequacy,
    word_for,
)
from dovetail.inference.fitting import Fit, refine
from dovetail.inference.fitting.fit import is_noise, shows_structure
from dovetail.inference.fitting.whiteness import find_deviating_bands
from dovetail.inference.posterior import typical_model_error
from dovetail.inference.posterior.model_error import ModelError
from dovetail.interfaces import Progress, logged, silent
from dovetail.problem import Problem
from dovetail.problem.definition import bounds_reached
from dovetail.problem.modal_observations import ModalProblem
from dovetail.problem.observations import Observations


@dataclass(frozen=True)
class Settings:
    """When a fit is no longer to the noise."""

    fewest_lines: int = 3
    """Of one FRF, in which a resonance shows."""
    compensates: float = 0.5
    """Relative change of a parameter, over that of a gain that it makes up for, above which it is named."""
    uncompensated: float = 1e-3
    """Part of a gain that parameters leave as a residual above which they do not make up for it."""
    independent: float = 1e-6
    """Ratio of singular values below which parameters have the same effect."""
    phase: float = 0.02
    """Error of the phase [rad] that is worth a sentence."""
    many_searches: int = 5
    few_agree: float = 0.2
    """Number of searches, and part of them that end in the same fit, for a warning about it. Chosen on measurements of
    random structures: the seeds 4242, 7001, 8123 and 20261127 of the benchmark of genuine measurements."""
    many_values: int = 40
    too_small: float = 0.1
    """Degrees of freedom, and the chi-squared of each below which the given random error is reported as too large."""
    exceeds: float = 2.0
    """Ratio of the error that the measurement shows to the one allowed above which this is reported."""


_SETTINGS = Settings()

_LATE = "The time for causes ended before all were tried; `cause_seconds=` gives more."


def check_limits(model_error: float | None, cause_seconds: float = 0.0) -> None:
    """Make sure that the allowed error of the model and the time for causes are valid.

    Raises
    ------
    ParameterError
    """
    if model_error is not None and not (isinstance(model_error, Real) and 0.0 <= model_error < 1.0):
        raise ParameterError(Fault("model_error", f"{model_error!r:.40} is not a relative error.", "from 0 to 1"))
    if not (isinstance(cause_seconds, Real) and cause_seconds >= 0.0):
        raise ParameterError(Fault("cause_seconds", f"{cause_seconds!r:.40} s is not a time.", "0, for none, or more"))


class JudgedFit(NamedTuple):
    """A fit, and how well the model explains the measurement with it.

    Parameters
    ----------
    fit : Fit
        With the errors that the model turned out to have, if it does not reach the noise.
    adequacy : Adequacy
    """

    fit: Fit
    adequacy: Adequacy

    @property
    def is_trustworthy(self) -> bool:
        """Whether the numbers can be trusted."""
        return self.adequacy.fits


@dataclass(frozen=True)
class JudgementOptions:
    """What a model is allowed, and how long causes of a misfit are searched for.

    Parameters
    ----------
    model_error : float, optional
        Relative error of natural frequencies that the model is allowed; by default the one that the measurement shows.
    cause_seconds : float
        Time [s] after which no further cause of a misfit is tried; with 0 none is.
    good, rough : ModelError
        The largest errors of a model that counts as *good*, and as *rough*; with larger ones it *does not fit*.

    Raises
    ------
    ParameterError
        A value is out of its range.
    """

    model_error: float | None = None
    cause_seconds: float = CAUSE_SECONDS
    good: ModelError = GOOD
    rough: ModelError = ROUGH

    def __post_init__(self) -> None:
        check_limits(self.model_error, self.cause_seconds)
        for name, limit in (("good", self.good), ("rough", self.rough)):
            if not isinstance(limit, ModelError) or any(np.isnan(size) for size in vars(limit).values()):
                raise ParameterError(Fault(name, f"{limit!r:.40} is not a size of errors.", "a ModelError without NaN"))
        if any(size > getattr(self.rough, kind) for kind, size in vars(self.good).items()):
            raise ParameterError(Fault("good", "it allows larger errors than 'rough'.", "smaller or equal ones"))


def assess(
    problem: Problem, fit: Fit, options: JudgementOptions, *, progress: Progress = silent
) -> tuple[Adequacy, Fit]:
    """Judge how well a fit explains a measurement, and refit with the errors that the model turns out to have.

    Causes of a misfit are not searched for.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        Of the same measurement.
    options : JudgementOptions
    progress : Progress

    Returns
    -------
    Adequacy
    Fit
        The given fit if it is to the noise and no error is allowed.
    """
    target, model_error = problem.observations, options.model_error
    if isinstance(problem, ModalProblem):
        if problem.limit.is_over:
            return Adequacy("not judged", allowed=model_error, reasons=(NO_TIME,)), fit
        return assess_modes(problem, fit, model_error, (options.good, options.rough))
    noise = is_noise(problem, fit)
    remarks = (*_remarks(problem, fit, None), *(_reached_by_few(fit) if noise else ()))
    if not shows_structure(target, fit, fits=noise):
        return Adequacy("does not fit", allowed=model_error, reasons=(NOTHING_SHOWN,)), fit
    if noise and target.residual_count(fit.used) <= len(fit.theta):
        return Adequacy("not judged", allowed=model_error, reasons=(TOO_FEW_VALUES, *remarks)), fit
    if noise and not model_error:
        return Adequacy("to the noise", allowed=model_error, reasons=remarks), fit
    if problem.limit.is_over:
        return Adequacy("not judged", allowed=model_error, reasons=(NO_TIME,)), fit
    progress("model error", 0, 1)
    with logged(__name__, "errors of the model"):
        errors = None if noise else find_errors(problem, fit, progress)
        allowed = None if model_error is None else typical_model_error(model_error)
        used = None if errors is None else errors.fit
        if allowed is not None:
            used = fit_with_error(ErrorEffects(problem, fit), allowed)
    assert used is not None
    at_bounds = bounds_reached(problem.parameters, used.fraction)
    theta = problem.from_unit(used.fraction)
    refitted = replace(fit, theta=theta, information=used.information, at_bounds=at_bounds)
    if errors is None:
        return Adequacy("to the noise", allowed=model_error, reasons=remarks), refitted
    estimated, shown = errors.fit, replace(errors.fit, size=errors.size)
    remarks = tuple(_remarks(problem, refitted, errors.in_intervals if errors.phases else None))
    delivered = problem.power_delivered(fit.variance)
    adequacy = Adequacy(
        "does not fit" if delivered > MOST_DELIVERED else word_for(errors.shown, options.good, options.rough),
        errors.size,
        model_error,
        in_intervals=errors.in_intervals if model_error is None else None,
        reasons=(
            *_phases(target, errors.phases),
            *_reasons(fit, shown, model_error, delivered),
            *remarks,
        ),
        bands=_bands(target, fit, estimated.values),
    )
    return adequacy, refitted


def judge(
    problem: Problem, fit: Fit, options: JudgementOptions | None = None, *, seed: int = 0, progress: Progress = silent
) -> JudgedFit:
    """Judge how well a model explains a measurement, by its random error even if lines are weighted otherwise.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        Of the same measurement.
    options : JudgementOptions, optional
    seed : int
        Of the starts of the fit that is judged instead if lines are weighted.
    progress : Progress

    Returns
    -------
    JudgedFit
        With weights, the adequacy is that of a fit by the random error, and the fit has the given parameters with their
        chi-squared over the random error.

    Raises
    ------
    ParameterError
        The fit is of another problem.
    """
    fit.check_belongs_to(problem)
    options = options or JudgementOptions()
    judgement = judge_without_causes(problem, fit, options, seed=seed, progress=progress)
    adequacy = judgement.with_causes(judgement.judged.adequacy, options, progress)
    return judgement.judged._replace(adequacy=adequacy)


@dataclass(frozen=True, eq=False)
class Judgement:
    """A judged fit, and what causes of its misfit are searched with.

    Parameters
    ----------
    judged : JudgedFit
    problem : Problem
        By whose random error it was judged.
    fit : Fit
        Of that problem.
    """

    judged: JudgedFit
    problem: Problem
    fit: Fit

    def with_causes(self, adequacy: Adequacy, options: JudgementOptions, progress: Progress = silent) -> Adequacy:
        """Return an adequacy of this fit with the causes of a misfit, if the model has errors that causes can explain.

        This is the first work to be left out where time is short.
        """
        seconds = options.cause_seconds
        if adequacy.size is None or not seconds or isinstance(self.problem, ModalProblem):
            return adequacy
        limit = self.problem.limit
        if limit.is_over:
            limit.leave_out("causes of the misfit, of which none was tried")
            return adequacy
        own = limit.at_most(seconds)
        with logged(__name__, "causes of the misfit"):
            causes = find_causes(self.problem.within(own), self.fit, seconds=seconds, progress=progress)
        if limit.is_over:
            limit.leave_out("causes of the misfit, of which not all were tried")
        late = (Note(_LATE, Importance.DETAIL),) if own.is_over and not limit.is_over else ()
        return replace(adequacy, causes=causes, reasons=(*adequacy.reasons, *late))


def judge_without_causes(
    problem: Problem, fit: Fit, options: JudgementOptions, *, seed: int = 0, progress: Progress = silent
) -> Judgement:
    """Judge how well a model explains a measurement, as `judge` does, without the causes of a misfit."""
    if problem.unweighted is None:
        adequacy, refitted = assess(problem, fit, options, progress=progress)
        return Judgement(JudgedFit(refitted, adequacy), problem, refitted)
    unweighted = problem.judged
    judged = refine(unweighted, [fit.theta], seed=seed, progress=progress)
    adequacy, refitted = assess(unweighted, judged, options, progress=progress)
    residual = unweighted.observations.weighted(judged.variance, judged.used)
    squares = float(np.sum(residual.of(unweighted.frf_at(fit.theta)[np.newaxis]) ** 2))
    with_own_error = replace(
        fit,
        chi_squared=squares / judged.degrees_of_freedom,
        degrees_of_freedom=judged.degrees_of_freedom,
        variance_known=judged.variance_known,
        variance_assumed=judged.variance_assumed,
    )
    return Judgement(JudgedFit(with_own_error, adequacy), unweighted, refitted)


def _remarks(problem: Problem, fit: Fit, in_intervals: ModelError | None) -> Iterator[str]:
    """Yield what a measurement cannot show, however well the model fits, as sentences."""
    target = problem.observations
    if max(target.counts) < _SETTINGS.fewest_lines:
        yield "So few lines show no resonance: intervals allow for no error of natural frequencies or damping."
    if fit.variance_assumed:
        yield (
            "So few lines do not show their random error: intervals allow for up to 10 % of the largest value. "
            "Give the variance of the measurement, or its coherence and averages."
        )
    if fit.variance_known and fit.degrees_of_freedom >= _SETTINGS.many_values and fit.chi_squared < _SETTINGS.too_small:
        size = "much larger than" if fit.chi_squared <= 0 else f"{fit.chi_squared**-0.5:.2g} times"
        yield (
            f"The random error that the measurement gives is {size} that of the residuals, and intervals are as wide "
            "as it says. Check its variance (the mean square of the error), or its coherence and averages."
        )
    compensating = _compensating_gain(problem, fit.theta) if target.residual_count(fit.used) > len(fit.theta) else []
    if compensating:
        shown = "no interval shows it"
        if in_intervals is not None:
            shown = f"the intervals allow for {100.0 * in_intervals.magnitude:.2g} % of it (a standard deviation)"
        yield (
            f"The measurement does not reveal its own gain: if that is wrong, {listing(compensating)} are wrong by as "
            f"much, and {shown}. State a mass or a stiffness that is known, or measure with a known mass added."
        )


def _compensating_gain(problem: Problem, theta: NDArray[np.float64]) -> list[str]:
    """Return the parameters that compensate for a wrong gain, as where all masses are unknown; none if a gain is."""
    values, derivatives = (array[0] for array in problem.model.frf_jacobian(theta[np.newaxis]))
    size = np.maximum(np.abs(values), np.finfo(float).tiny)
    gain, columns = (
        np.concatenate([part.real, part.imag]) for part in (values / size, derivatives * theta / size[:, None])
    )
    share = np.linalg.lstsq(columns, gain, rcond=_SETTINGS.independent)[0]
    parameters, gains = zip(problem.parameters, share, strict=True), problem.assembly.description.unknown_gains
    compensating = [parameter for parameter, part in parameters if abs(part) > _SETTINGS.compensates]
    is_known = any(parameter.prior == "normal" or parameter.name in gains for parameter in compensating)
    remainder = np.linalg.norm(columns @ share - gain) / np.linalg.norm(gain)
    return [] if is_known or remainder > _SETTINGS.uncompensated else [parameter.name for parameter in compensating]


def _reached_by_few(fit: Fit) -> Iterator[str]:
    """Yield a warning about a fit to the noise in which few of many searches ended: another one may be right."""
    if fit.starts >= _SETTINGS.many_searches and fit.agreeing < _SETTINGS.few_agree * fit.starts:
        yield (
            f"Only {fit.agreeing} of {fit.starts} searches ended in this fit, and none in a better one. It reaches the "
            "noise, but a better fit may exist, with other values: narrow the ranges, or give a start near the values "
            "that you expect."
        )


def _reasons(fit: Fit, estimated: FitWithError, allowed: float | None, delivered: float) -> Iterator[str]:
    """Yield further remarks on a measurement and on a fit that does not reach its noise, as sentences."""
    if delivered > MOST_DELIVERED:
        yield Note(
            f"As measured, the structure delivers {100.0 * delivered:.0f} % of the power where it is driven, which no "
            "passive structure does: a sign or a phase is wrong.",
            Importance.DECISIVE,
        )
    needed = estimated.size.natural_frequency
    if allowed is not None and needed > _SETTINGS.exceeds * allowed:
        yield (
            f"The measurement shows errors of natural frequencies of {100.0 * needed:.2g} %, more than the "
            f"{100.0 * allowed:.2g} % that are allowed."
        )
    if fit.starts:
        repeated = f"Of {fit.starts} searches {fit.agreeing} ended in the same fit, none in a better one."
        yield Note(repeated, Importance.DETAIL)


def _phases(target: Observations, phases: tuple[float, ...]) -> Iterator[str]:
    """Yield by how much each measurement is turned, if that is known."""
    for label, phase in zip(_places(target), phases, strict=False):
        if abs(phase) > _SETTINGS.phase:
            which = "ahead of" if phase > 0.0 else "behind"
            yield (
                f"The measured phase{label} is {np.degrees(abs(phase)):.2g} degrees {which} the model's on all lines: "
                "a channel is turned, or the response is delayed."
            )


def _places(target: Observations) -> list[str]:
    """Return words for each measurement if there are several."""
    return [f" of measurement {n}" if len(target.frfs) > 1 else "" for n in range(1, len(target.frfs) + 1)]


def _bands(target: Observations, fit: Fit, values: NDArray[np.complex128]) -> tuple[tuple[float, float], ...]:
    """Return the bands in which a fit deviates, response by response."""
    residuals = target.weighted(fit.variance, fit.used).of(values[np.newaxis])[0]
    pairs = zip(target.frfs, target.by_line(residuals), strict=True)
    return tuple(band for frf, block in pairs for band in find_deviating_bands(frf.frequency, block))
