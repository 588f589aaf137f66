"""Natural frequencies of chains of equal masses, dense and sparse, against the closed form."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from dovetail import SparseMatrices, StructuralMatrices
from dovetail.errors import DovetailError
from support.undamped_modes import elastic_frequencies

MASS, STIFFNESS = 2.0, 5e6


def chain(count: int, *, held: bool = True, massless: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """M and K of masses between springs, both ends held or both free; massless DOFs hang on the last one in a row."""
    K = 2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    if not held:
        K[0, 0] = K[-1, -1] = 1.0
    size = count + massless
    M, whole = np.zeros((size, size)), np.zeros((size, size))
    M[:count, :count] = MASS * np.eye(count)
    whole[:count, :count] = STIFFNESS * K
    for dof in range(count, size):
        whole[dof - 1 : dof + 1, dof - 1 : dof + 1] += STIFFNESS * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return M, whole


def closed_form(count: int, *, held: bool = True) -> np.ndarray:
    """The elastic modes [Hz] of the chain (a free chain has one rigid-body mode next to them)."""
    angle = np.pi * np.arange(1, count + 1) / (count + 1) if held else np.pi * np.arange(1, count) / count
    return 2 * np.sqrt(STIFFNESS / MASS) * np.sin(angle / 2) / (2 * np.pi)


def frequencies(form, M, K, count):
    matrices = StructuralMatrices(M, K) if form == "dense" else SparseMatrices(sp.csc_array(M), sp.csc_array(K))
    return elastic_frequencies(matrices, count)


@pytest.mark.parametrize("form", ["dense", "sparse"])
@pytest.mark.parametrize("count", [1, 3, 10])
@pytest.mark.parametrize("held", [True, False])
def test_the_requested_number_of_lowest_modes_is_returned(form, count, held):
    M, K = chain(12, held=held)
    np.testing.assert_allclose(frequencies(form, M, K, count), closed_form(12, held=held)[:count], rtol=1e-9)


@pytest.mark.parametrize(("form", "count"), [("dense", 8), ("sparse", 7)])
def test_all_modes_are_returned_if_more_are_requested(form, count):
    """Lanczos gives one mode less than there are masses."""
    M, K = chain(8)
    np.testing.assert_allclose(frequencies(form, M, K, 100), closed_form(8)[:count], rtol=1e-9)


@pytest.mark.parametrize("form", ["dense", "sparse"])
def test_massless_dofs_at_a_free_end_change_nothing(form):
    """They follow the mass at the end without a force, which is then free on that side."""
    M, K = chain(9, massless=3)
    np.testing.assert_allclose(frequencies(form, M, K, 4), closed_form(9)[:4], rtol=1e-8)


@pytest.mark.parametrize("form", ["dense", "sparse"])
def test_dofs_without_mass_have_no_mode(form):
    M, K = chain(6)
    separate = np.zeros((9, 9))
    separate[6:, 6:] = STIFFNESS * (2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
    separate[:6, :6] = K
    inert = np.zeros((9, 9))
    inert[:6, :6] = M
    np.testing.assert_allclose(frequencies(form, inert, separate, 3), closed_form(6)[:3], rtol=1e-9)
    assert frequencies(form, np.zeros((9, 9)), separate, 3).size == 0


@pytest.mark.parametrize("form", ["dense", "sparse"])
def test_several_free_parts_have_a_rigid_body_mode_each(form):
    """Eight chains apart: more rigid-body modes than one structure has, before the first elastic mode."""
    M, K = chain(5, held=False)
    M, K = np.kron(np.eye(8), M), np.kron(np.eye(8), K)
    np.testing.assert_allclose(frequencies(form, M, K, 9), np.repeat(closed_form(5, held=False)[:2], 8)[:9], rtol=1e-7)


@pytest.mark.parametrize("form", ["dense", "sparse"])
@pytest.mark.parametrize(("spoilt", "problem"), [("M", "mass is negative"), ("K", "stiffness")])
def test_an_unstable_structure_is_refused(form, spoilt, problem):
    M, K = chain(12)
    {"M": M, "K": K}[spoilt][3, 3] *= -1
    with pytest.raises(DovetailError, match=problem):
        frequencies(form, M, K, 2)
