"""How a method of identification is applied: problem, estimate, judgement, posterior, result."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Theta
from dovetail.errors import Fault, Importance, MeasurementError, Note, PluginError, listing
from dovetail.identification.measured_lines import MeasuredLines
from dovetail.identification.parameters import ROUNDING
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification
from dovetail.inference.adequacy import Adequacy
from dovetail.inference.adequacy.assess import JudgementOptions, judge
from dovetail.inference.fitting import Fit, fit_at, refine
from dovetail.inference.posterior import ModelError, Posterior
from dovetail.interfaces import Estimate, IdentificationMethod, Progress, plugin_errors, silent
from dovetail.interfaces.component import check_contract, component_label
from dovetail.network.bundle import TrainedNetwork
from dovetail.network.pipeline import FEWEST_DRAWS
from dovetail.network.preprocessing import accelerance_amplitudes
from dovetail.problem import Problem
from dovetail.problem.definition import fractions_within
from dovetail.provenance import provenance, source_of

_LEAST_GAIN = 25.0
"""Decrease of the sum of squares, per parameter, from which another fit is clearly better: five standard deviations."""
_LEAST_PART = 0.5
"""The same in parts of the better fit's sum of squares, which errors of the model make large for any fit."""
_CANNOT_TELL = (
    "This model cannot tell whether the measurement is like what it was trained on, since it is of an earlier version "
    "or takes several responses: use the method 'refined' to be sure."
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
    seed : int
    progress : Progress
    """

    method: IdentificationMethod[Problem]
    trained: TrainedNetwork | None = None
    start: Theta = None
    judgement: JudgementOptions = field(default_factory=JudgementOptions)
    seed: int = 0
    progress: Progress = silent

    @property
    def label(self) -> str:
        """The method's name in messages."""
        return component_label(self.method)

    def to(self, measured: MeasuredLines) -> Identification:
        """Identify the parameters from a measurement.

        Raises
        ------
        MeasurementError
            The network does not cover the measurement, or has no finite answer, and the method needs it.
        PluginError
            The method fails, or does not return finite parameters within their ranges.
        """
        if not self.method.fits_lines:
            return self._without_fit(measured)
        network, notes = _network_answer(measured, self.trained)
        starts = [] if self.start is None else [measured.assembly.vector(self.start)]
        starts += [known for known in (network, measured.start) if known is not None]
        problem = replace(measured.problem, starts=tuple(starts), network=self._network_of(measured))
        began = time.monotonic()
        estimate, samples = self._estimate(problem)
        if isinstance(estimate, Fit):
            fit = estimate
        else:
            fit = fit_at(problem, problem.to_unit(estimate.theta), seconds=time.monotonic() - began)
        judged = judge(problem, fit, self.judgement, seed=self.seed, progress=self.progress)
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
            return self._with_samples(result, problem, samples, fit.seconds)
        if not self.method.gives_posterior:
            return result
        with plugin_errors(self.method, self.label):
            posterior = self.method.sample(problem, judged, seed=self.seed, progress=self.progress)
            check_contract(posterior, self.method, Posterior, "sample")
        allowed = posterior.model_error.natural_frequency
        origin = {**result.provenance, "posterior_form": posterior.form, "model_error": allowed}
        warnings = (*result.warnings, *(posterior.warnings if judged.is_trustworthy else ()))
        return replace(result, posterior=posterior, provenance=origin, warnings=warnings)

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

    def _network_of(self, measured: MeasuredLines) -> Any:
        """Return a function that returns the network's estimate; None without a network."""
        return None if self.trained is None else lambda: _network_estimate(measured, self.trained)

    def _without_fit(self, measured: MeasuredLines) -> Identification:
        """Return the estimate of a network, with its own judgement of the measurement."""
        problem = replace(measured.problem, network=self._network_of(measured))
        began, trained = time.monotonic(), self.trained
        estimate = self._identified(problem)
        posterior = None
        if estimate.samples is not None:
            posterior = _posterior_of(problem, estimate.samples, time.monotonic() - began)
        theta = estimate.theta if posterior is None else posterior.estimate
        verdict: Adequacy | None = None
        unsure: tuple[str, ...] = (_CANNOT_TELL,)
        if trained is not None:
            resampled = measured.resampled(trained.assembly)
            if trained.novelty is not None:
                amplitude = trained.assembly.accelerance_amplitude(estimate.theta).astype(np.float64)
                verdict, unsure = trained.novelty.check(resampled[0], amplitude), ()
            if posterior is not None and (known := trained.known_noise) is not None:
                unsure += known.warnings(resampled, theta, posterior.theta)
        result = self._result(measured, theta, provenance=self._origin(measured), adequacy=verdict)
        warnings = (*result.warnings, *measured.warnings_of_features, *unsure)
        return replace(result, posterior=posterior, warnings=warnings)

    def _origin(self, measured: MeasuredLines) -> dict[str, Any]:
        """Return the provenance of the result."""
        evaluation, seed = None if self.trained is None else self.trained.evaluation, self.seed
        if evaluation is not None and not self.method.fits_lines:
            seed = evaluation.seed
        origin = provenance(
            measured.described, measured.whole, seed, None if evaluation is None else evaluation.to_dict()
        )
        origin["components"][f"method {self.method.name}"] = source_of(self.method)
        origin["method_options"] = self.method.config.model_dump(mode="json")
        return origin

    def _result(self, measured: MeasuredLines, theta: NDArray[np.float64], **known: Any) -> Identification:
        """Build the result with the natural frequencies in the whole band and warnings of lines that are missing."""
        lines, counts = measured.all_lines or measured, [len(frf.frequency) for frf in measured.frfs]
        result = reconstruct(
            lines.assembly, theta, lines.frfs, method=self.method.name, band=measured.band, fitted_lines=counts, **known
        )
        if result.fit is None:
            return result
        narrow = lines.narrow_resonances([response.frf.values for response in result.responses])
        return replace(result, warnings=(*result.warnings, *measured.warnings, *narrow))

    def _best_fit_warnings(self, problem: Problem, fit: Fit) -> tuple[str, ...]:
        """Return a warning if a fit that starts from a method's estimate explains the measurement far better."""
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


def _network_estimate(measured: MeasuredLines, trained: TrainedNetwork) -> Estimate:
    """Return a network's estimate for a measurement.

    Raises
    ------
    MeasurementError
        The measurement does not cover the network's frequencies, or the estimate is not finite.
    """
    resampled = measured.resampled(trained.assembly)
    amplitudes = accelerance_amplitudes(resampled)
    theta = trained.predict_parameters(amplitudes)[0]
    parameters = measured.described.parameters
    if lost := [p.name for p, value in zip(parameters, theta, strict=True) if not np.isfinite(value)]:
        problem = f"{resampled[0].label}: the network has no finite value for {listing(lost)}"
        raise MeasurementError(f"{problem}: this FRF is far from all it was trained on. Check its quantity and units.")
    return Estimate(theta, trained.predict_samples(amplitudes[0]))


def _network_answer(
    measured: MeasuredLines, trained: TrainedNetwork | None
) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    """Return a network's answer (n_params,) [SI], or None with a warning if a network has none."""
    if trained is None:
        return None, ()
    try:
        resampled = measured.resampled(trained.assembly)
    except MeasurementError as error:
        return None, (Note(f"The network takes no part: {error.faults[0].problem}", Importance.DETAIL),)
    answer = trained.predict_parameters(accelerance_amplitudes(resampled))[0]
    if not np.isfinite(answer).all():
        message = "The network takes no part: this FRF is far from all it was trained on."
        return None, (Note(message, Importance.DETAIL),)
    return answer, ()


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
