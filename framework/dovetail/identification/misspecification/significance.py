"""Whether what is left of a measurement is noise: in any run of lines, and towards anything that may be other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from dovetail.identification.fitting import Fit
from dovetail.identification.misspecification.perturbations import Change
from dovetail.identification.misspecification.whitened_residuals import Remainder

__all__ = ["Evidence", "evidence", "is_good", "runs"]

_MEASUREMENT_LIMIT, _PARTS_LIMIT = 3.7, 3.9
"""Standard deviations that a remainder hardly has by chance towards a change of the measurement, and of the parts."""
_LIMIT = 1e-7
"""Probability below which a remainder, in the run of lines where it is largest, is not noise."""
_ERRORS_LIMIT = 1e-4
_GOOD = 0.002
"""Part of the FRF's magnitude by which a model may be off and still be a good one, however little noise shows it."""
_SHORTEST = 8
_FAINT = 1e-6


@dataclass(frozen=True, eq=False)
class Evidence:
    """How far a remainder is from noise; each entry is 1 at the limit.

    Parameters
    ----------
    towards : mapping of str to float
        Standard deviations by which it lies towards each change.
    amounts : mapping of str to float
        Of each change, by which the remainder is the least, to first order.
    squares : float
        Sum of the squared residuals.
    errors : float
        Towards the errors of the model, beyond what they are reckoned with.
    runs : float
        In the run of lines where it is largest.
    """

    towards: Mapping[str, float]
    amounts: Mapping[str, float]
    squares: float
    errors: float
    runs: float

    @property
    def statistic(self) -> float:
        """The largest of all, over its limit."""
        return max(self._largest[1], self.errors, self.runs)

    @property
    def _largest(self) -> tuple[str, float]:
        """The change that the remainder lies towards the most, and how much over its limit."""
        over = {
            name: abs(size) / (_PARTS_LIMIT if ": " in name else _MEASUREMENT_LIMIT)
            for name, size in self.towards.items()
        }
        return max(over.items(), key=lambda one: one[1], default=("", 0.0))

    def sensitivity(self, name: str) -> float:
        """Return by how many standard deviations a unit of a change alters the FRF."""
        amount = self.amounts[name]
        return abs(self.towards[name] / amount) if amount else 0.0

    def words(self) -> str:
        """Say what the remainder's largest part is."""
        name, over = self._largest
        if over >= max(self.errors, self.runs):
            return f"what is left lies {abs(self.towards[name]):.3g} standard deviations towards another '{name}'"
        return "what is left is more than random error and small errors of the model"


def evidence(left: Remainder, possible: tuple[Change, ...]) -> Evidence:
    """Return how far what is left of a measurement is from noise."""
    effects = left.effect(np.array([change.effect(left.theta, left.values) for change in possible]))
    length = np.linalg.norm(effects, axis=1)
    along = np.divide(effects @ left.residuals, length, out=np.zeros_like(length), where=length > 0.0)
    amounts = np.divide(along, length, out=np.zeros_like(length), where=length > 0.0)
    names = [change.name for change in possible]
    return Evidence(
        dict(zip(names, along.tolist(), strict=True)),
        dict(zip(names, (-amounts).tolist(), strict=True)),
        float(left.residuals @ left.residuals),
        _towards_errors(left) / -np.log10(_ERRORS_LIMIT),
        max(runs(_rescaled(left.lines)).values(), default=0.0) / -np.log10(_LIMIT),
    )


def is_good(fit: Fit) -> bool:
    """Say whether a fit misses more than noise, but next to nothing of the FRF."""
    return 0.0 < fit.discrepancy < _GOOD


def _towards_errors(left: Remainder) -> float:
    """Return how improbable it is that the errors of the model are as large as the remainder says, as -log10."""
    if not len(left.errors):
        return 0.0
    size, axes = np.linalg.eigh(left.errors @ left.errors.T)
    clear = size > _FAINT * size[-1]
    squares = (axes.T @ (left.errors @ left.residuals))[clear] ** 2 / size[clear]
    return _surprise(float(squares.sum()), int(clear.sum()))


def _rescaled(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return residuals made smaller if they scatter from line to line by more than the random error says."""
    scatter = float(np.mean(np.diff(lines, axis=0) ** 2)) / 2.0 if len(lines) > 1 else 1.0
    return np.asarray(lines / np.sqrt(max(1.0, scatter)))


def runs(lines: NDArray[np.float64]) -> dict[int, float]:
    """Return how improbable the largest run of each length is, as -log10 of its probability for noise.

    Parameters
    ----------
    lines : (n_freq, parts) array
        White where nothing but noise is left.
    """
    found = {}
    sums = np.concatenate([np.zeros((1, lines.shape[1])), np.cumsum(lines, axis=0)])
    squares = np.concatenate([[0.0], np.cumsum(np.sum(lines**2, axis=1))])
    length = _SHORTEST
    while length <= len(lines):
        energy = float((squares[length:] - squares[:-length]).max())
        coherent = float((np.sum((sums[length:] - sums[:-length]) ** 2, axis=1) / length).max())
        parts = lines.shape[1]
        found[length] = max(_surprise(energy, parts * length), _surprise(coherent, parts))
        length *= 2
    return found


def _surprise(squares: float, freedom: int) -> float:
    """Return -log10 of the probability that noise gives so large a sum of squares."""
    surprise = -float(chi2.logsf(squares, freedom))
    return (surprise if np.isfinite(surprise) else squares / 2.0) / float(np.log(10.0))
