"""What may be other than described: what a little of it does to the FRF, and the assembly with any amount of it."""

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
from dovetail.identification.misspecification.overhang import Overhang, overhangs
from dovetail.interfaces import SubstructureModel
from dovetail.units import InUnit, format_quantity

__all__ = ["AlteredAssembly", "Change", "Entry", "Passage", "changes", "entries", "factor", "loaded"]

_STEP = 1e-4
"""Relative change by which derivatives are taken."""
_LARGEST = 2000
"""DOFs of a substructure above which condensing it anew takes too long to ask what it would be otherwise."""
_LEAST_BETWEEN = 0.05
"""Part of the length between joint and response, or end, that is left at least."""

Effect: TypeAlias = Callable[[NDArray[np.float64], NDArray[np.complex128]], NDArray[np.complex128]]


@dataclass(frozen=True, eq=False)
class Change:
    """One thing that may be other than described, by an amount that is 0 for what is described.

    Parameters
    ----------
    name : str
    effect : callable
        From the parameters (n_params,) and the FRF (n_freq,) to the derivative (n_freq,) of the FRF by the amount.
    altered : callable
        From an amount to the assembly with it.
    words : callable
        From an amount to what it is: "the frequency axis were off by 1 %".
    least, most : float
        Amounts between which it is sought.
    worth : float
        Amount below which it is not worth a word.
    overhang : bool
        Whether it is how far a part stands out of its joint.
    """

    name: str
    effect: Effect
    altered: Callable[[float], Assembly]
    words: Callable[[float], str]
    least: float
    most: float
    worth: float = 0.0
    overhang: bool = False


@lru_cache(maxsize=4)
def changes(assembly: Assembly) -> tuple[Change, ...]:
    """Return what may be other than described: of the measurement, and of each part."""
    of_measurement = (*_factors(assembly), *_mass(assembly), *_axis(assembly))
    return (*of_measurement, *_overhangs(assembly), *_of_parts(assembly))


def _factors(assembly: Assembly) -> Iterator[Change]:
    frequency = assembly.frequency
    logarithm = np.log(frequency) - np.log(frequency).mean()
    turned: NDArray[np.complex128] = np.asarray(2j * np.pi * frequency)

    def change(
        name: str, exponent: NDArray[np.complex128], words: Callable[[float], str], most: float, worth: float = 0.0
    ) -> Change:
        return Change(
            name,
            lambda _, values: exponent * values,
            lambda amount: AlteredAssembly(assembly, factor(np.exp(amount * exponent))),
            words,
            -most,
            most,
            worth,
        )

    one = np.ones(len(frequency), dtype=np.complex128)
    yield change("gain", one, _gain_in_words, 0.7, 0.005)
    yield change("phase", 1j * one, lambda by: f"the phase were off by {np.degrees(by):.2g} degrees", np.pi)
    yield change(
        "slope", logarithm + 0j, lambda by: f"the amplitude grew with the frequency to the power {by:.2g}", 1.0
    )
    yield change(
        "delay", -turned, lambda by: f"the response came {1e6 * by:.2g} microseconds late", 0.2 / frequency[-1]
    )


def _gain_in_words(by: float) -> str:
    return f"all values were {abs(100.0 * np.expm1(by)):.2g} % too {'large' if by > 0 else 'small'} (calibration?)"


def _mass(assembly: Assembly) -> Iterator[Change]:
    response = assembly.description.response
    if response.rotation:
        return
    to_accelerance = conversion(assembly.frequency, response.quantity, "accelerance")
    yield Change(
        "mass",
        lambda _, values: -to_accelerance * values**2,
        lambda mass: AlteredAssembly(assembly, loaded(mass, to_accelerance)),
        _mass_in_words,
        -0.05,
        0.2,
        1e-4,
    )


def _mass_in_words(mass: float) -> str:
    grams = f"{abs(1e3 * mass):.2g} g"
    if mass > 0:
        return f"an accelerometer mass of {grams} was not compensated"
    return f"an accelerometer mass of {grams} too much was compensated"


def _axis(assembly: Assembly) -> Iterator[Change]:
    frequency = assembly.frequency
    up, down = (assembly.on(frequency * np.exp(step)) for step in (_STEP, -_STEP))
    yield Change(
        "axis",
        lambda theta, _: (down.frf(theta) - up.frf(theta)) / (2.0 * _STEP),
        lambda amount: assembly.on(frequency * np.exp(-amount)),
        lambda by: f"the frequency axis were off by {100.0 * np.expm1(by):+.2g} %",
        -0.1,
        0.1,
        5e-4,
    )


def _overhangs(assembly: Assembly) -> Iterator[Change]:
    for overhang in overhangs(assembly.description, _LARGEST // 2):
        altered = partial(_with_overhang, assembly, overhang)
        words = partial(_overhang_in_words, overhang)
        for change in _of_part(assembly, overhang.part, f"overhang at {1e3 * overhang.end:.4g} mm", altered, words):
            shortest = np.log(_LEAST_BETWEEN + (1.0 - _LEAST_BETWEEN) * overhang.shortest / overhang.length)
            yield replace(change, least=max(change.least, float(shortest)), overhang=True)


def _of_parts(assembly: Assembly) -> Iterator[Change]:
    for name, model in assembly.description.substructures.items():
        if 2 * len(model.nodes) > _LARGEST:
            continue
        for entry in entries(model):
            altered = partial(_with_entry, assembly, name, entry)
            yield from _of_part(assembly, name, entry.name, altered, partial(_entry_in_words, name, entry))


def _of_part(
    assembly: Assembly, part: str, name: str, altered: Callable[[float], Assembly], words: Callable[[float], str]
) -> Iterator[Change]:
    """Yield a change of a part by the logarithm of a ratio, if it can be."""
    try:
        changed = altered(_STEP)
    except DovetailError:
        return
    yield Change(f"{part}: {name}", _difference(assembly, changed), altered, words, -0.5, 0.5, 0.002)


def _difference(assembly: Assembly, changed: Assembly) -> Effect:
    return lambda theta, _: (changed.frf(theta) - assembly.frf(theta)) / _STEP


def _with_entry(assembly: Assembly, part: str, entry: Entry, amount: float) -> Assembly:
    model = assembly.description.substructures[part]
    return _with_part(assembly, part, entry.changed(model, entry.value * float(np.exp(amount))))


def _with_overhang(assembly: Assembly, overhang: Overhang, amount: float) -> Assembly:
    model = assembly.description.substructures[overhang.part]
    return _with_part(assembly, overhang.part, overhang.changed(model, overhang.length * float(np.exp(amount))))


def _with_part(assembly: Assembly, part: str, model: SubstructureModel) -> Assembly:
    parts = {**assembly.description.substructures, part: model}
    return Assembly(replace(assembly.description, substructures=parts))


def _overhang_in_words(overhang: Overhang, amount: float) -> str:
    described = 1e3 * overhang.length
    now = described * np.exp(amount)
    return f"the {overhang.part} stood out of the {overhang.joint} by {now:.3g} mm in place of {described:.4g} mm"


def _entry_in_words(part: str, entry: Entry, amount: float) -> str:
    now, described = (format_quantity(value, entry.unit, 4) for value in (entry.value * np.exp(amount), entry.value))
    return f"'{entry.name}' of the {part} were {now} in place of {described}"


Passage: TypeAlias = Callable[[NDArray[np.complex128]], tuple[NDArray[np.complex128], NDArray[np.complex128]]]
"""From FRFs (..., n_freq) to what is measured of them, and its derivative by them, line by line."""


class AlteredAssembly(Assembly):
    """An assembly whose FRFs pass through something before they are measured.

    Parameters
    ----------
    assembly : Assembly
    passage : callable
    """

    def __init__(self, assembly: Assembly, passage: Passage) -> None:
        super().__init__(assembly.description)
        self._assembly = assembly
        self._passage = passage

    def frf(self, theta: Theta = None) -> NDArray[np.complex128]:
        """Return the FRFs as measured, (n_freq,) or (n, n_freq)."""
        return self._passage(self._assembly.frf(theta))[0]

    def frf_jacobian(self, theta: Theta = None) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the FRFs as measured and their derivatives, with a last axis n_params."""
        values, jacobian = self._assembly.frf_jacobian(theta)
        measured, slope = self._passage(values)
        return measured, jacobian * slope[..., np.newaxis]


def factor(by: NDArray[np.complex128] | complex) -> Passage:
    """Return what multiplies an FRF."""
    return lambda values: (values * by, np.broadcast_to(np.asarray(by, dtype=np.complex128), values.shape))


def loaded(mass: float, to_accelerance: NDArray[np.complex128]) -> Passage:
    """Return what puts a mass [kg] at the drive point."""

    def passage(values: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        load = 1.0 + mass * to_accelerance * values
        return values / load, 1.0 / load**2

    return passage


@dataclass(frozen=True)
class Entry:
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

    def changed(self, model: SubstructureModel, value: float) -> SubstructureModel:
        """Return the substructure with another value in this place."""
        return type(model)(_with(model.config, self.path, value))


def entries(model: SubstructureModel) -> tuple[Entry, ...]:
    """Return every physical quantity other than 0 that a substructure's Config holds."""
    return tuple(_walk(model.config, ()))


def _walk(node: Any, path: tuple[str | int, ...]) -> Iterator[Entry]:
    if isinstance(node, BaseModel):
        for name, field in type(node).model_fields.items():
            value = getattr(node, name)
            unit = _unit(field.annotation, field.metadata)
            if unit is not None and isinstance(value, float) and value != 0.0:
                yield Entry((*path, name), value, unit)
            else:
                yield from _walk(value, (*path, name))
    elif isinstance(node, tuple):
        for index, part in enumerate(node):
            yield from _walk(part, (*path, index))


def _unit(annotation: object, metadata: Iterable[object] = ()) -> str | None:
    """Return the unit that an annotation names, also one of several that are accepted."""
    for mark in metadata:
        if isinstance(mark, InUnit):
            return mark.unit
    for part in get_args(annotation):
        unit = _unit(part, getattr(part, "__metadata__", ()))
        if unit is not None:
            return unit
    return None


def _with(node: Any, path: tuple[str | int, ...], value: float) -> Any:
    if not path:
        return value
    key, *rest = path
    if isinstance(key, int):
        return (*node[:key], _with(node[key], tuple(rest), value), *node[key + 1 :])
    return node.model_copy(update={key: _with(getattr(node, key), tuple(rest), value)})
