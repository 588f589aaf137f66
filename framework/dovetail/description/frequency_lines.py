"""The lines of a description, and the bands that are left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.description.sections import FrequencyList, FrequencySection
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Path
from dovetail.documents.validation import validate
from dovetail.frf import HIGHEST_FREQUENCY, in_bands

_MOST_LINES, _FEWEST_LINES = 1_000_000, 2
_OFF_GRID = 1e-6
"""How far `stop` may be from a line, in steps."""
_BEYOND = 1.5
"""Ratio by which a band may reach beyond the lines, as round numbers do."""
_FREQUENCY: Path = ("frequency",)
_Bands = tuple[tuple[float, float], ...]


def read_frequency(faults: FaultList) -> tuple[NDArray[np.float64] | None, _Bands]:
    """Return the (n_freq,) lines in Hz, read-only, or None if they have faults; and the bands that are left out."""
    item = faults.root.at(_FREQUENCY)
    if item is None:
        return None, ()
    if isinstance(item.value, tuple):
        return _read_lines(faults), ()
    section = validate(FrequencySection, _FREQUENCY, faults, "'frequency'")
    lines = None if section is None else _read_axis(section, faults)
    if section is None or lines is None or not _is_low_enough(lines, (*_FREQUENCY, "stop"), faults):
        return None, ()
    if not _check_parts(section, lines, faults):
        return None, ()
    left_out = (*_between(section.bands, float(lines[0]), float(lines[-1])), *section.without)
    kept = lines[~in_bands(lines, left_out)]
    if kept.size < _FEWEST_LINES:
        key = "bands" if section.bands else "without"
        faults.add((*_FREQUENCY, key), f"{kept.size} of {lines.size} lines are left to compare.")
        return None, ()
    kept.setflags(write=False)
    return kept, left_out


def _check_parts(section: FrequencySection, lines: NDArray[np.float64], faults: FaultList) -> bool:
    """Report parts of the band that lie outside what is compared, and bands that reach far beyond it."""
    whole, before = [(float(lines[0]), float(lines[-1]))], len(faults)
    for key, parts, compared in (("bands", section.bands, whole), ("without", section.without, section.bands or whole)):
        for index, (low, high) in enumerate(parts):
            said = ""
            if not any(max(low, start, whole[0][0]) <= min(high, end, whole[0][1]) for start, end in compared):
                said = "lies outside of what is compared"
            elif key == "bands" and (high > _BEYOND * whole[0][1] or _BEYOND * low < whole[0][0]):
                said = "reaches beyond what is compared"
            if said:
                problem = (
                    f"{low:.10g} to {high:.10g} Hz {said}: the lines go from {lines[0]:.10g} to {lines[-1]:.10g} Hz."
                )
                faults.add((*_FREQUENCY, key, index), problem, remedy="Correct it, leave it out, or change the lines.")
    return len(faults) == before


def _read_lines(faults: FaultList) -> NDArray[np.float64] | None:
    """Return the lines of a list."""
    listed = validate(FrequencyList, _FREQUENCY, faults, "'frequency'")
    if listed is None:
        return None
    lines = np.array(listed.root)
    falling = np.flatnonzero(np.diff(lines) <= 0)
    if falling.size:
        first = int(falling[0])
        problem = f"{lines[first + 1]:.10g} Hz does not lie above {lines[first]:.10g} Hz."
        faults.add((*_FREQUENCY, first + 1), problem, "increasing frequencies")
        return None
    if not _is_low_enough(lines, (*_FREQUENCY, len(lines) - 1), faults):
        return None
    lines.setflags(write=False)
    return lines


def _is_low_enough(lines: NDArray[np.float64], where: Path, faults: FaultList) -> bool:
    """Return whether the lines can be computed with; add a fault if not."""
    if lines[-1] <= HIGHEST_FREQUENCY:
        return True
    problem = f"{lines[-1]:.10g} Hz is far above the frequencies of any structure."
    faults.add(where, problem, f"up to {HIGHEST_FREQUENCY:g} Hz")
    return False


def _between(bands: _Bands, first: float, last: float) -> _Bands:
    """Return what is between bands, and between them and the ends."""
    if not bands:
        return ()
    gaps, reached = [], np.nextafter(first, 0.0)
    for low, high in sorted(bands):
        if low > reached:
            gaps.append((reached, np.nextafter(low, 0.0)))
        reached = max(reached, np.nextafter(high, np.inf))
    return (*gaps, *([(reached, last)] if reached <= last else []))


def _read_axis(section: FrequencySection, faults: FaultList) -> NDArray[np.float64] | None:
    """Return the evenly spaced lines of a section."""
    start, stop = section.start, section.stop
    if stop <= start:
        faults.add((*_FREQUENCY, "stop"), f"stop ({stop:.10g} Hz) must be greater than start ({start:.10g} Hz).")
        return None
    if (section.step is None) == (section.lines is None):
        problem = "the frequency has a step and a number of lines." if section.step else "the frequency has no step."
        faults.add(_FREQUENCY, problem, "step or lines", key=True)
        return None
    steps = (stop - start) / section.step if section.step else float((section.lines or 0) - 1)
    if steps + 1 > _MOST_LINES:
        faults.add((*_FREQUENCY, "step"), f"{steps + 1:.4g} lines are more than {_MOST_LINES}.")
        return None
    if abs(steps - round(steps)) > _OFF_GRID or steps < _OFF_GRID:
        before = start + np.floor(steps) * (section.step or 0.0)
        problem = f"stop ({stop:.10g} Hz) is not on a line: from {start:.10g} Hz in steps of {section.step:.10g} Hz"
        remedy = f"The lines nearest to it are {before:.10g} Hz and {before + (section.step or 0.0):.10g} Hz."
        faults.add((*_FREQUENCY, "stop"), f"{problem}.", remedy=remedy)
        return None
    return np.linspace(start, stop, round(steps) + 1)
