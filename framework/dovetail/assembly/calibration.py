"""The measurement chain of a response: its gain, phase and delay, the sensor's mass, and an exponential window.

Gain, phase and delay change the FRF. A sensor's mass and a window change the structure that is computed for a
response: the mass is one more part of it, and the window of decay rate s, which multiplies signals by exp(-s t), moves
the frequency to omega - i s. That is the same as other matrices, K + s C + s^2 M and C + 2 s M instead of K and C,
and i omega + s instead of i omega where a quantity is the derivative of the displacement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.changed_joints import ChangedJoint, structurally_damped
from dovetail.assembly.description import Description, JointEntry, ParameterEntry, Place, Tie
from dovetail.assembly.parameter_sections import StatedParameters
from dovetail.assembly.reversed_parts import NodesAlone, ReversedPart
from dovetail.assembly.unknown_parts import UnknownPart, UnknownReceptance
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Item, Path, format_value, plain_values
from dovetail.errors import Fault, ParameterError, did_you_mean, listing
from dovetail.frf import QUANTITIES, Quantity
from dovetail.interfaces import JointModel, Parameter, Port, StructuralMatrices, SubstructureModel
from dovetail.synthesis import Attachment, Connection, Graph
from dovetail.synthesis.joint_evaluation import depends_on_frequency
from dovetail.units import format_quantity

_MASS = Parameter("mass", "kg", 0.0, 0.05, "linear", "Of the sensor at the response")
_WINDOW = Parameter("window", "1/s", 0.0, 100.0, "linear", "Decay rate of an exponential window over the signals")
CHAIN = (
    Parameter("gain", "1", 0.8, 1.25, "log", "Measured over true amplitude"),
    Parameter("phase", "rad", -0.5, 0.5, "linear", "Of the measured FRF ahead of the true one, on all lines"),
    Parameter("delay", "s", 0.0, 1e-4, "linear", "Of the response behind the force"),
    _MASS,
    _WINDOW,
)
"""What may be unknown of a response's measurement chain; a description states the ranges."""
SIGN = Parameter("sign", "1", -1.0, 1.0, "linear", "1, or -1 where the sensor or the force points the other way")
"""Known, or determined from the measurement before anything is fitted; NaN until then."""
SHARED = "calibration"
"""Owner of the parameters that the chains of all responses share, and their key in a description."""


class _SensorMass(JointModel):
    """The mass of a sensor at a node."""

    name = "sensor_mass"
    summary = "Mass of a sensor"
    parameters = (_MASS,)
    ports = (Port("sensor", 1),)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        matrices = StructuralMatrices.zeros(len(theta), self.size)
        matrices.M[:, 0, 0] = theta[:, 0]
        return matrices


class _Windowed(ChangedJoint):
    """A joint or a part as seen under an exponential window, whose decay rate is the last parameter."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The model's parameters and the decay rate."""
        return (*self.model.parameters, _WINDOW)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the matrices (n, d, d) at the frequency omega - i s."""
        plain = self.model.matrices(theta[:, :-1])
        rate = theta[:, -1, np.newaxis, np.newaxis]
        stiffness = plain.K + rate * plain.C + rate**2 * plain.M
        return StructuralMatrices(plain.M, stiffness, plain.C + 2.0 * rate * plain.M, plain.D)


def read_calibration(path: Path, faults: FaultList, others: Sequence[str] = ()) -> ParameterEntry:
    """Read the measurement chain of a response, or what the chains of all responses share.

    Parameters
    ----------
    path : Path
        Of the section ``calibration:``, which need not exist.
    faults : FaultList
        Collects the faults.
    others : sequence of str
        Keys of the section that are read elsewhere.
    """
    section = faults.root.at(path)
    if section is None:
        return ParameterEntry()
    if not section.is_mapping:
        faults.add(path, f"{format_value(section.value)} is not a section of keys and values.", key=True)
        return ParameterEntry()
    known = {parameter.name: parameter for parameter in CHAIN}
    stated = StatedParameters({name: known[name] for name in known if name in section.entries})
    for name, entry in section.entries.items():
        if name in known:
            stated.read((*path, name), name, entry.item, faults)
        elif name == "sign":
            stated.known[name] = SIGN
            stated.fixed[name] = _read_sign((*path, name), entry.item, faults)
        elif name not in others:
            accepted = listing([*(f"{p.name} [{p.unit}]" for p in CHAIN), "sign", *others])
            problem = f"{format_value(name)} is not a key of a calibration."
            faults.add((*path, name), problem, accepted, did_you_mean(name, [*known, "sign", *others]), key=True)
    for name, parameter in stated.known.items():
        lowest = stated.fixed.get(name, parameter.lower)
        if name in ("gain", "mass", "window") and (lowest < 0 or (name == "gain" and lowest == 0)):
            bound = "positive" if name == "gain" else "0 or more"
            problem = f"{name} must be {bound}, but is {format_quantity(lowest, parameter.unit)} here."
            remedy = "Write 'sign: unknown' or 'sign: -1' for the sign, and 'scale: log' with a wide 'sd'."
            faults.add((*path, name), problem, remedy=remedy if name == "gain" else "")
    return ParameterEntry(**stated.entry)


def shared_by(shared: ParameterEntry, own: ParameterEntry) -> ParameterEntry:
    """Return a response's entry completed by ties to the shared parameters; the shared mass is at sensors instead."""
    common = [parameter for parameter in shared.parameters if parameter.name != "mass"]
    ties = {parameter.name: Tie(SHARED, parameter.name) for parameter in common if parameter.name != "sign"}
    sign = {"sign": shared.fixed["sign"]} if "sign" in shared.fixed else {}
    return ParameterEntry(parameters=(*own.parameters, *common), fixed={**own.fixed, **sign}, ties={**own.ties, **ties})


def _read_sign(path: Path, sign: Item, faults: FaultList) -> float:
    """Return 1 or -1, or NaN for a sign that is to be determined from the measurement."""
    if sign.value == "unknown":
        return np.nan
    if isinstance(sign.value, (int, float)) and not isinstance(sign.value, bool) and abs(sign.value) == 1:
        return float(sign.value)
    faults.add(path, f"{format_value(plain_values(sign))} is no sign.", "1, -1 or unknown")
    return 1.0


def unknown_signs(description: Description) -> tuple[str, ...]:
    """Return the responses whose sign is to be determined from the measurement."""
    calibrations = description.calibrations.items()
    return tuple(name for name, entry in calibrations if name != SHARED and np.isnan(entry.fixed.get("sign", 1.0)))


def unknown_gains(description: Description) -> tuple[str, ...]:
    """Return the identified parameters that are gains of measurement chains, by name."""
    chains = description.calibrations.items()
    return tuple(f"{name}.gain" for name, chain in chains if any(p.name == "gain" for p in chain.identified))


def with_signs(description: Description, signs: Mapping[str, float]) -> Description:
    """Return the description with known signs of some responses, by name; its text is unchanged."""
    calibrations = dict(description.calibrations)
    for name, sign in signs.items():
        calibrations[name] = replace(calibrations[name], fixed={**calibrations[name].fixed, "sign": sign})
    return replace(description, calibrations=calibrations)


class Chain:
    """The factor by which a measurement chain multiplies an FRF, and its derivatives by the chain's parameters.

    Under a window of decay rate s, each time derivative is a factor of i omega + s instead of i omega.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    quantity : {"receptance", "mobility", "accelerance"}
        The measured quantity.
    entry : ParameterEntry
        The response's.
    theta : (n, n_chain) array
        Its parameters in SI.
    """

    def __init__(
        self, frequency: NDArray[np.float64], quantity: Quantity, entry: ParameterEntry, theta: NDArray[np.float64]
    ) -> None:
        sign = entry.fixed.get("sign", 1.0)
        self._names = [parameter.name for parameter in entry.parameters]
        self._omega = 2.0 * np.pi * frequency
        self._power = QUANTITIES.index(quantity)
        self._gain = self._column("gain", theta, 1.0)
        delay = self._column("delay", theta, 0.0)
        phase = self._column("phase", theta, 0.0)
        self._turned = (1.0 if np.isnan(sign) else sign) * np.exp(1j * (phase - self._omega * delay))
        self._ratio = 1.0 + self._column("window", theta, 0.0) / (1j * self._omega)

    def _column(self, name: str, theta: NDArray[np.float64], otherwise: float) -> NDArray[np.float64]:
        """Return one of the parameters, (n, 1)."""
        if name not in self._names:
            return np.full((len(theta), 1), otherwise)
        return theta[:, [self._names.index(name)]]

    @cached_property
    def factor(self) -> NDArray[np.complex128]:
        """(n, n_freq) gain, sign, phase, delay, and the window's change of the time derivatives."""
        return np.asarray(self._gain * self._turned * self._ratio**self._power)

    def derivative(self, column: int) -> NDArray[np.complex128]:
        """Return the derivative of the factor by the parameter in a column of theta, (n, n_freq)."""
        name = self._names[column]
        if name == "gain":
            return np.asarray(self._turned * self._ratio**self._power)
        if name == "phase":
            return 1j * self.factor
        if name == "delay":
            return np.asarray(-1j * self._omega * self._gain * self._turned * self._ratio**self._power)
        if name == "window":
            before = self._gain * self._turned * self._power * self._ratio ** (self._power - 1)
            return np.asarray(before / (1j * self._omega))
        return np.zeros_like(self.factor)


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
            nodes = Attachment(name, tuple(range(len(part.nodes))))
            model = UnknownPart(part, (), reversed=name in description.reversed_parts)
            entries[f"part {name}"] = JointEntry(connection=Connection(model, (nodes,)))
    window = chain.ties.get("window", Tie(response.name, "window"))
    return {f"{name} windowed": _windowed(name, entry, window) for name, entry in entries.items()}


def _sensor(place: Place, owner: str) -> JointEntry:
    sensor = Connection(_SensorMass(), (Attachment(place.substructure, (place.node,)),))
    return JointEntry(connection=sensor, parameters=_SensorMass.parameters, ties={"mass": Tie(owner, "mass")})


def _windowed(name: str, entry: JointEntry, window: Tie) -> JointEntry:
    model = entry.connection.model
    if depends_on_frequency(model) or (isinstance(model, UnknownPart) and not model.has_matrices):
        owner = name.removeprefix("part ")
        problem = f"'{owner}' has no matrices, so that the effect of the exponential window cannot be computed."
        remedy = "Remove the window from the measured FRF, or leave 'window' out."
        raise ParameterError(Fault(f"{window.owner}.window", problem, remedy=remedy))
    ties = {parameter.name: entry.ties.get(parameter.name, Tie(name, parameter.name)) for parameter in model.parameters}
    windowed = _Windowed(model)
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
    parts: dict[str, SubstructureModel] = dict(description.substructures)
    parts |= {name: ReversedPart(parts[name]) for name in description.reversed_parts}
    parts |= {name: NodesAlone(parts[name]) for name in alone}
    return Graph(parts, connections)


def graph_between(graph: Graph, points: Sequence[tuple[str, int]]) -> Graph:
    """Return a graph in which unknown parts that are described by FRFs have only the DOFs in use.

    Parameters
    ----------
    graph : Graph
    points : sequence of (str, int)
        Substructure and DOF of each force and response.
    """
    connections = dict(graph.connections)
    for name, connection in graph.connections.items():
        if isinstance(connection.model, UnknownReceptance):
            owner = connection.attachments[0].substructure
            others = [other for key, other in graph.connections.items() if key != name]
            ports = [port for other in others for port in other.attachments if port.substructure == owner]
            used = {dof for port in ports for dof in port.dofs} | {dof for part, dof in points if part == owner}
            connections[name] = replace(connection, model=connection.model.between(sorted(used)))
    return Graph(graph.substructures, connections)


def without_window(graph: Graph, theta: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return the parameters of each joint, (n, n_params), with which the structure itself is seen, without a window."""
    windowed = {name for name, connection in graph.connections.items() if isinstance(connection.model, _Windowed)}
    unseen = {name: theta[name].copy() for name in windowed}
    for values in unseen.values():
        values[:, -1] = 0.0
    return {**theta, **unseen}
