"""Functions of the diameters of equal round elements, and the matrices that they multiply, add up to the elements."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail_plugins.round_elements import RoundElements
from dovetail_plugins.timoshenko import Material, chain, circle, element_matrices

STEEL = Material(young=2e11, density=7850.0, poisson=0.29, loss_factor=0.004)
DIAMETERS = np.array([[0.03, 0.0], [0.03, 0.012], [0.05, 0.049], [0.2, 0.1]])
LENGTH, ELEMENTS = 0.011, 3


@pytest.fixture(scope="module")
def scaled():
    return RoundElements(STEEL, LENGTH).scaled_matrices(2 * (ELEMENTS + 1), range(ELEMENTS), 0)


@pytest.mark.parametrize("name", ["M", "K", "C", "D"])
def test_the_matrices_are_those_of_a_chain_of_elements(scaled, name):
    section = circle(DIAMETERS[:, :1], DIAMETERS[:, 1:], STEEL.poisson)
    every = element_matrices(LENGTH * np.ones((1, ELEMENTS)), section, STEEL)
    expected = getattr(chain(every), name)
    summed = np.einsum("nf,fij->nij", scaled.factors(DIAMETERS), [getattr(m, name).toarray() for m in scaled.matrices])
    scale = np.sqrt(np.einsum("nii->ni", np.abs(expected)))
    assert summed.shape == expected.shape
    assert (np.abs(summed - expected) <= 1e-13 * scale[:, :, np.newaxis] * scale[:, np.newaxis]).all()


def test_the_slopes_are_those_of_the_functions(scaled):
    step = 1e-6 * np.array([0.03, 0.01])
    slopes = scaled.slopes(DIAMETERS)
    for column in (0, 1):
        ahead = np.where(np.arange(2) == column, step, 0.0)
        change = scaled.factors(DIAMETERS + ahead) - scaled.factors(DIAMETERS - ahead)
        size = np.abs(slopes).max(axis=2) + np.abs(scaled.factors(DIAMETERS)) / DIAMETERS[:, :1]
        assert (np.abs(change / (2.0 * step[column]) - slopes[:, :, column]) <= 1e-6 * size).all()
