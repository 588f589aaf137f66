"""Structures that differ from their models by an error of a known kind and size, for the studies of adequacy."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

import dovetail
from dovetail.assembly.overhangs import find_overhangs
from dovetail.description import with_damping
from dovetail.errors import DovetailError
from dovetail.inference.adequacy.perturbations import list_perturbations
from dovetail.inference.posterior.model_error import fit_resonances
from dovetail.problem.part_quantities import list_quantities
from dovetail_bench.evaluation.mesh_refinement import finer

_LINES = 1000
"""On which poles are found; without noise they need not be resolved."""
_VISIBLE = 0.05
"""Part of the FRF, where a resonance is strongest, that it contributes at least if it counts."""
_SAME = 0.3
"""Logarithm of the ratio of natural frequencies beyond which two are not the same resonance."""
_LARGEST = 0.35
"""Logarithm of the ratio by which a quantity is off at most."""
_STIFFEST = 1e4
"""Unmodelled spring at most, over EI / L^3 of the beam that it holds."""
_LESS_DAMPED = 0.7
"""Loss factor of a part, in place of 1."""
_FINER = 4
_DELAY = 20e-6
_LEAST_PHASE = 0.1
"""Phase [rad] that a delay makes at the highest frequency; below, there is nothing to be seen of it."""

Apply = Callable[[float], dovetail.Assembly]
"""From an amount to the structure, on the same lines."""


@dataclass(frozen=True, eq=False)
class Poles:
    """The resonances that are visible in an FRF without noise.

    Parameters
    ----------
    values : (n,) complex array
        Hz, ascending.
    """

    values: np.ndarray

    @staticmethod
    def of(assembly: dovetail.Assembly, theta: np.ndarray) -> Poles:
        """Return those within the assembly's lines."""
        axis = np.linspace(*assembly.frequency[[0, -1]], _LINES)
        frf = assembly.on(axis).frf(theta)
        quantity = assembly.description.response.quantity
        found = fit_resonances([dovetail.Frf(axis, frf, quantity)], [frf])
        strongest = np.abs(found.near[0]).argmax(axis=1)
        visible = np.abs(found.near[0]).max(axis=1) > _VISIBLE * np.abs(frf)[strongest]
        within = (found.poles.real > axis[0]) & (found.poles.real < axis[-1])
        return Poles(found.poles[visible & within])


def pole_errors(one: Poles, other: Poles) -> tuple[float, float]:
    """Return the root mean square relative difference of natural frequencies and of damping ratios; NaN if none."""
    if not len(one.values) or not len(other.values):
        return np.nan, np.nan
    away = np.abs(np.log(one.values.real[:, np.newaxis] / other.values.real))
    pairs = [(i, j) for i, j in zip(*linear_sum_assignment(away), strict=True) if away[i, j] < _SAME]
    if not pairs:
        return np.nan, np.nan
    first, second = np.array(pairs).T
    of_frequency = away[first, second]
    damping = [poles.values.imag / poles.values.real for poles in (one, other)]
    of_damping = np.log(damping[0][first] / damping[1][second])
    return float(np.sqrt(np.mean(of_frequency**2))), float(np.sqrt(np.mean(of_damping**2)))


def dampers(assembly: dovetail.Assembly) -> np.ndarray:
    """Return which parameters (n_params,) are dampers."""
    return np.array([name.startswith("c") for _, name in assembly.description.identified_parameters])


# -- kinds of errors -------------------------------------------------------------------------------------------------


def _off(names: tuple[str, ...]) -> Callable[..., Apply | None]:
    """Return a kind: one of the quantities whose names end so is off by the logarithm of a ratio."""

    def kind(assembly: dovetail.Assembly, _theta: np.ndarray, rng: np.random.Generator) -> Apply | None:
        parts = assembly.description.substructures
        found = [(part, q) for part, model in parts.items() for q in list_quantities(model) if q.name.endswith(names)]
        if not found:
            return None
        part, quantity = found[rng.integers(len(found))]
        return lambda amount: _with_part(
            assembly, part, quantity.replace(parts[part], quantity.value * float(np.exp(amount)))
        )

    return kind


def _with_part(assembly: dovetail.Assembly, name: str, model: Any) -> dovetail.Assembly:
    substructures = {**assembly.description.substructures, name: model}
    changed = replace(assembly.description, substructures=substructures)
    return dovetail.Assembly(changed).on(assembly.frequency)


def _spring(assembly: dovetail.Assembly, _theta: np.ndarray, rng: np.random.Generator) -> Apply | None:
    """An unmodelled spring between the ground and some point of a beam; the amount is its stiffness."""
    description = json.loads(assembly.description.text)
    beams = [name for name, part in description["substructures"].items() if part["model"] == "timoshenko_beam"]
    name = beams[rng.integers(len(beams))]
    part = description["substructures"][name]
    section = part["sections"][0]
    step = section["length"] / section["elements"]
    position = float(step * rng.integers(section["elements"] + 1))
    if "height" in section:
        moment = section["width"] * section["height"] ** 3 / 12.0
    else:
        moment = np.pi / 64.0 * (section["outer"] ** 4 - section.get("inner", 0.0) ** 4)
    unit = part["material"]["young"] * moment / section["length"] ** 3
    middle = 2.0 * np.pi * float(np.sqrt(assembly.frequency[0] * assembly.frequency[-1]))

    def apply(amount: float) -> dovetail.Assembly:
        changed = copy.deepcopy(description)
        changed["substructures"]["unmodelled"] = {"model": "ground", "positions": [position]}
        connect = {"a": {"to": name, "at": [position]}, "b": {"to": "unmodelled", "at": [position]}}
        values = {"k": {"value": abs(amount) * unit}, "c": {"value": 0.01 * abs(amount) * unit / middle}}
        changed["joints"]["unmodelled"] = {
            "model": "spring_damper",
            "direction": "x",
            "connect": connect,
            "parameters": values,
        }
        return dovetail.load(changed).on(assembly.frequency)

    return apply


def _mesh(assembly: dovetail.Assembly, _theta: np.ndarray, _rng: np.random.Generator) -> Apply | None:
    return lambda _amount: finer(assembly, _FINER).on(assembly.frequency)


def _loss(assembly: dovetail.Assembly, theta: np.ndarray, rng: np.random.Generator) -> Apply | None:
    apply = _off(("loss_factor",))(assembly, theta, rng)
    return None if apply is None else lambda amount: apply(float(np.sign(amount) * np.log(_LESS_DAMPED)))


def _law(assembly: dovetail.Assembly, _theta: np.ndarray, _rng: np.random.Generator) -> Apply | None:
    return (lambda _amount: _structurally_damped(assembly)) if dampers(assembly).any() else None


def _structurally_damped(assembly: dovetail.Assembly) -> dovetail.Assembly:
    """Structural damping in place of dampers, as strong in the middle of the band."""
    middle = float(np.sqrt(assembly.frequency[0] * assembly.frequency[-1]))
    return dovetail.Assembly(with_damping(assembly.description, middle)).on(assembly.frequency)


SCALED: Mapping[str, Callable[..., Apply | None]] = {
    "young": _off(("young",)),
    "density": _off(("density",)),
    "mass": _off(("].mass",)),
    "length": _off(("].length",)),
    "section": _off(("].outer", "].height")),
    "spring": _spring,
}
"""Errors that are scaled to a wanted size."""

KINDS: Mapping[str, Callable[..., Apply | None]] = {**SCALED, "mesh": _mesh, "loss": _loss, "law": _law}


def wrong_structure(
    assembly: dovetail.Assembly, theta: np.ndarray, kind: str, wanted: float, rng: np.random.Generator
) -> dovetail.Assembly | None:
    """Return a structure whose natural frequencies are off by a wanted part, at equal parameters.

    Parameters
    ----------
    assembly : Assembly
        The model, on the lines of the measurement.
    theta : (n_params,) array
    kind : str
        One of `KINDS`.
    wanted : float
        Root mean square over the visible resonances; without effect for kinds that are not scaled.
    rng : numpy.random.Generator

    Returns
    -------
    Assembly or None
        None if there is no such quantity, or no plausible error of it is as large.
    """
    apply = KINDS[kind](assembly, theta, rng)
    if apply is None:
        return None
    amount = 0.01 * (1.0 if kind == "spring" or rng.random() < 0.5 else -1.0)
    if kind not in SCALED:
        return apply(amount)
    poles, most = Poles.of(assembly, theta), _STIFFEST if kind == "spring" else _LARGEST
    for _ in range(8):
        try:
            made = apply(amount)
        except DovetailError:
            return None
        size = pole_errors(Poles.of(made, theta), poles)[0]
        if abs(np.log(size / wanted)) < 0.1:
            return made
        if not np.isfinite(size) or size <= 0.0:
            return None
        amount *= float(np.clip(wanted / size, 0.02, 50.0))
        if abs(amount) > most:
            return None
    return None


# -- alterations of measurements -------------------------------------------------------------------------------------

ALTERATIONS = (
    "unaltered",
    "sign",
    "gain",
    "unit",
    "thousand",
    "quantity",
    "delay",
    "conjugate",
    "point",
    "mass",
    "overhang",
    "range",
    "damping",
)


def altered(
    assembly: dovetail.Assembly, theta: np.ndarray, name: str, rng: np.random.Generator
) -> dovetail.Assembly | None:
    """Return a structure that gives an altered measurement, or None where there is nothing to be altered so.

    Parameters
    ----------
    assembly : Assembly
        On the lines of the measurement.
    theta : (n_params,) array
    name : str
        One of `ALTERATIONS`: a gain of 1.2, g read as m/s^2, mm read as m, an FRF integrated once, or differentiated if
        it is a receptance, a delay of 20 microseconds, a point one to three nodes away, a mass of 5 % of the apparent
        mass, an overhang 10 mm or 10 % longer, a parameter of twice the upper end of its range or half the lower one,
        joints with structural damping.
    rng : numpy.random.Generator
    """
    factors = {"sign": -1.0, "gain": 1.2, "unit": 1.0 / 9.80665, "thousand": 1e3}
    if name == "unaltered":
        return assembly
    if name in factors:
        return _times(assembly, np.full(len(assembly.frequency), factors[name], dtype=np.complex128))
    if name == "quantity":
        angular = 2j * np.pi * assembly.frequency
        return _times(assembly, angular if assembly.description.response.quantity == "receptance" else 1.0 / angular)
    if name == "delay":
        phase = 2.0 * np.pi * _DELAY * assembly.frequency
        return _times(assembly, np.exp(-1j * phase)) if phase[-1] > _LEAST_PHASE else None
    if name == "conjugate":
        return ChangedMeasurement(assembly, np.conj)
    if name == "mass":
        mass = next(entry for entry in list_perturbations(assembly) if entry.kind == "mass")
        return mass.apply(0.05 * mass.upper)
    if name == "damping":
        return _structurally_damped(assembly) if dampers(assembly).any() else None
    kinds = {"point": _at_another_point, "overhang": _overhanging, "range": partial(_outside_its_range, theta=theta)}
    return kinds[name](assembly, rng)


class ChangedMeasurement(dovetail.Assembly):
    """An assembly whose FRF is changed by the measurement.

    Parameters
    ----------
    assembly : Assembly
    change : callable
        From FRFs (..., n_freq) to what is measured of them.
    """

    def __init__(self, assembly: dovetail.Assembly, change: Callable[[np.ndarray], np.ndarray]) -> None:
        super().__init__(assembly.description)
        self._of, self._change = assembly, change

    def frf(self, theta: Any = None) -> np.ndarray:
        """Return the FRF as measured."""
        return self._change(self._of.frf(theta))


def _times(assembly: dovetail.Assembly, factor: np.ndarray) -> dovetail.Assembly:
    return ChangedMeasurement(assembly, lambda values: values * factor)


def _at_another_point(assembly: dovetail.Assembly, rng: np.random.Generator) -> dovetail.Assembly | None:
    description = assembly.description
    response = description.response
    last = len(description.substructures[response.substructure].nodes) - 1
    away = int(rng.integers(1, 4)) * (-1 if response.node > last // 2 else 1)
    moved = replace(response, node=int(np.clip(response.node + away, 0, last)))
    changed = replace(description, responses=(moved, *description.responses[1:]))
    elsewhere = dovetail.Assembly(changed).on(assembly.frequency)
    try:
        elsewhere.frf(elsewhere.from_unit(np.full(len(elsewhere.parameters), 0.5)))
    except dovetail.DovetailError:  # it is held there
        return None
    return elsewhere


def _outside_its_range(
    assembly: dovetail.Assembly, rng: np.random.Generator, theta: np.ndarray
) -> dovetail.Assembly | None:
    index, upper = int(rng.integers(len(theta))), rng.random() < 0.5
    parameter, beyond = assembly.parameters[index], theta.copy()
    beyond[index] = 2.0 * parameter.upper if upper or not parameter.lower else 0.5 * parameter.lower
    ends = min(parameter.lower, beyond[index]), max(parameter.upper, beyond[index])
    described = assembly.description.with_range(*assembly.description.identified_parameters[index], *ends)
    wide = dovetail.Assembly(described).on(assembly.frequency)
    return ChangedMeasurement(assembly, lambda _values: wide.frf(beyond))


def _overhanging(assembly: dovetail.Assembly, rng: np.random.Generator) -> dovetail.Assembly | None:
    found = list(find_overhangs(assembly.description, 1000))
    if not found:
        return None
    overhang = found[rng.integers(len(found))]
    length = overhang.length + max(0.01, 0.1 * overhang.length)
    model = overhang.lengthen(assembly.description.substructures[overhang.substructure], length)
    return _with_part(assembly, overhang.substructure, model)
