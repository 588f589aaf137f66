"""What looks wrong with the joints and measurement chains of a valid description, whatever they are made of."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from dovetail.description import JointEntry
from dovetail.description.checked import Description, ParameterEntry
from dovetail.errors import listing
from dovetail.interfaces import Parameter
from dovetail.units import format_quantity

_FAR = 100.0
"""Ratio to the nearer end of the model's own range from which a range or a value is hardly meant."""
_OFF_BAND = 10.0
"""Ratio to the ends of the lines from which the frequency of structural damping is hardly meant."""
_GAINS = (0.2, 5.0)
_HEAVIEST = 1.0
"""Mass of a sensor [kg]; the heaviest, for earthquakes, have 0.6 kg."""
_NO_DECAY = 1e-3
"""Decay rate of a window times the inverse of the step of the lines, below which it changes nothing."""


def odd_joints(description: Description) -> Iterator[str]:
    """Yield what looks wrong with joints, with names and with measurement chains, a sentence or two each.

    Parameters
    ----------
    description : Description
    """
    for name, joint in description.joints.items():
        usual = {parameter.name: parameter for parameter in joint.connection.model.parameters}
        for parameter in joint.parameters:
            if text := _far_from_usual(joint, parameter, usual.get(parameter.name)):
                yield f"joints.{name}.parameters.{parameter.name}: {text}"
        yield from _far_from_band(name, joint, description)
    yield from _at_same_nodes(description)
    yield from _same_but_for_case(description)
    augmentation = description.identification.augmentation
    if augmentation is not None and augmentation.mass > _HEAVIEST:
        yield f"identification.augmentation.mass: {augmentation.mass:g} kg; were {augmentation.mass:g} g meant?"
    for name, chain in description.calibrations.items():
        yield from (f"{name}.{text}" for text in _odd_chain(chain, description))


def _far_from_usual(joint: JointEntry, parameter: Parameter, usual: Parameter | None) -> str:
    """Return how a value or a whole range lies far from the range that the model has by default."""
    if usual is None or usual.lower <= 0 or parameter.name in joint.ties:
        return ""
    known = joint.fixed.get(parameter.name)
    low, high = (parameter.lower, parameter.upper) if known is None else (known, known)
    if high == 0.0 or (high * _FAR > usual.lower and low < _FAR * usual.upper):
        return ""
    ends = f"{_span(low, high, usual.unit)} is far from {_span(usual.lower, usual.upper, usual.unit)}"
    return f"{ends}, the range of '{joint.connection.model.name}'. Is the unit missing or wrong?"


def _span(low: float, high: float, unit: str) -> str:
    ends = [format_quantity(end, unit) for end in dict.fromkeys((low, high))]
    return " to ".join(ends)


def _far_from_band(name: str, joint: JointEntry, description: Description) -> Iterator[str]:
    low, high, at = description.frequency[0], description.frequency[-1], joint.structural_damping
    if at is not None and not low / _OFF_BAND <= at <= _OFF_BAND * high:
        yield (
            f"joints.{name}.structural_damping: {at:g} Hz is far from the lines, {low:g} to {high:g} Hz. It is the "
            "frequency at which the dampers are as strong as viscous ones, not a loss factor."
        )


def _at_same_nodes(description: Description) -> Iterator[str]:
    """Yield joints of one model, with the same options, that connect the same nodes: they act in parallel."""
    equal = defaultdict[object, list[str]](list)
    for name, joint in description.joints.items():
        model, ends = joint.connection.model, joint.connection.attachments
        nodes = frozenset(frozenset((end.substructure, node) for node in end.nodes) for end in ends)
        equal[model.name, str(getattr(model, "config", "")), nodes].append(name)
    for names in equal.values():
        if len(names) > 1:
            which = listing(f"'{name}'" for name in names)
            yield f"joints: {which} are of the same model and connect the same nodes, so that they act in parallel."


def _same_but_for_case(description: Description) -> Iterator[str]:
    groups: Sequence[tuple[str, list[str]]] = (
        ("substructures", list(description.substructures)),
        ("joints", list(description.joints)),
        ("responses", [response.name for response in description.responses]),
    )
    for key, names in groups:
        first = dict[str, str]()
        for name in names:
            if (other := first.setdefault(name.lower(), name)) != name:
                yield f"{key}: the names '{other}' and '{name}' differ by upper and lower case only."


def _odd_chain(chain: ParameterEntry, description: Description) -> Iterator[str]:
    """Yield values of a measurement chain that hardly any has."""
    for parameter in chain.parameters:
        if parameter.name in chain.ties:
            continue
        known = chain.fixed.get(parameter.name)
        largest = max(map(abs, (parameter.lower, parameter.upper) if known is None else (known,)))
        shown = format_quantity(largest, parameter.unit)
        if parameter.name == "gain" and known is not None and not _GAINS[0] <= known <= _GAINS[1]:
            yield f"gain: {known:g} is measured over true amplitude. Was its uncertainty meant, 'about' and 'sd'?"
        elif parameter.name == "mass" and largest > _HEAVIEST:
            yield f"mass: {shown} is more than sensors have. Were {largest:g} g meant? Without a unit it is in kg."
        elif parameter.name == "delay" and largest * description.frequency[0] > 1.0:
            yield f"delay: {shown} is more than a period of the lowest line. Were {largest:g} us meant?"
        elif parameter.name == "window" and 0 < largest < _NO_DECAY * np.diff(description.frequency).min():
            yield f"window: a decay rate of {shown} changes nothing. A window that ends at a after T has -ln(a)/T."
