"""FRFs and time signals under the names that SDyPy's packages share (SEP 2 and SEP 5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dovetail.errors import Fault, MeasurementError, UnitError, listing
from dovetail.frf import QUANTITIES, Frf
from dovetail.measurement import EstimatedFrf, frf_from_signals
from dovetail.plain_text import unit_text
from dovetail.units import to_si

_MOTIONS = {"accelerance": ("a", "m/s^2"), "mobility": ("v", "m/s"), "receptance": ("d", "m")}
"""SEP 5's letter and the SI unit of the response of each quantity."""
_LETTERS = {"force": "f", **{quantity: letter for quantity, (letter, _) in _MOTIONS.items()}}


def to_sdypy(frf: Frf) -> dict[str, Any]:
    """Return an FRF under the names of SDyPy's SEP 2, for ``sdypy.EMA.Model(**...)`` and others.

    Parameters
    ----------
    frf : Frf

    Returns
    -------
    dict
        ``frf`` (1, n_freq) complex in SI, ``freq`` (n_freq,) [Hz] and ``frf_form``.
    """
    return {"frf": np.array(frf.values)[np.newaxis], "freq": np.array(frf.frequency), "frf_form": frf.quantity}


def from_sdypy(frf: ArrayLike, freq: ArrayLike, frf_form: str = "accelerance") -> tuple[Frf, ...]:
    """Return FRFs from arrays under the names of SDyPy's SEP 2.

    Parameters
    ----------
    frf : (n_freq,) or (n, n_freq) complex array
        SI.
    freq : (n_freq,) array
        Hz; a line at 0 Hz is left out.
    frf_form : {"accelerance", "mobility", "receptance"}

    Raises
    ------
    MeasurementError
        The shapes do not fit, or the form is not one of these.
    """
    if frf_form not in QUANTITIES:
        raise MeasurementError(Fault("frf_form", f"'{frf_form}' is not a form of an FRF.", listing(QUANTITIES)))
    values, axis = np.atleast_2d(np.asarray(frf, dtype=np.complex128)), np.asarray(freq, dtype=np.float64)
    if axis.ndim != 1 or values.ndim != 2 or values.shape[1] != len(axis):
        problem = f"FRFs of the shape {values.shape} do not fit frequencies of the shape {axis.shape}."
        raise MeasurementError(Fault("frf", problem, "(n, n_freq) and (n_freq,)"))
    positive = axis > 0.0
    return tuple(
        Frf(axis[positive], row[positive], frf_form, label=f"FRF {number}") for number, row in enumerate(values, 1)
    )


def to_sep005(
    force: ArrayLike, response: ArrayLike, fs: float, *, quantity: str = "accelerance"
) -> list[dict[str, Any]]:
    """Return the records of an impact test as time signals of SDyPy's SEP 5.

    Parameters
    ----------
    force : (n_impacts, n_samples) or (n_samples,) array
        N.
    response : array of the same shape
        In SI, according to `quantity`.
    fs : float
        Hz.
    quantity : {"accelerance", "mobility", "receptance"}
        As in `frf_from_signals`.

    Returns
    -------
    list of dict
        The forces, then the responses, each with ``data``, ``name``, ``unit_str``, ``fs`` and ``quantity``.
    """
    if quantity not in _MOTIONS:
        raise MeasurementError(Fault("quantity", f"'{quantity}' is not a quantity.", listing(_MOTIONS)))
    channels = [("force", "f", "N", force), ("response", *_MOTIONS[quantity], response)]
    return [
        {"data": np.array(row), "name": f"{name} {number}", "unit_str": unit_text(unit), "fs": fs, "quantity": letter}
        for name, letter, unit, rows in channels
        for number, row in enumerate(np.atleast_2d(np.asarray(rows, dtype=np.float64)), 1)
    ]


def from_sep005(signals: Sequence[Mapping[str, Any]], **options: Any) -> EstimatedFrf:
    """Estimate an FRF from time signals of SDyPy's SEP 5: forces and responses, one of each for every impact.

    Parameters
    ----------
    signals : sequence of mappings
        With ``data``, ``unit_str`` and ``fs`` or ``time``; the unit says which are forces.
    **options
        Of `frf_from_signals`.

    Raises
    ------
    MeasurementError
        There are not as many responses as forces; sampling rates or lengths differ; a unit is not that of a force or a
        motion.
    """
    rates = {rate for signal in signals for rate in _rates(signal)}
    found: dict[str, list[Any]] = {}
    for signal in signals:
        name, factor = _kind(signal)
        found.setdefault(name, []).append(factor * np.asarray(signal["data"], dtype=np.float64))
    forces, motions = found.pop("force", []), found
    if len(rates) != 1 or len(motions) != 1 or len(next(iter(motions.values()))) != len(forces):
        counts = ", ".join(f"{len(rows)} of {name}" for name, rows in {"force": forces, **motions}.items())
        problem = f"there are {counts}, sampled at {listing(f'{rate:g}' for rate in sorted(rates))} Hz."
        raise MeasurementError(Fault("signals", problem, "as many responses of one kind as forces, at one rate"))
    ((quantity, responses),) = motions.items()
    if len({len(row) for row in (*forces, *responses)}) != 1:
        raise MeasurementError(Fault("signals", "the signals have different lengths."))
    return frf_from_signals(np.stack(forces), np.stack(responses), rates.pop(), quantity=quantity, **options)


def _rates(signal: Mapping[str, Any]) -> set[float]:
    """Return the sampling rates [Hz] by 'fs' and by 'time', to the digits that times have."""
    fs = signal.get("fs")
    time = np.asarray(signal.get("time", ()), dtype=np.float64)
    if fs is not None and len(time) < 2:
        return {round(float(fs), 9)}
    if len(time) < 2 or not np.allclose(np.diff(time), (time[-1] - time[0]) / (len(time) - 1), rtol=1e-3):
        raise MeasurementError(Fault("signals", f"'{signal.get('name', '')}' has no 'fs', and no even 'time'."))
    rate = float((len(time) - 1) / (time[-1] - time[0]))
    if fs is None:
        return {round(rate, 9)}
    own = round(float(fs), 9)
    return {own} if np.isclose(rate, own, rtol=1e-6) else {own, round(rate, 9)}


def _kind(signal: Mapping[str, Any]) -> tuple[str, float]:
    """Return "force", or the quantity to which a motion belongs, and the factor to SI."""
    unit = str(signal.get("unit_str", "")).replace("²", "^2").replace("·", " ")
    for name, known in (("force", "N"), *((quantity, unit) for quantity, (_, unit) in _MOTIONS.items())):
        try:
            factor = to_si(f"1 {unit}", known)
        except UnitError:
            continue
        letter = signal.get("quantity")
        if letter in _LETTERS.values() and letter != _LETTERS[name]:
            problem = f"'{signal.get('name', '')}' has the unit '{unit}' and the quantity '{letter}'."
            accepted = ", ".join(f"'{one}' for {of}" for of, one in _LETTERS.items())
            raise MeasurementError(Fault("signals", problem, accepted))
        return name, factor
    problem = f"the unit '{unit}' of '{signal.get('name', '')}' is not that of a force or a motion."
    raise MeasurementError(Fault("signals", problem, "N, m/s^2, m/s, m, and their multiples"))
