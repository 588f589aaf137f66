"""Laws with a single fault, each derived from a sound one."""

from __future__ import annotations

import numpy as np

from dovetail import Law, LawUnknown
from support.broken_plugins.lists import breaks


class SoundLaw(Law):
    """A straight line over the covariate."""

    name = "line_law"
    summary = "A straight line"

    @property
    def unknowns(self):
        """Values of the parameter at both ends."""
        return LawUnknown("first", "Value at the smallest covariate"), LawUnknown("last", "Value at the largest one")

    def evaluate(self, covariate, ends, unknowns):
        """Return the values and their derivatives."""
        share = (covariate - ends[0]) / (ends[1] - ends[0])
        derivatives = np.tile([1.0 - share, share], (len(unknowns), 1))
        return np.sum(unknowns * derivatives, axis=1), derivatives


@breaks("unknowns_are_declared")
class SameNames(SoundLaw):
    """Two unknowns of one name."""

    @property
    def unknowns(self):
        """Give both values the same name."""
        return LawUnknown("value"), LawUnknown("value")


@breaks("values_and_derivatives_have_their_shapes")
class NotExtrapolated(SoundLaw):
    """Not a number beyond the largest covariate."""

    def evaluate(self, covariate, ends, unknowns):
        """Leave the span of the tests undefined outside."""
        values, derivatives = super().evaluate(covariate, ends, unknowns)
        return (values if covariate <= ends[1] else np.full_like(values, np.nan)), derivatives


@breaks("derivatives_are_those_of_the_values")
class ExchangedDerivatives(SoundLaw):
    """Derivatives in another order than the unknowns."""

    def evaluate(self, covariate, ends, unknowns):
        """Exchange the columns."""
        values, derivatives = super().evaluate(covariate, ends, unknowns)
        return values, derivatives[:, ::-1]


@breaks("rows_do_not_depend_on_one_another")
class DependentRows(SoundLaw):
    """Smaller values among other rows."""

    def evaluate(self, covariate, ends, unknowns):
        """Scale the values unless there is one row."""
        values, derivatives = super().evaluate(covariate, ends, unknowns)
        scale = 1.0 if len(unknowns) == 1 else 0.9
        return scale * values, scale * derivatives


@breaks("values_stay_within_the_range")
class OutOfRange(SoundLaw):
    """A bulge between the ends that leaves the range."""

    def evaluate(self, covariate, ends, unknowns):
        """Add a parabola that is 1 in the middle."""
        values, derivatives = super().evaluate(covariate, ends, unknowns)
        share = (covariate - ends[0]) / (ends[1] - ends[0])
        return values + 4.0 * share * (1.0 - share), derivatives
