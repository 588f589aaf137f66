"""How well a model explains a measurement: the size of its errors, one word for it, and what would explain them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.frf import Frf, coherence_with_model, poor_bands
from dovetail.frf.resonance_peaks import PairedPeaks, resonance_peaks
from dovetail.inference.posterior.model_error import TYPICAL, ModelError, typical_model_error
from dovetail.interfaces import Parameter
from dovetail.units import format_quantity

AdequacyWord: TypeAlias = Literal["to the noise", "good", "rough", "does not fit", "not judged"]
"""From best to worst; "not judged" if a method does not judge the model."""
TOO_FEW_VALUES = "The measurement has no more values than there are unknowns: the fit cannot be judged."
"""Why a fit is not judged that any model with as many unknowns would reach."""

NOTHING_SHOWN = (
    "The measurement shows nothing of the structure: no resonance or other motion stands out of its random error. "
    "Whatever is identified follows from noise."
)
"""Why a fit to mere noise does not count."""


NO_TIME = "The time ended before the fit was judged: it may not be the best one, and its errors are not known."
"""Why a fit is not judged for which a time limit was too short."""


GOOD: Final = ModelError(0.01, damping=0.5, magnitude=0.25, phase=0.15, other=0.2, background=0.2)
ROUGH: Final = ModelError(0.06, damping=2.0, magnitude=0.8, phase=0.6, other=0.7, background=np.inf)
"""The largest errors at which a model still counts as good, and as rough.

They follow from what such a model is used for, not from any measurement: a good model predicts the frequencies and
heights of resonances; a rough one shows only which resonance of the model is which of the measurement. A background
does not hide that, however large it is.
"""
_IN_INTERVALS: Final = 2.0
"""Multiple of the estimated errors that intervals allow for: the estimate is good within a factor of two."""

_MEANING: Final[dict[AdequacyWord, str]] = {
    "to the noise": "Nothing but random error separates model and measurement.",
    "good": "The model can be relied on as far as its intervals say; they allow for these errors.",
    "rough": "Take it for what goes with what, not for precise values; the intervals allow for these errors.",
    "does not fit": "No error of a plausible size explains the measurement: do not trust the numbers.",
    "not judged": "",
}
_KINDS = {
    "natural_frequency": "natural frequencies",
    "damping": "damping",
    "magnitude": "amplitudes",
    "phase": "phases",
    "background": "a smooth background",
}
_CHANGE = "A change explains more: if it is so, parameters may lie beyond these intervals; make it and identify again."


@dataclass(frozen=True)
class Cause:
    """A change of model or measurement with which the two agree better.

    Parameters
    ----------
    name : str
        Its kind: "sign", "gain", "unit", "quantity", "delay", "conjugate", "point", "mass", "overhang", "range",
        "resonance", "order", "damping", "window", "part", "level".
    words : str
        The change, worded to follow "with": "the sign reversed".
    coherence : (float, float)
        Mean coherence of model and measurement without and with it: that of the result, and that of a fit on few lines.
    residual_factor : float
        By how much typical residuals become smaller.
    theta : tuple of float
        The parameters that fit best with the change [SI].
    residual : float or None
        Typical residual with it, relative to the FRF.
    """

    name: str
    words: str
    coherence: tuple[float, float]
    residual_factor: float
    theta: tuple[float, ...] = ()
    residual: float | None = None

    @property
    def sentence(self) -> str:
        """The cause with its figures."""
        (before, after), improvements = self.coherence, list[str]()
        if after - before >= 5e-4:
            improvements.append(f"the coherence rises from {before:.3f} to {after:.3f}")
        if self.residual_factor >= 1.05:
            to = "" if self.residual is None else f", {100.0 * self.residual:.2g} % of the FRF"
            improvements.append(f"residuals become {self.residual_factor:.2g} times smaller{to}")
        return f"With {self.words} {' and '.join(improvements) or 'the structure delivers no power'}."


@dataclass(frozen=True)
class Adequacy:
    """How well a model explains a measurement.

    Parameters
    ----------
    word : {"to the noise", "good", "rough", "does not fit", "not judged"}
    size : ModelError or None
        The errors of the model that the measurement shows, NaN for each kind that it does not determine; None if it
        shows none, or the method does not estimate them.
    allowed : float or None
        Relative error of natural frequencies that the user allowed, which sets weights and intervals instead of
        `size`.
    causes : tuple of Cause
        What makes the model fit better, the best first; at most three.
    reasons : tuple of str
        What else there is to say, as sentences.
    bands : tuple of (float, float)
        Frequency bands [Hz] in which the measurement deviates by more than its noise, response by response, the worst
        of each first. If the model does not fit, those in which the `Identification`'s FRFs agree poorly.
    in_intervals : ModelError or None
        Errors that intervals allow for, if they are not twice `size`.
    """

    word: AdequacyWord
    size: ModelError | None = None
    allowed: float | None = None
    causes: tuple[Cause, ...] = ()
    reasons: tuple[str, ...] = ()
    bands: tuple[tuple[float, float], ...] = ()
    in_intervals: ModelError | None = None

    @property
    def fits(self) -> bool:
        """Whether an error of a plausible size explains the measurement, as far as the method judges that."""
        return self.word != "does not fit" and NO_TIME not in self.reasons

    @property
    def error_in_intervals(self) -> ModelError:
        """The errors that intervals allow for: the user's, or else twice the estimated ones, typical ones at least.

        Where the model is wrong, a quantity of any part may be the reason.
        """
        if self.in_intervals is not None:
            return self.in_intervals
        if self.allowed is not None:
            error = typical_model_error(self.allowed)
        elif self.size is not None:
            return errors_in_intervals(self.size)
        else:
            return TYPICAL
        return replace(error, quantities=error.natural_frequency)

    @property
    def meaning(self) -> str:
        """What the word means for use, in a sentence; empty if the model was not judged."""
        if NO_TIME in self.reasons:
            return "Do not trust the numbers: allow more time."
        if NOTHING_SHOWN in self.reasons:
            return "Do not trust the numbers: measure again with a stronger force, more averages, or another point."
        return f"{_MEANING[self.word]} {_CHANGE}" if self.causes and self.fits else _MEANING[self.word]

    @property
    def sentence(self) -> str:
        """The word with the figures behind it."""
        if self.size is None:
            return f"The model fits {self.word}." if self.word == "to the noise" else ""
        heads = {"good": "The model fits well", "rough": "The model fits roughly"}
        unknown = [_KINDS[name] for name in self.size.unknown if name in _KINDS]
        head, errors = heads.get(self.word, "The model does not fit"), self.size.describe()
        known = f"{head}{':' if self.word in heads else ', unless'} {errors}." if errors else f"{head}."
        if not unknown:
            return known
        named = " and ".join(filter(None, [", ".join(unknown[:-1]), unknown[-1]]))
        return f"{known} Errors of {named} are unknown: this measurement does not show them."

    def parameters_moved_by_causes(
        self, intervals: Mapping[str, tuple[float, float]], parameters: Sequence[Parameter]
    ) -> dict[str, str]:
        """Name the parameters that some cause moves from the middle of their interval by more than its width.

        The value of such a parameter depends on whether the cause is real, which the measurement alone does not decide.
        """
        moved = dict[str, str]()
        for cause in self.causes:
            for parameter, ends, value in zip(parameters, intervals.values(), cause.theta, strict=False):
                with np.errstate(divide="ignore", invalid="ignore"):
                    lower, upper, at = parameter.to_unit(np.array([*ends, value]))
                if abs(at - 0.5 * (lower + upper)) > upper - lower:
                    shown = format_quantity(value, parameter.unit)
                    moved.setdefault(parameter.name, f"with {cause.words} it is {shown}")
        return moved

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, fit for JSON."""
        return {
            "word": self.word,
            "meaning": self.meaning,
            "model_error": None if self.size is None else self.size.to_dict(),
            "model_error_in_intervals": None if self.in_intervals is None else self.in_intervals.to_dict(),
            "allowed": self.allowed,
            "causes": [{**asdict(cause), "sentence": cause.sentence} for cause in self.causes],
            "reasons": list(self.reasons),
            "bands_Hz": [list(band) for band in self.bands],
        }


def errors_in_intervals(size: ModelError) -> ModelError:
    """Return the errors that intervals allow for if a model has errors of this size, none of them unknown.

    They are twice as large, and typical ones at least. A quantity of any part may be their reason.
    """
    error = size.times(_IN_INTERVALS).at_least(TYPICAL)
    return replace(error, quantities=error.natural_frequency)


def word_for(size: ModelError, good: ModelError = GOOD, rough: ModelError = ROUGH) -> AdequacyWord:
    """Return the word for errors of this size, by the largest ones of a good and of a rough model."""
    if size.within(good):
        return "good"
    return "rough" if size.within(rough) else "does not fit"


@dataclass(frozen=True, eq=False)
class AtPoint:
    """The measured and the reconstructed FRF at one response.

    Parameters
    ----------
    point : str
        Where the response is: ``"tool, 10 mm"``.
    frf, measured : Frf
        As in `Identification`.
    """

    point: str
    frf: Frf
    measured: Frf

    @property
    def coherence(self) -> NDArray[np.float64]:
        """(n_freq,) coherence of reconstruction and measurement; of their amplitudes if there is no phase.

        Eq. 15 of Processes 14 (2026) 1875, doi:10.3390/pr14121875.
        """
        return coherence_with_model(self.measured, self.frf.values)

    @property
    def mean_coherence(self) -> float:
        """Mean of `coherence` over the frequencies."""
        return float(self.coherence.mean())

    @cached_property
    def peaks(self) -> PairedPeaks:
        """The resonance peaks of the two FRFs."""
        return PairedPeaks(resonance_peaks(self.measured), resonance_peaks(self.frf))

    @property
    def poor_bands(self) -> tuple[tuple[float, float], ...]:
        """Bands [Hz] in which the two agree poorly, those first that lower the mean coherence most."""
        return poor_bands(self.frf.frequency, self.coherence)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, fit for JSON."""
        return {
            "point": self.point,
            "frequency_Hz": self.frf.frequency.tolist(),
            "mean_coherence": self.mean_coherence,
            "poor_bands_Hz": [list(band) for band in self.poor_bands],
            "quantity": self.frf.quantity,
            "frf": plain_frf(self.frf),
            "measured": plain_frf(self.measured),
            "coherence": self.coherence.tolist(),
        }


def plain_frf(frf: Frf) -> dict[str, Any]:
    """Return label, kind and values of an FRF as plain values, fit for JSON."""
    values = {"real": frf.values.real.tolist(), "imag": frf.values.imag.tolist()}
    return {"label": frf.label, "has_phase": frf.has_phase, "rotation": frf.rotation, "moment": frf.by_moment, **values}
