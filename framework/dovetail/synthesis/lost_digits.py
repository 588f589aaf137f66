"""The number of digits of an FRF that remain after rounding in the matrices of parts."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from dovetail.synthesis.coupled_system import CoupledSystem, condense
from dovetail.synthesis.engine import Engine
from dovetail.synthesis.joint_evaluation import Theta
from dovetail.synthesis.pivoting import PivotedSolver

_LEAST = 1e-7
"""Relative change of an FRF by rounding above which digits are lost: a tenth of the error of 1e-6 that is reported,
since a few draws show a tenth of it or less. Chosen on uniform beams of 10 to 1000 elements."""
_DRAWS = 3
"""Random roundings that are tried; the largest change counts."""
_UNRELATED = 1e-6
"""Receptance over the largest one below which its rounding errors are not counted, as between directions that do not
move each other."""


def lost_digits(engine: Engine, theta: Theta) -> tuple[str, ...]:
    """Return a warning about the part whose rounding changes FRFs most at the first, middle or last line, if any.

    Parameters
    ----------
    engine : Engine
    theta : mapping of str to (1, n_params) array
        One parameter vector.
    """
    lines = np.unique([0, len(engine.frequency) // 2, len(engine.frequency) - 1])
    frequency, system = engine.frequency[lines], engine.system
    plain = engine.plan.pivoted.frfs(theta, lines)
    size = np.maximum(np.abs(plain), _UNRELATED * np.abs(plain).max(axis=0))
    size[size == 0.0] = np.inf  # motion in a direction in which a force has no effect

    def change(disturbed: Collection[str]) -> tuple[float, float]:
        difference = np.zeros(len(lines))
        for draw in range(_DRAWS):
            condensed = condense(engine.graph, frequency, system.points, dict.fromkeys(disturbed, draw))
            few = CoupledSystem(engine.graph, frequency, system.points, condensed, system.sparsity)
            frfs = PivotedSolver(few, {}, engine.pairs).frfs(theta, np.arange(len(lines)))
            difference = np.maximum(difference, (np.abs(frfs - plain) / size).max(axis=0))
        worst = int(np.argmax(difference))
        return float(difference[worst]), float(frequency[worst])

    parts = tuple(engine.graph.substructures)
    combined = change(parts)
    if combined[0] <= _LEAST:
        return ()
    losses = {name: change((name,)) for name in parts} if len(parts) > 1 else {parts[0]: combined}
    largest = max(losses, key=lambda name: losses[name][0])
    return (_sentence(largest, *combined),)


def _sentence(part: str, loss: float, frequency: float) -> str:
    digits = max(0, int(-np.log10(min(loss, 1.0))))
    return (
        f"substructures.{part}: rounding in its matrices changes the FRF by {100.0 * min(loss, 1.0):.1g} % or more at "
        f"{frequency:g} Hz, which leaves {digits} digits at most. Fewer elements or a higher band leave more."
    )
