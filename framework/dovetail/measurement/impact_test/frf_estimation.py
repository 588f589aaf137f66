"""The FRF from the time records of an impact test."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.errors import Fault, MeasurementError, require_package
from dovetail.frf import Frf, Quantity
from dovetail.measurement.impact_test.offsets import remove_force_offset, remove_response_offset
from dovetail.measurement.impact_test.signal_quality import check_signals
from dovetail.measurement.recording import parse_quantity

Estimator = Literal["H1", "H2"]
ESTIMATORS: tuple[Estimator, ...] = get_args(Estimator)
_FEWEST_SAMPLES = 16
_MOST_SAMPLES = 100_000_000
_RESPONSES = {"receptance": "d", "mobility": "v", "accelerance": "a"}

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EstimatedFrf:
    """An FRF from time records.

    Parameters
    ----------
    frf : Frf
        With coherence and number of averages, from which `Frf.random_variance` gives the variance of each line
        (Bendat and Piersol). A single impact has neither coherence nor variance.
    warnings : tuple of str
        Faults of the records.
    used : tuple of int
        Numbers of the impacts that were averaged, from 1.
    decay : float
        Decay [1/s] that an exponential window adds to each mode; 0 without a window.
    """

    frf: Frf
    warnings: tuple[str, ...]
    used: tuple[int, ...]
    decay: float


def frf_from_signals(
    force: ArrayLike,
    response: ArrayLike,
    rate: float,
    *,
    quantity: str = "accelerance",
    estimator: Estimator = "H1",
    force_window: float | None = None,
    exponential_window: float | None = None,
    leave_out_bad: bool = False,
    full_scale: tuple[float, float] | None = None,
    label: str = "signals",
    note: str = "",
) -> EstimatedFrf:
    """Estimate an FRF by averaging the spectra of several impacts (H1 or H2, with pyFRF).

    Parameters
    ----------
    force : (n_impacts, n_samples) or (n_samples,) array
        N, a record for each impact.
    response : array of the same shape
        m/s^2, m/s or m, according to `quantity`.
    rate : float
        Samples per second.
    quantity : {"accelerance", "mobility", "receptance"}
        Quantity of the response over the force.
    estimator : {"H1", "H2"}
        H1 is biased by noise on the force, H2 by noise on the response.
    force_window : float, optional
        Seconds from the beginning of the record, after which the force is set to zero to remove its noise. A DC offset
        and a linear drift of the force are removed before, since the window would spread them over all lines.
    exponential_window : float, optional
        Value at the end of the record, such as 0.01, of a window ``exp(-decay t)`` on both signals, for a response that
        has not decayed. DC offsets are removed before, that of the response if there are 8 samples or more before the
        impact; otherwise a warning reports it. The estimate is then H at ``i omega + decay``: the decay is added to
        that of every mode.
        `without_window_damping` corrects a damping ratio; the FRF cannot be corrected.
    leave_out_bad : bool
        Leave out impacts with an overload or a second hit.
    full_scale : (float, float), optional
        Range of force and response. A record that reaches it is overloaded, as is one with three equal highest samples.
    label, note : str
        Of the FRF.

    Returns
    -------
    EstimatedFrf
        With a spacing of rate / n_samples, without 0 Hz and half the sampling rate.

    Raises
    ------
    MeasurementError
        Shapes that do not match, records that are not finite or zero, a window that cuts the pulse, or no impact left.
    DovetailError
        pyFRF is not installed.

    References
    ----------
    Bendat and Piersol, Random Data, 4th ed., chapters 6 and 9. Fladung and Rost, Application and correction of the
    exponential window for frequency response functions, Mechanical Systems and Signal Processing 11 (1997).
    """
    require_package("pyFRF", "impact", label)
    pulses, signals = _check_records(force, response, rate, label)
    chosen = parse_quantity(quantity, "the argument quantity")
    if estimator not in ESTIMATORS:
        raise MeasurementError(
            Fault("the argument estimator", f"'{estimator}' is not an estimator.", ", ".join(ESTIMATORS))
        )
    faults = check_signals(pulses, signals, rate, full_scale)
    bad = {fault.impact for fault in faults if fault.is_bad} if leave_out_bad else set()
    used = tuple(number for number in range(1, len(pulses) + 1) if number not in bad)
    if not used:
        raise MeasurementError(Fault(label, f"no impact is left: {faults[0].problem}", remedy="Measure again."))
    rows = [number - 1 for number in used]
    warnings = [fault.problem for fault in faults if fault.impact not in bad]
    pulses, signals = pulses[rows], signals[rows]
    if exponential_window is not None:
        signals, problems = remove_response_offset(pulses, signals)
        warnings += problems
    if force_window is not None or exponential_window is not None:
        pulses, problems = remove_force_offset(pulses)
        warnings += problems
    if force_window is not None and force_window >= signals.shape[1] / rate:
        length = (
            f"the force window of {force_window:g} s is not shorter than the records, {signals.shape[1] / rate:g} s"
        )
        warnings.append(f"{length}, and changes nothing. A number without a unit is in s.")
    windowed = _apply_windows(pulses, signals, rate, force_window, exponential_window, label)
    frf = _estimate_frf(*windowed, rate, chosen, estimator, label)
    warnings += [f"impact {number} is left out." for number in sorted(bad)]
    if len(used) == 1:
        warnings.append("a single impact gives neither coherence nor variance.")
    decay = _decay(exponential_window, signals.shape[1] / rate)
    if decay:
        warnings.append(f"the exponential window adds {decay:.4g} 1/s to the decay of each mode.")
    return EstimatedFrf(replace(frf, label=label, note=note), tuple(warnings), used, decay)


def without_window_damping(ratio: float, natural: float, decay: float) -> tuple[float, float]:
    """Remove the damping of an exponential window from a mode that was identified in the FRF.

    Parameters
    ----------
    ratio : float
        Identified viscous damping ratio, below 1.
    natural : float
        Identified undamped natural frequency [Hz].
    decay : float
        1/s, `EstimatedFrf.decay`.

    Returns
    -------
    ratio, natural : float
        Of the mode without the window, which moves the pole parallel to the real axis; the damped frequency is kept.
    """
    omega = 2.0 * math.pi * natural
    damped, mode_decay = omega * math.sqrt(1.0 - ratio**2), ratio * omega - decay
    undamped = math.hypot(damped, mode_decay)
    return mode_decay / undamped, undamped / (2.0 * math.pi)


def _check_records(force: ArrayLike, response: ArrayLike, rate: float, label: str) -> tuple[Array, Array]:
    """Return both signals as (n_impacts, n_samples)."""
    pulses, signals = (np.atleast_2d(np.asarray(records, dtype=np.float64)) for records in (force, response))
    if pulses.shape != signals.shape or pulses.ndim != 2:
        problem = f"the force has the shape {pulses.shape}, the response {signals.shape}."
        raise MeasurementError(Fault(label, problem, "the same shape (n_impacts, n_samples)"))
    if not _FEWEST_SAMPLES <= pulses.shape[1] <= _MOST_SAMPLES:
        raise MeasurementError(Fault(label, f"a record of {pulses.shape[1]} samples.", f"{_FEWEST_SAMPLES} or more"))
    if not (math.isfinite(rate) and rate > 0):
        raise MeasurementError(Fault(label, f"the sampling rate is {rate!r} Hz.", "a positive number"))
    for name, records in (("force", pulses), ("response", signals)):
        bad = np.argwhere(~np.isfinite(records))
        if bad.size:
            where = f"impact {bad[0][0] + 1}, sample {bad[0][1] + 1}"
            raise MeasurementError(
                Fault(label, f"the {name} is {records[tuple(bad[0])]} at {where}, which is not finite.")
            )
    for name, records in (("force", pulses), ("response", signals)):
        silent = np.flatnonzero(~np.any(records, axis=1))
        if silent.size:
            raise MeasurementError(Fault(label, f"the {name} of impact {silent[0] + 1} is zero throughout."))
    return pulses, signals


def _apply_windows(
    force: Array, response: Array, rate: float, force_window: float | None, end: float | None, label: str
) -> tuple[Array, Array]:
    time = np.arange(force.shape[1]) / rate
    if force_window is not None:
        last = np.abs(force).argmax(axis=1).max() / rate
        if not force_window > last:
            problem = f"the force window of {force_window!r} s cuts a pulse whose peak is at {last:.4g} s."
            raise MeasurementError(Fault(label, problem))
        force = force * (time < force_window)
    decay = _decay(end, force.shape[1] / rate)
    return force * np.exp(-decay * time), response * np.exp(-decay * time)


def _decay(end: float | None, duration: float) -> float:
    """Return the decay [1/s] of an exponential window with the value `end` at the end of the record."""
    if end is None:
        return 0.0
    if not 0.0 < end <= 1.0:
        raise MeasurementError(
            Fault("the argument exponential_window", f"{end!r} is not a final value of the window.", "0 to 1")
        )
    return -math.log(end) / duration


def _estimate_frf(
    force: Array, response: Array, rate: float, quantity: Quantity, estimator: Estimator, label: str
) -> Frf:
    """Average the spectra; the windows are already applied, since pyFRF's windows scale an FRF by their areas."""
    from pyFRF import FRF

    samples = force.shape[1]
    lines = slice(1, (samples + 1) // 2)
    several = len(force) > 1
    with np.errstate(divide="ignore", invalid="ignore"):  # at 0 Hz, which is left out
        average = FRF(1, force, response, resp_type=_RESPONSES[quantity], window="none", frf_estimator=estimator)
        values = average.get_FRF(frf_form=quantity)[0, 0, lines]
        coherence = np.clip(average.get_coherence()[0, lines], 0.0, 1.0) if several else None
    frequency = np.asarray(np.fft.rfftfreq(samples, 1.0 / rate)[lines], dtype=np.float64)
    empty = np.flatnonzero(~np.isfinite(values))
    if empty.size:
        problem = f"at {empty.size} of {frequency.size} lines, from {frequency[empty[0]]:g} Hz, the spectra are zero."
        raise MeasurementError(Fault(label, f"{problem} There is no FRF there.", remedy="Check the channels."))
    return Frf(frequency, values, quantity, coherence=coherence, averages=len(force))
