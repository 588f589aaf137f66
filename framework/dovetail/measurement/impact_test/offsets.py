"""DC offsets of the signals of an impact test, which a window spreads from 0 Hz over other lines.

Without a window an offset is at 0 Hz only, and that line is not part of the FRF. A force window turns the offset of the
force into a rectangle, and an exponential window turns either offset into a decaying pulse.

The force is zero except during the contact, so its offset and its drift are estimated from all other samples. The
response is at rest only before the impact. Its end only refines an offset that was found there: a slow motion at the
end, such as that of a suspension, is part of the response.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """Limits for an offset; none was chosen on measured or simulated records.

    Parameters
    ----------
    pulse : float
        Fraction of the peak above which a sample of the force belongs to the pulse; twice less than a second hit that
        counts.
    above_noise : float
        Standard deviations of the noise above which it does; exceeded by 1 of 500 million samples of Gaussian noise.
    fewest_samples : int
        Smallest number of samples from which an offset is estimated: the fewest blocks, of two samples each.
    fewest_blocks, most_blocks : int
        Number of blocks into which the samples of a record are divided, of four samples if there are enough. The
        scatter of their means is the uncertainty of the offset, whatever the correlation of neighbouring samples.
    false_alarm : float
        Probability with which noise alone is taken for an offset.
    negligible : float
        Offset, as a fraction of the highest sample, that is below the resolution of the best converters (120 dB).
    consistent : float
        Standard errors within which the means before the impact and at the end are the same offset.
    tail : float
        Part of a record, at its end, in which a remaining offset of the response is reported.
    """

    pulse: float = 0.01
    above_noise: float = 6.0
    fewest_samples: int = 8
    fewest_blocks: int = 4
    most_blocks: int = 16
    false_alarm: float = 1e-4
    negligible: float = 1e-6
    consistent: float = 3.0
    tail: float = 0.25


_SETTINGS = Settings()


class Offsets(NamedTuple):
    """Signals without their offsets.

    Parameters
    ----------
    records : (n_impacts, n_samples) array
    problems : tuple of str
        Sentences on what was removed, and on what could not be.
    """

    records: Array
    problems: tuple[str, ...]


def remove_force_offset(force: Array) -> Offsets:
    """Remove offset and linear drift of the force, estimated outside its pulses.

    Parameters
    ----------
    force : (n_impacts, n_samples) array
    """
    quiet = np.array([_outside_pulse(pulse) for pulse in force])
    return _remove("force", force, quiet, with_drift=True)


def remove_response_offset(force: Array, response: Array) -> Offsets:
    """Remove the mean of the response before the impact, and report an offset that cannot be removed.

    Parameters
    ----------
    force, response : (n_impacts, n_samples) arrays
    """
    quiet = np.zeros(response.shape, dtype=bool)
    for pulse, row in zip(force, quiet, strict=True):
        row[: _onset(pulse)] = True
    corrected, problems = _remove("response", response, quiet, with_drift=False)
    tail = np.zeros_like(quiet)
    tail[:, -int(_SETTINGS.tail * response.shape[1]) :] = True
    if problems:
        corrected = _refined(corrected, quiet, tail)
    ends, starts = _blocks(corrected, tail), _blocks(corrected, quiet)
    mean, error = _mean_and_error(ends)
    uncertainty = np.hypot(error, _mean_and_error(starts)[1]) if starts.size else error
    limit = _quantile(min(block.size for block in (ends, starts) if block.size) - 1) * uncertainty
    if abs(mean) > max(limit, _SETTINGS.negligible * np.abs(response).max()):
        before = "" if starts.size else ", and too little was recorded before the impact"
        problems += (
            f"the response ends with a mean of {mean:.3g}{before}: an offset, a drift or a slow motion, which the "
            "exponential window spreads over the lowest lines.",
        )
    return Offsets(corrected, problems)


def _refined(records: Array, quiet: NDArray[np.bool_], tail: NDArray[np.bool_]) -> Array:
    """Return records whose offset before the impact was removed, with the remaining error reduced by their ends.

    The end counts by its own uncertainty, and only if its mean is within the uncertainty of that before the impact:
    what is subtracted is never larger than the offset may be wrong by, so that a slow motion is kept.
    """
    refined = records.copy()
    for row, before, after in zip(refined, quiet, tail, strict=True):
        starts, ends = (_blocks(row[np.newaxis], mask[np.newaxis]) for mask in (before, after))
        if starts.size and ends.size:
            error = _mean_and_error(starts)[1]
            mean, scatter = _mean_and_error(ends)
            if abs(mean) <= _SETTINGS.consistent * np.hypot(error, scatter) and error > 0:
                row -= mean * error**2 / (error**2 + scatter**2)
    return refined


def _remove(name: str, records: Array, quiet: NDArray[np.bool_], *, with_drift: bool) -> Offsets:
    """Subtract the offset that all records share, and then that of each one, where they are significant."""
    corrected = records.copy()
    corrected -= _significant_mean(_blocks(corrected, quiet))
    for row, mask in zip(corrected, quiet, strict=True):
        row -= _trend(row, mask) if with_drift else 0.0
        row -= _significant_mean(_blocks(row[np.newaxis], mask[np.newaxis]))
    removed = records - corrected
    largest = removed.flat[np.abs(removed).argmax()]
    if abs(largest) <= _SETTINGS.negligible * np.abs(records).max():
        return Offsets(records, ())
    share = 100 * np.max(np.abs(removed).max(axis=1) / np.abs(corrected).max(axis=1))
    size = f"{largest:.3g}" if np.ptp(removed) <= 1e-3 * abs(largest) else f"up to {largest:.3g}"
    return Offsets(corrected, (f"an offset of the {name} of {size} ({share:.2g} % of the peak) is removed.",))


def _threshold(magnitude: Array) -> float:
    """Return the magnitude of a force without its median above which a sample belongs to a pulse."""
    noise = 1.4826 * float(np.median(magnitude))
    return max(_SETTINGS.pulse * float(magnitude.max()), _SETTINGS.above_noise * noise)


def _margin(is_pulse: NDArray[np.bool_], peak: int) -> int:
    """Return how many samples around a pulse may still belong to it: its rise time, and the filter's ringing."""
    low = np.flatnonzero(~is_pulse[:peak])
    return max(peak - (int(low[-1]) if low.size else 0), 2)


def _onset(pulse: Array) -> int:
    """Return the number of samples before the impact."""
    magnitude = np.abs(pulse - np.median(pulse))
    is_pulse = magnitude > _threshold(magnitude)
    return max(int(is_pulse.argmax()) - _margin(is_pulse, int(magnitude.argmax())), 0)


def _outside_pulse(pulse: Array) -> NDArray[np.bool_]:
    magnitude = np.abs(pulse - np.median(pulse))
    is_pulse = magnitude > _threshold(magnitude)
    margin = _margin(is_pulse, int(magnitude.argmax()))
    return np.asarray(np.convolve(is_pulse, np.ones(2 * margin + 1), mode="same") < 0.5)


def _blocks(records: Array, quiet: NDArray[np.bool_]) -> Array:
    """Return the means of blocks of quiet samples, of all records; empty if there are too few samples."""
    means = []
    for row, mask in zip(records, quiet, strict=True):
        samples = row[mask]
        count = min(max(samples.size // 4, _SETTINGS.fewest_blocks), _SETTINGS.most_blocks)
        if samples.size >= _SETTINGS.fewest_samples:
            means += [part.mean() for part in np.array_split(samples, count)]
    return np.array(means)


def _mean_and_error(blocks: Array) -> tuple[float, float]:
    """Return the mean of block means and its standard error."""
    return float(blocks.mean()), float(blocks.std(ddof=1) / np.sqrt(blocks.size))


def _significant_mean(blocks: Array) -> float:
    """Return the mean of block means if noise alone would hardly reach it, or 0."""
    if not blocks.size:
        return 0.0
    mean, error = _mean_and_error(blocks)
    return mean if abs(mean) > _quantile(blocks.size - 1) * error else 0.0


def _trend(row: Array, mask: NDArray[np.bool_]) -> Array | float:
    """Return the line through the quiet samples of a record if its slope is significant, or 0."""
    index = np.arange(row.size, dtype=np.float64)[np.newaxis]
    time, means = _blocks(index, mask[np.newaxis]), _blocks(row[np.newaxis], mask[np.newaxis])
    if time.size < _SETTINGS.most_blocks:
        return 0.0
    centred = time - time.mean()
    slope = float(centred @ means / (centred @ centred))
    residual = means - means.mean() - slope * centred
    error = np.sqrt(residual @ residual / (time.size - 2) / (centred @ centred))
    if abs(slope) <= _quantile(time.size - 2) * error:
        return 0.0
    line: Array = means.mean() + slope * (index[0] - time.mean())
    return line


def _quantile(freedom: int) -> float:
    """Return Student's t that noise exceeds with the probability of a false alarm."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 1.0 - _SETTINGS.false_alarm / 2.0))
