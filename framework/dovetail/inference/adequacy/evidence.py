"""The density of residuals with parameters and errors of the model marginalised, and what they say of each error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.model_error import KINDS


def marginalised_products(
    residuals: NDArray[np.float64], changes: dict[str, NDArray[np.float64]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the products (k, k) of the changes by errors of `KINDS`, and those (k,) with the residuals.

    All other changes, by errors of known sizes, are marginalised.
    """
    known = np.concatenate([change for name, change in changes.items() if name not in KINDS])
    both = np.concatenate([*(changes[kind] for kind in KINDS), residuals[np.newaxis]])
    cross = known @ both.T
    inner = np.linalg.pinv(np.eye(len(known)) + known @ known.T, hermitian=True)  # it may be huge, and singular
    products = both @ both.T - cross.T @ inner @ cross
    return products[:-1, :-1], products[:-1, -1]


def misfit_and_moments(gram: NDArray[np.float64], along: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return -2 log of the density of residuals with unit errors marginalised, and second moments (k,) of the errors.

    Both follow from the products of the errors' changes with each other (k, k) and with the residuals (k,); the density
    is known up to a constant.
    """
    squares, axes = np.linalg.eigh(gram)
    variance, on_axes = 1.0 / (1.0 + np.maximum(squares, 0.0)), axes.T @ along
    moments = (axes @ (variance * on_axes)) ** 2 + axes**2 @ variance
    return -float(np.sum(np.log(variance) + variance * on_axes**2)), moments


def removed_variance(gram: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return which part of the variance of unit errors (k,) residuals remove, from the products of their changes."""
    squares, axes = np.linalg.eigh(gram)
    return np.asarray(1.0 - axes**2 @ (1.0 / (1.0 + np.maximum(squares, 0.0))))
