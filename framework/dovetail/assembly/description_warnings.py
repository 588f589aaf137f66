"""What looks wrong in a valid description: values that hardly anybody means, each with what was probably meant."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydantic import BaseModel

from dovetail.assembly.influences import influence_warnings
from dovetail.assembly.model import Assembly
from dovetail.assembly.odd_joints import odd_joints
from dovetail.assembly.placement import placement_warnings
from dovetail.description import JointEntry
from dovetail.documents.option_fields import numbers_within
from dovetail.errors import DovetailError, Fault, PluginError
from dovetail.interfaces import Parameter, plugin_errors
from dovetail.synthesis.lost_digits import lost_digits
from dovetail.units import format_quantity

_USUAL = {"Pa": (1e6, 1.3e12), "kg/m^3": (10.0, 25e3), "m": (1e-6, 20.0)}
"""From soft rubber to diamond, from foam to osmium, from a micrometre to a building."""
_MEANT = {
    "Pa": ((1e9, "GPa"), (1e6, "MPa")),
    "kg/m^3": ((1e3, "g/cm^3"), (1e12, "t/mm^3")),
    "m": ((1e-3, "mm"),),
}
_DECADES = 1e3
"""Upper over lower end from which a range on a linear scale hardly holds values near its lower end."""
_FAR = 2.0
"""Times the highest natural frequency looked at from which a band is far above it."""
_MODES, _VECTORS = 60, 8
"""Natural frequencies of so many random parameter vectors that are looked at."""
_MOST_LINES = 5_000
"""Lines on which digits are looked for that rounding takes; what they need of memory grows with their number."""


def find_warnings(assembly: Assembly, *, effects: bool = True) -> tuple[str, ...]:
    """Return what looks wrong in an assembly's description, a sentence each; none of it is an error.

    Parameters
    ----------
    assembly : Assembly
    effects : bool
        Whether to compute the effect of each parameter on the FRFs too.

    Returns
    -------
    tuple of str
        Moduli, densities and lengths far from any material's or structure's, in parts, joints and places; wide ranges
        on a linear scale; a band without a natural frequency; parts in odd places, or without positions to compare;
        digits that rounding takes; parameters without an effect, and pairs with the same; and those of the
        substructures themselves (`SubstructureModel.warnings`).
    """
    warnings = [
        f"substructures.{name}.{problem}"
        for name, part in assembly.description.substructures.items()
        for problem in _option_warnings(getattr(part, "config", None))
    ]
    for name, joint in assembly.description.joints.items():
        warnings += [f"joints.{name}.{problem}" for problem in _joint_warnings(joint)]
    for name, placement in assembly.description.placements.items():
        far = [float(coordinate) for coordinate in placement.origin if abs(coordinate) > _USUAL["m"][1]]
        warnings += [f"substructures.{name}.place.origin: {_unusual(coordinate, 'm')}" for coordinate in far]
    warnings += [problem for parameter in assembly.parameters for problem in _range_warnings(parameter)]
    highest = float(assembly.frequency[-1])
    for name, part in assembly.description.substructures.items():
        with plugin_errors(part, f"substructure '{name}' ({part.name})"):
            problems = part.warnings(highest)
            if not isinstance(problems, (list, tuple)) or not all(isinstance(problem, str) for problem in problems):
                problem = f"its warnings are {problems!r:.60}."
                raise PluginError(Fault(f"substructure '{name}' ({part.name})", problem, "a list of sentences"))
            warnings += [f"substructures.{name}: {problem}" for problem in problems]
    warnings += odd_joints(assembly.description)
    warnings += placement_warnings(assembly)
    few = _on_few_lines(assembly)
    warnings += _rounding_warnings(few)
    if effects:
        warnings += influence_warnings(few)
    return (*warnings, *_band_warnings(assembly))


def _option_warnings(config: object) -> Iterator[str]:
    """Yield warnings about a component's options with a unit."""
    if not isinstance(config, BaseModel):
        return
    for number in numbers_within(config):
        if text := _unusual(number.value, number.unit):
            yield f"{'.'.join(map(str, number.path))}: {text}"


def _joint_warnings(joint: JointEntry) -> Iterator[str]:
    """Yield warnings about a joint's options, its known parameters, and the ends of ranges."""
    model = joint.connection.model
    yield from _option_warnings(model.config)
    for parameter in joint.parameters:
        known = joint.fixed.get(parameter.name)
        values = (parameter.lower, parameter.upper) if known is None else (known,)
        if text := next(filter(None, (_unusual(value, parameter.unit) for value in values)), ""):
            yield f"parameters.{parameter.name}: {text}"


def _unusual(value: float, unit: str) -> str:
    """Return how a value is far from any material's or structure's, and what was probably meant, or an empty text."""
    low, high = _USUAL.get(unit, (-np.inf, np.inf))
    if value == 0.0 or low <= abs(value) <= high:
        return ""
    meant = [f"{value:g} {name}" for factor, name in _MEANT[unit] if low <= abs(value) * factor <= high]
    hint = f" Was {' or '.join(meant)} meant? A number without a unit is in SI." if meant else ""
    return f"{value:g} {unit} is not within {low:g} to {high:g} {unit}.{hint}"


def _range_warnings(parameter: Parameter) -> Iterator[str]:
    """Yield a warning about a range of decades on a linear scale."""
    if parameter.scale != "linear" or parameter.prior != "uniform":
        return
    if 0 < _DECADES * parameter.lower <= parameter.upper:
        ends = " to ".join(format_quantity(end, parameter.unit) for end in (parameter.lower, parameter.upper))
        yield (
            f"{parameter.name}: on a linear scale nine tenths of the range {ends} lie in its highest decade. Was "
            "'scale: log' meant?"
        )


def _on_few_lines(assembly: Assembly) -> Assembly:
    """Return an assembly at a part of very many lines."""
    count = len(assembly.frequency)
    if count <= _MOST_LINES:
        return assembly
    return assembly.on(assembly.frequency[np.linspace(0, count - 1, _MOST_LINES).round().astype(int)])


def _rounding_warnings(assembly: Assembly) -> tuple[str, ...]:
    """Return what rounding takes from the FRF in the middle of the ranges."""
    middle = assembly.from_unit(np.full((1, len(assembly.parameters)), 0.5))
    try:
        return lost_digits(assembly.engine, assembly.by_joint(middle))
    except PluginError:
        raise
    except DovetailError:  # reported where the FRF is computed
        return ()


def _band_warnings(assembly: Assembly) -> Iterator[str]:
    """Yield a warning about a band that is below or far above all natural frequencies that the ranges allow."""
    low, high = float(assembly.frequency[0]), float(assembly.frequency[-1])
    if not assembly.parameters:
        return
    first, last = np.inf, 0.0
    count = len(assembly.parameters)
    for fraction in np.concatenate([np.zeros((1, count)), np.random.default_rng(0).random((_VECTORS, count))]):
        try:
            natural = assembly.natural_frequencies(assembly.from_unit(fraction), _MODES)
        except PluginError:
            raise
        except (DovetailError, np.linalg.LinAlgError):
            return
        first, last = np.nanmin(natural, initial=first), np.nanmax(natural, initial=last)
        if high >= first and low <= _FAR * last:
            return  # which spares the other vectors of all but odd descriptions
    side, nearest = ("below", first) if high < first else ("far above", last)
    if last:
        yield (
            f"frequency: the band, {low:g} to {high:g} Hz, lies {side} all natural frequencies that the ranges "
            f"allow; the nearest is {nearest:.4g} Hz. Frequencies are in Hz, and numbers without a unit in SI."
        )
