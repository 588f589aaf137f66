"""Which resonances of a measurement a model lacks, from the peaks that are paired in the table of frequencies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Importance, Note
from dovetail.frf import Frf
from dovetail.frf.resonances import fit_resonances
from dovetail.inference.adequacy.verdict import AtPoint


@dataclass(frozen=True)
class Settings:
    """When a model lacks a resonance of the measurement."""

    most_listed: int = 5
    """Resonances that are listed."""
    shifted: float = 0.02
    """Relative distance within which a peak lies in receptance and accelerance."""
    same: float = 0.01
    """Relative distance within which resonances of several FRFs are taken for the same one."""
    displaced: float = 2.0
    """Distance of a peak from the model's resonance to which it may belong, over the error of natural frequencies."""
    near: tuple[float, float] = (0.01, 0.05)
    """Relative distance that this is at least and at most."""
    mains: tuple[float, ...] = (50.0, 60.0)
    """Hz; multiples show in measurements with a ground loop."""
    mains_lines: float = 2.0
    """Lines of the measurement within which a peak is at a multiple."""
    finest_part: float = 0.02
    """Of the mains frequency, above which lines are too coarse to recognise hum."""
    fewest_hums: int = 2
    """Lines at multiples of the mains frequency that make it hum, since one alone may be chance."""


_SETTINGS = Settings()


def lacking_resonances(responses: Sequence[AtPoint], natural_frequency_error: float) -> NDArray[np.float64]:
    """Return the resonances of a measurement [Hz] that a model lacks, increasing.

    They are the measured peaks without a counterpart among the model's. A peak near a resonance of the model that makes
    no peak in that FRF is not another resonance, nor is a hump of the accelerance that the receptance does not have.

    Parameters
    ----------
    responses : sequence of AtPoint
    natural_frequency_error : float
        Relative error of the model's natural frequencies; NaN if it is unknown.
    """
    unpaired = np.unique(
        [at for each in responses for at in each.peaks.unpaired.tolist() if _is_resonance(each.measured, at)]
    )
    if not unpaired.size:
        return unpaired
    modelled = [response.frf for response in responses]
    poles = fit_resonances(modelled, [frf.values for frf in modelled]).poles.real
    near = np.clip(_SETTINGS.displaced * np.nan_to_num(natural_frequency_error), *_SETTINGS.near)
    lacking = unpaired[np.all(np.abs(poles[:, np.newaxis] - unpaired) > near * unpaired, axis=0)]
    return lacking[np.append(True, np.diff(lacking) > _SETTINGS.same * lacking[1:])] if lacking.size else lacking


def _is_resonance(frf: Frf, frequency: float) -> bool:
    """Return whether the receptance has a maximum near a peak of the accelerance [Hz]."""
    receptance = frf.to("receptance").amplitude
    first, last = np.searchsorted(frf.frequency, frequency * (1.0 + _SETTINGS.shifted * np.array([-1.0, 1.0])))
    window = receptance[max(first - 2, 0) : last + 2]
    return 0 < int(np.argmax(window)) < len(window) - 1


def describe_lacking(lacking: NDArray[np.float64], measured: Sequence[Frf]) -> Iterator[Note]:
    """Yield which resonances [Hz] the model lacks, and whether they may be the hum of the mains, as sentences."""
    if not lacking.size:
        return
    named = [f"{frequency:.4g}" for frequency in lacking[: _SETTINGS.most_listed]]
    yield Note(f"The measurement has resonances that the model lacks: {', '.join(named)} Hz.", Importance.DECISIVE)
    lines = max(float(np.median(np.diff(frf.frequency))) for frf in measured if len(frf.frequency) > 1)
    for mains in _SETTINGS.mains:
        nearest = mains * np.maximum(1.0, np.round(lacking / mains))
        hum = np.abs(lacking - nearest) <= _SETTINGS.mains_lines * lines
        if lines < _SETTINGS.finest_part * mains and np.count_nonzero(hum) >= _SETTINGS.fewest_hums:
            at = ", ".join(f"{frequency:.4g}" for frequency in lacking[hum])
            yield Note(f"Of these, {at} Hz are multiples of {mains:g} Hz: the hum of the mains?", Importance.DECISIVE)
