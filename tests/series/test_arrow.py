"""Matrices in the form of an arrow against dense ones."""

import numpy as np
import pytest

from dovetail.series.arrow import ArrowMatrix, arrow_vector

SHARED = 3


@pytest.fixture(params=[(2, 0, 4), (1,), (0, 0), (5, 5, 5, 5)], ids=str)
def matrices(request):
    """An arrow matrix of five samples, and the same one dense."""
    random, own = np.random.default_rng(0), request.param
    roots = [random.standard_normal((5, SHARED + count, 30)) for count in own]
    parts = [root @ root.swapaxes(1, 2) for root in roots]
    size = SHARED + sum(own)
    dense, first = np.tile(np.eye(size), (5, 1, 1)), SHARED
    for count, part in zip(own, parts, strict=True):
        rows = [*range(SHARED), *range(first, first + count)]
        dense[np.ix_(range(5), rows, rows)] += part
        first += count
    return ArrowMatrix.added(np.ones((5, size)), parts, SHARED), dense


def test_solutions_determinants_and_covariances_are_those_of_the_dense_matrix(matrices):
    arrow, dense = matrices
    vector = np.random.default_rng(1).standard_normal(dense.shape[:2])
    np.testing.assert_allclose(arrow.solve(vector), np.linalg.solve(dense, vector[:, :, None])[:, :, 0], atol=1e-10)
    np.testing.assert_allclose(arrow.times(vector), (dense @ vector[:, :, None])[:, :, 0], atol=1e-10)
    np.testing.assert_allclose(arrow.log_determinant(), np.linalg.slogdet(dense)[1], rtol=1e-12)
    np.testing.assert_allclose(arrow.diagonal(), np.einsum("nii->ni", dense))
    inverse = np.linalg.inv(dense)
    np.testing.assert_allclose(arrow.shared_covariance(), inverse[:, :SHARED, :SHARED], atol=1e-12)
    count = arrow.blocks[0].shape[1]
    rows = [*range(SHARED + count)]
    np.testing.assert_allclose(arrow.own_covariance(0), inverse[:, rows][:, :, rows], atol=1e-12)


def test_draws_have_the_matrix_as_their_covariance(matrices):
    arrow, dense = matrices
    size = dense.shape[1]
    root = np.stack([arrow.root().times(np.tile(row, (5, 1))) for row in np.eye(size)], axis=2)
    np.testing.assert_allclose(root @ root.swapaxes(1, 2), dense, atol=1e-10)
    vector = np.random.default_rng(2).standard_normal(dense.shape[:2])
    np.testing.assert_allclose(arrow.root().times(arrow.root().solve(vector)), vector, atol=1e-10)
    np.testing.assert_allclose(2.0 * arrow.root().log_determinant(), np.linalg.slogdet(dense)[1], rtol=1e-12)


def test_vectors_of_the_tests_are_added_in_the_shared_rows_only():
    parts = [np.array([[1.0, 2.0, 3.0]]), np.array([[10.0, 20.0, 30.0, 40.0]])]
    np.testing.assert_array_equal(arrow_vector(parts, 2), [[11.0, 22.0, 3.0, 30.0, 40.0]])
