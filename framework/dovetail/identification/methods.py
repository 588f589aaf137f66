"""Methods that identify a joint: the network's answer, the refined fit, many local searches, the posterior.

Each takes measurements with the assembly on their lines, a trained network or None, and further options by keyword.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, Theta
from dovetail.errors import Fault, Importance, MeasurementError, Note, ParameterError, PluginError, listing
from dovetail.identification.measured_lines import MeasuredLines
from dovetail.identification.parameters import ROUNDING
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification
from dovetail.inference.adequacy import CAUSE_SECONDS
from dovetail.inference.adequacy.assess import check_limits, judge_fit
from dovetail.inference.fitting import Fit, Objective, fit_at, multistart, refine
from dovetail.inference.fitting.fit import allow_for_unknown_noise
from dovetail.inference.posterior import TYPICAL, Form, ModelError, Posterior, laplace_posterior, sample_posterior
from dovetail.inference.posterior.distribution import check_options
from dovetail.interfaces import Estimate, IdentificationMethod, IdentificationProblem, Progress, plugin_errors, silent
from dovetail.network.bundle import TrainedNetwork
from dovetail.network.pipeline import FEWEST_DRAWS, check_contract, component_label
from dovetail.network.preprocessing import accelerance_amplitudes
from dovetail.problem import Problem
from dovetail.problem.ranges import fractions_within
from dovetail.provenance import provenance, source_of

_LEAST_GAIN = 25.0
"""Decrease of the sum of squares, per parameter, from which another fit is clearly better: five standard deviations."""
_LEAST_PART = 0.5
"""The same in parts of the better fit's sum of squares, which errors of the model make large for any fit."""
_CANNOT_TELL = (
    "This model cannot tell whether the measurement is like what it was trained on, since it is of an earlier version "
    "or takes several responses: use the method 'refined' to be sure."
)


def by_network(
    measured: MeasuredLines, trained: TrainedNetwork | None = None, *, progress: Progress = silent
) -> Identification:
    """Identify the joint from measured FRFs with the network alone.

    Raises
    ------
    ParameterError
        There is no network.
    MeasurementError
        A measurement does not cover the network's frequencies, or the network's answer is not finite.
    """
    assembly = measured.described
    if trained is None:
        problem = "the method 'network' needs a trained model."
        raise ParameterError(Fault(assembly.name, problem, remedy="Train one with dovetail.train, or use 'refined'."))
    progress("network", 0, 1)
    began = time.monotonic()
    resampled = measured.resampled(trained.assembly)
    amplitudes = accelerance_amplitudes(resampled)
    theta = trained.predict_parameters(amplitudes)[0]
    if lost := [p.name for p, value in zip(assembly.parameters, theta, strict=True) if not np.isfinite(value)]:
        problem = f"{resampled[0].label}: the network has no finite value for {listing(lost)}"
        raise MeasurementError(f"{problem}: this FRF is far from all it was trained on. Check its quantity and units.")
    verdict = None
    if trained.novelty is not None:
        amplitude = trained.assembly.accelerance_amplitude(theta).astype(np.float64)
        verdict = trained.novelty.check(resampled[0], amplitude)
    origin = provenance(assembly, measured.whole, trained.evaluation.seed, trained.evaluation.to_dict())
    samples = trained.predict_samples(amplitudes[0])
    posterior = None if samples is None else _posterior_of(measured, samples, time.monotonic() - began)
    theta = theta if posterior is None else posterior.estimate
    result = _result(measured, theta, method="network", provenance=origin, adequacy=verdict)
    unsure: tuple[str, ...] = () if verdict is not None else (_CANNOT_TELL,)
    if posterior is not None and (known := trained.known_noise) is not None:
        unsure += known.warnings(resampled, theta, posterior.theta)
    warnings = (*result.warnings, *measured.warnings_of_features, *unsure)
    return replace(result, posterior=posterior, warnings=warnings)


def _posterior_of(measured: MeasuredLines, theta: NDArray[np.float64], seconds: float) -> Posterior:
    """Build a posterior within the ranges from samples (n, n_params) [SI] of equal weight."""
    assembly = measured.described
    return Posterior.from_fractions(
        assembly.parameters,
        fractions_within(assembly.parameters, theta),
        np.full(len(theta), 1.0 / len(theta)),
        model_error=ModelError(0.0),
        searches=len(theta),
        lines=sum(len(frf.frequency) for frf in measured.frfs),
        seconds=seconds,
    )


def by_refined_fit(
    measured: MeasuredLines,
    trained: TrainedNetwork | None = None,
    *,
    start: Theta = None,
    model_error: float | None = None,
    cause_seconds: float = CAUSE_SECONDS,
    seed: int | None = None,
    progress: Progress = silent,
) -> Identification:
    """Fit the joint to the measured FRF, with starts from the ranges alone or also from a network's answer.

    Parameters
    ----------
    measured : MeasuredLines
    trained : TrainedNetwork, optional
        The fit starts from its answer, if the measurement covers its frequencies.
    start : (n_params,) array or mapping of names to values, optional
        Start of the fit.
    model_error : float, optional
        Relative error of natural frequencies that the model is allowed; by default the one that the measurement shows.
    cause_seconds : float
        Time [s] after which no further cause of a misfit is tried; with 0 none is.
    seed : int, optional
        Of the other starts; the description's by default.
    progress : Progress
    """
    problem, assembly = measured.problem, measured.assembly
    seed = assembly.description.identification.seed if seed is None else seed
    check_limits(model_error, cause_seconds)
    progress("fit", 0, 1)
    network, warnings = _network_answer(measured, trained)
    starts = [] if start is None else [assembly.vector(start)]
    starts += [known for known in (network, measured.start) if known is not None]
    fit = refine(problem, starts, seed=seed, progress=progress)
    adequacy, fit = judge_fit(problem, fit, model_error, seed, cause_seconds, progress)
    evaluation = None if trained is None else trained.evaluation.to_dict()
    origin = provenance(measured.described, measured.whole, seed, evaluation)
    result = _result(measured, fit.theta, method="refined", provenance=origin, fit=fit, adequacy=adequacy)
    beside = None if network is None else dict(zip(result.parameters, network.tolist(), strict=True))
    return replace(result, network=beside, warnings=(*result.warnings, *warnings))


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


def _result(measured: MeasuredLines, theta: NDArray[np.float64], **known: Any) -> Identification:
    """Build the result with the natural frequencies in the whole band and warnings of parts that were not measured."""
    lines, counts = measured.all_lines or measured, [len(frf.frequency) for frf in measured.frfs]
    result = reconstruct(lines.assembly, theta, lines.frfs, band=measured.band, fitted_lines=counts, **known)
    if result.fit is None:
        return result
    narrow = lines.narrow_resonances([response.frf.values for response in result.responses])
    return replace(result, warnings=(*result.warnings, *measured.warnings, *narrow))


def by_multistart(
    measured: MeasuredLines,
    _trained: TrainedNetwork | None = None,
    *,
    starts: int = 64,
    seconds: float | None = None,
    objective: Objective = "frf",
    model_error: float | None = None,
    cause_seconds: float = CAUSE_SECONDS,
    seed: int | None = None,
    progress: Progress = silent,
) -> Identification:
    """Fit the joint to the measured FRF by many local searches.

    Parameters
    ----------
    measured : MeasuredLines
    _trained : TrainedNetwork, optional
        Not used.
    starts : int
        Number of starts from a Latin hypercube.
    seconds : float, optional
        Time [s] after which no further step begins.
    objective : {"frf", "weighted"}
        Sum of the squared differences of the FRFs as they are, or over their random error.
    model_error, cause_seconds : float, optional
        As in `by_refined_fit`. The fit, which minimises `objective`, is judged by them.
    seed : int, optional
        Of the Latin hypercube; the description's by default.
    progress : Progress
    """
    problem, assembly = measured.problem, measured.assembly
    check_limits(model_error, cause_seconds)
    seed = assembly.description.identification.seed if seed is None else seed
    fit = multistart(problem, starts=starts, seconds=seconds, objective=objective, seed=seed, progress=progress)
    origin = provenance(measured.described, measured.whole, seed) | {"objective": objective}
    adequacy, own = judge_fit(problem, fit, model_error, seed, cause_seconds, progress)
    fit = fit if measured.unweighted is None else own
    return _result(measured, fit.theta, method="multistart", provenance=origin, fit=fit, adequacy=adequacy)


_FORMS = {"samples": sample_posterior, "laplace": laplace_posterior}


def by_posterior(
    measured: MeasuredLines,
    trained: TrainedNetwork | None = None,
    *,
    form: Form = "samples",
    samples: int = 400,
    start: Theta = None,
    model_error: float | None = None,
    cause_seconds: float = CAUSE_SECONDS,
    seed: int | None = None,
    progress: Progress = silent,
) -> Identification:
    """Fit the joint to the measured FRF, and estimate the posterior of the parameters.

    Parameters
    ----------
    measured : MeasuredLines
    trained : TrainedNetwork, optional
        The fit starts from its answer, if the measurement covers its frequencies.
    form : {"samples", "laplace"}
        Samples of the posterior, or a Gaussian about its mode, which is faster but cannot follow a curved posterior. If
        the model does not fit, no interval is trustworthy, and the Gaussian is used in any case.
    samples : int
    start, cause_seconds, seed
        As in `by_refined_fit`.
    model_error : float, optional
        As in `by_refined_fit`; the posterior allows 5e-4 if the measurement shows none.
    progress : Progress
    """
    check_options(samples, form)
    fitted = by_refined_fit(
        measured,
        trained,
        start=start,
        model_error=model_error,
        cause_seconds=cause_seconds,
        seed=seed,
        progress=progress,
    )
    assert fitted.fit is not None
    allowed = TYPICAL if fitted.adequacy is None else fitted.adequacy.error_in_intervals
    used: Form = form if fitted.is_trustworthy else "laplace"
    posterior = _FORMS[used](
        measured.problem,
        allow_for_unknown_noise(measured.problem.observations, fitted.fit),
        samples=samples,
        model_error=allowed,
        seed=fitted.provenance["seed"],
        progress=progress,
    )
    origin = {**fitted.provenance, "posterior_form": used, "model_error": allowed.natural_frequency}
    warnings = (*fitted.warnings, *(posterior.warnings if fitted.is_trustworthy else ()))
    return replace(fitted, method="posterior", posterior=posterior, provenance=origin, warnings=warnings)


def by_plugin(
    method: IdentificationMethod,
    measured: MeasuredLines,
    *,
    model_error: float | None = None,
    cause_seconds: float = CAUSE_SECONDS,
    seed: int | None = None,
    progress: Progress = silent,
) -> Identification:
    """Identify the joint by a plugin's method, and judge its estimate like those of the other methods.

    Parameters
    ----------
    method : IdentificationMethod
    measured : MeasuredLines
    model_error, cause_seconds : float, optional
        As in `by_refined_fit`.
    seed : int, optional
        The description's by default.
    progress : Progress

    Raises
    ------
    PluginError
        The method fails, or does not return finite parameters within their ranges.
    """
    check_limits(model_error, cause_seconds)
    problem, assembly = measured.problem, measured.assembly
    seed = assembly.description.identification.seed if seed is None else seed
    began = time.monotonic()
    fraction, sampled = _estimate_of(method, problem, seed, progress)
    fit = fit_at(problem, fraction, seconds=time.monotonic() - began)
    adequacy, own = judge_fit(problem, fit, model_error, seed, cause_seconds, progress)
    fit = fit if measured.unweighted is None else own
    origin = provenance(measured.described, measured.whole, seed)
    origin["components"][f"method {method.name}"] = source_of(method)
    origin["method_options"] = method.config.model_dump(mode="json")
    result = _result(measured, fit.theta, method=method.name, provenance=origin, fit=fit, adequacy=adequacy)
    warnings = [*result.warnings, *_best_fit_warnings(measured, fit, method.name, seed, progress)]
    if sampled is None:
        return replace(result, warnings=tuple(warnings))
    if adequacy.word not in ("to the noise", "not judged"):
        whose = f"those of the method '{method.name}'"
        warnings.append(f"The intervals are {whose}: they allow for no errors of the model.")
    posterior = _posterior_of(measured, assembly.from_unit(sampled), fit.seconds)
    return replace(result, posterior=posterior, warnings=(*warnings, *posterior.warnings))


def _estimate_of(
    method: IdentificationMethod, solved: Problem, seed: int, progress: Progress
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return a plugin's estimate (n_params,), and its samples (n, n_params) if any, in fractions of the ranges.

    Raises
    ------
    PluginError
        As in `by_plugin`.
    """
    model, target, label = solved.model, solved.observations, component_label(method)
    problem = IdentificationProblem(solved.parameters, target.frfs, target.variance(), model.frf, model.frf_jacobian)
    with plugin_errors(method, label):
        estimate = method.identify(problem, seed=seed, progress=progress)
        check_contract(estimate, method, Estimate, "identify")
        (fraction,) = _fractions(solved.assembly, [estimate.theta], label)
        if estimate.samples is None:
            return fraction, None
        samples = _fractions(solved.assembly, estimate.samples, label)
        if len(samples) < FEWEST_DRAWS:
            too_few = f"it gave {len(samples)} samples, too few for intervals."
            raise PluginError(Fault(label, too_few, f"{FEWEST_DRAWS} or more, or none"))
    return fraction, samples


def _best_fit_warnings(measured: MeasuredLines, fit: Fit, name: str, seed: int, progress: Progress) -> tuple[str, ...]:
    """Return a warning if a fit that starts from a plugin's estimate explains the measurement far better."""
    problem = measured.problem
    theta = refine(problem, [fit.theta], seed=seed, progress=progress).theta
    best = fit_at(problem, problem.to_unit(theta))
    gain = (fit.chi_squared - best.chi_squared) * fit.degrees_of_freedom
    if gain <= max(_LEAST_GAIN * len(theta), _LEAST_PART * best.chi_squared * fit.degrees_of_freedom):
        return ()
    message = (
        f"The estimate of the method '{name}' is not the best fit: its chi-squared is {fit.chi_squared:.3g} per degree "
        f"of freedom, and a fit reaches {best.chi_squared:.3g}. What is said of the model is not said of the estimate."
    )
    return (Note(message, Importance.DECISIVE),)


def _fractions(assembly: Assembly, answer: object, label: str) -> NDArray[np.float64]:
    """Return a plugin's parameters (n, n_params) as fractions of their ranges.

    Raises
    ------
    PluginError
        They are not finite, of another shape, or outside the ranges.
    """
    count = len(assembly.parameters)
    try:
        theta = np.asarray(answer)
    except ValueError:
        raise PluginError(Fault(label, f"it gave {answer!r:.60} for parameters.", "an array of numbers")) from None
    if theta.ndim != 2 or theta.shape[1] != count or not len(theta) or theta.dtype.kind not in "fiu":
        accepted = f"{count} numbers in each row"
        raise PluginError(Fault(label, f"it gave parameters of the shape {theta.shape}, {theta.dtype}.", accepted))
    if theta.dtype.itemsize < 8:  # an end of a range, in single precision, may lie beyond it
        lower, upper = np.transpose([(parameter.lower, parameter.upper) for parameter in assembly.parameters])
        within = np.clip(theta.astype(np.float64), lower, upper)
        theta = np.where(np.isclose(theta, within, rtol=2.0 * np.finfo(np.float32).eps, atol=0.0), within, theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = assembly.to_unit(np.asarray(theta, dtype=np.float64))
    outside = ~(np.abs(fraction - 0.5) <= 0.5 + ROUNDING)
    if outside.any():
        row, column = np.argwhere(outside)[0]
        parameter = assembly.parameters[column]
        problem = f"it gave {parameter.name} = {theta[row, column]:g} {parameter.unit}."
        raise PluginError(Fault(label, problem, f"{parameter.lower:g} to {parameter.upper:g}"))
    return np.asarray(np.clip(fraction, 0.0, 1.0))


METHODS: Mapping[str, Callable[..., Identification]] = {
    "network": by_network,
    "refined": by_refined_fit,
    "multistart": by_multistart,
    "posterior": by_posterior,
}
"""Methods by their names."""

DEFAULT_METHOD = "posterior"
"""It gives the best estimate, with intervals and verdicts, and needs no training."""
