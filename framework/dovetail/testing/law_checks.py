"""Checks of laws: values and derivatives over a covariate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import Law, LawUnknown
from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.specimen import SEED, Specimen

_ENDS = (2.0, 10.0)
_INSIDE = (2.0, 2.5, 4.0, 7.0, 10.0)
_BEYOND = (1.5, 14.0)
_STEP = 1e-6
"""Step of central differences, in units of the unknowns, which are of the order of one."""
_TOLERANCE = 1e-5
"""Largest error of a derivative, over the largest derivative: central differences have six digits or more."""
_SAMPLES = 32


@dataclass(frozen=True, eq=False)
class LawSpecimen(Specimen):
    """A law with vectors of its unknowns."""

    component: Law

    @cached_property
    def vectors(self) -> NDArray[np.float64]:
        """(n, k) unknowns within their ranges."""
        parts = np.random.default_rng(SEED).random((_SAMPLES, len(self.component.unknowns)))
        columns = [_within(unknown, part) for unknown, part in zip(self.component.unknowns, parts.T, strict=True)]
        return np.stack(columns, axis=1)

    def at(self, covariate: float, vectors: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values and derivatives at a covariate."""
        values, derivatives = self.component.evaluate(covariate, _ENDS, vectors.copy())
        return np.asarray(values), np.asarray(derivatives)


def _within(unknown: LawUnknown, part: NDArray[np.float64]) -> NDArray[np.float64]:
    if unknown.is_value:
        return part
    assert unknown.lower is not None
    assert unknown.upper is not None
    if unknown.scale == "log":
        return np.asarray(unknown.lower * (unknown.upper / unknown.lower) ** part)
    return np.asarray(unknown.lower + (unknown.upper - unknown.lower) * part)


def check_unknowns_are_declared(specimen: LawSpecimen) -> None:
    """A law declares its unknowns: a tuple of LawUnknown with different names."""
    unknowns = specimen.component.unknowns
    if not isinstance(unknowns, tuple) or not unknowns or not all(isinstance(one, LawUnknown) for one in unknowns):
        raise Nonconformity(f"unknowns returned {unknowns!r:.80}.", "Return a tuple of dovetail.LawUnknown.")
    names = [unknown.name for unknown in unknowns]
    if len(set(names)) < len(names) or not all(name.isidentifier() for name in names):
        raise Nonconformity(f"the unknowns are named {names}.", "Give each another name of letters, digits and '_'.")


def check_values_and_derivatives_have_their_shapes(specimen: LawSpecimen) -> None:
    """`evaluate` returns (n,) values and (n, k) derivatives, all finite, beyond the ends too."""
    for covariate in (*_INSIDE, *_BEYOND):
        values, derivatives = specimen.at(covariate, specimen.vectors)
        shapes, wanted = (values.shape, derivatives.shape), (specimen.vectors.shape[:1], specimen.vectors.shape)
        if shapes != wanted:
            raise Nonconformity(f"evaluate returned arrays of the shapes {shapes}.", f"They must be {wanted}.")
        if not (np.isfinite(values).all() and np.isfinite(derivatives).all()):
            raise Nonconformity(f"at the covariate {covariate:g}, between {_ENDS}, something is not finite.")


def check_derivatives_are_those_of_the_values(specimen: LawSpecimen) -> None:
    """The derivatives are those of the values."""
    for covariate in (*_INSIDE, *_BEYOND):
        _, derivatives = specimen.at(covariate, specimen.vectors)
        for column, unknown in enumerate(specimen.component.unknowns):
            step = np.zeros(specimen.vectors.shape[1])
            step[column] = _STEP
            ahead, behind = (specimen.at(covariate, specimen.vectors + sign * step)[0] for sign in (1.0, -1.0))
            error = np.abs((ahead - behind) / (2.0 * _STEP) - derivatives[:, column]).max()
            if error > _TOLERANCE * max(1.0, float(np.abs(derivatives).max())):
                problem = f"the derivative by '{unknown.name}' is wrong by {error:.2g} at the covariate {covariate:g}."
                raise Nonconformity(problem, "Differentiate the values by the unknowns, in their order.")


def check_rows_do_not_depend_on_one_another(specimen: LawSpecimen) -> None:
    """A vector of unknowns gives the same value alone and among others."""
    for covariate in _INSIDE:
        among_others = specimen.at(covariate, specimen.vectors)[0]
        alone = specimen.at(covariate, specimen.vectors[3:4])[0]
        if abs(float(among_others[3] - alone[0])) > 1e-12:
            raise Nonconformity("a row alone gives another value than among others.", "Compute each row by itself.")


def check_values_stay_within_the_range(specimen: LawSpecimen) -> None:
    """Between the ends a law of values within the range, 0 to 1, stays within it."""
    for covariate in _INSIDE:
        values, _ = specimen.at(covariate, specimen.vectors)
        if values.min() < -1e-9 or values.max() > 1.0 + 1e-9:
            problem = f"at the covariate {covariate:g} its values reach from {values.min():.3g} to {values.max():.3g}."
            raise Nonconformity(problem, "Use values at places between the ends as unknowns.")
