"""The comparison of models: their marginal likelihoods and leave-one-out scores, and what these say."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.evidence import FEWEST_EFFECTIVE, Evidence

DECISIVE = 3.0
"""Difference of log Z from which a model is preferred: odds of 20 to 1, if the models were equally likely before."""
_STANDARD_ERRORS = 2.0
"""Standard errors of the difference by which it has to exceed `DECISIVE`."""


@dataclass(frozen=True, eq=False)
class ComparedModel:
    """One of the models.

    Parameters
    ----------
    name : str
    unknowns : int
    evidence : Evidence or None
        The marginal likelihood; None if too few searches count for it.
    bounds : (float, float)
        Between which log Z lies: one that it exceeds with a probability of 99 %, and the largest log-likelihood, with
        all constants.
    line_scores : (m,) array
        Log predictive density of each measured value, given all others.
    fits : str
        The word for how well the model fits, for the test that it fits worst.
    """

    name: str
    unknowns: int
    evidence: Evidence | None
    bounds: tuple[float, float]
    line_scores: NDArray[np.float64]
    fits: str

    @property
    def least(self) -> float:
        """Logarithm of the marginal likelihood, or the least that it may be."""
        return self.bounds[0] if self.evidence is None else self.evidence.log

    @property
    def most(self) -> float:
        """Logarithm of the marginal likelihood, or the most that it may be."""
        return self.bounds[1] if self.evidence is None else self.evidence.log

    @property
    def error(self) -> float:
        """Standard error of the logarithm; 0 of a bound."""
        return 0.0 if self.evidence is None else self.evidence.error

    @property
    def score(self) -> float:
        """Sum of the line scores."""
        return float(self.line_scores.sum())


@dataclass(frozen=True, eq=False)
class ModelComparison:
    """Models of the same measurements, the preferred one first.

    Parameters
    ----------
    name : str
        Of the assembly or the series.
    models : tuple of ComparedModel
        Two or more, in any order.
    """

    name: str
    models: tuple[ComparedModel, ...]

    @cached_property
    def ranking(self) -> tuple[ComparedModel, ...]:
        """The models, the highest log Z first, or the highest lower bound where only bounds are known."""
        return tuple(sorted(self.models, key=lambda one: -one.least))

    def difference(self, model: ComparedModel) -> tuple[float, float]:
        """Return by how much at least the log Z of a model is below that of the first, and its standard error."""
        first = self.ranking[0]
        if model is first:
            return 0.0, 0.0
        return first.least - model.most, float(np.hypot(first.error, model.error))

    def score_difference(self, model: ComparedModel) -> tuple[float, float]:
        """Return by how much the score of a model is below that of the first, and the standard error of this."""
        differences = self.ranking[0].line_scores - model.line_scores
        return float(differences.sum()), float(np.sqrt(len(differences)) * differences.std())

    @property
    def preferred(self) -> ComparedModel | None:
        """The model that the measurements prefer to all others; None if they cannot tell."""
        first, *others = self.ranking
        exceeds = [gap - _STANDARD_ERRORS * error > DECISIVE for gap, error in map(self.difference, others)]
        return first if all(exceeds) else None

    @property
    def sentence(self) -> str:
        """Which model the measurements prefer, and by how much; or why they cannot tell."""
        first, *others = self.ranking
        if self.preferred is None and all(model.evidence is None for model in self.models):
            return (
                f"The models cannot be compared: of none do {FEWEST_EFFECTIVE:.0f} effective samples count for the "
                "marginal likelihood. Ask for more samples."
            )
        nearest = min(others, key=lambda one: self.difference(one)[0])
        gap, error = self.difference(nearest)
        if self.preferred is None:
            if unknown := [model.name for model in (nearest, first) if model.evidence is None]:
                return (
                    f"The measurements cannot tell {first.name} from {nearest.name}: too few samples count for the "
                    f"marginal likelihood of {unknown[0]}; that of {nearest.name} is at most exp({max(-gap, 0.0):.3g}) "
                    "times as large."
                )
            return (
                f"The measurements cannot tell {first.name} from {nearest.name}: log Z differs by {gap:.2g} "
                f"(± {error:.1g}), and less than {DECISIVE:g} is not decisive."
            )
        at_least = "at least " if None in (first.evidence, nearest.evidence) else ""
        text = (
            f"The measurements prefer {first.name}: its marginal likelihood is {at_least}{_factor(gap)} times that of "
            f"{nearest.name} (log Z differs by {at_least}{gap:.3g})."
        )
        if first.fits in ("does not fit", "rough"):
            text += f" But even {first.name} does not fit: none of these models may be right."
        return text

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as plain values for JSON."""
        preferred = self.preferred
        models = {}
        for model in self.ranking:
            gap, gap_error = self.difference(model)
            score, score_error = self.score_difference(model)
            models[model.name] = {
                "unknowns": model.unknowns,
                "log_evidence": None if model.evidence is None else model.evidence.log,
                "log_evidence_error": None if model.evidence is None else model.evidence.error,
                "least_log_evidence": _finite(model.bounds[0]),
                "largest_log_likelihood": model.bounds[1],
                "below_the_first": _finite(gap),
                "below_the_first_error": gap_error,
                "leave_one_out": model.score,
                "leave_one_out_below_the_first": score,
                "leave_one_out_below_the_first_error": score_error,
                "model_fits": model.fits,
            }
        return {
            "name": self.name,
            "models": models,
            "preferred": None if preferred is None else preferred.name,
            "sentence": self.sentence,
        }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _factor(gap: float) -> str:
    """Return exp(gap) in words that stay readable for large gaps."""
    return f"{np.exp(gap):.2g}" if gap < 14.0 else f"exp({gap:.0f})"
