"""The content of the report as rows of text for the template."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from dovetail.errors import listing
from dovetail.frf.resonance_peaks import counterpart
from dovetail.identification import Fit, Identification, ModalIdentification, Mode, Posterior, TableRow
from dovetail.identification.parameters import place_on_range
from dovetail.report.truth import Truth
from dovetail.report.wording import ABSENT, display_unit, fixed, hertz, number, readable
from dovetail.units import format_quantity

__all__ = [
    "EvaluationRow",
    "ModeRow",
    "ParameterRow",
    "adequacy_sentences",
    "columns_sentence",
    "evaluation_rows",
    "fit_sentence",
    "is_synthetic",
    "known_rows",
    "misfit_sentence",
    "mode_rows",
    "parameter_rows",
    "posterior_sentence",
    "provenance_rows",
    "truth_sentence",
    "verdict",
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
"""Entries of the provenance that have separate sections in the report."""

_SYNTHETIC = "This measurement is synthetic: it was simulated, not taken in a laboratory."


_CHANCE = 0.01
"""Probability of as many intervals without the truth below which they are more than expected."""
_PIECES, _AGREES = 20, 0.995
"""Number of parts of the band, of which the one with the least agreement is named, unless its mean is above this."""

_EXPLAINED = {
    "to the noise": ("good", "The model explains the measurement down to its noise"),
    "good": ("good", "The model explains the measurement well"),
    "rough": ("rough", "The model explains the measurement roughly"),
    "does not fit": ("bad", "The model does not explain the measurement: do not believe the numbers."),
    "not judged": ("open", "Whether the model explains the measurement was not judged"),
}
"""Mark and sentence for each word of the adequacy."""

_KNOWN = {"identified": "well known", "weakly identified": "roughly known", "not identifiable": "not told by it"}
"""Words for the verdicts on parameters."""


@dataclass(frozen=True)
class ParameterRow:
    """One row of the table of parameters: what was `identified`, as text, with the truth if it is known.

    Places are fractions of the range on the parameter's scale, None if nothing is drawn. The interval of a result that
    is not to be believed is withheld, since it would be valid only if the model were right.
    """

    identified: TableRow
    estimate: str
    interval: str
    unit: str
    best_fit: str
    network: str
    lower: str
    upper: str
    place: float | None
    low_place: float | None
    high_place: float | None
    true_value: str
    error: str
    network_error: str
    true_place: float | None
    within: bool | None
    """Whether the interval holds the truth; None if one of them is not known."""


@dataclass(frozen=True)
class ModeRow:
    """One row of the table of natural frequencies, in Hz and per cent.

    `error` is that of `natural` relative to `true_natural`, `difference` that of the reconstructed peak of the FRF
    relative to the measured one.
    """

    natural: str
    true_natural: str
    error: str
    reconstructed_peak: str
    measured_peak: str
    difference: str


@dataclass(frozen=True)
class EvaluationRow:
    """Accuracy of the network for one parameter on the test part."""

    name: str
    r2: str
    mae: str
    unit: str
    mae_of_range: str


def is_synthetic(result: Identification, truth: Truth | None) -> bool:
    """Return whether the measurement was simulated, according to its name or note, the provenance or the truth."""
    if truth is not None and truth.synthetic:
        return True
    said = (result.measured.label, *(result.provenance.get(key, "") for key in ("measurement", "measurement_note")))
    return bool(result.provenance.get("synthetic")) or any("synthetic" in str(text).lower() for text in said)


def warnings_of(result: Identification, truth: Truth | None) -> list[str]:
    """Return the warnings, with one of a synthetic measurement first."""
    warnings = [readable(warning) for warning in result.warnings]
    if is_synthetic(result, truth) and not any("synthetic" in warning.lower() for warning in warnings):
        warnings.insert(0, _SYNTHETIC)
    return warnings


def verdict(result: Identification) -> tuple[str, str]:
    """Return the verdict on a result: how well the model explains the measurement, and what is known.

    Returns
    -------
    mark : {"good", "rough", "bad", "open"}
    sentence : str
    """
    word = "not judged" if result.adequacy is None else result.adequacy.word
    size = None if result.adequacy is None else result.adequacy.size
    mark, explained = _EXPLAINED[word]
    if mark == "bad":
        return mark, explained
    first_error = "" if size is None else size.describe().partition(", ")[0]
    within = f" ({first_error})" if first_error else ""
    counts = Counter(row.verdict for row in result.table)
    told = [f"{counts[word]} {words}" for word, words in _KNOWN.items() if counts[word]]
    count = len(result.parameters)
    known = (
        f"of {count} parameter{'s' * (count > 1)}, {listing(told)}"
        if told
        else "how well each parameter is known was not asked"
    )
    return mark, readable(f"{explained}{within}; {known}.")


def adequacy_sentences(result: Identification | ModalIdentification) -> list[str]:
    """Return sentences on how well the model explains the measurement, what that means, and possible causes."""
    adequacy = result.adequacy
    if adequacy is None:
        return []
    sentences = [result.caveat, adequacy.sentence, *adequacy.reasons, "" if result.caveat else adequacy.meaning]
    sentences += [cause.sentence for cause in adequacy.causes]
    if adequacy.bands and not result.believable:
        bands = ", ".join(f"{low:.6g} to {high:.6g} Hz" for low, high in adequacy.bands)
        sentences.append(f"It is off at {bands}.")
    return [readable(sentence) for sentence in sentences if sentence]


def parameter_rows(result: Identification | ModalIdentification, truth: Truth | None) -> list[ParameterRow]:
    """Return the table of parameters, in the assembly's order."""
    true = {} if truth is None else truth.with_followers(result.parameters.values())
    withheld = result.posterior is not None and not result.believable
    return [_parameter_row(row, withheld, true.get(row.name)) for row in result.table]


def known_rows(result: Identification) -> list[tuple[str, str]]:
    """Return the known parameters of the description, in SI."""
    return [(name, readable(format_quantity(value, "1", 6))) for name, value in result.known.items()]


def mode_rows(result: Identification, truth: Truth | None) -> list[ModeRow]:
    """Return the table of natural frequencies: the identified ones, and true ones without a counterpart."""
    low, high = result.frf.frequency[[0, -1]] if result.band is None else result.band
    inside = np.array([f for f in (truth.natural_frequencies if truth is not None else ()) if low <= f <= high])
    identified = np.array([mode.natural_frequency for mode in result.modes])
    known = identified[np.isfinite(identified)]
    matched = [counterpart(frequency, known, inside, closeness=np.inf) for frequency in identified.tolist()]
    rows = [(mode.natural_frequency, _mode_row(mode, true)) for mode, true in zip(result.modes, matched, strict=True)]
    missed = [frequency for frequency in inside.tolist() if frequency not in matched]
    rows += [(true, ModeRow(ABSENT, hertz(true), ABSENT, ABSENT, ABSENT, ABSENT)) for true in missed]
    return [row for _, row in sorted(rows, key=lambda entry: (not np.isfinite(entry[0]), entry[0]))]


def evaluation_rows(result: Identification) -> list[EvaluationRow]:
    """Return the network's accuracy on the test part, if the provenance contains it."""
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


def columns_sentence(result: Identification | ModalIdentification) -> str:
    """Return sentences that explain the columns of the table."""
    sentences = []
    if any(row.best_fit is not None for row in result.table):
        sentences.append(
            "The estimate is what to quote of one parameter by itself. The best fit is all parameters together that "
            "fit the measurement best: where parameters trade with each other, the two differ."
        )
    if result.network is not None:
        sentences.append("The fit began with the network's answer.")
    return " ".join(sentences)


def truth_sentence(rows: Sequence[ParameterRow]) -> str:
    """Return a sentence on which intervals hold the truth; empty without intervals or truth."""
    known = [row for row in rows if row.within is not None]
    missed = [row.identified.name for row in known if not row.within]
    if not known:
        return ""
    if not missed:
        return f"All {len(known)} true values lie within their 90 % intervals."
    count = len(known)
    chance = scipy.stats.binom.sf(len(missed) - 1, count, 0.1)
    expected = "as one of ten is expected to be" if chance > _CHANCE else "more than the one of ten that is expected"
    return f"Outside their 90 % intervals, {expected}: the true values of {listing(missed)}."


def misfit_sentence(result: Identification) -> str:
    """Return a sentence on where in the band measured and reconstructed FRFs agree least; empty if all agree."""
    worst = []
    for response in result.responses:
        pieces = np.array_split(np.arange(response.frf.frequency.size), min(_PIECES, response.frf.frequency.size))
        agreement = [float(response.coherence[lines].mean()) for lines in pieces]
        if min(agreement) > _AGREES:
            continue
        lines = pieces[int(np.argmin(agreement))]
        low, high = response.frf.frequency[lines[[0, -1]]]
        where = f" at {response.point}" if result.further else ""
        worst.append(f"from {low:.5g} to {high:.5g} Hz{where}, with a mean of {min(agreement):.3f}")
    return f"The agreement is least {'; '.join(worst)}." if worst else ""


def posterior_sentence(posterior: Posterior) -> str:
    """Return a sentence on how the posterior was computed, and how many samples it has."""
    name, apart = max(posterior.split_half_difference.items(), key=lambda entry: entry[1])
    halves = f"two halves of them differ in an interval by at most {apart:.0%} of its width ({name})"
    samples, seconds = f"{len(posterior.weight)} samples", number(posterior.seconds, 2, padded=False)
    if posterior.form == "laplace":
        return f"A Gaussian at the most probable place, in {seconds} s; {samples} of it, {halves}."
    if np.ptp(posterior.weight) == 0.0 and posterior.converged_fraction == 1.0:  # drawn without any search
        return f"{samples} of equal weight in {seconds} s; {halves}."
    return (
        f"{samples} in {seconds} s; {posterior.converged_fraction:.0%} of the searches for them reached their target. "
        f"They tell as much as {posterior.effective_sample_size:.0f} independent ones; {halves}."
    )


def fit_sentence(fit: Fit) -> str:
    """Return a sentence on how good a fit is, and on its cost."""
    source = "as the measurement tells it" if fit.variance_known else "told from the scatter from line to line"
    if fit.variance_assumed:
        source = "assumed to be 1 % of the largest value, since fewer than 10 lines do not tell it"
    return (
        f"Chi-squared {fit.chi_squared:.3g} per degree of freedom ({fit.degrees_of_freedom}) over the random error, "
        f"{source}; {fit.starts} start{'s' * (fit.starts != 1)}, {fit.steps} steps, "
        f"{number(fit.seconds, 2, padded=False)} s."
    )


def provenance_rows(provenance: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Return labels and lines of all entries of the provenance that no other section shows."""
    rows = []
    for key, value in provenance.items():
        if key in _ELSEWHERE or value is None:
            continue
        rows.append((_LABELS.get(key, key.replace("_", " ").capitalize()), _lines(value)))
    return rows


def _parameter_row(row: TableRow, withheld: bool, true: float | None) -> ParameterRow:
    shown = display_unit(row.unit, row.range_low, row.range_high)

    def text(value: float | None) -> str:
        return "" if value is None else number(value * shown.factor)

    low, high = row.interval_low, row.interval_high
    interval = "" if low is None or high is None else f"{text(low)} to {text(high)}"
    return ParameterRow(
        row,
        estimate=text(row.estimate),
        interval="withheld" if withheld else interval,
        unit=shown.text,
        best_fit=text(row.best_fit),
        network=text(row.network),
        lower=number(row.range_low * shown.factor, padded=False),
        upper=number(row.range_high * shown.factor, padded=False),
        place=_place(row, row.estimate),
        low_place=_place(row, low),
        high_place=_place(row, high),
        true_value=text(true) or ABSENT,
        error=_difference(row.estimate, true),
        network_error="" if row.network is None else _difference(row.network, true),
        true_place=_place(row, true),
        within=None if true is None or low is None or high is None else low <= true <= high,
    )


def _place(row: TableRow, value: float | None) -> float | None:
    """Return the place of a value on its range, or None if it has none."""
    place = math.nan if value is None else place_on_range(value, row.range_low, row.range_high, row.scale)
    return None if math.isnan(place) else place


def _mode_row(mode: Mode, true: float | None) -> ModeRow:
    return ModeRow(
        natural=hertz(mode.natural_frequency),
        true_natural=hertz(true),
        error=_difference(mode.natural_frequency, true),
        reconstructed_peak=hertz(mode.reconstructed_peak),
        measured_peak=hertz(mode.measured_peak),
        difference=_difference(mode.reconstructed_peak, mode.measured_peak),
    )


def _difference(value: float | None, reference: float | None) -> str:
    """Write the difference of a value from a reference in per cent."""
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
