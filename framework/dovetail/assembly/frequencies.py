"""The frequency lines of a description."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.findings import Findings
from dovetail.assembly.sections import FrequencySection
from dovetail.assembly.validation import validate

__all__ = ["MOST_LINES", "read_frequency"]

MOST_LINES = 1_000_000
_OFF_GRID = 1e-6
"""How far `stop` may be from a line, in steps."""
_PATH = ("frequency",)


def read_frequency(findings: Findings) -> NDArray[np.float64] | None:
    """Return the (n_freq,) lines in Hz, read-only, or None with faults."""
    if findings.root.at(_PATH) is None:
        return None
    section = validate(FrequencySection, _PATH, findings, "'frequency'")
    if section is None:
        return None
    start, stop = section.start, section.stop
    if stop <= start:
        findings.add((*_PATH, "stop"), f"stop ({stop:.10g} Hz) must be greater than start ({start:.10g} Hz).")
        return None
    if (section.step is None) == (section.lines is None):
        found = "the frequency has a step and a number of lines." if section.step else "the frequency has no step."
        findings.add(_PATH, found, "step or lines", key=True)
        return None
    steps = (stop - start) / section.step if section.step else float((section.lines or 0) - 1)
    if steps + 1 > MOST_LINES:
        findings.add((*_PATH, "step"), f"{steps + 1:.4g} lines are more than {MOST_LINES}.")
        return None
    if abs(steps - round(steps)) > _OFF_GRID or steps < _OFF_GRID:
        before = start + np.floor(steps) * (section.step or 0.0)
        found = f"stop ({stop:.10g} Hz) is not on a line: from {start:.10g} Hz in steps of {section.step:.10g} Hz"
        remedy = f"The lines nearest to it are {before:.10g} Hz and {before + (section.step or 0.0):.10g} Hz."
        findings.add((*_PATH, "stop"), f"{found}.", remedy=remedy)
        return None
    frequency = np.linspace(start, stop, round(steps) + 1)
    frequency.setflags(write=False)
    return frequency
