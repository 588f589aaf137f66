"""Noise of synthetic measurements and of robustness tests: level, shape, seed."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.measurement import complex_noise, data_noise


def test_complex_noise_is_circular_and_in_proportion_to_each_line() -> None:
    clean = np.array([1.0, 1000j, -3 + 4j, 0.0])[:, np.newaxis] * np.ones(40_000)
    noise = complex_noise(clean, 0.01, 0) - clean
    for line, size in zip(noise, (1.0, 1000.0, 5.0, 0.0), strict=True):
        np.testing.assert_allclose(np.sqrt(np.mean(np.abs(line) ** 2)), 0.01 * size, rtol=0.02)
        np.testing.assert_allclose([line.real.std(), line.imag.std()], 0.01 * size / np.sqrt(2), rtol=0.02)
        assert abs(np.mean(line**2)) <= 0.02 * (0.01 * size) ** 2
        assert abs(line.mean()) <= 0.02 * 0.01 * size


def test_data_noise_has_the_deviation_of_all_the_data() -> None:
    clean = np.arange(60_000.0).reshape(200, 300).T
    noise = data_noise(clean, 0.2, 0) - clean
    np.testing.assert_allclose(noise.std(), 0.2 * clean.std(), rtol=0.02)
    np.testing.assert_allclose(noise[:, 0].std(), 0.2 * clean.std(), rtol=0.15)
    assert noise.shape == clean.shape


@pytest.mark.parametrize("add", [complex_noise, data_noise])
def test_seeds(add) -> None:
    clean = np.linspace(1, 2, 50)
    np.testing.assert_array_equal(add(clean, 0.1, 7), add(clean, 0.1, 7))
    np.testing.assert_array_equal(add(clean, 0.1, 7), add(clean, 0.1, np.random.default_rng(7)))
    assert not np.array_equal(add(clean, 0.1, 7), add(clean, 0.1, 8))
    np.testing.assert_array_equal(add(clean, 0.0, 7), clean)


@pytest.mark.parametrize("add", [complex_noise, data_noise])
@pytest.mark.parametrize("level", [-0.1, np.nan, np.inf])
def test_a_level_that_is_none(add, level: float) -> None:
    with pytest.raises(ValueError, match="a noise level is finite and not negative"):
        add(np.ones(3), level, 0)
