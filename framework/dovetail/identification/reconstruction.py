"""From identified values to a result: reconstructed FRFs, natural frequencies and warnings."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, VibrationMode
from dovetail.assembly.vibration_modes import Terms
from dovetail.description import Tie, resolve
from dovetail.errors import DovetailError, Importance, Note, PluginError, by_importance
from dovetail.frf import LOW_COHERENCE
from dovetail.frf.resonance_peaks import counterpart
from dovetail.identification.parameters import IdentifiedParameter, TiedParameter, is_in_range
from dovetail.identification.result import Identification, Mode
from dovetail.inference.adequacy import Adequacy
from dovetail.inference.adequacy.resonances import describe_lacking, lacking_resonances
from dovetail.inference.adequacy.verdict import AtPoint
from dovetail.inference.fitting import Fit
from dovetail.interfaces import Parameter
from dovetail.problem import Problem
from dovetail.problem.merged_lines import MOST_LINES, frf_in_blocks
from dovetail.units import format_quantity

_LEAST_SHARE = 0.2
"""Magnitude of a mode's part of the FRF at a peak, over the FRF's, below which the mode does not make the peak."""
_CLOSENESS = 0.15
"""Relative distance within which a natural frequency and a peak can belong together, as for two peaks."""


@dataclass(frozen=True)
class Settings:
    """When a result has a warning, and what it lists."""

    low_r2: float = 0.1
    """R2 on test FRFs below which a network is hardly better than a guess of the middle of the range."""
    most_listed: int = 8
    """Ignored lines that a warning lists."""
    modes: int = 10
    """Modes that are computed first, and twice as many while all of them are below the band's end."""


_SETTINGS = Settings()


def reconstruct(
    problem: Problem,
    theta: NDArray[np.float64],
    *,
    method: str,
    provenance: Mapping[str, Any],
    band: tuple[float, float] | None = None,
    fit: Fit | None = None,
    adequacy: Adequacy | None = None,
    fitted_lines: Sequence[int] = (),
) -> Identification:
    """Build the result of identified parameter values.

    Parameters
    ----------
    problem : Problem
        With all lines that the result has.
    theta : (n_params,) array
        SI values.
    method : str
    provenance : mapping
        Plain values.
    band : (float, float), optional
        Hz; within which natural frequencies are listed. The assembly's frequencies by default.
    fit : Fit, optional
        From which `theta` comes.
    adequacy : Adequacy, optional
        How well the model explains the measurement.
    fitted_lines : sequence of int
        Lines of each response that were fitted; by default all.

    Returns
    -------
    Identification
    """
    assembly, at_points = problem.assembly, _at_points(problem, theta, f"{problem.assembly.name}, {method}")
    first = at_points[0]
    band = (float(assembly.frequency[0]), float(assembly.frequency[-1])) if band is None else band
    modes, without_modes = _modes(assembly, theta, band, at_points)
    result = Identification(
        method=method,
        parameters=identified_parameters(assembly, theta),
        known=known_parameters(assembly),
        frf=first.frf,
        measured=first.measured,
        modes=modes,
        warnings=(),
        provenance=provenance,
        fit=fit,
        point=first.point,
        further=at_points[1:],
        adequacy=adequacy and _with_agreement(adequacy, at_points),
        band=band,
        peaks_without_mode=unpaired_peaks(first, modes),
    )
    counts = fitted_lines or [len(at_point.frf.frequency) for at_point in at_points]
    return replace(result, warnings=_warnings(result, without_modes, counts))


def _at_points(problem: Problem, theta: NDArray[np.float64], label: str) -> tuple[AtPoint, ...]:
    """Return the reconstructed and the measured FRF at each response."""
    description, measured, at_points = problem.assembly.description, problem.measured, []
    assemblies = problem.assembly.each_response
    responses = zip(description.responses, description.response_labels, assemblies, measured, strict=True)
    for response, point, alone, frf in responses:
        name = label if len(measured) == 1 else f"{label}, {point}"
        computed = alone.frf(theta) if len(alone.frequency) <= MOST_LINES else frf_in_blocks(alone, theta)
        values = response.frf(alone.frequency, computed, label=name)
        measurement = replace(frf, rotation=response.rotation, moment=response.moment)
        at_points.append(AtPoint(point, values, measurement))
    return tuple(at_points)


def _with_agreement(adequacy: Adequacy, at_points: Sequence[AtPoint]) -> Adequacy:
    """Add to a judgement the resonances of the reconstructed FRFs that the model lacks."""
    if adequacy.size is None:
        return adequacy
    lacking = lacking_resonances(at_points, adequacy.size.natural_frequency)
    notes = describe_lacking(lacking, [at_point.measured for at_point in at_points])
    return replace(adequacy, reasons=by_importance((*notes, *adequacy.reasons)))


def identified_parameters(assembly: Assembly, theta: NDArray[np.float64]) -> dict[str, IdentifiedParameter]:
    """Return the assembly's parameters with the values that were identified, (n_params,) SI."""
    description, tied = assembly.description, defaultdict[tuple[str, str], list[TiedParameter]](list)
    for owner, parameter, tie in _ties(assembly):
        name = f"{owner}.{parameter.name}"
        tied[tie.owner, tie.parameter].append(TiedParameter(name, tie.ratio, parameter.description, owner))
    identified = {}
    for parameter, value, of in zip(
        assembly.parameters, theta.tolist(), description.identified_parameters, strict=True
    ):
        in_range = is_in_range(value, parameter.lower, parameter.upper, parameter.scale)
        identified[parameter.name] = IdentifiedParameter(
            **asdict(parameter), value=value, in_range=in_range, joint=of[0], tied=tuple(tied[of])
        )
    return identified


def known_parameters(assembly: Assembly) -> dict[str, float]:
    """Return the parameters that the description fixes, and those that it ties to them."""
    entries = assembly.description.entries
    known = {f"{owner}.{name}": float(value) for owner, entry in entries.items() for name, value in entry.fixed.items()}
    for owner, parameter, tie in _ties(assembly):
        if tie.parameter in entries[tie.owner].fixed:
            known[f"{owner}.{parameter.name}"] = tie.ratio * entries[tie.owner].fixed[tie.parameter]
    return known


def _ties(assembly: Assembly) -> Iterator[tuple[str, Parameter, Tie]]:
    """Yield owner and parameter of each tie, and where it leads in the end."""
    entries = assembly.description.entries
    for owner, entry in entries.items():
        for parameter in entry.parameters:
            if parameter.name in entry.ties:
                yield owner, parameter, resolve(entries, entry.ties[parameter.name])


def _modes(
    assembly: Assembly, theta: NDArray[np.float64], band: tuple[float, float], at_points: Sequence[AtPoint]
) -> tuple[tuple[Mode, ...], str]:
    """Return the modes within a band and, where there are none, why."""
    try:
        count = _SETTINGS.modes
        modes = assembly.modes(theta, count)
        while len(modes) == count and modes[-1].natural_frequency <= band[1]:
            count *= 2
            modes = assembly.modes(theta, count)
    except PluginError:
        raise
    except DovetailError as error:
        return (), f"No natural frequencies are given: {error.faults[0].problem}"
    except np.linalg.LinAlgError as error:
        return (), f"No natural frequencies are given: they cannot be computed ({error})."
    inside = [mode for mode in modes if band[0] <= mode.natural_frequency <= band[1]]
    if not inside:
        return (), "The identified model has no natural frequency within the assembly's frequencies."
    responses = zip(assembly.description.responses, at_points, strict=True)
    at_each = [paired_modes(inside, (each.terms, each.force_terms), at_point) for each, at_point in responses]
    return tuple(
        next((mode for mode in pairs if mode.measured_peak), pairs[0]) for pairs in zip(*at_each, strict=True)
    ), ""


def _warnings(result: Identification, without_modes: str, fitted_lines: Sequence[int]) -> tuple[str, ...]:
    warnings: list[str] = [
        Note(
            f"{parameter.name} = {format_quantity(parameter.value, parameter.unit)} lies outside its range, "
            f"{format_quantity(parameter.lower, parameter.unit)} to "
            f"{format_quantity(parameter.upper, parameter.unit)}.",
            Importance.DECISIVE,
        )
        for parameter in result.parameters.values()
        if not parameter.in_range
    ]
    tests = result.provenance.get("evaluation", {}).get("parameters", {}).items()
    unknown = [name for name, metrics in tests if metrics["r2"] is not None and metrics["r2"] < _SETTINGS.low_r2]
    if unknown and result.fit is None:
        warnings.append(
            Note(
                f"Do not rely on {', '.join(unknown)}: on FRFs that it was not trained on, the network does hardly "
                "better there than a guess of the middle of the range.",
                Importance.LIMITING,
            )
        )
    if result.fit is not None:
        warnings += [
            f"In the best fit {name} is at the {end} end of its range." for name, end in result.fit.at_bounds.items()
        ]
    for index, at_point in enumerate(result.responses):
        where = f" at {at_point.point}" if result.further else ""
        if result.fit is not None:
            warnings += _warnings_of_lines(result.fit.at(index, fitted_lines), where)
        to_noise = result.adequacy is not None and result.adequacy.word == "to the noise"
        warnings += _warnings_at(at_point, where, result.is_trustworthy and not to_noise)
    if without_modes:
        warnings.append(without_modes)
    return tuple(warnings)


def _warnings_at(at_point: AtPoint, where: str, by_coherence: bool) -> list[str]:
    """Return the warnings about the FRF at one response; `where` names it if there are several.

    Lines of noise alone have no coherence, even if a fit reaches the noise: there it means nothing.
    """
    warnings: list[str] = []
    if not at_point.measured.has_phase:
        warnings.append(
            f"The measurement{where} has no phase: the coherence compares amplitudes and cannot fall below 0.5."
        )
    if at_point.mean_coherence < LOW_COHERENCE and by_coherence:
        warnings.append(
            Note(
                f"The mean coherence{where} is {at_point.mean_coherence:.3f}: the reconstructed FRF does not follow "
                "the measured one, so the parameters are not to be relied on.",
                Importance.DECISIVE,
            )
        )
    return warnings


def _warnings_of_lines(fit: Fit, where: str) -> list[str]:
    """Return the warning about ignored lines of a response; `where` names it if there are several."""
    if not fit.ignored.size:
        return []
    lines = ", ".join(f"{frequency:.6g}" for frequency in fit.ignored[: _SETTINGS.most_listed])
    more = ", ..." if fit.ignored.size > _SETTINGS.most_listed else ""
    count = "1 isolated line was" if fit.ignored.size == 1 else f"{fit.ignored.size} isolated lines were"
    message = f"{count} left out{where}: {lines}{more} Hz."
    return [Note(message, Importance.DETAIL)]


def paired_modes(modes: Sequence[VibrationMode], points: tuple[Terms, Terms], at_point: AtPoint) -> tuple[Mode, ...]:
    """Pair each mode with its peak in the reconstructed FRF, and that with its peak in the measured one.

    Parameters
    ----------
    modes : sequence of VibrationMode
        Of the identified model, by frequency.
    points : (Terms, Terms)
        Where the motion is measured and where the force acts.
    at_point : AtPoint

    Returns
    -------
    tuple of Mode
        One for each mode.

    Notes
    -----
    A reconstructed peak belongs to the mode that contributes most to the receptance there. Of two peaks with the same
    mode the nearer one is taken. Peaks of the two FRFs are counterparts if each is the other's nearest and they are
    close.
    """
    paired, receptance = at_point.peaks, at_point.frf.to("receptance")
    peak_of: dict[int, float] = {}
    for peak in paired.modelled.tolist():
        near = [i for i, mode in enumerate(modes) if abs(mode.natural_frequency - peak) <= _CLOSENESS * peak]
        if not near:
            continue
        parts = [modes[index].contribution(*points, peak) for index in near]
        amplitude = receptance.amplitude[np.argmin(np.abs(receptance.frequency - peak))]
        largest = near[int(np.argmax(parts))]
        natural = modes[largest].natural_frequency
        if max(parts) >= _LEAST_SHARE * amplitude and not abs(peak_of.get(largest, np.inf) - natural) < abs(
            peak - natural
        ):
            peak_of[largest] = peak
    counterparts = {peak: paired.measured_for(peak) for peak in peak_of.values()}
    return tuple(
        Mode(mode.natural_frequency, peak_of.get(i), counterparts.get(peak_of.get(i, np.nan)), mode.damping_ratio)
        for i, mode in enumerate(modes)
    )


def unpaired_peaks(at_point: AtPoint, modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """Return the measured peaks that belong to no mode, with the reconstructed ones near by that belong to none."""
    taken = [peak for mode in modes for peak in (mode.reconstructed_peak, mode.measured_peak) if peak is not None]
    free = at_point.peaks.without(taken)
    pairs = [(counterpart(peak, free.measured, free.modelled), peak) for peak in free.measured.tolist()]
    return tuple(Mode(np.nan, modelled, measured) for modelled, measured in pairs)
