"""Eqs. 12 to 14: features, z-score and min-max on the parameter's scale."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.interfaces import Parameter
from dovetail.network.preprocessing import BLOCK_ROWS, TargetScaling, ZScore, log10p1

RNG = np.random.default_rng(3)
LINEAR = Parameter("mass", "kg", 0.0, 2.0)
LOG = Parameter("k", "N/m", 1e5, 1e9, "log")


def test_features_are_log10_of_one_plus_amplitude_in_single_precision() -> None:
    features = log10p1(np.array([[0.0, 9.0, 99.0]]))
    assert features.dtype == np.float32
    np.testing.assert_allclose(features, [[0.0, 1.0, 2.0]], rtol=1e-6)


def test_features_keep_the_digits_of_small_amplitudes() -> None:
    np.testing.assert_allclose(log10p1(np.array([1e-6])), [1e-6 / np.log(10.0)], rtol=1e-5)


def test_features_can_be_written_in_place() -> None:
    amplitude = RNG.uniform(0, 100, (4, 5)).astype(np.float32)
    expected = log10p1(amplitude)
    np.testing.assert_array_equal(log10p1(amplitude, out=amplitude), expected)
    np.testing.assert_array_equal(amplitude, expected)


@pytest.mark.parametrize("rows", [3, BLOCK_ROWS, 2 * BLOCK_ROWS + 7])
def test_z_score_gives_mean_0_and_deviation_1(rows: int) -> None:
    features = RNG.normal([5.0, -200.0], [0.1, 30.0], (rows, 2)).astype(np.float32)
    scaled = ZScore.fit(features).transform(features).astype(np.float64)
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=1e-5)
    np.testing.assert_allclose(scaled.std(axis=0), 1.0, rtol=1e-5)


def test_z_score_of_a_constant_column_is_zero_and_stays_finite_elsewhere() -> None:
    features = np.full((BLOCK_ROWS + 1, 2), 0.1, dtype=np.float32)
    features[:, 1] = RNG.normal(size=len(features))
    scaling = ZScore.fit(features)
    np.testing.assert_allclose(scaling.transform(features)[:, 0], 0.0, atol=1e-7)
    other = scaling.transform(np.array([[0.4, 0.0]], dtype=np.float32))
    np.testing.assert_allclose(other[0, 0], 0.3, rtol=1e-6)


def test_targets_are_0_to_1_between_the_extremes_of_the_training_values() -> None:
    theta = np.array([[0.5, 1e6], [1.5, 1e8], [0.75, 1e7]])
    scaling = TargetScaling.fit(theta, (LINEAR, LOG))
    np.testing.assert_allclose(scaling.transform(theta), [[0, 0], [1, 1], [0.25, 0.5]], atol=1e-12)


def test_targets_come_back() -> None:
    theta = np.column_stack([LINEAR.from_unit(RNG.random(50)), LOG.from_unit(RNG.random(50))])
    scaling = TargetScaling.fit(theta, (LINEAR, LOG))
    np.testing.assert_allclose(scaling.inverse(scaling.transform(theta)), theta, rtol=1e-12)


def test_a_constant_target_comes_back() -> None:
    theta = np.full((5, 1), 0.3)
    scaling = TargetScaling.fit(theta, (LINEAR,))
    np.testing.assert_array_equal(scaling.transform(theta), 0.0)
    np.testing.assert_array_equal(scaling.inverse(np.zeros((2, 1))), 0.3)


def test_scaling_does_not_change_its_input() -> None:
    theta, features = RNG.uniform(1, 2, (4, 2)), RNG.normal(size=(4, 2)).astype(np.float32)
    kept = theta.copy(), features.copy()
    scaling = TargetScaling.fit(theta, (LOG, LOG))
    scaling.inverse(scaling.transform(theta))
    ZScore.fit(features).transform(features)
    np.testing.assert_array_equal(theta, kept[0])
    np.testing.assert_array_equal(features, kept[1])


@pytest.mark.parametrize(
    ("scaling", "tampered"),
    [
        (ZScore, {"mean": np.zeros(3), "deviation": np.ones(2)}),
        (ZScore, {"mean": np.zeros(2), "deviation": np.zeros(2)}),
        (ZScore, {"mean": np.array([np.nan, 0.0]), "deviation": np.ones(2)}),
        (TargetScaling, {"lower": np.zeros(2), "upper": np.ones(2), "logarithmic": np.zeros(3, bool)}),
        (TargetScaling, {"lower": np.ones(2), "upper": np.ones(2), "logarithmic": np.zeros(2, bool)}),
    ],
)
def test_an_inconsistent_state_is_refused(scaling: type[ZScore], tampered: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"shape|positive|finite|inconsistent"):
        scaling.restore(tampered)
