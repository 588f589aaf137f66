"""Checks of substructures: what they declare about their matrices as functions of their options."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.documents.option_fields import numbers_within
from dovetail.errors import PluginError
from dovetail.interfaces import Declaration, StructuralMatrices, SubstructureModel, describes_matrices
from dovetail.testing.linear_algebra import dense
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimens import SubstructureSpecimen

_RANGE = (0.97, 1.03)
"""Ends of the range of an option over its value."""
_SAMPLES = 4
"""Random values of the options."""
_STEP = 1e-3
"""Step of the differences relative to the option, which leaves an error of 1e-12 of the second derivative."""
_WRONG = 1e-6
"""Smallest relative error of a wrong slope."""


def check_declared_matrices_are_those_of_each_value(specimen: SubstructureSpecimen) -> None:
    """`linear_options` and `scaled_matrices`, if declared, give the matrices and derivatives of the part itself."""
    part = specimen.component
    numbers = {".".join(map(str, number.path)): number.value for number in numbers_within(part.config)}
    values = {place: value for place, value in numbers.items() if value and isinstance(value, float)}
    sets = [*([place] for place in values), list(values)]
    if not sum(_verified(part, options, np.array([values[place] for place in options])) for options in sets if options):
        raise NotApplicable("the part declares nothing about its matrices.")


def _verified(part: SubstructureModel, options: Sequence[str], values: NDArray[np.float64]) -> bool:
    """Compare what a part declares for some options with parts that have their values; return whether it does."""
    linear = [place for place in options if place in part.linear_options]
    linear = linear if describes_matrices(part, "linear_options") else []
    others = [place for place in options if place not in linear]
    scaled = part.scaled_matrices(others) if others and describes_matrices(part, "scaled_matrices") else None
    if not linear and scaled is None:
        return False
    lower, upper = np.sort(np.outer(_RANGE, values), axis=0)
    samples = lower + np.random.default_rng(0).random((_SAMPLES, len(options))) * (upper - lower)

    def matrices(theta: NDArray[np.float64]) -> StructuralMatrices:
        parts = [_made(part, options, row) for row in theta.tolist()]
        return StructuralMatrices(*(np.stack([dense(getattr(each, name)) for each in parts]) for name in "MKCD"))

    try:
        size = matrices(samples[:1]).size
    except Exception:  # the part cannot have such options
        return False
    declaration = Declaration(part.name, matrices, size, options, lower, upper, samples, linear, scaled)
    try:
        declaration.verify()
        superposition = declaration.superposition()
    except PluginError as error:
        raise Nonconformity(error.faults[0].problem, error.faults[0].remedy) from error
    if superposition is not None and scaled is not None:
        at = samples[:, superposition.others]
        for column, place in enumerate(others):
            step = np.zeros_like(at)
            step[:, column] = _STEP * at[:, column]
            near, far = (scaled.factors(at + n * step) - scaled.factors(at - n * step) for n in (1, 2))
            difference = (8.0 * near - far) / (12.0 * step[:, column, np.newaxis])
            scale = np.abs(difference) + np.abs(scaled.factors(at) / at[:, column, np.newaxis])
            if (np.abs(scaled.slopes(at)[..., column] - difference) > _WRONG * scale).any():
                raise Nonconformity(f"slopes of scaled_matrices by '{place}' disagree with differences of factors.")
    return True


def _made(part: SubstructureModel, options: Sequence[str], values: Sequence[float]) -> object:
    section = part.config.with_options(dict(zip(options, values, strict=True))).model_dump(by_alias=True)
    return type(part)(type(part.config).model_validate(section)).matrices()
