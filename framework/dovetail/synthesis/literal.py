"""Frequency-domain substructure synthesis as it is published (Eqs. 4-7): the reference in tests and benchmarks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dovetail.synthesis.graph import Graph

__all__ = ["LiteralSynthesis"]


class LiteralSynthesis:
    """Drive-point receptance H_rr - H_rb (H_bb + H_J)^-1 H_br; the substructures' receptances are computed once.

    Parameters
    ----------
    graph : Graph
        Without merged or held DOFs, each interface DOF in one joint only, and every joint with inertia of its own
        (its receptance must exist).
    frequency : (n_freq,) array
        Hz.
    substructure, dof : str and int
        Where the response is.
    """

    def __init__(self, graph: Graph, frequency: NDArray[np.float64], substructure: str, dof: int) -> None:
        self._graph = graph
        self._frequency = frequency
        interface = [
            (port.substructure, number) for c in graph.connections.values() for port in c.attachments
            for number in port.dofs
        ]  # fmt: skip
        size = len(interface)
        self._H_bb = np.zeros((len(frequency), size, size), dtype=np.complex128)
        self._H_br = np.zeros((len(frequency), size, 1), dtype=np.complex128)
        self._H_rr = np.zeros(len(frequency), dtype=np.complex128)
        for name, part in graph.substructures.items():
            here = [index for index, (owner, _) in enumerate(interface) if owner == name]
            dofs = [interface[index][1] for index in here]
            receptance = part.receptance(frequency, [*dofs, dof] if name == substructure else dofs)
            self._H_bb[:, np.array(here)[:, None], here] = receptance[:, : len(dofs), : len(dofs)]
            if name == substructure:
                self._H_br[:, here, 0] = receptance[:, : len(dofs), -1]
                self._H_rr = receptance[:, -1, -1]

    def receptance(self, theta: Mapping[str, NDArray[np.float64]]) -> NDArray[np.complex128]:
        """Return the (n_freq,) drive-point receptance for one vector of all parameters of each joint."""
        H = self._H_bb.copy()
        first = 0
        for name, connection in self._graph.connections.items():
            ports = connection.model.size - connection.model.internal_dofs
            Z = connection.model.dynamic_stiffness(self._frequency, theta[name][None, :])[0]
            H[:, first : first + ports, first : first + ports] += np.linalg.inv(Z)[:, :ports, :ports]
            first += ports
        correction = np.swapaxes(self._H_br, 1, 2) @ np.linalg.solve(H, self._H_br)
        result: NDArray[np.complex128] = self._H_rr - correction[:, 0, 0]
        return result
