"""The check whether a model can have produced a measurement with any joint within the ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting import Fit, one_per_response
from dovetail.identification.misspecification.explanations import FlaggedFrf, find_explanations
from dovetail.identification.misspecification.frequency_bands import find_deviating_bands
from dovetail.identification.misspecification.perturbations import list_perturbations
from dovetail.identification.misspecification.prior_predictive import find_missing_resonance
from dovetail.identification.misspecification.result import Misspecification
from dovetail.identification.misspecification.significance import assess_significance, is_negligible
from dovetail.identification.misspecification.whitened_residuals import whiten_residuals
from dovetail.identification.posterior.model_error import MODEL_ERROR

__all__ = ["check_misspecification"]


def check_misspecification(
    assembly: Assembly,
    measured: Frf | Sequence[Frf],
    fit: Fit,
    model_error: float = MODEL_ERROR,
    *,
    explain: bool = True,
) -> Misspecification:
    """Check whether the model can have produced a measurement.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf or sequence of Frf
        One for each response, on its frequencies in the assembly; each is checked by itself.
    fit : Fit
        Of the same measurement.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed.
    explain : bool
        Whether to search for an explanation of a flagged measurement, which takes some seconds.
    """
    frfs = one_per_response(assembly, measured)
    if len(frfs) == 1:
        return _check_response(assembly, frfs[0], fit, model_error, explain)
    counts = [len(frf.frequency) for frf in frfs]
    verdicts = [
        _check_response(assembly.at(index), frf, fit.at(index, counts), model_error, explain)
        for index, frf in enumerate(frfs)
    ]
    worst = max(verdicts, key=lambda verdict: verdict.statistic)
    if not worst.flagged:
        return worst
    point = assembly.description.response_labels[verdicts.index(worst)]
    return replace(worst, reasons=(f"The FRF at {point} is the one that fits the least.", *worst.reasons))


def _check_response(assembly: Assembly, measured: Frf, fit: Fit, model_error: float, explain: bool) -> Misspecification:
    target = measured.to(assembly.description.response.quantity)
    whitened = whiten_residuals(assembly, target, fit, model_error)
    significance = assess_significance(whitened, list_perturbations(assembly))
    if significance.statistic <= 1.0 or is_negligible(fit):
        return Misspecification(False, min(significance.statistic, 1.0))
    flagged = FlaggedFrf(assembly, measured, target, whitened, significance, model_error)
    looks_like = _explain(flagged) if explain else ""
    reason = f"No joint within the ranges explains it: {significance.describe()} (chi-squared {fit.chi_squared:.3g})."
    bands = find_deviating_bands(target.frequency, whitened.by_line)
    return Misspecification(True, significance.statistic, looks_like, (reason,), bands)


def _explain(flagged: FlaggedFrf) -> str:
    explanations = find_explanations(flagged)
    if explanations:
        return f"It looks as if {', or '.join(explanation.words for explanation in explanations)}."
    missing = find_missing_resonance(flagged.assembly, flagged.target)
    if missing is None:
        return ""
    low, high = missing
    return (
        f"It looks as if a resonance were missing or elsewhere: nearly every joint has one between {low:.0f} Hz and "
        f"{high:.0f} Hz, the measurement has none there."
    )
