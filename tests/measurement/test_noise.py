"""Noise of synthetic measurements and of robustness tests: level, shape, seed."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.frf import Frf
from dovetail.measurement import complex_noise, data_noise, noisy_frf


def test_complex_noise_is_circular_and_in_proportion_to_each_line() -> None:
    clean = np.array([1.0, 1000j, -3 + 4j, 0.0])[:, np.newaxis] * np.ones(40_000)
    noise = complex_noise(clean, 0.01, 0) - clean
    for line, size in zip(noise, (1.0, 1000.0, 5.0, 0.0), strict=True):
        np.testing.assert_allclose(np.sqrt(np.mean(np.abs(line) ** 2)), 0.01 * size, rtol=0.02)
        np.testing.assert_allclose([line.real.std(), line.imag.std()], 0.01 * size / np.sqrt(2), rtol=0.02)
        assert abs(np.mean(line**2)) <= 0.02 * (0.01 * size) ** 2
        assert abs(line.mean()) <= 0.02 * 0.01 * size


def test_uniform_noise_is_the_same_on_all_lines_and_its_variance_is_known() -> None:
    frf = Frf(np.arange(1.0, 40_001.0), np.linspace(1, 1000, 40_000) * 1j, "mobility")
    noisy = noisy_frf(frf, 0.01, 0)
    deviation = 0.01 * frf.values.std()
    np.testing.assert_array_equal(noisy.values, complex_noise(frf.values, 0.01, 0, kind="uniform"))
    np.testing.assert_allclose(noisy.variance, deviation**2)
    for lines in (slice(0, 20_000), slice(20_000, None)):
        np.testing.assert_allclose(np.abs(noisy.values - frf.values)[lines].std(), 0.463 * deviation, rtol=0.02)
    np.testing.assert_allclose(noisy_frf(frf, 0.1, 0, kind="proportional").variance, (0.1 * frf.amplitude) ** 2)


def test_data_noise_has_the_deviation_of_all_the_data() -> None:
    clean = np.arange(60_000.0).reshape(200, 300).T
    noise = data_noise(clean, 0.2, 0) - clean
    np.testing.assert_allclose(noise.std(), 0.2 * clean.std(), rtol=0.02)
    np.testing.assert_allclose(noise[:, 0].std(), 0.2 * clean.std(), rtol=0.15)
    assert noise.shape == clean.shape


@pytest.mark.parametrize("add", [complex_noise, data_noise])
def test_a_seed_repeats_the_noise(add) -> None:
    clean = np.linspace(1, 2, 50)
    np.testing.assert_array_equal(add(clean, 0.1, 7), add(clean, 0.1, 7))
    np.testing.assert_array_equal(add(clean, 0.1, 7), add(clean, 0.1, np.random.default_rng(7)))
    assert not np.array_equal(add(clean, 0.1, 7), add(clean, 0.1, 8))
    np.testing.assert_array_equal(add(clean, 0.0, 7), clean)


@pytest.mark.parametrize("add", [complex_noise, data_noise])
@pytest.mark.parametrize("level", [-0.1, np.nan, np.inf, "1 %", None])
def test_a_noise_level_that_is_not_a_positive_number_is_refused(add, level: object) -> None:
    with pytest.raises(ValueError, match=r"a noise level is a number such as 0\.01, finite and not negative, not"):
        add(np.ones(3), level, 0)
