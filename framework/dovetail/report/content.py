"""The content of the report as rows of text for the template."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from dovetail.errors import Importance, Note, by_importance, listing, reworded
from dovetail.frf import LOW_COHERENCE
from dovetail.frf.resonance_peaks import counterpart
from dovetail.identification import AtPoint, Fit, Identification, Mode, Posterior, TableRow
from dovetail.identification.parameters import place_on_range
from dovetail.identification.truth import TrueValues
from dovetail.inference.posterior import FIXED
from dovetail.plain_text import ABSENT, display_unit, fixed, hertz, number, readable
from dovetail.report.pages import residual_over_noise
from dovetail.units import format_quantity

_SYNTHETIC = "This measurement is synthetic: it was simulated, not taken in a laboratory."


_CHANCE = 0.01
"""Probability of as many intervals without the truth below which they are more than expected."""
_MOST_BANDS = 5
"""Bands in which model and measurement agree poorly that a sentence lists."""
_PIECES, _AGREES = 20, 0.995
"""Number of parts of the band, of which the one with the least agreement is named, unless its mean is above this."""

_EXPLAINED = {
    "to the noise": ("good", "The model fits to the noise"),
    "good": ("good", "The model fits well"),
    "rough": ("rough", "The model fits roughly"),
    "does not fit": ("bad", "The model does not fit: do not trust the numbers."),
    "not judged": ("open", "Whether the model fits was not judged"),
}
"""Mark and sentence for each word of the adequacy."""

VERDICT_MARKS = {"identified": "good", "weakly identified": "rough", "not identifiable": "bad"}
"""Mark of each verdict on a parameter, in the order in which they are counted."""


@dataclass(frozen=True)
class GroupRow:
    """One of the separate groups of a parameter's likely values, as text."""

    share: str
    estimate: str
    interval: str
    precision: str


@dataclass(frozen=True)
class ParameterRow:
    """One row of the table of parameters: what was `identified`, as text, with the truth if it is known.

    Places are fractions of the range on the parameter's scale, None if nothing is drawn. The interval of a result that
    is not trustworthy is withheld, since it would be valid only if the model were right.
    """

    identified: TableRow
    estimate: str
    interval: str
    unit: str
    best_fit: str
    best_fit_place: str
    """Whether the best fit is at an end of the range, or outside the interval; empty if neither."""
    best_fit_on_range: float | None
    """Place of a best fit outside its interval; None for all others."""
    mark: str
    """Of the verdict, as in `VERDICT_MARKS`."""
    groups: tuple[GroupRow, ...]
    reason: str
    """Of the verdict; empty if there is nothing to add to it."""
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

    `damping` is the damping ratio, `error` is that of `natural` relative to `true_natural`, `difference` that of the
    reconstructed peak of the FRF relative to the measured one, or of `natural` to that in a measured table.
    """

    natural: str
    damping: str
    true_natural: str
    error: str
    reconstructed_peak: str
    measured_peak: str
    difference: str
    measured_natural: str = ""
    measured_damping: str = ""


def is_synthetic(result: Identification, truth: TrueValues | None) -> bool:
    """Return whether the measurement was simulated, according to its name or note, the provenance or the truth."""
    if truth is not None and truth.synthetic:
        return True
    said = (result.measured.label, *(result.provenance.get(key, "") for key in ("measurement", "measurement_note")))
    return bool(result.provenance.get("synthetic")) or any("synthetic" in str(text).lower() for text in said)


def warnings_of(result: Identification, truth: TrueValues | None) -> list[str]:
    """Return the warnings by their importance, with one of a synthetic measurement at the end."""
    warnings = [reworded(warning, readable(warning)) for warning in result.warnings]
    is_said = any("synthetic" in warning.lower() for warning in warnings)
    if not is_said and is_synthetic(result, truth):
        warnings.append(Note(_SYNTHETIC, Importance.DETAIL))
    return list(by_importance(warnings))


def verdict_on(result: Identification) -> tuple[str, str]:
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
    counted = [f"{counts[word]} {word}" for word in VERDICT_MARKS if counts[word]]
    count = len(result.parameters)
    known = (
        f"of {count} parameter{'s' * (count > 1)}, {listing(counted)}"
        if counted
        else "how well each parameter is known was not asked"
    )
    return mark, readable(f"{explained}{within}; {known}.")


def outside_sentence(table: Sequence[TableRow]) -> str:
    """Return a sentence that explains best fits outside their intervals; empty if there are none."""
    outside = [row.name for row in table if row.best_fit_outside and not row.tied_to]
    if not outside:
        return ""
    one = len(outside) == 1
    return (
        f"The best fit of {listing(outside)} lies outside {'its' if one else 'their'} 90 % "
        f"interval{'s' * (not one)}: where many sets fit nearly equally well, small errors decide which is the "
        "best, and it need not be a likely one."
    )


def adequacy_sentences(result: Identification) -> list[str]:
    """Return sentences on how well the model explains the measurement, what that means, and possible causes."""
    adequacy = result.adequacy
    if adequacy is None:
        return []
    notes = [*adequacy.reasons, "" if result.warning else adequacy.meaning]
    notes += [cause.sentence for cause in adequacy.causes]
    if not result.is_trustworthy:
        notes += [_poor_bands_sentence(response, result) for response in result.responses]
    return [readable(sentence) for sentence in (result.warning, adequacy.sentence, *by_importance(notes)) if sentence]


def _poor_bands_sentence(response: AtPoint, result: Identification) -> str:
    """Say where the FRFs at a response agree poorly: the bands that the chart shades; empty if nowhere."""
    bands = [f"{low:.6g} to {high:.6g} Hz" for low, high in response.poor_bands]
    if not bands:
        return ""
    where = f" at {response.point}" if result.further else ""
    named = listing([*bands[:_MOST_BANDS], *([f"{len(bands) - _MOST_BANDS} more"] * (len(bands) > _MOST_BANDS))])
    return f"The model is off{where} (coherence below {LOW_COHERENCE:g}) at {named}."


def parameter_rows(result: Identification, truth: TrueValues | None) -> list[ParameterRow]:
    """Return the table of parameters, in the assembly's order."""
    true = {} if truth is None else truth.with_tied(result.parameters.values())
    withheld = result.posterior is not None and not result.is_trustworthy
    return [_parameter_row(row, withheld, true.get(row.name)) for row in result.table]


def known_rows(result: Identification) -> list[tuple[str, str]]:
    """Return the known parameters of the description, in SI."""
    return [(name, readable(format_quantity(value, "1", 6))) for name, value in result.known.items()]


def mode_rows(result: Identification, truth: TrueValues | None) -> list[ModeRow]:
    """Return the table of natural frequencies: the identified ones, and measured peaks and true ones without any."""
    if result.frf is None:
        low, high = 0.0, max(mode.natural_frequency for mode in result.modes)
    else:
        low, high = result.frf.frequency[[0, -1]] if result.band is None else result.band
    inside = np.array([f for f in (truth.natural_frequencies if truth is not None else ()) if low <= f <= high])
    identified = np.array([mode.natural_frequency for mode in result.modes])
    known = identified[np.isfinite(identified)]
    matched = [counterpart(frequency, known, inside, closeness=np.inf) for frequency in identified.tolist()]
    mode_row = _mode_row if result.responses else _tabulated_mode_row
    rows = [(mode.natural_frequency, mode_row(mode, true)) for mode, true in zip(result.modes, matched, strict=True)]
    missed = inside[~np.isin(inside, [true for true in matched if true is not None])]
    peaks = np.array([peak.measured_peak for peak in result.peaks_without_mode])
    for peak, frequency in zip(result.peaks_without_mode, peaks.tolist(), strict=True):
        true = counterpart(frequency, peaks, missed)
        missed = missed[missed != true]
        rows.append((frequency, _mode_row(peak, true)))
    rows += [(true, _mode_row(Mode(math.nan, None, None), true)) for true in missed.tolist()]
    return [row for _, row in sorted(rows, key=lambda entry: (not np.isfinite(entry[0]), entry[0]))]


def columns_sentence(result: Identification) -> str:
    """Return sentences that explain the columns of the table."""
    sentences = []
    if any(row.best_fit is not None for row in result.table):
        sentences.append(
            "Quote the estimate of a single parameter; the best fit is the set of all that together reproduce the "
            "measurement best."
        )
    sentences.append(outside_sentence(result.table))
    if result.network is not None:
        sentences.append("The network's estimate is one of the starts of the fit.")
    return " ".join(filter(None, sentences))


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
        residual = residual_over_noise(response.measured, response.frf.values)[lines]
        noises = number(np.sqrt(np.mean(residual**2)).item(), 2, padded=False)
        agreement_words = f"a mean of {min(agreement):.3f} and a residual of {noises} times the noise"
        worst.append(f"from {low:.5g} to {high:.5g} Hz{where}, with {agreement_words}")
    return f"The agreement is least {'; '.join(worst)}." if worst else ""


def posterior_sentence(posterior: Posterior) -> str:
    """Return a sentence on how the posterior was computed, and how many samples it has."""
    name, difference = max(posterior.split_half_difference.items(), key=lambda entry: entry[1])
    halves = (
        f"two halves of the samples differ in an interval by at most {100 * difference:.0f} % of its width ({name})"
    )
    samples, seconds = f"{len(posterior.weight)} samples", number(posterior.seconds, 2, padded=False)
    if posterior.form == "laplace":
        return f"A Gaussian at the most probable place, in {seconds} s; {samples} of it, {halves}."
    if np.ptp(posterior.weight) == 0.0 and posterior.converged_fraction == 1.0:  # drawn without any search
        return f"{samples} of equal weight in {seconds} s; {halves}."
    reached = f"{100 * posterior.converged_fraction:.0f} % of the searches for them reached their target"
    return (
        f"{samples} in {seconds} s; {reached}. "
        f"The effective sample size is {posterior.effective_sample_size:.0f}; {halves}."
    )


def fit_sentence(fit: Fit, *, has_lines: bool = True) -> str:
    """Return a sentence on how good a fit to lines of FRFs or to a table is, and on its cost."""
    estimated = "estimated from " + ("the scatter from line to line" if has_lines else "the residuals")
    source = "as the measurement gives it" if fit.variance_known else estimated
    if fit.variance_assumed:
        source = "assumed to be 1 % of the largest value, since fewer than 10 lines cannot show it"
    freedom = str(fit.degrees_of_freedom) if has_lines else number(fit.degrees_of_freedom, 2, padded=False)
    searches = f"{fit.starts} start{'s' * (fit.starts != 1)}, {fit.steps} steps, " if fit.starts else ""
    return (
        f"Chi-squared {fit.chi_squared:.3g} per degree of freedom ({freedom}) over the random error, "
        f"{source}; {searches}{number(fit.seconds, 2, padded=False)} s."
    )


def _parameter_row(row: TableRow, withheld: bool, true: float | None) -> ParameterRow:
    shown = display_unit(row.unit, row.range_low, row.range_high)

    def text(value: float | None) -> str:
        return "" if value is None else number(value * shown.factor)

    def interval(low: float | None, high: float | None) -> str:
        return "" if low is None or high is None else f"{text(low)} to {text(high)}"

    low, high = row.interval_low, row.interval_high
    return ParameterRow(
        row,
        estimate=text(row.estimate),
        interval="withheld" if withheld else interval(low, high),
        unit=shown.text,
        best_fit=text(row.best_fit),
        best_fit_place=_place_of_best_fit(row),
        best_fit_on_range=_place(row, row.best_fit) if row.best_fit_outside else None,
        mark=VERDICT_MARKS.get(row.verdict, "open"),
        groups=tuple(
            GroupRow(
                f"{100 * group.weight:.0f} %",
                text(group.estimate),
                interval(group.interval_low, group.interval_high),
                group.precision,
            )
            for group in row.groups or ()
        ),
        reason="" if row.why == FIXED else row.why,
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


def _place_of_best_fit(row: TableRow) -> str:
    at_end = f"at the {row.best_fit_at} end of its range" if row.best_fit_at else ""
    return ", ".join(filter(None, [at_end, "outside its interval" if row.best_fit_outside else ""]))


def _place(row: TableRow, value: float | None) -> float | None:
    """Return the place of a value on its range, or None if it has none."""
    place = math.nan if value is None else place_on_range(value, row.range_low, row.range_high, row.scale)
    return None if math.isnan(place) else place


def _mode_row(mode: Mode, true: float | None) -> ModeRow:
    return ModeRow(
        natural=hertz(mode.natural_frequency),
        damping=ABSENT if mode.damping_ratio is None else number(100.0 * mode.damping_ratio, 3),
        true_natural=hertz(true),
        error=_difference(mode.natural_frequency, true),
        reconstructed_peak=hertz(mode.reconstructed_peak),
        measured_peak=hertz(mode.measured_peak),
        difference=_difference(mode.reconstructed_peak, mode.measured_peak),
    )


def _tabulated_mode_row(mode: Mode, true: float | None) -> ModeRow:
    """Return the row of a mode of which a measured table may have frequency and damping, and no peaks."""
    return replace(
        _mode_row(mode, true),
        reconstructed_peak="",
        measured_peak="",
        difference=_difference(mode.natural_frequency, mode.measured_frequency),
        measured_natural=hertz(mode.measured_frequency),
        measured_damping=ABSENT if mode.measured_damping is None else number(100.0 * mode.measured_damping, 3),
    )


def _difference(value: float | None, reference: float | None) -> str:
    """Write the difference of a value from a reference in per cent."""
    if value is None or not reference or not np.isfinite([value, reference]).all():
        return ABSENT
    per_cent = 100.0 * (value - reference) / abs(reference)
    decimals = 2 if abs(per_cent) < 10.0 else 1 if abs(per_cent) < 100.0 else 0
    return fixed(per_cent, decimals, signed=True)
