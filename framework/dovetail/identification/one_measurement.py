"""Identification of a joint from a measurement by any method."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import FRF_TOLERANCE, Assembly, AssemblySource, as_assembly, largest_frf_difference
from dovetail.assembly.variants import at_drive_points
from dovetail.documents.validation import validated
from dovetail.errors import Fault, MeasurementError, ParameterError, argument, did_you_mean, listing
from dovetail.frf import Frf
from dovetail.identification.application import DEFAULT_METHOD, Application
from dovetail.identification.forecast import ForecastProgress
from dovetail.identification.measured_lines import MeasuredLines
from dovetail.identification.measured_modes import MeasuredModes
from dovetail.identification.result import Identification
from dovetail.identification.unknown_signs import amplitudes, with_signs
from dovetail.inference.adequacy.judgement import JudgementOptions
from dovetail.inference.posterior.verdicts import VERDICT_LIMITS, VerdictLimits
from dovetail.interfaces import IdentificationMethod, Progress, TimeLimit, logged, progress_reporter, silent
from dovetail.measurement import ModalParameters, is_modal_table, read_frf, read_modal_parameters
from dovetail.network.bundle import TrainedNetwork
from dovetail.parallel import one_blas_thread
from dovetail.problem.observations import Weights, one_per_response, weighted_variance
from dovetail.registry import Registry, installed_components

Measurement = Frf | str | Path | Sequence[Frf | str | Path]
"""An FRF or its file; one for each response, if there are several."""

_MOST_ZEROS = 0.01
"""Part of the lines; single ones are bad lines like others."""
_LARGEST_SPIKE = 1e20
"""Times the median amplitude; above it squares and sums lose all other lines."""
_NO_MOTION, _PROBES, _SOME_LINES = 1e-10, 2, 100
"""Amplitude over the geometric mean of those at the drive points of output and input, at half of some lines, up to
which an FRF is rounding or cannot be measured; parameter vectors that are tried besides the middle; and these lines."""
_JUDGEMENT = ("model_error", "cause_seconds", "good", "rough")
"""Options of `JudgementOptions`."""
_LIMITS = ("identified", "weakly_identified")
"""Those of `VerdictLimits`."""


def identify(
    assembly: AssemblySource,
    measured: Measurement | ModalParameters,
    method: str | IdentificationMethod | None = None,
    *,
    model: TrainedNetwork | None = None,
    weights: Weights | Sequence[Weights] | None = None,
    phase: bool = True,
    seconds: float | TimeLimit | None = None,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Identification:
    """Identify the joint of an assembly from the measured FRF of its response point, or of each of its response points.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description.
    measured : Frf or path, or sequence of them; or ModalParameters or path
        One for each response of the description, in its order; of any quantity, without the accelerometer. The lines
        within the description's band count, each measurement on its own: the model is computed there, and measured
        values are never interpolated, except for the features of a network. Or a table of natural frequencies and
        damping ratios, for methods that fit these (`IdentificationMethod.fits_modes`); it has no causes of a misfit.
    method : str or IdentificationMethod, optional
        ``"posterior"``, the default: the refined fit, with intervals and verdicts for each parameter. ``"refined"``: a
        least-squares fit alone, down to the measurement's random error. ``"multistart"``: many local searches from all
        over the ranges. ``"network"``: the answer of `model` as it is, which is the method of the publication. Or
        a method of a plugin, which is the default where the description names one.
    model : TrainedNetwork, optional
        A trained network of this assembly: its answer is a start of the refined fit, and is part of the result
        (`Identification.network`).
    weights : {"coherence", "amplitude"} or (n_freq,) array, optional
        How much lines count in estimate and intervals: by their random error by default; by their coherence; by
        amplitude, so that relative errors count; or an array for each measurement. How well the model fits is judged by
        the random error whatever the weights. The network does not use them.
    phase : bool
        False for a fit that ignores the measurement's phase.
    seconds : float or TimeLimit, optional
        Time [s] for the answer; `Identification.cut_short` then lists what was left out: causes of a misfit first, then
        samples, then intervals and the end of the fit. A step that has begun is completed. None for a complete answer.
        A `TimeLimit` can be stopped from another thread.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.
    **options
        Of the method: ``seed`` for all but the network; ``start``, where the fit begins [SI], for ``"refined"`` and
        ``"posterior"``; ``starts`` and ``objective`` (``"frf"`` or ``"weighted"``) for
        ``"multistart"``; ``form`` (``"samples"`` or ``"laplace"``),
        ``samples`` and ``model_error`` for ``"posterior"``; ``cause_seconds``, the time after which no further cause
        of a misfit is tried (20 by default, none with 0), and ``good`` and ``rough``, the largest `ModelError` of a
        model that is called so, for all but the network. ``identified`` and ``weakly_identified``, as in
        `VerdictLimits`, for methods with intervals. For a plugin's method those of its `Config`, instead of the
        description's, ``seed``, ``model_error``, ``cause_seconds``, ``good`` and ``rough``.

    Returns
    -------
    Identification

    Raises
    ------
    MeasurementError
        There are more or fewer measurements than responses, or some have no lines within the band; or a table has more
        modes than the model. With the method
        ``"network"``: some do not cover the band, or the network has no finite answer.
    ParameterError
        The assembly has nothing to identify, the method has no such option or needs a model, or the model was trained
        for another assembly.
    PluginError
        The code of a plugin's method fails.
    ValueError
        `method` is not a method.

    Notes
    -----
    If the measurement lacks part of the band, at its ends or in a gap, the result's warnings say so. The network is
    used only if the measurement covers the whole band.

    During an identification the linear algebra of this process uses one thread: the matrices are small, and more
    threads would wait for each other.
    """
    limit, assembly = TimeLimit.of(seconds), as_assembly(assembly)
    table = _as_table(measured)
    frfs = () if table is not None else as_frfs(cast("Measurement", measured))
    chosen = find_method(method, assembly) if table is None else method_for_modes(method, assembly)
    if not assembly.parameters:
        raise ParameterError(Fault(assembly.name, "all parameters are known: there is nothing to identify."))
    if table is not None and (model is not None or weights is not None or not phase):
        problem = "modal parameters are not FRFs: they take no network, no weights and no phase."
        raise ParameterError(Fault("identify", problem, f"a method, as '{DEFAULT_METHOD}', and its options"))
    accepted_options = [name for name in method_options(chosen) if table is None or name != "cause_seconds"]
    for name in options:
        if name not in accepted_options:
            problem = f"the method '{chosen.name}' has no option '{name}'."
            raise ParameterError(Fault("options", problem, listing(accepted_options) or "none"))
    if model is not None:
        _check_model(assembly, model.assembly)
    labels = table.label if table is not None else listing(frf.label for frf in frfs)
    step = logged(__name__, f"{assembly.name} identified from {labels} by {chosen.name}")
    with one_blas_thread(), step, progress_reporter(progress) as report:
        application = replace(_application(chosen, assembly, model, options, report), limit=limit)
        if (evaluations := application.method.evaluations) is not None and report is not silent:
            forecast = ForecastProgress(report, evaluations)
            application = replace(application, progress=forecast, on_problem=forecast.begin)
        if table is not None:
            result = application.to(MeasuredModes(assembly, table))
        else:
            lines = lines_to_fit(assembly, frfs, weights, report, phase=phase)
            result = application.to(lines.merged(application.seed, report) if chosen.fits_lines else lines)
        requested = {"weights": weights, "seconds": limit.seconds, "phase": None if phase else False, **options}
        given = {name: value for name, value in requested.items() if isinstance(value, (str, int, float))}
        return replace(result, provenance={**result.provenance, **({"options": given} if given else {})})


def _as_table(measured: Measurement | ModalParameters) -> ModalParameters | None:
    """Return a table of modal parameters, or None if FRFs were measured."""
    if isinstance(measured, ModalParameters):
        return measured
    return read_modal_parameters(measured) if isinstance(measured, (str, Path)) and is_modal_table(measured) else None


def method_for_modes(method: str | IdentificationMethod | None, assembly: Assembly) -> IdentificationMethod:
    """Return the method that is meant for a table of modal parameters: if none is named, one that takes such a table.

    Raises
    ------
    ParameterError
        The named method takes FRFs only.
    """
    chosen = find_method(method, assembly)
    if chosen.fits_modes:
        return chosen
    if method is None:
        return find_method(None, None)
    problem = f"modal parameters are not FRFs, and the method '{chosen.name}' takes FRFs only."
    raise ParameterError(Fault("method", problem, f"'{DEFAULT_METHOD}', 'refined', 'multistart'"))


def lines_to_fit(
    assembly: Assembly,
    frfs: tuple[Frf, ...],
    weights: Weights | Sequence[Weights] | None,
    progress: Progress,
    *,
    phase: bool,
) -> MeasuredLines:
    """Return the lines of measured FRFs with the requested weights, with the signs that the description leaves open."""
    frfs = one_per_response(assembly.description, frfs)
    for frf in frfs:
        _check_numbers(frf)
    weighted, own = (each if phase else tuple(map(amplitudes, each)) for each in (_weighted(frfs, weights), frfs))
    lines = MeasuredLines.of(assembly, weighted)
    _check_motion(lines.assembly)
    if weights is not None:
        lines = replace(lines, unweighted=MeasuredLines.of(assembly, own).frfs)
    return with_signs(lines, progress) if assembly.description.unknown_signs else lines


def _application(
    method: IdentificationMethod,
    assembly: Assembly,
    model: TrainedNetwork | None,
    options: Mapping[str, Any],
    progress: Progress,
) -> Application:
    """Return a method with the options of a call; those that are not given are the method's and the description's."""
    judgement, limits = (
        {name: options[name] for name in names if options.get(name) is not None} for names in (_JUDGEMENT, _LIMITS)
    )
    seed: Any = options.get("seed")
    if seed is not None and not (isinstance(seed, (int, np.integer)) and seed >= 0):
        raise ParameterError(Fault("seed", f"{seed!r:.40} is not a seed.", "a whole number of 0 or more"))
    own = {name: value for name, value in options.items() if name in _option_names(method)}
    return Application(
        _with_options(method, own) if own else method,
        model,
        options.get("start"),
        JudgementOptions(**judgement),
        VerdictLimits(**limits) if limits else VERDICT_LIMITS,
        assembly.description.identification.seed if seed is None else int(seed),
        progress,
    )


def _check_model(assembly: Assembly, trained: Assembly) -> None:
    """Raise ParameterError unless a network's assembly has the same parameters and FRFs; a band may differ."""
    if trained.description.fingerprint == assembly.description.fingerprint:
        return
    names, expected = ([parameter.name for parameter in known.parameters] for known in (trained, assembly))
    if names == expected and len(trained.description.responses) == len(assembly.description.responses):
        middle = trained.from_unit(np.full((1, len(names)), 0.5))
        amplitude = trained.accelerance_amplitude(middle)
        if largest_frf_difference(assembly.on(trained.frequency), middle, amplitude) <= FRF_TOLERANCE:
            return
    problem = f"it was trained for another assembly than '{assembly.name}': parameters or FRFs differ."
    raise ParameterError(Fault("model", problem, remedy="Train one for this description."))


def check_mass(assembly: Assembly, mass: float) -> None:
    """Raise a MeasurementError if an accelerometer's mass [kg] cannot be removed from a measured FRF."""
    where = argument("accelerometer_mass")
    for response in assembly.description.responses if mass else ():
        if response.rotation or not response.is_drive_point:
            what = "a rotation per moment" if response.rotation else "no drive point"
            problem = f"the response of '{assembly.name}' is {what}, from which no mass can be removed."
            remedy = "Leave it out." if response.rotation else "State it as the response's 'calibration: {mass: ...}'."
            raise MeasurementError(Fault(where, problem, remedy=remedy))
    if mass and assembly.description.calibrations:
        problem = f"'{assembly.name}' has a 'calibration', and a mass would be removed before it."
        raise MeasurementError(Fault(where, problem, remedy="State the mass there, as 'mass'."))


def find_method(
    method: str | IdentificationMethod | None, assembly: Assembly | None, registry: Registry | None = None
) -> IdentificationMethod:
    """Return the method of identification that is meant.

    Parameters
    ----------
    method : str or IdentificationMethod or None
        None for that of the description, or else the default.
    assembly : Assembly or None
        The options of the method that its description names are taken from there.
    registry : Registry, optional
        Of what is installed by default.

    Raises
    ------
    ValueError
        There is no such method.
    PluginError
        Several plugins offer it.
    """
    described = None if assembly is None else assembly.description.identification.method
    if isinstance(method, IdentificationMethod):
        return method
    if described is not None and method in (None, described.name):
        return described
    method, registry = method or f"dovetail-frf:{DEFAULT_METHOD}", registry or installed_components()
    if "method" not in registry.kinds_of(method):
        known = registry.names("method")
        raise ValueError(f"'{method}' is not a method. {did_you_mean(method, known)} Accepted: {', '.join(known)}")
    if described is not None and registry.find("method", method).component is type(described):
        return described  # with the options of the description
    made = registry.create("method", method)
    assert isinstance(made, IdentificationMethod)
    return made


def _with_options(method: IdentificationMethod, options: Mapping[str, Any]) -> IdentificationMethod:
    """Return a method with other options.

    Raises
    ------
    ParameterError
        Its `Config` refuses them.
    """
    fields = type(method.config).model_fields.items()
    present = {field.alias or name: getattr(method.config, name) for name, field in fields}
    return type(method)(validated(type(method.config), {**present, **options}, f"the method '{method.name}'"))


def as_frfs(measured: Measurement) -> tuple[Frf, ...]:
    """Return measured FRFs as they are, or read from their files.

    Raises
    ------
    MeasurementError
        Something is neither, or a file cannot be read.
    """
    several = isinstance(measured, Iterable) and not isinstance(measured, (Frf, str, Path))
    each: list[Any] = list(cast("Iterable[Any]", measured)) if several else [measured]
    for source in each:
        if not isinstance(source, (Frf, str, Path)):
            problem = f"this is an object of the type {type(source).__name__}."
            raise MeasurementError(Fault("measured", problem, "an Frf, or the path of its file"))
        if not isinstance(source, Frf) and is_modal_table(source):
            remedy = "It is a measurement by itself: pass it alone."
            raise MeasurementError(
                Fault(str(source), "this is a table of modal parameters, not an FRF.", remedy=remedy)
            )
    return tuple(one if isinstance(one, Frf) else read_frf(one) for one in each)


def _weighted(frfs: tuple[Frf, ...], weights: Weights | Sequence[Weights] | None) -> tuple[Frf, ...]:
    """Return the measurements with the requested weights."""
    if weights is not None:
        each: list[Any] = list(weights) if isinstance(weights, (list, tuple)) else [weights] * len(frfs)
        if len(each) != len(frfs):
            raise ParameterError(Fault("weights", f"{len(each)} were given for {len(frfs)} measurements."))
        accepted = ("coherence", "amplitude")
        for word in (by for by in each if isinstance(by, str) and by not in accepted):
            problem, hint = f"'{word}' is not a way to weight lines.", did_you_mean(word, accepted)
            raise ParameterError(Fault("weights", problem, f"{listing(accepted)}; or an array", hint))
        counted: list[Any] = [by if isinstance(by, str) else np.asarray(by, dtype=np.float64) for by in each]
        frfs = tuple(replace(frf, variance=weighted_variance(frf, by)) for frf, by in zip(frfs, counted, strict=True))
    return frfs


def _check_numbers(frf: Frf) -> None:
    """Raise a MeasurementError if many amplitudes are zero, or if one exceeds the range of the arithmetic."""
    zeros = int(np.count_nonzero(frf.amplitude == 0.0))
    if zeros > _MOST_ZEROS * frf.amplitude.size:
        problem = f"its amplitude is exactly zero at {zeros} of {frf.amplitude.size} lines, as no structure's is."
        remedy = "Measure again, or leave these lines out: 'frequency: {without: ...}'."
        raise MeasurementError(Fault(frf.label, problem, remedy=remedy))
    line = int(np.argmax(frf.amplitude))
    if frf.amplitude[line] > _LARGEST_SPIKE * float(np.median(frf.amplitude)):
        problem = f"its amplitude is {frf.amplitude[line]:.3g} at {frf.frequency[line]:g} Hz, a damaged number."
        raise MeasurementError(Fault(frf.label, problem, remedy="Leave this line out: 'frequency: {without: ...}'."))


def _moves(assembly: Assembly, theta: NDArray[np.float64]) -> bool:
    """Return whether the force of the only response moves its point, for one of some parameter vectors."""
    some = assembly.frequency[:: max(1, len(assembly.frequency) // _SOME_LINES)]
    amplitude = np.abs(assembly.on(some, chosen=True).frf(theta))
    if assembly.description.response.is_drive_point:
        return bool(amplitude.any())
    output, force = (np.abs(each.on(some, chosen=True).frf(theta)) for each in at_drive_points(assembly))
    moved = np.mean(amplitude > _NO_MOTION * np.sqrt(output * force), axis=1)
    return bool((moved >= 0.5).any())


def _check_motion(assembly: Assembly) -> None:
    """Raise a ParameterError if the force of a response does not move its point, as in another plane of symmetry.

    Its FRF is then zero, or consists of rounding errors.
    """
    fractions = np.random.default_rng(0).random((_PROBES, len(assembly.parameters)))
    theta = assembly.from_unit(np.concatenate([np.full((1, len(assembly.parameters)), 0.5), fractions]))
    for label, each in zip(assembly.description.response_labels, assembly.each_response, strict=True):
        if not _moves(each, theta):
            problem = f"the model's FRF at {label} is zero at all lines: the force does not move this point so."
            raise ParameterError(Fault(assembly.name, problem, remedy="Correct the directions of response and force."))


def method_options(method: IdentificationMethod) -> tuple[str, ...]:
    """Return the names of the options that `identify` takes with a method."""
    start = ("start",) if method.uses_starts else ()
    judgement = (*_JUDGEMENT, "seed") if method.fits_lines else ()
    limits = _LIMITS if method.gives_posterior else ()
    return (*_option_names(method), *start, *judgement, *limits)


def _option_names(method: IdentificationMethod) -> tuple[str, ...]:
    """Return the options of a method as a description has them."""
    return tuple(field.alias or name for name, field in type(method.config).model_fields.items())
