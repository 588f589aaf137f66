"""The content of the report as rows of text, which the template sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dovetail.identification import Fit, Identification, IdentifiedParameter, Mode, Posterior
from dovetail.identification.posterior import NOT_BELIEVED
from dovetail.interfaces import Parameter
from dovetail.report.truth import Truth
from dovetail.report.wording import ABSENT, display_unit, fixed, number, readable
from dovetail.units import format_quantity

__all__ = [
    "EvaluationRow",
    "ModeRow",
    "ParameterRow",
    "PosteriorRow",
    "adequacy_sentences",
    "evaluation_rows",
    "fit_sentence",
    "is_synthetic",
    "known_rows",
    "mode_rows",
    "parameter_rows",
    "posterior_rows",
    "posterior_sentence",
    "provenance_rows",
    "warnings_of",
]

_LABELS = {
    "measurement": "Measurement",
    "measured_quantity": "Quantity measured",
    "assembly": "Assembly",
    "description_sha256": "Description, SHA-256",
    "training_samples": "Training samples",
}
_ELSEWHERE = ("description", "evaluation")
"""Entries of the provenance that have a place of their own in the report."""

_SYNTHETIC = "This measurement is synthetic: it was simulated, not taken in a laboratory."


@dataclass(frozen=True)
class ParameterRow:
    """One line of the table of parameters; `place` and `true_place` are parts of the range, None if undefined."""

    name: str
    joint: str
    description: str
    value: str
    unit: str
    si: str
    lower: str
    upper: str
    scale: str
    place: float | None
    in_range: bool
    true_value: str
    error: str
    true_place: float | None


@dataclass(frozen=True)
class ModeRow:
    """One line of the table of natural frequencies, in Hz and per cent.

    `error` is that of `natural` against `true_natural`, `difference` that of the reconstructed against the measured
    peak of the FRF.
    """

    natural: str
    true_natural: str
    error: str
    reconstructed_peak: str
    measured_peak: str
    difference: str


@dataclass(frozen=True)
class PosteriorRow:
    """Posterior of one parameter; `low`, `middle` and `high` are parts of the range, None where nothing is drawn.

    Of a result that is not to be believed the interval is withheld: it would hold only if the model were right.
    """

    name: str
    estimate: str
    lower: str
    upper: str
    unit: str
    verdict: str
    reason: str
    doubtful: bool
    low: float | None
    middle: float | None
    high: float | None

    @property
    def interval(self) -> str:
        """The interval, unless it is withheld."""
        return "withheld" if self.verdict == NOT_BELIEVED else f"{self.lower} to {self.upper}"


@dataclass(frozen=True)
class EvaluationRow:
    """Accuracy of the network for one parameter on the test part."""

    name: str
    r2: str
    mae: str
    unit: str
    mae_of_range: str


def is_synthetic(result: Identification, truth: Truth | None) -> bool:
    """Return whether the measurement's name or note, the provenance or the truth says that it was simulated."""
    if truth is not None and truth.synthetic:
        return True
    said = (result.measured.label, *(result.provenance.get(key, "") for key in ("measurement", "measurement_note")))
    return bool(result.provenance.get("synthetic")) or any("synthetic" in str(text).lower() for text in said)


def warnings_of(result: Identification, truth: Truth | None) -> list[str]:
    """Return the warnings that a reader must see first."""
    warnings = [readable(warning) for warning in result.warnings]
    if is_synthetic(result, truth) and not any("synthetic" in warning.lower() for warning in warnings):
        warnings.insert(0, _SYNTHETIC)
    return warnings


def adequacy_sentences(result: Identification) -> list[str]:
    """Return how well the model explains the measurement, what that means, and what would explain the rest."""
    adequacy = result.adequacy
    if adequacy is None:
        return []
    sentences = [result.caveat, adequacy.sentence, *adequacy.reasons, "" if result.caveat else adequacy.meaning]
    sentences += [cause.sentence for cause in adequacy.causes]
    if adequacy.bands and not result.believable:
        bands = ", ".join(f"{low:.6g} to {high:.6g} Hz" for low, high in adequacy.bands)
        sentences.append(f"It is off at {bands}.")
    return [readable(sentence) for sentence in sentences if sentence]


def parameter_rows(result: Identification, truth: Truth | None) -> list[ParameterRow]:
    """Return the table of parameters, in the assembly's order."""
    true_values = truth.parameters if truth is not None else {}
    return [_parameter_row(parameter, true_values.get(name)) for name, parameter in result.parameters.items()]


def known_rows(result: Identification) -> list[tuple[str, str]]:
    """Return the parameters that the description fixes, in SI."""
    return [(name, readable(format_quantity(value, "1", 6))) for name, value in result.known.items()]


def mode_rows(result: Identification, truth: Truth | None) -> list[ModeRow]:
    """Return the table of natural frequencies: those identified, and those of the truth that none of them is near."""
    low, high = result.frf.frequency[[0, -1]] if result.band is None else result.band
    inside = [f for f in (truth.natural_frequencies if truth is not None else ()) if low <= f <= high]
    identified = [mode.natural_frequency for mode in result.modes]
    matched = [_counterpart(frequency, identified, inside) for frequency in identified]
    rows = [(mode.natural_frequency, _mode_row(mode, true)) for mode, true in zip(result.modes, matched, strict=True)]
    rows += [(frequency, _missed_mode_row(frequency)) for frequency in inside if frequency not in matched]
    return [row for _, row in sorted(rows, key=lambda entry: (not np.isfinite(entry[0]), entry[0]))]


def evaluation_rows(result: Identification) -> list[EvaluationRow]:
    """Return how the network does on the test part, if the provenance says it."""
    evaluation = result.provenance.get("evaluation")
    evaluated = evaluation.get("parameters", {}) if isinstance(evaluation, Mapping) else {}
    rows = []
    for name, metrics in evaluated.items():
        unit, factor = str(metrics["unit"]), 1.0
        if name in result.parameters:
            parameter = result.parameters[name]
            shown = display_unit(parameter.unit, parameter.lower, parameter.upper)
            unit, factor = shown.text, shown.factor
        rows.append(
            EvaluationRow(
                name=name,
                r2=fixed(metrics["r2"], 2),
                mae=number(metrics["mae_si"] * factor, 3),
                unit=unit,
                mae_of_range=fixed(100.0 * metrics["mae"], 1),
            )
        )
    return rows


def posterior_rows(result: Identification) -> list[PosteriorRow]:
    """Return estimate, interval and verdict of each parameter; nothing for methods without a posterior."""
    if result.posterior is None:
        return []
    posterior, intervals = result.posterior, result.posterior.interval()
    rows = []
    for (name, parameter), estimate in zip(result.parameters.items(), posterior.estimate.tolist(), strict=True):
        shown, (low, high) = display_unit(parameter.unit, parameter.lower, parameter.upper), intervals[name]
        verdict, withheld = posterior.verdicts[name], not result.believable
        rows.append(
            PosteriorRow(
                name=name,
                estimate=number(estimate * shown.factor),
                lower=ABSENT if withheld else number(low * shown.factor),
                upper=ABSENT if withheld else number(high * shown.factor),
                unit=shown.text,
                verdict=verdict.word,
                reason=verdict.reason,
                doubtful=name in posterior.unreliable,
                low=None if withheld else _place(parameter, low),
                middle=_place(parameter, estimate),
                high=None if withheld else _place(parameter, high),
            )
        )
    return rows


def posterior_sentence(posterior: Posterior) -> str:
    """Say how the posterior was computed, and whether there are samples enough."""
    name, apart = max(posterior.split_half_difference.items(), key=lambda entry: entry[1])
    halves = f"two halves of them differ in an interval by at most {apart:.0%} of its width ({name})"
    if posterior.form == "laplace":
        start = f"A Gaussian at the most probable place, in {posterior.seconds:.2g} s; {len(posterior.weight)} samples"
        return f"{start} of it, {halves}."
    return (
        f"{len(posterior.weight)} samples in {posterior.seconds:.2g} s; {posterior.converged_fraction:.0%} of the "
        "searches for them reached their target. They tell as much as "
        f"{posterior.effective_sample_size:.0f} independent ones; {halves}."
    )


def fit_sentence(fit: Fit) -> str:
    """Say how good a fit is and what it took."""
    source = "as the measurement tells it" if fit.variance_known else "told from the scatter from line to line"
    return (
        f"Chi-squared {fit.chi_squared:.3g} per degree of freedom ({fit.degrees_of_freedom}) over the random error, "
        f"{source}; {fit.starts} starts, {fit.steps} steps, {fit.seconds:.2g} s."
    )


def provenance_rows(provenance: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Return labels and lines of everything in the provenance that no other section shows."""
    rows = []
    for key, value in provenance.items():
        if key in _ELSEWHERE or value is None:
            continue
        rows.append((_LABELS.get(key, key.replace("_", " ").capitalize()), _lines(value)))
    return rows


def _parameter_row(parameter: IdentifiedParameter, true: float | None) -> ParameterRow:
    shown = display_unit(parameter.unit, parameter.lower, parameter.upper)
    return ParameterRow(
        name=parameter.name,
        joint=parameter.joint,
        description=parameter.description,
        value=number(parameter.value * shown.factor),
        unit=shown.text,
        si=f"{parameter.value:.6g} {parameter.unit}",
        lower=number(parameter.lower * shown.factor, padded=False),
        upper=number(parameter.upper * shown.factor, padded=False),
        scale=parameter.scale,
        place=_place(parameter, parameter.value),
        in_range=parameter.in_range,
        true_value=ABSENT if true is None else number(true * shown.factor),
        error=_difference(parameter.value, true),
        true_place=None if true is None else _place(parameter, true),
    )


def _place(parameter: IdentifiedParameter, value: float) -> float | None:
    """Return where a value lies on its range: 0 at the lower end, 1 at the upper, on the parameter's scale."""
    range_ = Parameter("value", "1", parameter.lower, parameter.upper, parameter.scale)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = float(range_.to_unit(np.array(value, dtype=np.float64)))
    return None if np.isnan(place) else place


def _counterpart(frequency: float, among: Sequence[float], others: Sequence[float]) -> float | None:
    """Return the one of `others` that is nearest to `frequency`, if `frequency` is the nearest to it in turn."""
    if not others or not np.isfinite(frequency):
        return None
    candidate = min(others, key=lambda other: abs(other - frequency))
    nearest = min(
        (frequency for frequency in among if np.isfinite(frequency)), key=lambda frequency: abs(frequency - candidate)
    )
    return candidate if nearest == frequency else None


def _mode_row(mode: Mode, true: float | None) -> ModeRow:
    return ModeRow(
        natural=fixed(mode.natural_frequency, 1),
        true_natural=fixed(true, 1),
        error=_difference(mode.natural_frequency, true),
        reconstructed_peak=fixed(mode.reconstructed_peak, 1),
        measured_peak=fixed(mode.measured_peak, 1),
        difference=_difference(mode.reconstructed_peak, mode.measured_peak),
    )


def _missed_mode_row(true: float) -> ModeRow:
    return ModeRow(ABSENT, fixed(true, 1), ABSENT, ABSENT, ABSENT, ABSENT)


def _difference(value: float | None, reference: float | None) -> str:
    """Write by how many per cent a value lies above or below a reference."""
    if value is None or not reference or not np.isfinite([value, reference]).all():
        return ABSENT
    per_cent = 100.0 * (value - reference) / abs(reference)
    decimals = 2 if abs(per_cent) < 10.0 else 1 if abs(per_cent) < 100.0 else 0
    return fixed(per_cent, decimals, signed=True)


def _lines(value: object) -> list[str]:
    if isinstance(value, Mapping):
        return [f"{name}: {entry}" for name, entry in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [str(entry) for entry in value]
    return [str(value)]
