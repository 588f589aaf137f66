"""Checks of the declarations of a joint or a substructure: parameters, ports, degrees of freedom, nodes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from numbers import Real
from typing import Any

from dovetail.errors import Fault, PluginError
from dovetail.interfaces.component import Component
from dovetail.interfaces.joint import JointModel, Parameter
from dovetail.interfaces.matrices import DIRECTIONS, direction_problem
from dovetail.interfaces.substructure import JointPort, PartNode
from dovetail.units import is_unit


def joint_faults(model: JointModel) -> tuple[Fault, ...]:
    """Return the faults in the declarations of a joint.

    Parameters
    ----------
    model : JointModel

    Returns
    -------
    tuple of Fault
        `Fault.where` is the name of the property, `Fault.problem` a sentence whose subject is the joint.
    """
    faults = [*_read(model, "parameters", parameter_faults), *_read(model, "ports", port_faults)]
    if not faults:
        faults = _read(model, "internal_dofs", _internal_faults)
    if not faults:
        faults = _read(model, "merged_dofs", lambda pairs: _pair_faults(pairs, model.size))
        faults += _read(model, "facing_ports", lambda pairs: _facing_faults(pairs, model.ports))
        faults += _read(model, "nested_ports", lambda nested: _nested_faults(nested, model.ports))
    return tuple(faults)


def parameter_faults(parameters: object) -> list[Fault]:
    """Return the faults of a joint's parameters: their types, names and units."""
    accepted = 'a tuple such as (Parameter("k", "N/m", 1e5, 1e7, "log", "stiffness"),)'
    if faults := _member_faults("parameters", parameters, Parameter, accepted):
        return faults
    members: Sequence[Parameter] = parameters  # type: ignore[assignment]
    faults = _name_faults("parameters", [parameter.name for parameter in members])
    for parameter in members:
        if not is_unit(parameter.unit):
            problem = f"has the parameter '{parameter.name}' in '{parameter.unit}', which is not a unit."
            faults.append(Fault("parameters", problem, "SI units in pint's spelling: N/m, N m/rad, N s/m, kg, m; 1"))
    return faults


def port_faults(ports: object) -> list[Fault]:
    """Return the faults of a joint's ports: their types and names."""
    if faults := _member_faults("ports", ports, JointPort, 'a tuple such as (JointPort("a", 1), JointPort("b", 1))'):
        return faults
    members: Sequence[JointPort] = ports  # type: ignore[assignment]
    return _name_faults("ports", [port.name for port in members])


def node_faults(nodes: object) -> list[Fault]:
    """Return the faults of a substructure's nodes: their types, labels and positions."""
    accepted = 'a tuple such as (PartNode("left", 0.0), PartNode("right", 0.1))'
    if faults := _member_faults("nodes", nodes, PartNode, accepted):
        return faults
    members: Sequence[PartNode] = nodes  # type: ignore[assignment]
    for node in members:
        if isinstance(node.position, bool) or not isinstance(node.position, Real) or not math.isfinite(node.position):
            problem = f"has {_shortened(node.position)} for the position of the node '{node.label}'."
            return [Fault("nodes", problem, "a finite number of metres")]
        if problem := direction_problem(node.directions) or _point_problem(node.point):
            problem = f"has a node '{node.label}' of which {problem}."
            return [Fault("nodes", problem, 'directions such as ("x", "rz"); for its point three finite numbers [m]')]
        if node.carrier is not None and not _can_carry(members, node.carrier):
            problem = f"has a node '{node.label}' whose carrier is {_shortened(node.carrier)}."
            return [Fault("nodes", problem, "the index of a node with all six directions that nothing carries")]
    return []


def _can_carry(nodes: Sequence[PartNode], carrier: object) -> bool:
    """Return whether a node can carry others."""
    if isinstance(carrier, bool) or not isinstance(carrier, int) or not 0 <= carrier < len(nodes):
        return False
    return nodes[carrier].carrier is None and nodes[carrier].directions == DIRECTIONS


def _point_problem(point: object) -> str:
    """Return what is wrong with the coordinates of a node, or an empty text."""
    if point is None:
        return ""
    if (
        isinstance(point, tuple)
        and len(point) == 3
        and all(isinstance(c, Real) and not isinstance(c, bool) and math.isfinite(c) for c in point)
    ):
        return ""
    return f"the point is {_shortened(point)}"


def _read(model: Component, name: str, faults_of: Callable[[Any], list[Fault]]) -> list[Fault]:
    try:
        value = getattr(model, name)
    except PluginError as error:
        lead = f"cannot give its {name}:"
        return [Fault(name, f"{lead} {fault.where}: {fault.problem}", fault.accepted) for fault in error.faults]
    except (Exception, SystemExit) as error:  # a plugin's property may raise anything
        return [Fault(name, f"cannot give its {name}: {type(error).__name__}: {error}.")]
    return faults_of(value)


def _shortened(value: object) -> str:
    return f"{value!r:.60}"


def _member_faults(name: str, value: object, member: type, accepted: str) -> list[Fault]:
    if not isinstance(value, (tuple, list)):
        return [Fault(name, f"has {_shortened(value)} for its {name}, not a tuple.", accepted)]
    strangers = [entry for entry in value if not isinstance(entry, member)]
    reason = f"which is not a {member.__name__}"
    return [Fault(name, f"has {_shortened(entry)} among its {name}, {reason}.", accepted) for entry in strangers[:1]]


def _name_faults(name: str, words: Sequence[str]) -> list[Fault]:
    faults = [
        Fault(name, f"has {count} {name} of the name '{word}'.", "names that differ")
        for word, count in Counter(words).items()
        if count > 1
    ]
    return faults + [
        Fault(
            name,
            f"has '{word}' among its {name}, which cannot be a name.",
            "letters, digits and '_', not beginning with a digit",
        )
        for word in dict.fromkeys(words)
        if not word.isidentifier()
    ]


def _internal_faults(count: object) -> list[Fault]:
    if isinstance(count, int) and not isinstance(count, bool) and count >= 0:
        return []
    return [Fault("internal_dofs", f"has {_shortened(count)} for its internal_dofs.", "a whole number, 0 or more")]


def _pair_faults(pairs: object, size: int) -> list[Fault]:
    accepted = f"pairs of local DOFs from 0 to {size - 1}; those of the ports' nodes first"
    if not isinstance(pairs, (tuple, list)):
        return [Fault("merged_dofs", f"has {_shortened(pairs)} for its merged_dofs, not a tuple.", accepted)]
    for pair in pairs:
        are_dofs = isinstance(pair, (tuple, list)) and all(isinstance(dof, int) and 0 <= dof < size for dof in pair)
        if not are_dofs or len(pair) != 2:
            return [Fault("merged_dofs", f"has {_shortened(pair)} among its merged_dofs.", accepted)]
    return []


def _nested_faults(nested: object, ports: Sequence[JointPort]) -> list[Fault]:
    names = {port.name for port in ports}
    accepted = f"two of the ports {', '.join(port.name for port in ports)}, and a diameter [m] or None; () for none"
    if not isinstance(nested, (tuple, list)):
        return [Fault("nested_ports", f"has {_shortened(nested)} for its nested_ports, not a tuple.", accepted)]
    for entry in nested:
        is_nested = isinstance(entry, (tuple, list)) and len(entry) == 3 and {str(name) for name in entry[:2]} <= names
        if (
            not is_nested
            or entry[0] == entry[1]
            or not (entry[2] is None or (isinstance(entry[2], (int, float)) and entry[2] > 0))
        ):
            return [Fault("nested_ports", f"has {_shortened(entry)} among its nested_ports.", accepted)]
    return []


def _facing_faults(pairs: object, ports: Sequence[JointPort]) -> list[Fault]:
    nodes = {port.name: port.nodes for port in ports}
    accepted = f"pairs of the ports {', '.join(nodes)} with equal numbers of nodes; () for none"
    if not isinstance(pairs, (tuple, list)):
        return [Fault("facing_ports", f"has {_shortened(pairs)} for its facing_ports, not a tuple.", accepted)]
    for pair in pairs:
        is_pair = isinstance(pair, (tuple, list)) and len(pair) == 2 and all(isinstance(name, str) for name in pair)
        if not is_pair or not {*pair} <= nodes.keys() or nodes[pair[0]] != nodes[pair[1]] or pair[0] == pair[1]:
            return [Fault("facing_ports", f"has {_shortened(pair)} among its facing_ports.", accepted)]
    return []
