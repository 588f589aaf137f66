"""Signs of responses that the description leaves open, determined from the phases."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dovetail.frf import Frf
from dovetail.identification.measured_lines import MeasuredLines
from dovetail.inference.fitting import refine
from dovetail.interfaces import Progress
from dovetail.problem import Problem

_DELAYS = 201
"""Delays over their range with which a sign is determined; enough for 25 turns of the phase."""
_CLEAR_SIGN = 0.2
"""Mean cosine of the phase differences below which the sign is doubtful: of a ruler, a wrong one had 0.11."""


def with_signs(lines: MeasuredLines, progress: Progress) -> MeasuredLines:
    """Determine the signs that the description leaves open, from a fit that ignores the phases."""
    description = lines.described.description
    unknown = description.unknown_signs
    few = lines.every_nth
    pairs = list(zip(description.responses, few.problem.measured, strict=True))
    without_phase = [amplitudes(frf) if response.name in unknown else frf for response, frf in pairs]
    theta = refine(few.problem.with_frfs(without_phase), seed=description.identification.seed, progress=progress).theta
    signs = {
        response.name: _sign(alone, theta)
        for response, alone in zip(description.responses, few.problem.each_response, strict=True)
        if response.name in unknown
    }
    described = lines.described.with_description(lines.described.description.with_signs(signs))
    return replace(MeasuredLines.of(described, lines.whole), unweighted=lines.unweighted)


def amplitudes(frf: Frf) -> Frf:
    """Return an FRF without its phase."""
    return replace(frf, values=np.abs(frf.values), has_phase=False)


def _sign(problem: Problem, theta: NDArray[np.float64]) -> float:
    """Return the sign, 1 or -1, with which the phases of one FRF agree better with the model's, at the best delay.

    There is a warning where they agree with neither.
    """
    assembly, (frf,) = problem.assembly, problem.measured
    response = assembly.description.response
    delays = [column for column, p in enumerate(assembly.parameters) if p.name == f"{response.name}.delay"]
    vectors = np.repeat(theta[np.newaxis], _DELAYS if delays else 1, axis=0)
    for column in delays:
        vectors[:, column] = assembly.parameters[column].from_unit(np.linspace(0.0, 1.0, _DELAYS))
    model, values = assembly.frf(vectors), frf.values
    agreements = np.cos(np.angle(np.conj(model) * values)).mean(axis=1)
    sign = 1.0 if not frf.has_phase or agreements.max() >= -agreements.min() else -1.0
    if frf.has_phase and (agreement := float((sign * agreements).max())) < _CLEAR_SIGN:
        agree = f"phases agree with the model's as little with one sign as with the other (mean cosine {agreement:.2f})"
        warnings.warn(f"{frf.label or response.name}: {agree}; {sign:+g} was taken. State the sign.", stacklevel=2)
    return sign
