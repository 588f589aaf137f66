"""What reducers and regressors return, held against their contracts before it is used."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, PluginError
from dovetail.interfaces import Component

__all__ = ["checked_fit", "checked_rows", "label_of"]


def label_of(component: Component) -> str:
    """Return how messages name a reducer or a regressor."""
    return f"{component.kind} '{component.name}'"


def checked_rows(values: object, label: str, count: int, width: int | None = None) -> NDArray[Any]:
    """Return what `transform` or `predict` gave, if it has a row for each FRF.

    Parameters
    ----------
    values : object
    label : str
        Who gave it.
    count : int
        Number of FRFs.
    width : int, optional
        Number of columns; any from 1 by default.

    Returns
    -------
    (count, width) array

    Raises
    ------
    PluginError
        It is no array of numbers of that shape; NumPy would spread one of another shape over all columns.
    """
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        given = f"an array of {values.dtype}" if isinstance(values, np.ndarray) else type(values).__name__
        raise PluginError(Fault(label, f"it returned {given}.", "an array of numbers"))
    wanted = (count, width or values.shape[-1] if values.ndim else 0)
    if values.shape != wanted or 0 in values.shape:
        accepted = f"({count}, {'n_components' if width is None else width})"
        raise PluginError(Fault(label, f"it returned the shape {values.shape} for {count} FRFs.", accepted))
    return values


def checked_fit(made: object, recipe: Component, contract: type) -> None:
    """Make sure that `fit` or `restore` returned what its contract says.

    Raises
    ------
    PluginError
    """
    if not isinstance(made, contract):
        found = f"its fit returned {type(made).__name__}."
        raise PluginError(Fault(label_of(recipe), found, f"a {contract.__name__}"))
