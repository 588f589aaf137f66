"""How a method of identification is applied: problem, estimate, judgement, posterior, result."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, Theta
from dovetail.errors import Fault, Importance, MeasurementError, Note, PluginError, listing
from dovetail.identification.measured_lines import MeasuredLines
from dovetail.identification.measured_modes import MeasuredModes
from dovetail.identification.parameters import ROUNDING, is_in_range
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification
from dovetail.inference.adequacy import Adequacy
from dovetail.inference.adequacy.judgement import JudgedFit, Judgement, JudgementOptions, judge_without_causes
from dovetail.inference.fitting import Fit, fit_at, refine
from dovetail.inference.posterior import ModelError, Posterior
from dovetail.inference.posterior.verdicts import VERDICT_LIMITS, VerdictLimits
from dovetail.interfaces import (
    NO_LIMIT,
    CutShort,
    Estimate,
    IdentificationMethod,
    Progress,
    TimeLimit,
    plugin_errors,
    silent,
)
from dovetail.interfaces.component import check_contract, component_label
from dovetail.network.bundle import TrainedNetwork
from dovetail.network.pipeline import FEWEST_DRAWS
from dovetail.problem import Problem
from dovetail.problem.definition import fractions_within
from dovetail.provenance import provenance, source_of

_LEAST_GAIN = 25.0
"""Decrease of the sum of squares, per parameter, from which another fit is clearly better: five standard deviations."""
_LEAST_PART = 0.5
"""The same in parts of the better fit's sum of squares, which errors of the model make large for any fit."""
_SAME_FRACTION = 1e-6
"""Rounding that fractions of ranges and sums of weights may have."""
_CANNOT_JUDGE = (
    "This model cannot judge whether the measurement resembles its training data, since it has several "
    "responses: use the method 'refined' to be sure."
)


@dataclass(frozen=True)
class Application:
    """A method, and what it is applied with.

    Parameters
    ----------
    method : IdentificationMethod
    trained : TrainedNetwork, optional
    start : (n_params,) array or mapping of names to values, optional
        SI; where a search starts.
    judgement : JudgementOptions
    limits : VerdictLimits
    seed : int
    progress : Progress
    limit : TimeLimit
        The time for all of it.
    on_problem : callable, optional
        Called with the problem of measured lines before the method starts.
    """

    method: IdentificationMethod[Problem]
    trained: TrainedNetwork | None = None
    start: Theta = None
    judgement: JudgementOptions = field(default_factory=JudgementOptions)
    limits: VerdictLimits = VERDICT_LIMITS
    seed: int = 0
    progress: Progress = silent
    limit: TimeLimit = NO_LIMIT
    on_problem: Callable[[Problem], None] | None = None

    @property
    def label(self) -> str:
        """The method's name in messages."""
        return component_label(self.method)

    def to(self, measured: MeasuredLines | MeasuredModes) -> Identification:
        """Identify the parameters from a measurement.

        Raises
        ------
        MeasurementError
            The network does not cover the measurement, or has no finite answer, and the method needs it.
        PluginError
            The method fails, or does not return finite parameters within their ranges.
        """
        result = self._complete_result(measured)
        if result.posterior is not None:
            result = replace(result, posterior=replace(result.posterior, limits=self.limits))
        cut = CutShort.of(self.limit)
        return result if cut is None else replace(result, cut_short=cut, warnings=(*result.warnings, cut.note))

    def _checked_start(self, assembly: Assembly) -> NDArray[np.float64]:
        """Return the start (n_params,) [SI], and warn of values outside of their ranges, to whose ends they move."""
        start = assembly.vector(self.start)
        for parameter, value in zip(assembly.parameters, start, strict=True):
            if not is_in_range(value, parameter.lower, parameter.upper, parameter.scale):
                ends = f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
                text = f"start: {parameter.name} = {value:g} {parameter.unit} is outside of its range, {ends}."
                warnings.warn(f"{text} The fit starts from the nearer end.", stacklevel=5)
        return start

    def _complete_result(self, measured: MeasuredLines | MeasuredModes) -> Identification:
        """Return the result of as many steps as the time allows."""
        starts = [] if self.start is None else [self._checked_start(measured.problem.assembly)]
        network: NDArray[np.float64] | None = None
        notes: tuple[str, ...] = ()
        problem: Problem
        if isinstance(measured, MeasuredModes):
            problem = replace(measured.problem, starts=tuple(starts), limit=self.limit)
        elif not self.method.fits_lines:
            return self._without_fit(measured)
        else:
            network, notes = _network_start(measured, self.trained)
            starts += [known for known in (network, measured.start) if known is not None]
            network_of = _network_of(self.trained, measured)
            problem = replace(measured.problem, starts=tuple(starts), network=network_of, limit=self.limit)
            if self.on_problem is not None:
                self.on_problem(problem)
        began = time.monotonic()
        estimate, samples = self._estimate(problem)
        if isinstance(estimate, Fit):
            fit = estimate
        else:
            fit = fit_at(problem, problem.to_unit(estimate.theta), seconds=time.monotonic() - began)
        judgement = judge_without_causes(problem, fit, self.judgement, seed=self.seed, progress=self.progress)
        judged = judgement.judged
        if problem.unweighted is None and not self.method.refits_with_errors:
            judged = judged._replace(fit=fit)
        result = self._result(
            measured, judged.fit.theta, provenance=self._origin(measured), fit=judged.fit, adequacy=judged.adequacy
        )
        named = None if network is None else dict(zip(result.parameters, network.tolist(), strict=True))
        if fit is not estimate:
            notes = (*notes, *self._best_fit_warnings(problem, judged.fit))
        result = replace(result, network=named, warnings=(*result.warnings, *notes))
        if samples is not None:
            result = self._with_samples(result, problem, samples, fit.seconds)
        elif self.method.gives_posterior:
            result = self._with_posterior(result, problem, judged)
        return self._with_causes(result, judgement)

    def _with_posterior(self, result: Identification, problem: Problem, judged: JudgedFit) -> Identification:
        """Add the method's posterior; without time, none of a fit that is not trustworthy."""
        if self.limit.is_over and not judged.is_trustworthy:
            self.limit.leave_out("intervals")
            return result
        with plugin_errors(self.method, self.label):
            sampled = self.method.sample(problem, judged, seed=self.seed, progress=self.progress)
            posterior = checked_posterior(problem, sampled, self.method)
        allowed = posterior.model_error.natural_frequency
        origin = {**result.provenance, "posterior_form": posterior.form, "model_error": allowed}
        warnings = (*result.warnings, *(posterior.warnings if judged.is_trustworthy else ()))
        return replace(result, posterior=posterior, provenance=origin, warnings=warnings)

    def _with_causes(self, result: Identification, judgement: Judgement) -> Identification:
        """Add the causes of a misfit, compared with the coherence of the result."""
        if result.adequacy is None or not judgement.problem.assembly.has_parts:
            return result
        adequacy = judgement.with_causes(result.adequacy, self.judgement, self.progress)
        if not adequacy.causes:
            return replace(result, adequacy=adequacy)
        coherence = float(np.concatenate([response.coherence for response in result.responses]).mean())
        causes = tuple(replace(cause, coherence=(coherence, cause.coherence[1])) for cause in adequacy.causes)
        return replace(result, adequacy=replace(adequacy, causes=causes))

    def _estimate(self, problem: Problem) -> tuple[Estimate, NDArray[np.float64] | None]:
        """Return the method's estimate, and its samples (n, n_params), if any, in fractions of the ranges."""
        estimate = self._identified(problem)
        if isinstance(estimate, Fit):
            return estimate, None
        with plugin_errors(self.method, self.label):
            (fraction,) = _fractions(problem, [estimate.theta], self.label)
            theta = problem.from_unit(fraction)
            if estimate.samples is None:
                return Estimate(theta), None
            samples = _fractions(problem, estimate.samples, self.label)
            if len(samples) < FEWEST_DRAWS:
                too_few = f"it gave {len(samples)} samples, too few for intervals."
                raise PluginError(Fault(self.label, too_few, f"{FEWEST_DRAWS} or more, or none"))
            return Estimate(theta), samples

    def _identified(self, problem: Problem) -> Estimate:
        """Return what the method returns, if it is an estimate."""
        with plugin_errors(self.method, self.label):
            estimate = self.method.identify(problem, seed=self.seed, progress=self.progress)
            check_contract(estimate, self.method, Estimate, "identify")
        return estimate

    def _with_samples(
        self, result: Identification, problem: Problem, samples: NDArray[np.float64], seconds: float
    ) -> Identification:
        """Add a method's own samples, as fractions of the ranges."""
        warnings = list(result.warnings)
        if result.adequacy is not None and result.adequacy.word not in ("to the noise", "not judged"):
            whose = f"those of the method '{self.method.name}'"
            warnings.append(f"The intervals are {whose}: they allow for no errors of the model.")
        posterior = _posterior_of(problem, problem.from_unit(samples), seconds)
        return replace(result, posterior=posterior, warnings=(*warnings, *posterior.warnings))

    def _without_fit(self, measured: MeasuredLines) -> Identification:
        """Return the estimate of a network, with its own judgement of the measurement."""
        trained = self.trained
        problem = replace(measured.problem, network=_network_of(trained, measured))
        began = time.monotonic()
        estimate = self._identified(problem)
        posterior = None
        if estimate.samples is not None:
            posterior = _posterior_of(problem, estimate.samples, time.monotonic() - began)
        theta = estimate.theta if posterior is None else posterior.estimate
        verdict: Adequacy | None = None
        unsure: tuple[str, ...] = (_CANNOT_JUDGE,)
        if trained is not None:
            if trained.novelty is not None:
                amplitude = trained.assembly.accelerance_amplitude(estimate.theta).astype(np.float64)
                verdict, unsure = trained.novelty.check(measured.resampled(trained.assembly)[0], amplitude), ()
            if posterior is not None and (known := trained.known_noise) is not None:
                unsure += known.warnings(measured.amplitudes_on(trained.assembly), theta, posterior.theta)
        result = self._result(measured, theta, provenance=self._origin(measured), adequacy=verdict)
        warnings = (*result.warnings, *measured.warnings_of_features, *unsure)
        return replace(result, posterior=posterior, warnings=warnings, is_fitted=False)

    def _origin(self, measured: MeasuredLines | MeasuredModes) -> dict[str, Any]:
        """Return the provenance of the result."""
        evaluation, seed = None if self.trained is None else self.trained.evaluation, self.seed
        if evaluation is not None and not self.method.fits_lines:
            seed = evaluation.seed
        tested = None if evaluation is None else evaluation.to_dict()
        origin = provenance(measured.described, measured.record, seed, tested)
        origin["components"][f"method {self.method.name}"] = source_of(self.method)
        origin["method_options"] = self.method.config.model_dump(mode="json")
        return origin

    def _result(
        self, measured: MeasuredLines | MeasuredModes, theta: NDArray[np.float64], **known: Any
    ) -> Identification:
        """Build the result with the natural frequencies in the whole band and warnings of lines that are missing."""
        if isinstance(measured, MeasuredModes):
            return measured.result(theta, method=self.method.name, **known)
        lines, counts = measured.all_lines or measured, [len(frf.frequency) for frf in measured.frfs]
        result = reconstruct(
            lines.problem, theta, method=self.method.name, band=measured.band, fitted_lines=counts, **known
        )
        if result.fit is None:
            return result
        narrow = lines.narrow_resonances([response.frf.values for response in result.responses])
        return replace(result, warnings=(*result.warnings, *measured.warnings, *narrow))

    def _best_fit_warnings(self, problem: Problem, fit: Fit) -> tuple[str, ...]:
        """Return a warning if a fit that starts from a method's estimate explains the measurement far better."""
        if self.limit.is_over:
            self.limit.leave_out("whether another fit is better than the method's estimate")
            return ()
        theta = refine(problem, [fit.theta], seed=self.seed, progress=self.progress).theta
        best = fit_at(problem, problem.to_unit(theta))
        gain = (fit.chi_squared - best.chi_squared) * fit.degrees_of_freedom
        if gain <= max(_LEAST_GAIN * len(theta), _LEAST_PART * best.chi_squared * fit.degrees_of_freedom):
            return ()
        message = (
            f"The estimate of the method '{self.method.name}' is not the best fit: its chi-squared is "
            f"{fit.chi_squared:.3g} per degree of freedom, and a fit reaches {best.chi_squared:.3g}. What is said of "
            "the model is not said of the estimate."
        )
        return (Note(message, Importance.DECISIVE),)


def _network_estimate(trained: TrainedNetwork, measured: MeasuredLines) -> Estimate:
    """Return a network's estimate for a measurement, with samples if it has them."""
    amplitude = measured.amplitudes_on(trained.assembly)[0]
    return Estimate(_network_theta(trained, measured), trained.predict_samples(amplitude))


def _network_theta(trained: TrainedNetwork, measured: MeasuredLines) -> NDArray[np.float64]:
    """Return the parameters (n_params,) [SI] that a network estimates.

    Raises
    ------
    MeasurementError
        They are not finite.
    """
    theta: NDArray[np.float64] = trained.predict_parameters(measured.amplitudes_on(trained.assembly))[0]
    parameters = trained.assembly.parameters
    if lost := [p.name for p, value in zip(parameters, theta, strict=True) if not np.isfinite(value)]:
        problem = f"this FRF is far from all that the network was trained on: {listing(lost)} has no finite estimate."
        raise MeasurementError(Fault(measured.whole[0].label, problem, remedy="Check its quantity and units."))
    return theta


def _network_start(
    measured: MeasuredLines, trained: TrainedNetwork | None
) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    """Return a network's estimate (n_params,) [SI] as a start, or None with a note if it has none."""
    if trained is None:
        return None, ()
    try:
        return _network_theta(trained, measured), ()
    except MeasurementError as error:
        return None, (Note(f"The network is not used: {error.faults[0].problem}", Importance.DETAIL),)


def _network_of(trained: TrainedNetwork | None, measured: MeasuredLines) -> Callable[[], Estimate] | None:
    """Return a function that returns the network's estimate; None without a network."""
    return None if trained is None else partial(_network_estimate, trained, measured)


def checked_posterior(problem: Problem, posterior: object, method: IdentificationMethod[Problem]) -> Posterior:
    """Return what a method's `sample` returned, if it is a posterior of the problem.

    Raises
    ------
    PluginError
        It is not a `Posterior` of the problem's parameters, its samples are not finite or outside the ranges, or its
        weights are not shares that add up to 1.
    """
    label = component_label(method)
    check_contract(posterior, method, Posterior, "sample")
    assert isinstance(posterior, Posterior)
    names = tuple(parameter.name for parameter in problem.parameters)
    if posterior.names != names:
        raise PluginError(Fault(label, f"its posterior is of {listing(posterior.names)}.", listing(names)))
    fraction = _fractions(problem, posterior.theta, label)
    _fractions(problem, [posterior.estimate], label)
    if np.shape(posterior.fraction) != fraction.shape or np.abs(posterior.fraction - fraction).max() > _SAME_FRACTION:
        accepted = "those of `theta`, as dovetail.Posterior.from_fractions computes them"
        raise PluginError(Fault(label, "the fractions of its samples are not those of their values.", accepted))
    weight = np.asarray(posterior.weight)
    if weight.shape != (len(fraction),):
        raise PluginError(Fault(label, f"its weights have the shape {weight.shape}.", f"({len(fraction)},)"))
    if not (np.all(weight >= 0.0) and abs(weight.sum() - 1.0) <= _SAME_FRACTION):
        problem_of_weights = (
            f"its weights range from {weight.min():g} to {weight.max():g}, with the sum {weight.sum():g}."
        )
        raise PluginError(Fault(label, problem_of_weights, "shares of 0 or more that add up to 1"))
    return posterior


def _posterior_of(problem: Problem, theta: NDArray[np.float64], seconds: float) -> Posterior:
    """Build a posterior within the ranges from samples (n, n_params) [SI] of equal weight."""
    return Posterior.from_fractions(
        problem.parameters,
        fractions_within(problem.parameters, theta),
        np.full(len(theta), 1.0 / len(theta)),
        model_error=ModelError(0.0),
        searches=len(theta),
        lines=sum(len(frf.frequency) for frf in problem.measured),
        seconds=seconds,
    )


def _fractions(problem: Problem, answer: object, label: str) -> NDArray[np.float64]:
    """Return a plugin's parameters (n, n_params) as fractions of their ranges.

    Raises
    ------
    PluginError
        They are not finite, of another shape, or outside the ranges.
    """
    count = len(problem.parameters)
    try:
        theta = np.asarray(answer)
    except ValueError:
        raise PluginError(Fault(label, f"it gave {answer!r:.60} for parameters.", "an array of numbers")) from None
    if theta.ndim != 2 or theta.shape[1] != count or not len(theta) or theta.dtype.kind not in "fiu":
        accepted = f"{count} numbers in each row"
        raise PluginError(Fault(label, f"it gave parameters of the shape {theta.shape}, {theta.dtype}.", accepted))
    if theta.dtype.itemsize < 8:  # an end of a range, in single precision, may lie beyond it
        lower, upper = np.transpose([(parameter.lower, parameter.upper) for parameter in problem.parameters])
        within = np.clip(theta.astype(np.float64), lower, upper)
        theta = np.where(np.isclose(theta, within, rtol=2.0 * np.finfo(np.float32).eps, atol=0.0), within, theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = problem.to_unit(np.asarray(theta, dtype=np.float64))
    outside = ~(np.abs(fraction - 0.5) <= 0.5 + ROUNDING)
    if outside.any():
        row, column = np.argwhere(outside)[0]
        parameter = problem.parameters[column]
        outside_range = f"it gave {parameter.name} = {theta[row, column]:g} {parameter.unit}."
        raise PluginError(Fault(label, outside_range, f"{parameter.lower:g} to {parameter.upper:g}"))
    return np.asarray(np.clip(fraction, 0.0, 1.0))


DEFAULT_METHOD = "posterior"
"""It gives the best estimate, with intervals and verdicts, and needs no training."""
