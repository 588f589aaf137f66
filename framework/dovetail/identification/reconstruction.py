"""From identified values back to the FRF, the natural frequencies and what to warn of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import DovetailError, PluginError
from dovetail.frf import Frf
from dovetail.identification.fitting import Fit, one_for_each
from dovetail.identification.misspecification import Foreign
from dovetail.identification.resonance_peaks import paired_modes, resonance_peaks
from dovetail.identification.result import AtPoint, Identification, IdentifiedParameter, Mode
from dovetail.units import format_quantity

__all__ = ["reconstruct", "sought"]

_LOW_COHERENCE = 0.9
"""Mean coherence below which the reconstruction visibly misses the measurement."""

_HARDLY_TOLD = 0.1
"""R2 on test FRFs below which a network does hardly better than a guess of the middle."""

_FEWEST_AGREEING = 2

_MOST_LISTED = 8
"""Lines that were left out that a warning names."""

_MOST_MODES = 10
"""Natural frequencies to ask for; those beyond the assembly's frequencies are left out."""


def sought(assembly: Assembly) -> list[tuple[str, str]]:
    """Return the joint and the name within it of each of ``assembly.parameters``."""
    return [
        (joint, parameter.name)
        for joint, entry in assembly.description.joints.items()
        for parameter in entry.parameters
        if parameter.name not in entry.fixed
    ]


def reconstruct(
    assembly: Assembly,
    theta: NDArray[np.float64],
    measured: Frf | Sequence[Frf],
    *,
    method: str,
    provenance: Mapping[str, Any],
    fit: Fit | None = None,
    foreign: Foreign | None = None,
) -> Identification:
    """Build the result that belongs to identified parameter values.

    Parameters
    ----------
    assembly : Assembly
    theta : (n_params,) array
        SI values.
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies.
    method : str
    provenance : mapping
        Plain values.
    fit : Fit, optional
        That gave `theta`.
    foreign : Foreign, optional
        Whether the model can have made the measurement.

    Returns
    -------
    Identification
    """
    at_points = _at_points(assembly, theta, one_for_each(assembly, measured), f"{assembly.name}, {method}")
    first = at_points[0]
    modes, without_modes = _modes(assembly, theta, first.frf, first.measured)
    result = Identification(
        method=method,
        parameters=MappingProxyType(_identified(assembly, theta)),
        known=MappingProxyType(_known(assembly)),
        frf=first.frf,
        measured=first.measured,
        modes=modes,
        warnings=(),
        provenance=MappingProxyType(dict(provenance)),
        fit=fit,
        point=first.point,
        further=at_points[1:],
        foreign=foreign,
    )
    return replace(result, warnings=_warnings(result, without_modes))


def _at_points(
    assembly: Assembly, theta: NDArray[np.float64], measured: Sequence[Frf], label: str
) -> tuple[AtPoint, ...]:
    """Return what was reconstructed and measured at each response."""
    description, found = assembly.description, []
    each = zip(description.responses, description.response_labels, assembly.each_response, measured, strict=True)
    for response, point, one, frf in each:
        name = label if len(measured) == 1 else f"{label}, {point}"
        values = Frf(one.frequency, one.frf(theta), response.quantity, label=name, rotation=response.rotation)
        found.append(AtPoint(point, values, replace(frf.to(response.quantity), rotation=response.rotation)))
    return tuple(found)


def _identified(assembly: Assembly, theta: NDArray[np.float64]) -> dict[str, IdentifiedParameter]:
    identified = {}
    for parameter, value, (joint, _) in zip(assembly.parameters, theta.tolist(), sought(assembly), strict=True):
        identified[parameter.name] = IdentifiedParameter(
            name=parameter.name,
            value=value,
            unit=parameter.unit,
            lower=parameter.lower,
            upper=parameter.upper,
            scale=parameter.scale,
            in_range=parameter.lower <= value <= parameter.upper,
            description=parameter.description,
            joint=joint,
        )
    return identified


def _known(assembly: Assembly) -> dict[str, float]:
    joints = assembly.description.joints
    return {f"{joint}.{name}": float(value) for joint, entry in joints.items() for name, value in entry.fixed.items()}


def _modes(assembly: Assembly, theta: NDArray[np.float64], frf: Frf, measured: Frf) -> tuple[tuple[Mode, ...], str]:
    """Return the modes within the assembly's frequencies and, where there are none, why."""
    try:
        natural = assembly.natural_frequencies(theta, count=_MOST_MODES)
    except PluginError:
        raise
    except DovetailError as error:
        return (), f"No natural frequencies are given: {error.faults[0].problem}"
    except np.linalg.LinAlgError as error:
        return (), f"No natural frequencies are given: they cannot be computed ({error})."
    inside = (natural >= assembly.frequency[0]) & (natural <= assembly.frequency[-1])
    if not inside.any():
        return (), "The identified model has no natural frequency within the assembly's frequencies."
    return paired_modes(natural[inside], resonance_peaks(frf), resonance_peaks(measured)), ""


def _warnings(result: Identification, without_modes: str) -> tuple[str, ...]:
    warnings = [
        f"{parameter.name} = {format_quantity(parameter.value, parameter.unit)} lies outside its range, "
        f"{format_quantity(parameter.lower, parameter.unit)} to {format_quantity(parameter.upper, parameter.unit)}."
        for parameter in result.parameters.values()
        if not parameter.in_range
    ]
    tested = result.provenance.get("evaluation", {}).get("parameters", {})
    guessed = [name for name, metrics in tested.items() if metrics["r2"] is not None and metrics["r2"] < _HARDLY_TOLD]
    if guessed:
        warnings.append(
            f"Do not rely on {', '.join(guessed)}: on FRFs that it was not trained on, the network does hardly better "
            "there than a guess of the middle of the range."
        )
    is_foreign = result.foreign is not None and result.foreign.flagged
    if result.fit is not None:
        warnings += _warnings_of_fit(result.fit, is_foreign)
    for index, at_point in enumerate(result.responses):
        where = f" at {at_point.point}" if result.further else ""
        if result.fit is not None:
            warnings += _warnings_of_lines(result.fit.at(index, len(result.responses)), where)
        warnings += _warnings_at(at_point, where, is_foreign)
    if without_modes:
        warnings.append(without_modes)
    return tuple(warnings)


def _warnings_at(at_point: AtPoint, where: str, is_foreign: bool) -> list[str]:
    """Return what a reader must know of the FRF at one response; `where` names it if there are several."""
    warnings = []
    if not at_point.measured.has_phase:
        warnings.append(
            f"The measurement{where} has no phase: the coherence compares amplitudes and cannot fall below 0.5."
        )
    if at_point.mean_coherence < _LOW_COHERENCE and not is_foreign:
        warnings.append(
            f"The mean coherence{where} is {at_point.mean_coherence:.3f}: the reconstructed FRF does not follow the "
            "measured one, so the parameters are not to be relied on."
        )
    return warnings


def _warnings_of_fit(fit: Fit, is_foreign: bool) -> list[str]:
    """Return what a reader must know of a fit, but that the measurement is foreign, which is said elsewhere."""
    warnings = [f"{name} ended at the {end} end of its range." for name, end in fit.at_bounds.items()]
    if fit.discrepancy and not is_foreign:
        warnings.append(
            f"No parameters within the ranges explain this measurement down to its random error (chi-squared "
            f"{fit.chi_squared:.3g}): the model is off by about {100 * fit.discrepancy:.2g} % of the FRF, so the "
            "parameters may be off by more than the noise says."
        )
        if fit.agreeing < _FEWEST_AGREEING:
            warnings.append("No two searches ended in the same place: there may be a better fit.")
    return warnings


def _warnings_of_lines(fit: Fit, where: str) -> list[str]:
    """Return which lines of a response were left out; `where` names it if there are several."""
    if not fit.ignored.size:
        return []
    lines = ", ".join(f"{frequency:.6g}" for frequency in fit.ignored[:_MOST_LISTED])
    more = ", ..." if fit.ignored.size > _MOST_LISTED else ""
    return [f"{fit.ignored.size} lines{where} stand alone and were left out: {lines}{more} Hz."]
