"""The boundary dynamic stiffness of a part that is known by its receptance only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError, Fault, PluginError
from dovetail.interfaces import SubstructureModel

__all__ = ["inverted_receptance"]

_WORST_CONDITION = 1e10
"""Condition of a receptance, its rows and columns brought to the same size, beyond which nothing is left of it."""


def inverted_receptance(
    substructure: SubstructureModel, dofs: Sequence[int], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Invert the receptance of a substructure between some of its DOFs.

    Parameters
    ----------
    substructure : SubstructureModel
    dofs : sequence of int
        n DOFs.
    frequency : (n_freq,) array
        Hz.

    Returns
    -------
    (n_freq, n, n) complex array
        Zero at the DOFs that the part does not have.

    Raises
    ------
    PluginError
        The model returns something else than finite numbers of this shape.
    DovetailError
        The receptance is singular at a frequency, or so badly conditioned that its inverse is rounding.
    """
    places = [place for place, dof in enumerate(dofs) if dof not in substructure.absent_dofs]
    whole = np.zeros((len(frequency), len(dofs), len(dofs)), dtype=np.complex128)
    if places:
        present = [int(dofs[place]) for place in places]
        whole[:, np.array(places)[:, None], places] = _inverse(substructure, present, frequency)
    return whole


def _inverse(
    substructure: SubstructureModel, dofs: Sequence[int], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    where = f"substructure model '{substructure.name}'"
    receptance = np.asarray(substructure.receptance(frequency, dofs), dtype=np.complex128)
    wanted = (len(frequency), len(dofs), len(dofs))
    if receptance.shape != wanted:
        raise PluginError(Fault(where, f"it returns a receptance of the shape {receptance.shape}, not {wanted}."))
    if not np.isfinite(receptance).all():
        raise PluginError(Fault(where, "it returns a receptance that is not finite."))
    scale = np.sqrt(np.abs(np.diagonal(receptance, axis1=1, axis2=2)))
    still = np.argwhere(scale == 0)
    if len(still):
        line, dof = still[0]
        label = substructure.dof_label(int(dofs[dof]))
        found = f"its receptance at {label} is zero at {frequency[line]:g} Hz: a part that is held there."
        raise DovetailError(Fault(where, found, remedy="Connect it with a joint to 'ground' in its place."))
    balanced = receptance / (scale[:, :, None] * scale[:, None, :])
    condition = np.linalg.cond(balanced)
    worst = int(np.argmax(condition))
    if not condition[worst] < _WORST_CONDITION:
        labels = ", ".join(substructure.dof_label(int(dof)) for dof in dofs)
        found = f"its receptance between {labels} cannot be inverted at {frequency[worst]:g} Hz: "
        found += f"rows depend on each other (condition {condition[worst]:.1e}, balanced)."
        remedy = "Displacement and rotation must come from independent measurements; look at where they were taken."
        raise DovetailError(Fault(where, found, f"a condition below {_WORST_CONDITION:.0e}", remedy))
    inverse: NDArray[np.complex128] = np.linalg.inv(balanced) / (scale[:, :, None] * scale[:, None, :])
    return inverse
