"""The significance of whitened residuals: along each perturbation, along the model's errors and in runs of lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from dovetail.identification.fitting import Fit
from dovetail.identification.misspecification.perturbations import Perturbation
from dovetail.identification.misspecification.whitened_residuals import WhitenedResiduals

__all__ = ["Significance", "assess_runs", "assess_significance", "is_negligible"]


@dataclass(frozen=True)
class Settings:
    """From where residuals are significant."""

    measurement_limit: float = 3.7
    """Standard deviations along a perturbation of the measurement; noise exceeds them with probability 2e-4."""
    substructure_limit: float = 3.9
    """The same along a perturbation of a substructure, with probability 1e-4, since there are more of these."""
    run_probability: float = 1e-7
    """Probability of the residuals in their worst run of lines below which they are not noise; runs are many."""
    error_probability: float = 1e-4
    """Probability of the residuals along the model's errors below which these are larger than allowed."""
    negligible_discrepancy: float = 0.002
    """Discrepancy over the FRF's magnitude of a model that is good, however little noise would hide it."""
    shortest_run: int = 8
    """Lines; fewer may be an interference line."""
    rank: float = 1e-6
    """Eigenvalue over the largest below which the model's errors have no further direction."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class Significance:
    """How significant whitened residuals are.

    Parameters
    ----------
    deviations : mapping of str to float
        Standard deviations of the residuals along each perturbation.
    amounts : mapping of str to float
        Amount of each perturbation that minimises the residuals, to first order.
    sum_of_squares : float
        Of the residuals.
    model_error : float
        Significance along the errors that the model is allowed, 1 at its limit.
    run : float
        Significance of the worst run of lines, 1 at its limit.
    """

    deviations: Mapping[str, float]
    amounts: Mapping[str, float]
    sum_of_squares: float
    model_error: float
    run: float

    @property
    def statistic(self) -> float:
        """The largest of all over its limit."""
        return max(self._worst[1], self.model_error, self.run)

    @property
    def _worst(self) -> tuple[str, float]:
        """The perturbation along which the deviation is the largest over its limit, and that ratio."""
        ratios = {
            name: abs(deviation) / (_SETTINGS.substructure_limit if ": " in name else _SETTINGS.measurement_limit)
            for name, deviation in self.deviations.items()
        }
        return max(ratios.items(), key=lambda item: item[1], default=("", 0.0))

    def sensitivity(self, name: str) -> float:
        """Return by how many standard deviations a unit of a perturbation changes the FRF."""
        amount = self.amounts[name]
        return abs(self.deviations[name] / amount) if amount else 0.0

    def describe(self) -> str:
        """Return the most significant deviation in words."""
        name, ratio = self._worst
        if ratio >= max(self.model_error, self.run):
            return f"what is left lies {abs(self.deviations[name]):.3g} standard deviations towards another '{name}'"
        return "what is left is more than random error and small errors of the model"


def assess_significance(whitened: WhitenedResiduals, perturbations: tuple[Perturbation, ...]) -> Significance:
    """Return how significant the whitened residuals of a measurement are."""
    derivatives = np.array([p.derivative(whitened.theta, whitened.values) for p in perturbations])
    directions = whitened.project(derivatives)
    length = np.linalg.norm(directions, axis=1)
    length[length == 0.0] = np.inf
    deviations = directions @ whitened.residuals / length
    names = [perturbation.name for perturbation in perturbations]
    return Significance(
        dict(zip(names, deviations.tolist(), strict=True)),
        dict(zip(names, (-deviations / length).tolist(), strict=True)),
        float(whitened.residuals @ whitened.residuals),
        _assess_model_error(whitened) / -np.log10(_SETTINGS.error_probability),
        assess_runs(_scale_to_scatter(whitened.by_line)) / -np.log10(_SETTINGS.run_probability),
    )


def is_negligible(fit: Fit) -> bool:
    """Return whether a fit misses more than noise, but next to nothing of the FRF."""
    return 0.0 < fit.discrepancy < _SETTINGS.negligible_discrepancy


def _assess_model_error(whitened: WhitenedResiduals) -> float:
    """Return -log10 of the probability that the model's errors are as large as the residuals suggest."""
    if not len(whitened.errors):
        return 0.0
    eigenvalues, axes = np.linalg.eigh(whitened.errors @ whitened.errors.T)
    clear = eigenvalues > _SETTINGS.rank * eigenvalues[-1]
    squares = (axes.T @ (whitened.errors @ whitened.residuals))[clear] ** 2 / eigenvalues[clear]
    return _significance(float(squares.sum()), int(clear.sum()))


def _scale_to_scatter(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return residuals (n_freq, n), smaller if they scatter from line to line by more than random error."""
    scatter = float(np.mean(np.diff(residuals, axis=0) ** 2)) / 2.0 if len(residuals) > 1 else 1.0
    return np.asarray(residuals / np.sqrt(max(1.0, scatter)))


def assess_runs(residuals: NDArray[np.float64]) -> float:
    """Return the significance of the worst run of lines, as -log10 of its probability for noise.

    Parameters
    ----------
    residuals : (n_freq, n) array
        White if the model explains the measurement.
    """
    sums = np.concatenate([np.zeros((1, residuals.shape[1])), np.cumsum(residuals, axis=0)])
    squares = np.concatenate([[0.0], np.cumsum(np.sum(residuals**2, axis=1))])
    worst, length, width = 0.0, _SETTINGS.shortest_run, residuals.shape[1]
    while length <= len(residuals):
        energy = float((squares[length:] - squares[:-length]).max())
        coherent = float((np.sum((sums[length:] - sums[:-length]) ** 2, axis=1) / length).max())
        worst = max(worst, _significance(energy, width * length), _significance(coherent, width))
        length *= 2
    return worst


def _significance(squares: float, degrees_of_freedom: int) -> float:
    """Return -log10 of the probability that noise gives so large a sum of squares."""
    negative_log = -float(chi2.logsf(squares, degrees_of_freedom))
    return (negative_log if np.isfinite(negative_log) else squares / 2.0) / float(np.log(10.0))
