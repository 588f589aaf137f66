"""A measurement held against all that the model can make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting import Fit, one_for_each
from dovetail.identification.misspecification.explanations import Cause, causes
from dovetail.identification.misspecification.frequency_bands import off_bands
from dovetail.identification.misspecification.perturbations import changes
from dovetail.identification.misspecification.prior_predictive import missing_resonance
from dovetail.identification.misspecification.result import Foreign
from dovetail.identification.misspecification.significance import evidence, is_good
from dovetail.identification.misspecification.whitened_residuals import remainder
from dovetail.identification.posterior.model_error import MODEL_ERROR

__all__ = ["examine"]

_MOST_NAMED = 3


def examine(
    assembly: Assembly,
    measured: Frf | Sequence[Frf],
    fit: Fit,
    model_error: float = MODEL_ERROR,
    *,
    name: bool = True,
) -> Foreign:
    """Say whether the model can have made a measurement.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies; each is examined by itself.
    fit : Fit
        Of the same measurement.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed.
    name : bool
        Whether to seek what explains a foreign measurement, which takes some seconds.
    """
    frfs = one_for_each(assembly, measured)
    if len(frfs) == 1:
        return _examine(assembly, frfs[0], fit, model_error, name)
    parts = [
        _examine(assembly.at(index), frf, fit.at(index, len(frfs)), model_error, name) for index, frf in enumerate(frfs)
    ]
    worst = max(parts, key=lambda part: part.statistic)
    if not worst.flagged:
        return worst
    point = assembly.description.response_labels[parts.index(worst)]
    return replace(worst, reasons=(f"The FRF at {point} is the one that fits the least.", *worst.reasons))


def _examine(assembly: Assembly, measured: Frf, fit: Fit, model_error: float, name: bool) -> Foreign:
    target = measured.to(assembly.description.response.quantity)
    left = remainder(assembly, target, fit, model_error)
    found = evidence(left, changes(assembly))
    if found.statistic <= 1.0 or is_good(fit):
        return Foreign(False, min(found.statistic, 1.0))
    looks_like = _looks_like(assembly, target, causes(assembly, measured, left, found, model_error)) if name else ""
    reason = f"No joint within the ranges explains it: {found.words()} (chi-squared {fit.chi_squared:.3g})."
    return Foreign(True, found.statistic, looks_like, (reason,), off_bands(target.frequency, left.lines))


def _looks_like(assembly: Assembly, target: Frf, explaining: tuple[Cause, ...]) -> str:
    if explaining:
        return f"It looks as if {', or '.join(cause.words for cause in explaining[:_MOST_NAMED])}."
    missing = missing_resonance(assembly, target)
    if missing is None:
        return ""
    low, high = missing
    return (
        f"It looks as if a resonance were missing or elsewhere: nearly every joint has one between {low:.0f} Hz and "
        f"{high:.0f} Hz, the measurement has none there."
    )
