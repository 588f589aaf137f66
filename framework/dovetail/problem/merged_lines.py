"""Fewer lines of very long measurements: means of neighbouring lines, and FRFs that are computed block by block."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.measurement import find_gaps
from dovetail.problem.definition import Problem
from dovetail.problem.random_error import known_variance

MOST_LINES = 50_000
"""Largest number of lines that are fitted, and that an FRF is computed on at once. A fit with a posterior takes 12 kB a
line; chosen so that it stays below 1 GB."""


def every_nth_line(frf: Frf, count: int) -> Frf:
    """Return the middle line of each `count` lines."""
    return _at(frf, np.arange(count // 2, len(frf.frequency), count))


def merged_lines(problem: Problem, most: int, theta: NDArray[np.float64]) -> Frf:
    """Return the means of groups of neighbouring lines, less the curvature of a fitted FRF.

    Parameters
    ----------
    problem : Problem
        With one response, measured with its phase.
    most : int
        Number of groups, not counting further ones that end at gaps.
    theta : (n_params,) array
        SI values that fit the measurement.

    Returns
    -------
    Frf
        In the response's quantity, at the mean frequency of each group.

    Notes
    -----
    The mean of a group is the fitted FRF at its mean frequency plus the mean difference from the fitted FRF. The
    difference is smooth even where a resonance is sharp, so that the mean has no bias, and its variance is that of a
    line over the number of lines. A known variance is averaged likewise. Then half of the groups are evenly spaced, and
    the others divide the changes of the fitted FRF's logarithm evenly, so that all lines of a group are equally
    sensitive to the parameters and nothing is lost. An unknown variance is estimated from the scatter of the means, as
    it is from that of lines, for which groups need the same size.
    """
    (measured,) = problem.measured
    fitted = frf_in_blocks(problem.assembly, theta)
    variance = known_variance(measured)
    firsts = _first_lines(measured, fitted, most, is_even=variance is None)
    sizes = np.diff(firsts, append=len(measured.frequency))

    def mean(values: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(np.add.reduceat(values, firsts) / sizes)

    frequency = mean(measured.frequency)
    values = frf_in_blocks(problem.assembly.on(frequency), theta) + mean(measured.values - fitted)
    merged = None if variance is None else mean(variance) / sizes
    return replace(measured, frequency=frequency, values=values, variance=merged, coherence=None, averages=None)


def _first_lines(frf: Frf, fitted: NDArray[np.complex128], most: int, *, is_even: bool) -> NDArray[np.intp]:
    """Return the first line of each group."""
    size = np.maximum(np.abs(fitted), np.finfo(float).tiny)
    changes = np.abs(np.diff(fitted)) / np.minimum(size[1:], size[:-1])
    by_change = np.concatenate([[0.0], np.cumsum(changes)]) / max(float(changes.sum()), np.finfo(float).tiny)
    evenly = np.arange(len(fitted)) / len(fitted)
    group = np.floor(most * (evenly if is_even else (evenly + by_change) / 2.0))
    starts = np.flatnonzero(np.append(True, np.diff(group) >= 1.0))
    return np.union1d(starts, np.searchsorted(frf.frequency, [above for _, above in find_gaps(frf)]))


def frf_in_blocks(assembly: Assembly, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the FRF (n_freq,) of an assembly with one response, computed on at most `MOST_LINES` lines at once."""
    description, count = assembly.description, len(assembly.frequency)
    blocks = np.array_split(assembly.frequency, -(-count // MOST_LINES))
    on_blocks = (assembly.with_description(replace(description, frequency=block)) for block in blocks)
    return np.concatenate([block.frf(theta) for block in on_blocks])


def _at(frf: Frf, lines: NDArray[np.intp]) -> Frf:
    coherence, variance = (None if array is None else array[lines] for array in (frf.coherence, frf.variance))
    return replace(
        frf, frequency=frf.frequency[lines], values=frf.values[lines], coherence=coherence, variance=variance
    )
