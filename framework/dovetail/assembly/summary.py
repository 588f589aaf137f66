"""What is in an assembly, as plain values."""

from __future__ import annotations

from dataclasses import asdict
from math import isnan
from typing import Any

from dovetail.assembly.description_warnings import find_warnings
from dovetail.assembly.model import Assembly
from dovetail.assembly.natural_frequencies import modes_in_band
from dovetail.assembly.omissions import find_omissions
from dovetail.assembly.theta import Theta
from dovetail.description import Place, Response

_MOST = 10
"""Largest number of natural frequencies that are listed."""


def natural_frequencies(assembly: Assembly, theta: Theta = None) -> tuple[list[float], list[float], str]:
    """Return the first natural frequencies [Hz] in the band, their damping ratios, and why there are none."""
    modes, reason = modes_in_band(assembly, theta, count=_MOST)
    return [mode.natural_frequency for mode in modes], [mode.damping_ratio for mode in modes], reason


def assembly_summary(assembly: Assembly) -> dict[str, Any]:
    """Return what a description says, and what it makes of it, as plain values."""
    description, graph = assembly.description, assembly.graph
    frequency = assembly.frequency
    natural, damping, reason = natural_frequencies(assembly)
    substructures = [
        {
            "name": name,
            "model": part.name,
            "dofs": part.node_dofs.size,
            "held": part.grounded,
            "reversed": name in description.placements and description.placements[name].reversed,
            "nodes": [{"label": node.label, "position": node.position} for node in part.nodes],
        }
        for name, part in description.substructures.items()
    ]
    joints = [
        {"name": name, "model": joint.connection.model.name, "internal_dofs": joint.connection.model.internal_dofs}
        for name, joint in description.joints.items()
    ]
    return {
        "name": assembly.name,
        "source": description.source,
        "substructures": substructures,
        "joints": joints,
        "dofs": {"assembly": graph.size, "condensed": len(assembly.engine.program.order)},
        "parameters": [asdict(parameter) for parameter in assembly.parameters],
        "fixed": _fixed(assembly),
        "response": _response(assembly, description.response),
        "further_responses": [_response(assembly, response) for response in description.responses[1:]],
        "frequency": {"first": float(frequency[0]), "last": float(frequency[-1]), "lines": len(frequency)},
        "natural_frequencies": natural,
        "damping_ratios": damping,
        "without_natural_frequencies": reason,
        "omissions": list(find_omissions(assembly)),
        "warnings": list(find_warnings(assembly)),
    }


def _response(assembly: Assembly, response: Response) -> dict[str, Any]:
    force = {} if response.force is None else {"force": _place(assembly, response.force)}
    return {**_place(assembly, response), "quantity": response.quantity, **force}


def _place(assembly: Assembly, place: Place) -> dict[str, Any]:
    position = assembly.description.substructures[place.substructure].nodes[place.node].position
    point = assembly.description.point_label(place)
    return {"at": place.substructure, "position": position, "point": point, "direction": place.direction}


def _fixed(assembly: Assembly) -> list[dict[str, Any]]:
    """Return the known parameters, without a sign that the measurement determines."""
    return [
        {"name": f"{joint}.{parameter.name}", "value": entry.fixed[parameter.name], "unit": parameter.unit}
        for joint, entry in assembly.description.entries.items()
        for parameter in entry.parameters
        if parameter.name in entry.fixed and not isnan(entry.fixed[parameter.name])
    ]
