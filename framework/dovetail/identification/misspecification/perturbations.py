"""Perturbations: deviations of the measurement or of a substructure from the description, each by any amount."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from dovetail.assembly import Assembly
from dovetail.assembly.parameters import Theta
from dovetail.errors import DovetailError
from dovetail.frf import conversion
from dovetail.identification.misspecification.overhang import Overhang, find_overhangs
from dovetail.interfaces import SubstructureModel
from dovetail.units import InUnit, format_quantity

__all__ = ["Perturbation", "PerturbedAssembly", "add_mass", "list_perturbations", "list_quantities", "scale_by"]


@dataclass(frozen=True)
class Settings:
    """How substructures are perturbed."""

    step: float = 1e-4
    """Logarithmic step of derivatives: small against any amount that matters, large against rounding."""
    most_dofs: int = 2000
    """DOFs of a substructure above which condensing it anew takes too long."""
    least_overhang: float = 0.05
    """Part of the length between the joint and the response, or the end, that remains at least."""


_SETTINGS = Settings()

Derivative: TypeAlias = Callable[[NDArray[np.float64], NDArray[np.complex128]], NDArray[np.complex128]]
Apply: TypeAlias = Callable[[float], Assembly]
Describe: TypeAlias = Callable[[float], str]


@dataclass(frozen=True, eq=False)
class Perturbation:
    """A deviation from the description by an amount, which is 0 for what is described.

    Parameters
    ----------
    name : str
        ``"gain"``, or ``"tool: material.young"`` of a substructure.
    derivative : callable
        From the parameters (n_params,) and the FRF (n_freq,) to the derivative (n_freq,) of the FRF by the amount.
    apply : callable
        From an amount to the perturbed assembly.
    describe : callable
        From an amount to words: "the frequency axis were off by 1 %".
    lower, upper : float
        Amounts between which it is searched.
    negligible : float
        Amount below which it is not worth reporting.
    is_overhang : bool
        Whether it is how far a substructure stands out of its joint.
    """

    name: str
    derivative: Derivative
    apply: Apply
    describe: Describe
    lower: float
    upper: float
    negligible: float = 0.0
    is_overhang: bool = False

    @property
    def of_substructure(self) -> bool:
        """Whether it is of a substructure, not of the measurement."""
        return ": " in self.name


@lru_cache(maxsize=1)  # each perturbed assembly keeps its condensed substructures; all of the spindle's, a gigabyte
def list_perturbations(assembly: Assembly) -> tuple[Perturbation, ...]:
    """Return the perturbations of the measurement and of each substructure."""
    of_measurement = (*_factors(assembly), *_sensor_mass(assembly), *_frequency_axis(assembly))
    return (*of_measurement, *_overhangs(assembly), *_quantities(assembly))


def _factors(assembly: Assembly) -> Iterator[Perturbation]:
    frequency = assembly.frequency
    ones = np.ones(len(frequency), dtype=np.complex128)
    logarithm = np.log(frequency) - np.log(frequency).mean()

    def perturb(name: str, exponent: NDArray[np.complex128], describe: Describe, upper: float) -> Perturbation:
        def apply(amount: float) -> Assembly:
            return PerturbedAssembly(assembly, scale_by(np.exp(amount * exponent)))

        return Perturbation(name, lambda _, frf: exponent * frf, apply, describe, -upper, upper)

    yield replace(perturb("gain", ones, _describe_gain, 0.7), negligible=0.005)
    yield perturb("phase", 1j * ones, lambda by: f"the phase were off by {np.degrees(by):.2g} degrees", np.pi)
    yield perturb("slope", logarithm + 0j, "the amplitude grew with the frequency to the power {:.2g}".format, 1.0)
    yield perturb("delay", np.asarray(-2j * np.pi * frequency), _describe_delay, 0.2 / frequency[-1])


def _describe_gain(by: float) -> str:
    return f"all values were {abs(100.0 * np.expm1(by)):.2g} % too {'large' if by > 0 else 'small'} (calibration?)"


def _describe_delay(seconds: float) -> str:
    return f"the response came {1e6 * seconds:.2g} microseconds late"


def _sensor_mass(assembly: Assembly) -> Iterator[Perturbation]:
    response = assembly.description.response
    if response.rotation:
        return
    to_accelerance = conversion(assembly.frequency, response.quantity, "accelerance")

    def apply(mass: float) -> Assembly:
        return PerturbedAssembly(assembly, add_mass(mass, to_accelerance))

    yield Perturbation("mass", lambda _, frf: -to_accelerance * frf**2, apply, _describe_mass, -0.05, 0.2, 1e-4)


def _describe_mass(mass: float) -> str:
    grams = f"{abs(1e3 * mass):.2g} g"
    if mass > 0:
        return f"an accelerometer mass of {grams} was not compensated"
    return f"an accelerometer mass of {grams} too much was compensated"


def _frequency_axis(assembly: Assembly) -> Iterator[Perturbation]:
    frequency, step = assembly.frequency, _SETTINGS.step
    up, down = (assembly.on(frequency * np.exp(by)) for by in (step, -step))

    def derivative(theta: NDArray[np.float64], _: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return (down.frf(theta) - up.frf(theta)) / (2.0 * step)

    def apply(amount: float) -> Assembly:
        return assembly.on(frequency * np.exp(-amount))

    yield Perturbation("axis", derivative, apply, _describe_axis, -0.1, 0.1, 5e-4)


def _describe_axis(by: float) -> str:
    return f"the frequency axis were off by {100.0 * np.expm1(by):+.2g} %"


def _overhangs(assembly: Assembly) -> Iterator[Perturbation]:
    for overhang in find_overhangs(assembly.description, _SETTINGS.most_dofs // 2):
        name = f"overhang at {1e3 * overhang.end:.4g} mm"
        apply = partial(_with_overhang, assembly, overhang)
        describe = partial(_describe_overhang, overhang)
        for perturbation in _of_substructure(assembly, overhang.substructure, name, apply, describe):
            least = _SETTINGS.least_overhang
            shortest = np.log(least + (1.0 - least) * overhang.unchanged / overhang.length)
            yield replace(perturbation, lower=max(perturbation.lower, float(shortest)), is_overhang=True)


def _quantities(assembly: Assembly) -> Iterator[Perturbation]:
    for name, model in assembly.description.substructures.items():
        if 2 * len(model.nodes) > _SETTINGS.most_dofs:
            continue
        for quantity in list_quantities(model):
            apply = partial(_with_quantity, assembly, name, quantity)
            yield from _of_substructure(assembly, name, quantity.name, apply, partial(_describe, name, quantity))


def _of_substructure(
    assembly: Assembly, substructure: str, name: str, apply: Apply, describe: Describe
) -> Iterator[Perturbation]:
    """Yield a perturbation of a substructure by the logarithm of a ratio, if the model permits it."""
    try:
        ahead = apply(_SETTINGS.step)
    except DovetailError:
        return

    def derivative(theta: NDArray[np.float64], _: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return (ahead.frf(theta) - assembly.frf(theta)) / _SETTINGS.step

    yield Perturbation(f"{substructure}: {name}", derivative, apply, describe, -0.5, 0.5, 0.002)


def _with_quantity(assembly: Assembly, name: str, quantity: ConfigQuantity, amount: float) -> Assembly:
    model = assembly.description.substructures[name]
    return _with_model(assembly, name, quantity.replace(model, quantity.value * float(np.exp(amount))))


def _with_overhang(assembly: Assembly, overhang: Overhang, amount: float) -> Assembly:
    model = assembly.description.substructures[overhang.substructure]
    lengthened = overhang.lengthen(model, overhang.length * float(np.exp(amount)))
    return _with_model(assembly, overhang.substructure, lengthened)


def _with_model(assembly: Assembly, name: str, model: SubstructureModel) -> Assembly:
    substructures = {**assembly.description.substructures, name: model}
    return Assembly(replace(assembly.description, substructures=substructures))


def _describe_overhang(overhang: Overhang, amount: float) -> str:
    described = 1e3 * overhang.length
    actual = described * np.exp(amount)
    lengths = f"{actual:.3g} mm in place of {described:.4g} mm"
    return f"the {overhang.substructure} stood out of the {overhang.joint} by {lengths}"


def _describe(substructure: str, quantity: ConfigQuantity, amount: float) -> str:
    value = quantity.value
    actual, described = (format_quantity(size, quantity.unit, 4) for size in (value * np.exp(amount), value))
    return f"'{quantity.name}' of the {substructure} were {actual} in place of {described}"


FrfTransform: TypeAlias = Callable[[NDArray[np.complex128]], tuple[NDArray[np.complex128], NDArray[np.complex128]]]
"""From FRFs (..., n_freq) to what is measured of them, and its derivative by them, line by line."""


class PerturbedAssembly(Assembly):
    """An assembly whose FRFs are transformed by the measurement.

    Parameters
    ----------
    assembly : Assembly
    transform : callable
    """

    def __init__(self, assembly: Assembly, transform: FrfTransform) -> None:
        super().__init__(assembly.description)
        self._assembly = assembly
        self._transform = transform

    def frf(self, theta: Theta = None) -> NDArray[np.complex128]:
        """Return the FRFs as measured, (n_freq,) or (n, n_freq)."""
        return self._transform(self._assembly.frf(theta))[0]

    def frf_jacobian(self, theta: Theta = None) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the FRFs as measured and their derivatives, with a last axis n_params."""
        values, jacobian = self._assembly.frf_jacobian(theta)
        measured, derivative = self._transform(values)
        return measured, jacobian * derivative[..., np.newaxis]


def scale_by(factor: NDArray[np.complex128] | complex) -> FrfTransform:
    """Return what multiplies an FRF by a factor."""
    return lambda values: (values * factor, np.broadcast_to(np.asarray(factor, dtype=np.complex128), values.shape))


def add_mass(mass: float, to_accelerance: NDArray[np.complex128]) -> FrfTransform:
    """Return what puts a mass [kg] at the drive point."""

    def transform(values: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        load = 1.0 + mass * to_accelerance * values
        return values / load, 1.0 / load**2

    return transform


@dataclass(frozen=True)
class ConfigQuantity:
    """A physical quantity in a substructure's Config.

    Parameters
    ----------
    path : tuple of str or int
        Keys from the Config down, as in ``("sections", 2, "length")``.
    value : float
        SI.
    unit : str
    """

    path: tuple[str | int, ...]
    value: float
    unit: str

    @property
    def name(self) -> str:
        """As in the description: ``sections[2].length``."""
        first, *rest = self.path
        return str(first) + "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in rest)

    def replace(self, model: SubstructureModel, value: float) -> SubstructureModel:
        """Return the substructure with another value of the quantity."""
        return type(model)(_replaced(model.config, self.path, value))


def list_quantities(model: SubstructureModel) -> tuple[ConfigQuantity, ...]:
    """Return every physical quantity other than 0 that a substructure's Config holds."""
    return tuple(_walk(model.config, ()))


def _walk(node: Any, path: tuple[str | int, ...]) -> Iterator[ConfigQuantity]:
    if isinstance(node, BaseModel):
        for name, field in type(node).model_fields.items():
            value = getattr(node, name)
            unit = _unit(field.annotation, field.metadata)
            if unit is not None and isinstance(value, float) and value != 0.0:
                yield ConfigQuantity((*path, name), value, unit)
            else:
                yield from _walk(value, (*path, name))
    elif isinstance(node, tuple):
        for index, item in enumerate(node):
            yield from _walk(item, (*path, index))


def _unit(annotation: object, metadata: Iterable[object] = ()) -> str | None:
    """Return the unit that an annotation names, also that of one of several accepted types."""
    for mark in metadata:
        if isinstance(mark, InUnit):
            return mark.unit
    units = (_unit(accepted, getattr(accepted, "__metadata__", ())) for accepted in get_args(annotation))
    return next((unit for unit in units if unit is not None), None)


def _replaced(node: Any, path: tuple[str | int, ...], value: float) -> Any:
    if not path:
        return value
    key, *rest = path
    if isinstance(key, int):
        return (*node[:key], _replaced(node[key], tuple(rest), value), *node[key + 1 :])
    return node.model_copy(update={key: _replaced(getattr(node, key), tuple(rest), value)})
