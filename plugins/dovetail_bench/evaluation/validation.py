"""Validation: natural frequencies as measured, without the accelerometer, and as a model predicts them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache, partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from dovetail import (
    Assembly,
    Fault,
    Frf,
    Identification,
    IdentificationMethod,
    MeasurementError,
    ParameterError,
    Progress,
    identify,
    load,
    load_result,
)
from dovetail.evaluation import (
    batch_contradictions,
    check_cover,
    check_mass,
    check_measured,
    coherence_with_model,
    counterpart,
    joined_warnings,
    joint_values,
    modes_in_band,
    predicted_frf,
    progress_reporter,
    resonance_peaks,
    within_band,
)
from dovetail_bench.evaluation.cases import Case, Cases, JointSource, Measurement
from dovetail_bench.evaluation.failures import Failures

PROMINENCE = 1.5
"""dB by which a peak must stand out: modes that the joint damps have low peaks."""

_MOST_MODES = 20
"""Lowest modes that are compared."""

Identify = Callable[[Assembly, Frf], Identification]
"""What identifies a joint from an assembly's measurement without the accelerometer."""


@dataclass(frozen=True)
class PeakRow:
    """A resonance as measured, without the accelerometer, and as predicted.

    Parameters
    ----------
    measured, compensated, predicted : float or None
        Hz; where the accelerance peaks. None where there is no such peak.
    """

    measured: float | None
    compensated: float | None
    predicted: float | None

    @property
    def error(self) -> float | None:
        """Predicted against compensated, per cent."""
        return _per_cent(self.predicted, self.compensated)

    @property
    def shift(self) -> float | None:
        """Compensated against measured, per cent: large where the measured part itself is what vibrates."""
        return _per_cent(self.compensated, self.measured)


def _per_cent(value: float | None, of: float | None) -> float | None:
    return None if value is None or of is None else 100.0 * (value / of - 1.0)


@dataclass(frozen=True, eq=False)
class ValidatedCase:
    """A case with its three FRFs on the measured lines within the assembly's band.

    Parameters
    ----------
    case : Case
    measured, compensated, predicted : Frf
    peaks : tuple of PeakRow
        By frequency.
    joint : Identification or None
        The joint that was used.
    natural : tuple of float
        Natural frequencies [Hz] of the model within the band; none where a part has only FRFs.
    damping : tuple of float
        Their damping ratios.
    """

    case: Case
    measured: Frf
    compensated: Frf
    predicted: Frf
    peaks: tuple[PeakRow, ...]
    joint: Identification | None
    natural: tuple[float, ...]
    damping: tuple[float, ...] = ()

    @property
    def is_trustworthy(self) -> bool:
        """Whether the joint can be trusted; True where the description leaves nothing to identify."""
        return self.joint is None or self.joint.is_trustworthy

    @property
    def mean_coherence(self) -> float:
        """Mean agreement of prediction and compensated measurement (Eq. 15)."""
        return float(coherence_with_model(self.compensated, self.predicted.values).mean())


@dataclass(frozen=True, eq=False)
class Validation:
    """All cases of a file, validated.

    Parameters
    ----------
    title, series : str
        As in the series.
    cases : tuple of ValidatedCase
    failures : mapping of str to str
        Why a case has no result, by its name.
    """

    title: str
    series: str
    cases: tuple[ValidatedCase, ...]
    failures: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_trustworthy(self) -> bool:
        """Whether the joints of all cases can be trusted."""
        return all(result.is_trustworthy for result in self.cases)

    @property
    def warning(self) -> str:
        """Warnings of the joints, with the cases that they belong to; empty if there are none."""
        return joined_warnings((result.case.name, result.joint) for result in self.cases)

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the FRFs as plain values, fit for JSON."""
        return {
            "title": self.title,
            "series": self.series,
            "is_trustworthy": self.is_trustworthy,
            "warning": self.warning,
            "failures": dict(self.failures),
            "cases": [
                {
                    "name": result.case.name,
                    "value": result.case.value,
                    "is_trustworthy": result.is_trustworthy,
                    "peaks": [asdict(row) | {"error": row.error, "shift": row.shift} for row in result.peaks],
                    "natural_frequencies": list(result.natural),
                    "damping_ratios": list(result.damping),
                    "mean_coherence": result.mean_coherence,
                    "method": None if result.joint is None else result.joint.method,
                    "joint": None if result.joint is None else {n: p.value for n, p in result.joint.parameters.items()},
                }
                for result in self.cases
            ],
        }


def validate(
    cases: Cases,
    method: str | IdentificationMethod | Identify = "refined",
    *,
    plugins: Iterable[str | PathLike[str]] = (),
    progress: Progress | bool | None = None,
) -> Validation:
    """Predict what was measured, case by case.

    Parameters
    ----------
    cases : Cases
    method : str, IdentificationMethod or callable
        How joints are identified: a method of `dovetail.identify` that needs no trained network, or a function from
        an assembly and its measurement without the accelerometer to an identification. Each is identified once.
    plugins : iterable of paths
        Plugin files to take in.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    Validation
        A case that fails, as where its measurement cannot be read or does not reach both ends of the band, is one of
        its failures, and does not end the others.

    Raises
    ------
    DovetailError
        A description cannot be used, a case does not give its joint, or every case fails: why the first does.

    Notes
    -----
    Resonances are compared where the accelerance peaks, as both FRFs show them, on the lines of the measurement.
    """
    files = tuple(plugins)
    loaded = [load(case.source, plugins=files) for case in cases.cases]
    _check_same_points(cases, files)
    identified = partial(identify, method=method) if isinstance(method, (str, IdentificationMethod)) else method
    joint_of = cache(partial(_joint, identified=identified, plugins=files))  # what several cases share, once
    validated, failures = [], Failures()
    with progress_reporter(progress) as report:
        for index, (case, assembly) in enumerate(zip(cases.cases, loaded, strict=True)):
            report("cases", index, len(loaded))
            with failures.of(case.name):
                validated.append(_validated(case, assembly, joint_of))
        report("cases", len(loaded), len(loaded))
    failures.raise_unless(validated)
    return Validation(cases.title, cases.series, tuple(validated), failures.reasons)


def _check_same_points(cases: Cases, plugins: tuple[str | PathLike[str], ...]) -> None:
    """Raise a MeasurementError if measurements of one assembly, of cases or joints, were made at different points."""
    uses = list[tuple[Path | dict[str, Any], str, Measurement]]()
    for case in cases.cases:
        uses.append((case.source, case.name, case.measured))
        if case.joint is not None and case.joint.assembly is not None and case.joint.measured is not None:
            uses.append((case.joint.assembly, case.name, case.joint.measured))
    for source in {str(use[0]): use[0] for use in uses}.values():
        measurements = [(name, measured) for other, name, measured in uses if other == source]
        if len({measured.file for _, measured in measurements}) > 1:
            first = load(source, plugins=plugins).each_response[0]
            if faults := batch_contradictions(first.description, [_readable(*one) for one in measurements]):
                raise MeasurementError(*faults.values())


def _readable(name: str, measured: Measurement) -> Frf | None:
    """Return the measurement of a case, or None where it cannot be read; its validation reports what is wrong."""
    with Failures().of(name):
        return measured.read(compensated=False)
    return None


def _joint(source: JointSource, identified: Identify, plugins: tuple[str | PathLike[str], ...]) -> Identification:
    """Return the joint that a case says: a stored result, or one that is identified from a measurement."""
    if source.assembly is None or source.measured is None:
        assert source.result is not None
        return load_result(source.result)
    check_mass(assembly := load(source.assembly, plugins=plugins), source.measured.accelerometer_mass)
    return identified(assembly, *check_measured(assembly.description, source.measured.read(compensated=True)))


def _validated(case: Case, assembly: Assembly, joint_of: Callable[[JointSource], Identification]) -> ValidatedCase:
    if case.joint is None and assembly.parameters:
        raise ParameterError(
            Fault(
                f"case {case.name}",
                f"assembly '{assembly.name}' has parameters to identify, and the test does not say from what.",
                remedy="Add 'joint: {assembly: ..., measured: ...}' or 'joint: {result: ...}'.",
            )
        )
    check_mass(assembly, case.measured.accelerometer_mass)
    joint = None if case.joint is None else joint_of(case.joint)
    known: Identification | dict[str, float] = {} if joint is None else joint
    quantity, left_out = assembly.description.response.quantity, assembly.description.left_out
    first = assembly.each_response[0].description
    read = [check_measured(first, case.measured.read(compensated=compensated))[0] for compensated in (False, True)]
    raw, bare = (within_band(frf, assembly.frequency, left_out).to(quantity) for frf in read)
    check_cover(raw, assembly.frequency)
    predicted = predicted_frf(assembly.on(raw.frequency), known)
    peaks = tuple(_paired(raw, bare, predicted))
    modes, _ = modes_in_band(assembly, joint_values(assembly, known), count=_MOST_MODES)
    natural, damping = (tuple(getattr(mode, name) for mode in modes) for name in ("natural_frequency", "damping_ratio"))
    return ValidatedCase(case, raw, bare, predicted, peaks, joint, natural, damping)


def _paired(raw: Frf, bare: Frf, prediction: Frf) -> Iterator[PeakRow]:
    """Yield a row for each compensated peak, and one for each clear predicted peak that has no counterpart."""
    measured, compensated, predicted = (resonance_peaks(frf, PROMINENCE) for frf in (raw, bare, prediction))
    rows = [
        PeakRow(counterpart(peak, compensated, measured), float(peak), counterpart(peak, compensated, predicted))
        for peak in compensated
    ]
    taken = {row.predicted for row in rows}
    rows += [PeakRow(None, None, float(peak)) for peak in resonance_peaks(prediction) if float(peak) not in taken]
    yield from sorted(rows, key=lambda row: row.compensated or row.predicted or np.inf)
