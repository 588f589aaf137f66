"""Delays of the measuring chain, on which the amplitudes of a search do not depend."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.problem import Problem
from dovetail.problem.residuals import Residual

_MOST_DELAYS = 100
"""Largest number of delays of a response that are tried, eight for each turn of the phase at the highest line."""


def with_best_delays(problem: Problem, residual: Residual, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Set the delays at some positions (n, p), in fractions of the ranges, to the values that fit best.

    Parameters
    ----------
    problem : Problem
    residual : Residual
        Of its lines.
    position : (n, p) array
    """
    misfit, description = problem.residuals(residual), problem.assembly.description
    calibrations, owners = description.calibrations, enumerate(description.identified_parameters)
    for column in (column for column, (owner, name) in owners if owner in calibrations and name == "delay"):
        delay = problem.parameters[column]
        turns = (delay.upper - delay.lower) * float(problem.observations.frequency.max())
        tried = np.repeat(position[np.newaxis], 1 + min(_MOST_DELAYS, int(8 * turns) + 1), axis=0)
        tried[1:, :, column] = np.linspace(0.0, 1.0, len(tried) - 1)[:, np.newaxis]
        costs = np.array([np.sum(misfit.residuals(each) ** 2, axis=1) for each in tried])
        position = tried[np.argmin(costs, axis=0), np.arange(len(position))]
    return position
