"""A smooth law that only rises or only falls."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

import dovetail

_DEGREE = 2
"""Quadratic pieces, whose slope is continuous."""
_LARGEST = 3.0
"""Range of the logarithms of the coefficients' increments: one is at most 20 times the next."""


class MonotoneSpline(dovetail.Law):
    """A quadratic spline whose coefficients only rise or only fall; constant beyond the ends.

    Its increments are shares of the change from the first to the last value. Their logarithms are the unknowns, that of
    the last increment is 0.
    """

    name = "monotone_spline"
    summary = "A smooth curve that only rises or only falls"
    references = ("Ramsay, Monotone regression splines in action, Statistical Science 3 (1988) 425",)

    class Config(dovetail.ComponentConfig):
        """How flexible it is.

        Attributes
        ----------
        pieces : int
            Pieces of equal length; the law has two unknowns more than pieces.
        """

        pieces: Annotated[int, Field(ge=1, le=20)] = 2

    @property
    def unknowns(self) -> tuple[dovetail.LawUnknown, ...]:
        """The values at both ends, and the logarithms of the increments."""
        count = self.config.pieces + _DEGREE - 2
        values = (
            dovetail.LawUnknown("first", "Value at the smallest covariate"),
            dovetail.LawUnknown("last", "Value at the largest covariate"),
        )
        shape = "Logarithm of an increment of the coefficients, over the last one"
        return (
            *values,
            *(dovetail.LawUnknown(f"shape_{n}", shape, -_LARGEST, _LARGEST) for n in range(1, count + 1)),
        )

    def evaluate(
        self, covariate: float, ends: tuple[float, float], unknowns: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the spline's values."""
        first, last = unknowns[:, 0], unknowns[:, 1]
        increments = np.exp(np.column_stack([unknowns[:, 2:], np.zeros(len(unknowns))]))
        increments /= increments.sum(axis=1, keepdims=True)
        reached = self._reached(min(max((covariate - ends[0]) / (ends[1] - ends[0]), 0.0), 1.0))
        share = increments @ reached
        slopes = (increments * (reached - share[:, np.newaxis]))[:, :-1]
        derivatives = np.column_stack([1.0 - share, share, (last - first)[:, np.newaxis] * slopes])
        return first + (last - first) * share, derivatives

    def _reached(self, part: float) -> NDArray[np.float64]:
        """Return how much of each increment the spline has made at a part of the span: sums of B-splines."""
        from scipy.interpolate import BSpline

        inner = np.linspace(0.0, 1.0, self.config.pieces + 1)
        knots = np.concatenate([np.zeros(_DEGREE), inner, np.ones(_DEGREE)])
        basis = BSpline.design_matrix(np.array([part]), knots, _DEGREE).toarray()[0]
        return np.asarray(np.cumsum(basis[::-1])[::-1][1:])
