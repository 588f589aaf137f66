"""What the models of joints leave out, and how much it would change the natural frequencies of an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.model import Assembly
from dovetail.assembly.vibration_modes import lowest_frequencies
from dovetail.errors import DovetailError, Fault, PluginError, listing
from dovetail.interfaces import JointModel, JointPort, Omission, Parameter, StructuralMatrices, plugin_errors
from dovetail.synthesis import Connection

_MODES = 3
"""Natural frequencies that are compared, as many as ``dovetail check`` shows."""


class _Added(JointModel):
    """A known stiffness between the nodes of a joint.

    Parameters
    ----------
    ports : tuple of JointPort
    stiffness : (d, d) array
    """

    name = "added_stiffness"
    summary = "A known stiffness"
    parameters: tuple[Parameter, ...] = ()

    def __init__(self, ports: Sequence[JointPort], stiffness: NDArray[np.float64]) -> None:
        super().__init__()
        self._ports, self._stiffness = tuple(ports), stiffness

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """Those of the joint."""
        return self._ports

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the stiffness (n, d, d), without mass and damping."""
        K = np.broadcast_to(self._stiffness, (len(theta), *self._stiffness.shape))
        return StructuralMatrices(np.zeros_like(K), K)


def find_omissions(assembly: Assembly) -> tuple[str, ...]:
    """Return what the joints of an assembly leave out, with the size of it in the middle of the ranges.

    Parameters
    ----------
    assembly : Assembly

    Returns
    -------
    tuple of str
        A text for each joint that leaves something out (`JointModel.omission`).
    """
    texts = []
    for name, joint in assembly.description.joints.items():
        connection = joint.connection
        omission = _omission(name, connection, assembly)
        if omission is not None:
            texts.append(f"joints.{name}: {omission.problem} {_size(assembly, connection, omission)}")
    return tuple(texts)


def _omission(name: str, connection: Connection, assembly: Assembly) -> Omission | None:
    model, label = connection.model, f"joint '{name}' ({connection.model.name})"
    parts = [assembly.description.substructures[end.substructure] for end in connection.attachments]
    with plugin_errors(model, label):
        omission = model.omission(parts, [end.nodes for end in connection.attachments])
        if omission is None or omission.stiffness is None:
            return omission
        ports = model.size - model.internal_dofs
        if np.shape(omission.stiffness) != (ports, ports) or not np.all(np.isfinite(omission.stiffness)):
            problem = f"the stiffness that it leaves out has the shape {np.shape(omission.stiffness)}."
            raise PluginError(Fault(label, problem, f"finite numbers ({ports}, {ports})"))
    return omission


def _size(assembly: Assembly, connection: Connection, omission: Omission) -> str:
    """Return in words how much the stiffness that is left out would change natural frequencies."""
    if omission.stiffness is None:
        return "How much that changes is not known: its parts do not give their cross-sections."
    added = _Added(connection.model.ports, omission.stiffness)
    graph = assembly.graph
    name = "omitted stiffness"
    whole = graph.with_connection(name, replace(connection, model=added, rigid=False))
    theta = assembly.by_joint(assembly.vector(None)[np.newaxis])
    try:
        before = lowest_frequencies(graph, theta, _MODES)
        after = lowest_frequencies(whole, {**theta, name: np.empty((1, 0))}, _MODES)
    except DovetailError as error:
        return f"How much that changes cannot be computed: {error.faults[0].problem}"
    modes = min(len(before), len(after))
    if not modes:
        return "The assembly has no natural frequencies that it could change."
    rise = after[:modes] / before[:modes] - 1.0
    return (
        f"In the middle of the ranges the natural frequencies are {_hertz(before[:modes])}; with all of it they would "
        f"be {_hertz(after[:modes])}, up to {100.0 * rise.max():.2g} % higher. Those of the structure lie between."
    )


def _hertz(values: NDArray[np.float64]) -> str:
    return f"{listing(f'{value:.4g}' for value in values)} Hz"
