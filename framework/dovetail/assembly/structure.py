"""The structure that is computed for a response: the graph of the parts and joints, with sensors and under a window.

A sensor's mass is one more component. An exponential window of decay rate s, which multiplies signals by exp(-s t),
moves the frequency to omega - i s. That is the same as other matrices, K + s C + s^2 M and C + 2 s M instead of K and
C, and i omega + s instead of i omega where a quantity is the derivative of the displacement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.carried_joints import at_carriers
from dovetail.assembly.changed_joints import structurally_damped
from dovetail.assembly.constraints import ConstrainedGraph, constrained
from dovetail.description.calibration import MASS, WINDOW
from dovetail.description.changed_joint import ChangedJoint
from dovetail.description.checked import SHARED, Description, JointEntry, Place, Response, Tie
from dovetail.description.unknown_parts import UnknownPart, UnknownReceptance
from dovetail.errors import DovetailError, Fault, ParameterError
from dovetail.interfaces import (
    DIRECTIONS,
    PLANAR,
    JointModel,
    JointPort,
    Parameter,
    PartNode,
    StructuralMatrices,
    SubstructureModel,
    is_rotation,
)
from dovetail.synthesis import Attachment, Connection, Engine, Graph, Point
from dovetail.synthesis.condensation import substructure_constraints
from dovetail.synthesis.joint_evaluation import Theta, depends_on_frequency


class _SensorMass(JointModel):
    """The mass of a sensor at a node.

    Parameters
    ----------
    directions : tuple of str
        Of the node; it resists the displacements among them.
    """

    name = "sensor_mass"
    summary = "Mass of a sensor"
    parameters = (MASS,)
    linear_parameters = (MASS.name,)

    def __init__(self, directions: tuple[str, ...]) -> None:
        super().__init__()
        self._directions = directions

    @property
    def ports(self) -> tuple[JointPort, ...]:
        return (JointPort("sensor", 1, directions=self._directions),)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        matrices = StructuralMatrices.zeros(len(theta), self.size)
        for dof in np.flatnonzero(~self.node_dofs.rotations):
            matrices.M[:, dof, dof] = theta[:, 0]
        return matrices


class _Windowed(ChangedJoint):
    """A joint or a part as seen under an exponential window, whose decay rate is the last parameter."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The model's parameters and the decay rate."""
        return (*self.model.parameters, WINDOW)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the matrices (n, d, d) at the frequency omega - i s."""
        plain = self.model.matrices(theta[:, :-1])
        rate = theta[:, -1, np.newaxis, np.newaxis]
        stiffness = plain.K + rate * plain.C + rate**2 * plain.M
        return StructuralMatrices(plain.M, stiffness, plain.C + 2.0 * rate * plain.M, plain.D)


_sensor_mass, _windowed_model = lru_cache(maxsize=64)(_SensorMass), lru_cache(maxsize=64)(_Windowed)
"""The models made once each, so that their superpositions are derived and checked once."""


class _NodesAlone(SubstructureModel):
    """The nodes of a part without its matrices, which its `UnknownPart` has.

    Parameters
    ----------
    part : SubstructureModel
    """

    name = "nodes"
    summary = "Nodes without mass or stiffness"

    def __init__(self, part: SubstructureModel) -> None:
        super().__init__()
        self._nodes, self._size = part.nodes, part.node_dofs.size

    @property
    def nodes(self) -> tuple[PartNode, ...]:
        """The nodes of the part."""
        return self._nodes

    def matrices(self) -> StructuralMatrices:
        """Return (d, d) matrices of zeros."""
        return StructuralMatrices.zeros(self._size)


def entries_at_response(description: Description) -> dict[str, JointEntry]:
    """Return all components of the first response's structure that depend on parameters, by their names in the graph.

    Raises
    ------
    ParameterError
        There is a window, and a part or a joint without matrices.
    """
    entries: dict[str, JointEntry] = {**description.joints, **description.unknown_parts}
    entries |= {name: structurally_damped(joint) for name, joint in entries.items() if joint.structural_damping}
    response = description.response
    chain = description.chain_of(response)
    names = {parameter.name for parameter in chain.parameters}
    if "mass" in names:
        entries[f"{response.name} sensor"] = _sensor(response, response.name)
    for place in description.sensors:
        entries[f"sensor {place.substructure} {place.node}"] = _sensor(place, SHARED)
    if "window" not in names:
        return entries
    for name, part in description.substructures.items():
        if name not in description.unknown_parts and not part.grounded:
            model = UnknownPart(part, (), description.placements.get(name))
            entries[f"part {name}"] = JointEntry(connection=Connection(model, Attachment.to_all(name, part)))
    window = chain.ties.get("window", Tie(response.name, "window"))
    return {f"{name} windowed": _windowed(name, entry, window) for name, entry in entries.items()}


def _sensor(place: Place, owner: str) -> JointEntry:
    moves = DIRECTIONS if place.node in place.dofs.carriers else place.dofs.directions[place.node]
    directions = tuple(d for d in moves if moves == PLANAR or not is_rotation(d))  # a planar node's stay together
    sensor = Connection(_sensor_mass(directions), (Attachment(place.substructure, (place.node,)),))
    return JointEntry(connection=sensor, parameters=_SensorMass.parameters, ties={"mass": Tie(owner, "mass")})


def _windowed(name: str, entry: JointEntry, window: Tie) -> JointEntry:
    model = entry.connection.model
    if depends_on_frequency(model) or (isinstance(model, UnknownPart) and not model.has_matrices):
        owner = name.removeprefix("part ")
        problem = f"'{owner}' has no matrices, so that the effect of the exponential window cannot be computed."
        remedy = "Remove the window from the measured FRF, or leave 'window' out."
        raise ParameterError(Fault(f"{window.owner}.window", problem, remedy=remedy))
    ties = {parameter.name: entry.ties.get(parameter.name, Tie(name, parameter.name)) for parameter in model.parameters}
    windowed = _windowed_model(model)
    connection = replace(entry.connection, model=windowed)
    return JointEntry(connection=connection, parameters=windowed.parameters, ties={**ties, "window": window})


def graph_of(description: Description, entries: Mapping[str, JointEntry], *, rigid: bool) -> Graph:
    """Return the substructures and their connections.

    Parameters
    ----------
    description : Description
    entries : mapping of str to JointEntry
        Of the same description, by `entries_at_response`.
    rigid : bool
        Whether the contacts of the joints with identified parameters are rigid.
    """
    joints = description.joints.items() if rigid else ()
    rigid_joints = {name for name, joint in joints if len(joint.fixed) < len(joint.parameters)}
    connections, alone = {}, set[str]()
    for name, entry in entries.items():
        connections[name] = replace(entry.connection, rigid=name.removesuffix(" windowed") in rigid_joints)
        model = entry.connection.model
        if isinstance(model.model if isinstance(model, _Windowed) else model, UnknownPart):
            alone.add(entry.connection.attachments[0].substructure)
    parts: dict[str, SubstructureModel] = dict(description.placed_parts)
    parts |= {name: _NodesAlone(parts[name]) for name in alone}
    if any(node.carrier is not None for part in parts.values() for node in part.nodes):
        connections = {name: at_carriers(connection, parts) for name, connection in connections.items()}
    return _with_constraints(Graph(parts, connections))


def graph_between(graph: Graph, points: Sequence[tuple[str, int]]) -> Graph:
    """Return a graph in which unknown parts that are described by FRFs have only the DOFs in use.

    Parameters
    ----------
    graph : Graph
    points : sequence of (str, int)
        Substructure and DOF of each force and response.
    """
    plain = graph.plain if isinstance(graph, ConstrainedGraph) else graph
    connections = dict(plain.connections)
    for name, connection in plain.connections.items():
        if isinstance(connection.model, UnknownReceptance):
            owner = connection.attachments[0].substructure
            attached = [port for other in plain.connections if other != name for port in plain.attached_dofs(other)]
            used = {dof for part, dofs in attached if part == owner for dof in dofs}
            used |= {dof for part, dof in points if part == owner}
            connections[name] = replace(connection, model=connection.model.between(sorted(used)))
    return _with_constraints(Graph(plain.substructures, connections))


def _with_constraints(graph: Graph) -> Graph:
    """Return a graph with what its parts and joints hold; itself if all act as their models do."""
    changed = any(isinstance(connection.model, ChangedJoint) for connection in graph.connections.values())
    parts = graph.substructures.values()
    return constrained(graph) if changed or any(len(substructure_constraints(part)) for part in parts) else graph


def _is_windowed(model: JointModel) -> bool:
    """Return whether a joint is seen under a window, also at carried nodes."""
    return isinstance(model, _Windowed) or (isinstance(model, ChangedJoint) and _is_windowed(model.model))


def without_window(graph: Graph, theta: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return the parameters of each joint, (n, n_params), with which the structure itself is seen, without a window."""
    windowed = {name for name, connection in graph.connections.items() if _is_windowed(connection.model)}
    unseen = {name: theta[name].copy() for name in windowed}
    for values in unseen.values():
        values[:, -1] = 0.0
    return {**theta, **unseen}


@dataclass(frozen=True, eq=False)
class ResponsePairs:
    """Pairs of DOFs whose FRFs make those of responses.

    Parameters
    ----------
    points : list of Point
        DOFs of all responses and forces, each once.
    pairs : list of (int, int)
        Numbers of output and input of each pair.
    weights : (n_responses, n_pairs) array or None
        Of each pair in the FRF of each response, for directions between the axes; None if each response is a pair.
    """

    points: list[Point]
    pairs: list[tuple[int, int]]
    weights: NDArray[np.float64] | None

    @staticmethod
    def from_responses(responses: Sequence[Response], graph: Graph) -> ResponsePairs:
        """Return the pairs of some responses in a graph; a pair and its reciprocal one are the same in a sum.

        Raises
        ------
        DovetailError
            A response or its force is where rigid connections hold the structure.
        """
        ends = []
        for response in responses:
            outputs, forces = graph.terms(response.terms), graph.terms(response.force_terms)
            if not outputs or not forces:
                problem = (
                    f"{'the force acts' if outputs else 'it measures'} where rigid connections hold the structure."
                )
                raise DovetailError(Fault(response.name, problem, remedy="Take a point that moves, or free it."))
            ends.append([(a * b, output, force) for a, output in outputs for b, force in forces])
        points = list(dict.fromkeys(point for some in ends for _, *pair in some for point in pair))
        if all(len(some) == 1 and some[0][0] == 1.0 for some in ends):
            pairs = [(points.index(output), points.index(force)) for ((_, output, force),) in ends]
            return ResponsePairs(points, pairs, None)
        weights: dict[tuple[int, int], NDArray[np.float64]] = {}
        for number, some in enumerate(ends):
            for weight, *pair in some:
                low, high = sorted(map(points.index, pair))
                weights.setdefault((low, high), np.zeros(len(ends)))[number] += weight
        return ResponsePairs(points, list(weights), np.stack(list(weights.values()), axis=1))

    def summed(self, values: NDArray[np.complex128], factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return what responses have, times factors, from what the pairs have.

        Parameters
        ----------
        values : (n, n_pairs, n_freq, ...) array
        factors : (n_responses, n_freq) array
            Applied already to pairs that are responses.
        """
        if self.weights is None:
            return values
        sums = factors * (self.weights @ np.moveaxis(values, (1, 2), (-2, -1)))
        return np.moveaxis(sums, (-2, -1), (1, 2))


class PointReceptances:
    """Receptances between DOFs, some of which may move by others.

    Parameters
    ----------
    graph : Graph
    outputs, inputs : sequences of Point
    """

    def __init__(self, graph: Graph, outputs: Sequence[Point], inputs: Sequence[Point]) -> None:
        self._outputs, self._inputs = ([graph.terms([(1.0, point)]) for point in some] for some in (outputs, inputs))
        self.points = list(dict.fromkeys(point for some in (*self._outputs, *self._inputs) for _, point in some))

    def at(self, engine: Engine, theta: Theta) -> NDArray[np.complex128]:
        """Return the receptances (n_freq, n_out, n_in) for one parameter vector from an engine of `points`."""
        outputs, weights = _weighted(self._outputs)
        inputs, shares = _weighted(self._inputs)
        receptance = engine.receptance(theta, outputs, inputs)
        return receptance if weights is None and shares is None else _product(weights, receptance, shares)


def _weighted(sums: Sequence[Sequence[tuple[float, Point]]]) -> tuple[list[Point], NDArray[np.float64] | None]:
    """Return the points of sums, and their weights (n_sums, n_points); None if each sum is one point."""
    if all(len(terms) == 1 and terms[0][0] == 1.0 for terms in sums):
        return [point for ((_, point),) in sums], None
    points = list(dict.fromkeys(point for terms in sums for _, point in terms))
    weights = np.zeros((len(sums), len(points)))
    for row, terms in enumerate(sums):
        for weight, point in terms:
            weights[row, points.index(point)] += weight
    return points, weights


def _product(
    weights: NDArray[np.float64] | None, receptance: NDArray[np.complex128], shares: NDArray[np.float64] | None
) -> NDArray[np.complex128]:
    moved = receptance if weights is None else weights @ receptance
    return moved if shares is None else np.asarray(moved @ shares.T)
