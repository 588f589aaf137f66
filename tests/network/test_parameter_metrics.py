"""R2, RMSE and MAE on the sampling scale and in SI units."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.interfaces import Parameter
from dovetail.network.evaluation import Evaluation, parameter_metrics

LINEAR = Parameter("mass", "kg", 0.0, 2.0)
LOG = Parameter("k", "N/m", 1e5, 1e9, "log")


def test_metrics_of_a_linear_parameter_equal_a_manual_calculation() -> None:
    truth, predicted = np.array([[0.0], [1.0], [2.0]]), np.array([[0.5], [1.0], [1.0]])
    metrics = parameter_metrics((LINEAR,), truth, predicted)["mass"]
    assert metrics.r2 == pytest.approx(1 - 1.25 / 2.0)
    assert metrics.mae_si == pytest.approx(0.5)
    assert metrics.mae == pytest.approx(0.25)
    assert metrics.rmse_si == pytest.approx(np.sqrt(1.25 / 3))
    assert metrics.rmse == pytest.approx(np.sqrt(1.25 / 3) / 2)
    assert metrics.unit == "kg"


def test_a_logarithmic_parameter_is_judged_by_decades() -> None:
    truth, predicted = np.array([[1e6], [1e8]]), np.array([[1e7], [1e8]])
    metrics = parameter_metrics((LOG,), truth, predicted)["k"]
    assert metrics.mae == pytest.approx(0.5 * 0.25)
    assert metrics.r2 == pytest.approx(1 - 0.25**2 / (2 * 0.25**2))
    assert metrics.mae_si == pytest.approx(0.5 * 9e6)


def test_r2_is_undefined_where_the_truth_does_not_vary() -> None:
    metrics = parameter_metrics((LINEAR,), np.full((3, 1), 0.7), np.array([[0.6], [0.7], [0.8]]))
    assert metrics["mass"].r2 is None
    evaluation = Evaluation(metrics, 3, 3, 0, {})
    assert np.isnan(evaluation.mean_r2)


def test_the_mean_leaves_the_undefined_out() -> None:
    truth = np.array([[0.7, 1e6], [0.7, 1e8]])
    evaluation = Evaluation(parameter_metrics((LINEAR, LOG), truth, truth), 2, 2, 0, {})
    assert evaluation.mean_r2 == 1.0
