"""Perturbations: deviations of the measurement or of a substructure from the description, by a variable amount.

One of them is the overhang of a substructure: its free end is longer or shorter, and the joint's nodes stay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly import Assembly, FrfModel, Theta
from dovetail.assembly.overhangs import Overhang, find_overhangs
from dovetail.assembly.variants import at_drive_point
from dovetail.errors import DovetailError
from dovetail.frf import conversion
from dovetail.interfaces import NO_LIMIT, TimeLimit
from dovetail.problem.least_squares import Linearisation, SumOfSquares
from dovetail.problem.part_quantities import (
    MOST_DOFS,
    Apply,
    ConfigQuantity,
    known_quantities,
    materials_in_common,
    with_part,
)
from dovetail.problem.residuals import FrfResiduals, Residual
from dovetail.units import format_quantity


@dataclass(frozen=True)
class Settings:
    """How substructures are perturbed."""

    step: float = 1e-4
    """Logarithm of a ratio with which it is tested whether the model can be changed at all."""
    difference: float = 1e-5
    """Step of the finite differences by an amount, as a fraction of its range."""
    least_overhang: float = 0.05
    """Smallest fraction of the length between the joint and the response, or the end, that remains."""


_SETTINGS = Settings()

Describe: TypeAlias = Callable[[float], str]


@dataclass(frozen=True, eq=False)
class Perturbation:
    """A deviation from the description by an amount, which is 0 for what is described.

    Parameters
    ----------
    kind : {"mass", "overhang", "part"}
    name : str
        ``"mass"``, or ``"tool: material.young"`` of a substructure.
    apply : callable
        From an amount to the perturbed assembly.
    describe : callable
        From an amount to words that follow "with": "the tool protruding 31 mm from the collet instead of 30 mm".
    lower, upper : float
        Bounds of the amount.
    negligible : float
        Amount below which the perturbation is not worth reporting.
    """

    kind: str
    name: str
    apply: Apply
    describe: Describe
    lower: float
    upper: float
    negligible: float = 0.0


def list_perturbations(assembly: Assembly) -> tuple[Perturbation, ...]:
    """Return the perturbations of an assembly: a mass at its responses, overhangs, quantities of the parts."""
    return (*_added_mass(assembly), *_overhangs(assembly), *_quantities(assembly))


def _added_mass(assembly: Assembly) -> Iterator[Perturbation]:
    if any(response.rotation for response in assembly.description.responses):
        return
    responses = [(each, at_drive_point(each)) for each in assembly.each_response]
    drive_point = responses[0][1]
    quantity = drive_point.description.response.quantity
    accelerance = drive_point.frf() * conversion(drive_point.frequency, quantity, "accelerance")
    apparent = 1.0 / float(np.median(np.abs(accelerance)))
    apply, describe = partial(LoadedModel, responses), partial(_describe_mass, len(responses))
    yield Perturbation("mass", "mass", apply, describe, -0.5 * apparent, apparent, 1e-3 * apparent)


def _describe_mass(responses: int, mass: float) -> str:
    grams = np.format_float_positional(abs(1e3 * mass), 2, fractional=False, trim="-")
    change = "added to" if mass > 0 else "taken from"
    where = "the response" if responses == 1 else "each response, while it is measured"
    return f"a mass of {grams} g {change} the model at {where} (an accelerometer?)"


def _overhangs(assembly: Assembly) -> Iterator[Perturbation]:
    for overhang in find_overhangs(assembly.description, MOST_DOFS // 2):
        name = f"overhang at {1e3 * overhang.end:.4g} mm"
        apply = partial(_with_overhang, assembly, overhang)
        describe = partial(_describe_overhang, overhang)
        for perturbation in _part_perturbation(overhang.substructure, name, apply, describe):
            least = _SETTINGS.least_overhang
            shortest = np.log(least + (1.0 - least) * overhang.unchanged / overhang.length)
            yield replace(perturbation, kind="overhang", lower=max(perturbation.lower, float(shortest)))


def _quantities(assembly: Assembly) -> Iterator[Perturbation]:
    for name, quantity, apply in known_quantities(assembly):
        yield from _part_perturbation(name, quantity.name, apply, partial(_describe, name, quantity))
    for names, quantity, apply in materials_in_common(assembly):
        names_of_all = " and the ".join(names)
        yield from _part_perturbation(names_of_all, quantity.name, apply, partial(_describe, names_of_all, quantity))


def _part_perturbation(substructure: str, name: str, apply: Apply, describe: Describe) -> Iterator[Perturbation]:
    """Yield the perturbation of a substructure by the logarithm of a ratio, if the model accepts another value."""
    try:
        apply(_SETTINGS.step)
    except DovetailError:
        return
    yield Perturbation("part", f"{substructure}: {name}", apply, describe, -0.5, 0.5, 0.002)


def _with_overhang(assembly: Assembly, overhang: Overhang, amount: float) -> Assembly:
    model = assembly.description.substructures[overhang.substructure]
    lengthened = overhang.lengthen(model, overhang.length * float(np.exp(amount)))
    return with_part(assembly, overhang.substructure, lengthened)


def _describe_overhang(overhang: Overhang, amount: float) -> str:
    described = 1e3 * overhang.length
    actual = described * np.exp(amount)
    protruding = f"the {overhang.substructure} protruding {actual:.3g} mm from the {overhang.joint}"
    return f"{protruding} instead of {described:.4g} mm"


def _describe(substructure: str, quantity: ConfigQuantity, amount: float) -> str:
    value = quantity.value
    actual, described = (format_quantity(size, quantity.unit, 4) for size in (value * np.exp(amount), value))
    return f"'{quantity.name}' of the {substructure} at {actual} instead of {described}"


class PerturbedResiduals(SumOfSquares):
    """Residuals as a function of the parameters and, as the last coordinate, the amount of a perturbation.

    Parameters
    ----------
    perturbation : Perturbation
        Like the parameters, its amount is a fraction of its range.
    residual : Residual
        Against the measurement.
    limit : TimeLimit
        The time for a search.
    """

    def __init__(self, perturbation: Perturbation, residual: Residual, limit: TimeLimit = NO_LIMIT) -> None:
        self._perturbation = perturbation
        self._residual = residual
        self.limit = limit
        self._width = perturbation.upper - perturbation.lower

    def position(self, fraction: NDArray[np.float64], amount: float) -> NDArray[np.float64]:
        """Return the position (1, p + 1) for fractions of the parameters' ranges (p,) and an amount."""
        return np.append(fraction, (amount - self._perturbation.lower) / self._width)[np.newaxis]

    def amount(self, position: NDArray[np.float64]) -> float:
        """Return the amount at a position (p + 1,)."""
        return float(self._perturbation.lower + self._width * position[-1])

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at positions (n, p + 1)."""
        return np.concatenate([self._at(self.amount(row)).residuals(row[np.newaxis, :-1]) for row in position])

    def linearise(self, position: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives at positions (n, p + 1)."""
        rows = [self._linearise(row) for row in position]
        return Linearisation(*(np.stack(arrays) for arrays in zip(*rows, strict=True)))

    def _linearise(self, position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        fraction, amount = position[np.newaxis, :-1], self.amount(position)
        step = -_SETTINGS.difference if position[-1] > 0.5 else _SETTINGS.difference
        linear = self._at(amount).linearise(fraction)
        ahead = self._at(amount + step * self._width).residuals(fraction)
        return linear.residuals[0], np.concatenate([linear.jacobian[0], (ahead - linear.residuals) / step])

    def _at(self, amount: float) -> FrfResiduals:
        return FrfResiduals(self._perturbation.apply(amount), self._residual)


class LoadedModel:
    """An assembly with a mass that is moved from response to response, to each while it is measured (`FrfModel`).

    Parameters
    ----------
    responses : sequence of (Assembly, Assembly)
        Each response, and the drive point where it is measured.
    mass : float
        kg.
    """

    def __init__(self, responses: Sequence[tuple[Assembly, Assembly]], mass: float) -> None:
        self._responses, self._mass = responses, mass
        self._plain, self._at_response = responses[0]
        self.description, self.parameters = self._plain.description, self._plain.parameters
        self.frequency = self._plain.frequency
        quantity = self._at_response.description.response.quantity
        self._load = mass * conversion(self.frequency, quantity, "accelerance")

    @cached_property
    def each_response(self) -> tuple[LoadedModel, ...]:
        """One model for each response; the first is this one."""
        return self, *(LoadedModel([other], self._mass) for other in self._responses[1:])

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions of the ranges to SI values."""
        return self._plain.from_unit(fraction)

    def to_unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map SI values to fractions of the ranges."""
        return self._plain.to_unit(theta)

    def on(self, frequency: ArrayLike, *further: ArrayLike, chosen: bool = False) -> LoadedModel:
        """Return the same model at other frequencies: one axis for all responses, or one for each."""
        axes = (frequency, *further) if further else (frequency,) * len(self._responses)
        pairs = zip(self._responses, axes, strict=True)
        moved = [tuple(model.on(axis, chosen=chosen) for model in models) for models, axis in pairs]
        return LoadedModel([(plain, at_response) for plain, at_response in moved], self._mass)

    def combined(self, _others: Sequence[FrfModel], /) -> None:
        """Return None, since the structure is another one for each response."""

    def frf(self, theta: Theta = None) -> NDArray[np.complex128]:
        """Return the FRFs as measured, (n_freq,) or (n, n_freq)."""
        return np.asarray(self._plain.frf(theta) / (1.0 + self._load * self._at_response.frf(theta)))

    def frf_jacobian(self, theta: Theta = None) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the FRFs as measured and their derivatives, with a last axis n_params."""
        values, jacobian = self._plain.frf_jacobian(theta)
        same = self._at_response is self._plain
        load_frf, slope = (values, jacobian) if same else self._at_response.frf_jacobian(theta)
        loaded = values / (1.0 + self._load * load_frf)
        change = jacobian - (loaded * self._load)[..., np.newaxis] * slope
        return loaded, change / (1.0 + self._load * load_frf)[..., np.newaxis]
