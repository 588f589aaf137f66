"""How well a trained network predicts the parameters of FRFs that it was not trained on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import Parameter


@dataclass(frozen=True)
class ParameterMetrics:
    """Errors of one parameter over the test part.

    Parameters
    ----------
    r2 : float or None
        Coefficient of determination on the scale on which the parameter is sampled (linear or logarithmic); None
        where the test values do not vary.
    rmse, mae : float
        Root-mean-square and mean absolute error on that scale, as a fraction of the parameter's range; for a
        normal prior, of its probability.
    rmse_si, mae_si : float
        The same errors of the value itself, in `unit`.
    unit : str
    """

    r2: float | None
    rmse: float
    mae: float
    rmse_si: float
    mae_si: float
    unit: str


@dataclass(frozen=True)
class Evaluation:
    """The errors of a trained network on samples that it was not trained on, and the cost of its training.

    Parameters
    ----------
    parameters : mapping of str to ParameterMetrics
    training_samples, test_samples : int
    seed : int
    seconds : mapping of str to float
        Wall-clock time of each stage of training [s].
    """

    parameters: Mapping[str, ParameterMetrics]
    training_samples: int
    test_samples: int
    seed: int
    seconds: Mapping[str, float]

    @property
    def mean_r2(self) -> float:
        """Mean of the R2 that are defined, each on its parameter's sampling scale; NaN if none is."""
        defined = [metrics.r2 for metrics in self.parameters.values() if metrics.r2 is not None]
        return float(np.mean(defined)) if defined else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, fit for JSON."""
        return asdict(self)


def parameter_metrics(
    parameters: Sequence[Parameter], truth: NDArray[np.float64], predicted: NDArray[np.float64]
) -> dict[str, ParameterMetrics]:
    """Compare predicted with true parameter values.

    Parameters
    ----------
    parameters : sequence of n_params Parameter
    truth, predicted : (n_samples, n_params) arrays
        SI values.

    Returns
    -------
    dict of str to ParameterMetrics
        By the parameter's name.
    """
    return {
        parameter.name: _metrics(parameter, truth[:, column], predicted[:, column])
        for column, parameter in enumerate(parameters)
    }


def _metrics(parameter: Parameter, truth: NDArray[np.float64], predicted: NDArray[np.float64]) -> ParameterMetrics:
    true = parameter.to_unit(truth)
    error, error_si = parameter.to_unit(predicted) - true, predicted - truth
    total = np.sum((true - true.mean()) ** 2)
    return ParameterMetrics(
        r2=float(1.0 - np.sum(error**2) / total) if true.max() > true.min() else None,
        rmse=_rms(error),
        mae=float(np.mean(np.abs(error))),
        rmse_si=_rms(error_si),
        mae_si=float(np.mean(np.abs(error_si))),
        unit=parameter.unit,
    )


def _rms(error: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(error**2)))
