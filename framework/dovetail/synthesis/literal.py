"""Frequency-domain substructure synthesis as it is published (Eqs. 4-7): the reference in tests and benchmarks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dovetail.synthesis.graph import Graph

__all__ = ["literal_receptance"]


def literal_receptance(
    graph: Graph,
    frequency: NDArray[np.float64],
    theta: Mapping[str, NDArray[np.float64]],
    substructure: str,
    dof: int,
) -> NDArray[np.complex128]:
    """Drive-point receptance H_rr = H_rr - H_rb (H_bb + H_J)^-1 H_br.

    Parameters
    ----------
    graph : Graph
        Without merged or held DOFs, each interface DOF in one joint only, and every joint with inertia of its own
        (its receptance must exist).
    frequency : (n_freq,) array
        Hz.
    theta : mapping of str to (n_params,) array
    substructure, dof : str and int
        Where the response is.

    Returns
    -------
    (n_freq,) complex array
    """
    interface = [
        (port.substructure, dof_) for c in graph.connections.values() for port in c.attachments for dof_ in port.dofs
    ]
    size = len(interface)
    H_bb = np.zeros((len(frequency), size, size), dtype=np.complex128)
    H_br = np.zeros((len(frequency), size, 1), dtype=np.complex128)
    H_rr = np.zeros(len(frequency), dtype=np.complex128)
    for name, part in graph.substructures.items():
        here = [index for index, (owner, _) in enumerate(interface) if owner == name]
        dofs = [interface[index][1] for index in here]
        receptance = part.receptance(frequency, [*dofs, dof] if name == substructure else dofs)
        H_bb[:, np.array(here)[:, None], here] = receptance[:, : len(dofs), : len(dofs)]
        if name == substructure:
            H_br[:, here, 0] = receptance[:, : len(dofs), -1]
            H_rr = receptance[:, -1, -1]
    first = 0
    for name, connection in graph.connections.items():
        ports = connection.model.size - connection.model.internal_dofs
        Z = connection.model.dynamic_stiffness(frequency, theta[name][None, :])[0]
        H_bb[:, first : first + ports, first : first + ports] += np.linalg.inv(Z)[:, :ports, :ports]
        first += ports
    correction = np.swapaxes(H_br, 1, 2) @ np.linalg.solve(H_bb, H_br)
    result: NDArray[np.complex128] = H_rr - correction[:, 0, 0]
    return result
