"""A multilayer perceptron, which predicts values or, with `uncertainty: gaussian`, distributions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray
from pydantic import Field, PositiveInt

import dovetail
from dovetail_plugins.arrays import checked_rows, state_array
from dovetail_plugins.regressors.network_regressor import LARGEST_FEATURE, NetworkRegressor, normal_quantiles
from dovetail_plugins.regressors.training import TrainingConfig

if TYPE_CHECKING:
    import torch


Activation = Literal["relu", "silu", "gated"]

_OWNER = "regressor 'mlp'"
_GAUSSIAN, _ACTIVATION = "gaussian", "activation"
_LARGEST_LOGARITHM = 10.0
"""Largest logarithm on the diagonal of a precision's Cholesky factor: a standard deviation of 1/20,000."""
_DRAWS = 500
"""Draws from the distribution of each answer."""
_NORM_EPSILON = 1e-5
"""As in torch.nn.LayerNorm."""
_BLOCK = 4096
"""Rows that are predicted at once, which bounds the memory."""
_HELD = 0.9
"""Probability of the intervals that are calibrated, and share of held-back samples that they then contain."""
_GROUPS, _FEWEST_HELD_BACK = 8, 300
"""Largest number of groups of such samples, and smallest number in each, which gives this share to 2 %."""
_MOST_FACTOR = 5.0
"""Largest factor by which a standard deviation is corrected."""
_LEVELS, _FACTORS = "levels", "factors"


class FittedMLP(dovetail.FittedRegressor):
    """Hidden layers and a linear output.

    Parameters
    ----------
    weights : sequence of (n_in, n_out) arrays
    biases : sequence of (n_out,) arrays
    activation : {"relu", "silu", "gated"}
        Of the hidden units; with "gated" the layers are those of a `GatedNetwork`.
    is_gaussian : bool
        Whether the output is a Gaussian of the normal quantiles of the targets: means, then the lower triangle of the
        precision's Cholesky factor, row by row, with logarithms on its diagonal.
    calibration : two (n_levels, n_targets) arrays, optional
        Logarithms of standard deviations, and the factors that correct these.

    Notes
    -----
    The forward pass uses NumPy in double precision: its few matrix products do not need torch, and the result for a row
    does not depend on the other rows.
    """

    def __init__(
        self,
        weights: list[NDArray[Any]],
        biases: list[NDArray[Any]],
        activation: Activation,
        is_gaussian: bool,
        calibration: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    ) -> None:
        self._activation: Activation = activation
        self._is_gaussian = is_gaussian
        self._calibration = calibration
        self._weights = [np.ascontiguousarray(weight, dtype=np.float64) for weight in weights]
        self._biases = [np.asarray(bias, dtype=np.float64) for bias in biases]

    def predict(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Predict targets (n_samples, n_targets) from features (n_samples, n_features)."""
        if not self._is_gaussian:
            return self._output(features)
        mean, inverse = self._gaussians(features)
        variance = _deviations(inverse) ** 2  # the mean of a normal quantile's probability has a closed form
        return np.asarray(scipy.special.ndtr(mean / np.sqrt(1.0 + variance)))

    def predict_distribution(self, features: NDArray[np.float32]) -> dovetail.TargetDistribution | None:
        """Return draws of the targets of each row, or None without `uncertainty`."""
        if not self._is_gaussian:
            return None
        mean, inverse = self._gaussians(features)
        draws = dovetail.spread_normal(_DRAWS, mean.shape[1]) @ inverse
        draws += mean[:, np.newaxis]
        return dovetail.TargetDistribution(scipy.special.ndtr(draws, out=draws))

    def calibrated(self, features: NDArray[np.float32], quantiles: NDArray[np.float64]) -> FittedMLP:
        """Return the same regressor with Gaussians calibrated with held-back samples.

        The intervals of a maximum-likelihood Gaussian are too wide if errors have long tails, and too narrow if it
        overfits the training samples. Each target's standard deviation is multiplied by a factor that depends on it, so
        that the 90 % intervals contain 90 % of the samples, both of those with small and of those with large
        deviations (little and much noise). Correlations are kept.

        Parameters
        ----------
        features : (n_samples, n_features) array
            300 or more.
        quantiles : (n_samples, n_targets) array
            Normal quantiles of the targets.
        """
        mean, inverse = _gaussians(self._output(features))
        deviation = _deviations(inverse)
        errors = np.abs(quantiles - mean) / deviation
        groups = np.array_split(np.argsort(deviation, axis=0), min(_GROUPS, len(features) // _FEWEST_HELD_BACK))
        levels = [np.median(np.log(np.take_along_axis(deviation, rows, axis=0)), axis=0) for rows in groups]
        reaches = [np.quantile(np.take_along_axis(errors, rows, axis=0), _HELD, axis=0) for rows in groups]
        factors = np.clip(np.array(reaches) / scipy.special.ndtri(0.5 + 0.5 * _HELD), 1.0 / _MOST_FACTOR, _MOST_FACTOR)
        return FittedMLP(self._weights, self._biases, self._activation, True, (np.array(levels), factors))

    def _gaussians(self, features: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return means (n, t) of normal quantiles, and calibrated factors (n, t, t) of their covariances."""
        mean, inverse = _gaussians(self._output(features))
        if self._calibration is not None:
            pairs = zip(np.log(_deviations(inverse)).T, *(values.T for values in self._calibration), strict=True)
            inverse *= np.stack([np.interp(*each) for each in pairs], axis=1)[:, np.newaxis]
        return mean, inverse

    def _output(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        rows = checked_rows(features, _OWNER, width=self._weights[0].shape[0])
        if self._is_gaussian:
            rows = np.clip(rows, -LARGEST_FEATURE, LARGEST_FEATURE)
        blocks = [self._forward(rows[start : start + _BLOCK]) for start in range(0, len(rows), _BLOCK)]
        return np.concatenate(blocks)

    def state(self) -> dovetail.ComponentState:
        """Return the weights and biases of all layers, and the kinds of hidden units and output."""
        weights = {f"weight{i}": weight.astype(np.float32) for i, weight in enumerate(self._weights)}
        biases = {f"bias{i}": bias.astype(np.float32) for i, bias in enumerate(self._biases)}
        activation = {} if self._activation == "relu" else {_ACTIVATION: self._activation}
        gaussian: dict[str, Any] = {_GAUSSIAN: True} if self._is_gaussian else {}
        if self._calibration is not None:
            gaussian[_LEVELS], gaussian[_FACTORS] = self._calibration
        return {**weights, **biases, **activation, **gaussian}

    def _forward(self, rows: NDArray[Any]) -> NDArray[np.float64]:
        activation = rows.astype(np.float64)
        if self._activation == "gated":
            return self._gated(activation)
        for weight, bias in zip(self._weights[:-1], self._biases[:-1], strict=True):
            activation = activation @ weight + bias
            activation = (
                np.maximum(activation, 0.0)
                if self._activation == "relu"
                else activation * scipy.special.expit(activation)
            )
        result: NDArray[np.float64] = activation @ self._weights[-1] + self._biases[-1]
        return result

    def _gated(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        (first, into), *blocks, (last, onto) = zip(self._weights, self._biases, strict=True)
        stream = rows @ first + into
        for (up, above), (down, below) in zip(blocks[::2], blocks[1::2], strict=True):
            linear, gate = np.split(_normalised(stream) @ up + above, 2, axis=1)
            stream = stream + (linear * gate * scipy.special.expit(gate)) @ down + below
        return np.asarray(_normalised(stream) @ last + onto)


class MLP(NetworkRegressor):
    """A multilayer perceptron: hidden layers, linear output, mean squared error or likelihood, Adam.

    Notes
    -----
    With `uncertainty: gaussian` the output for each FRF is a Gaussian, with mean and full covariance, of the normal
    quantiles of the targets (so that a parameter that the FRF does not determine is uniform over its range), and the
    loss is its negative log-likelihood.

    Overfitting is limited by L2 regularisation of the weights, dropout after each hidden layer, and early stopping with
    a held-back part of the training samples, of which the best weights are kept.
    """

    name = "mlp"
    summary = "multilayer perceptron (torch), with intervals on request"
    references = (
        "Kingma and Ba, Adam: a method for stochastic optimization, ICLR 2015",
        "Shazeer, GLU variants improve transformer, arXiv:2002.05202",
        "Dorta, Vicente, Agapito, Campbell and Simpson, Structured uncertainty prediction networks, CVPR 2018",
    )

    class Config(TrainingConfig):
        """Options of the network and its training.

        Attributes
        ----------
        hidden : one to eight int
            Units of each hidden layer.
        uncertainty : {"none", "gaussian"}
            Prediction of values only, or of a Gaussian with a full covariance.
        activation : {"relu", "silu", "gated"}
            Of the hidden units: rectified linear; x / (1 + exp(-x)), which learns a smooth map from fewer samples; or
            residual blocks, in which one half of the units gates the other, the first width being that of the stream.
        squared_error : float
            Weight of the squared error of a Gaussian's mean, in normal quantiles, added to the negative log-likelihood.
            The same mean minimises both. The gradients of the likelihood are proportional to the precision, so that
            alone it favours the parameters that are known best and learns the others late.
        precision : {"single", "mixed"}
            Of the products in gated blocks during training: "mixed" uses bfloat16 if the processor is faster with it
            (AVX512-BF16, AMX), which nearly halves the time of a step.
        """

        hidden: Annotated[tuple[PositiveInt, ...], Field(min_length=1, max_length=8)] = (512, 256)
        uncertainty: Literal["none", "gaussian"] = "none"
        activation: Activation = "relu"
        squared_error: Annotated[float, Field(ge=0.0)] = 0.0
        precision: Literal["single", "mixed"] = "single"

    config: Config

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a quick training, and a small network with intervals."""
        options = {"activation": "silu", "hidden": [64], "max_epochs": 25, "learning_rate": 1e-2}
        return {"hidden": [64, 32], "max_epochs": 20, "learning_rate": 1e-2}, {"uncertainty": _GAUSSIAN, **options}

    def restore(self, state: dovetail.ComponentState) -> FittedMLP:
        """Rebuild the network from its weights and biases."""
        activation = next((one for one in get_args(Activation) if one == state.get(_ACTIVATION, "relu")), None)
        if activation is None:
            problem = f"its state has the activation {state[_ACTIVATION]!r}."
            raise dovetail.DovetailError(dovetail.Fault(_OWNER, problem, ", ".join(get_args(Activation))))
        weights: list[NDArray[Any]] = []
        layers = {name.removeprefix("weight").removeprefix("bias") for name in state}
        layers -= {_GAUSSIAN, _ACTIVATION, _LEVELS, _FACTORS}
        for i in range(len(layers)):
            ends_block = activation == "gated" and i > 0 and i % 2 == 0
            rows = weights[-1].shape[1] // (2 if ends_block else 1) if weights else None
            columns = weights[0].shape[1] if ends_block else None
            weights.append(state_array(state, f"weight{i}", _OWNER, (rows, columns)))
        biases = [state_array(state, f"bias{i}", _OWNER, (weight.shape[1],)) for i, weight in enumerate(weights)]
        calibration = None
        if _LEVELS in state:
            levels = state_array(state, _LEVELS, _OWNER, (None, _target_count(len(biases[-1]))))
            calibration = levels, state_array(state, _FACTORS, _OWNER, levels.shape)
        return FittedMLP(weights, biases, activation, bool(state.get(_GAUSSIAN, False)), calibration)

    @property
    def is_distribution(self) -> bool:
        """Whether it predicts a Gaussian."""
        return bool(self.config.uncertainty == _GAUSSIAN)

    def network(self, n_features: int, n_targets: int) -> torch.nn.Module:
        """Return the layers before training."""
        from torch import nn

        config, outputs = self.config, n_targets
        if self.is_distribution:
            outputs += n_targets * (n_targets + 1) // 2
        if config.activation == "gated":
            from dovetail_plugins.regressors.gated_layers import GatedNetwork, is_faster_in_bfloat16

            mixed = config.precision == "mixed" and is_faster_in_bfloat16()
            return GatedNetwork(n_features, config.hidden, outputs, config.dropout, mixed)
        layers: list[nn.Module] = []
        for width in config.hidden:
            unit = nn.ReLU() if config.activation == "relu" else nn.SiLU()
            layers += [nn.Linear(n_features, width), unit, nn.Dropout(config.dropout)]
            n_features = width
        return nn.Sequential(*layers, nn.Linear(n_features, outputs))

    def loss(self, network: torch.nn.Module, inputs: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
        """Return the mean squared error, or the negative log-likelihood plus the weighted squared error."""
        import torch

        output = network(inputs)
        if not self.is_distribution:
            return torch.nn.functional.mse_loss(output, targets)
        quantiles = normal_quantiles(targets)
        loss = _negative_log_likelihood(output, quantiles)
        if self.config.squared_error:
            squares = (quantiles - output[:, : targets.shape[1]]).square()
            loss = loss + self.config.squared_error * squares.sum(dim=1).mean()
        return loss

    def fitted(self, network: Any) -> FittedMLP:
        """Return the fitted regressor with the weights and biases of a trained network."""
        from torch import nn

        if self.config.activation == "gated":
            layers = network.layers()
        else:
            layers = [(layer.weight, layer.bias) for layer in network.children() if isinstance(layer, nn.Linear)]
        weights = [weight.detach().numpy().T.copy() for weight, _ in layers]
        biases = [bias.detach().numpy().copy() for _, bias in layers]
        return FittedMLP(weights, biases, self.config.activation, self.is_distribution)

    def calibrated(self, fitted: dovetail.FittedRegressor, held_back: tuple[torch.Tensor, torch.Tensor]) -> FittedMLP:
        """Return a fitted network with Gaussians calibrated with the samples of its validation loss."""
        assert isinstance(fitted, FittedMLP)
        features, targets = held_back
        if not self.is_distribution or len(features) < _FEWEST_HELD_BACK:
            return fitted
        return fitted.calibrated(features.numpy(), normal_quantiles(targets.double()).numpy())


def _negative_log_likelihood(output: torch.Tensor, quantiles: torch.Tensor) -> torch.Tensor:
    """Return the mean negative log-likelihood of normal quantiles (n, t), up to a constant."""
    import torch

    count = quantiles.shape[1]
    rows, columns = torch.tril_indices(count, count)
    factor = output.new_zeros(len(output), count, count)
    factor[:, rows, columns] = output[:, count:]
    logarithms = torch.diagonal(factor, dim1=1, dim2=2).clamp(-_LARGEST_LOGARITHM, _LARGEST_LOGARITHM)
    factor = factor.tril(-1) + torch.diag_embed(torch.exp(logarithms))
    white = torch.einsum("nij,ni->nj", factor, quantiles - output[:, :count])
    return (0.5 * white.square().sum(dim=1) - logarithms.sum(dim=1)).mean()


def _normalised(stream: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows scaled to mean 0 and variance 1, as by torch's layer norm."""
    centred = stream - stream.mean(axis=1, keepdims=True)
    return np.asarray(centred / np.sqrt(np.mean(centred**2, axis=1, keepdims=True) + _NORM_EPSILON))


def _target_count(outputs: int) -> int:
    """Return the number of targets of a Gaussian, given its number of outputs (means and Cholesky entries)."""
    return round((math.sqrt(9.0 + 8.0 * outputs) - 3.0) / 2.0)


def _deviations(inverse: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviations (n, t) from factors (n, t, t) of the covariances."""
    return np.asarray(np.sqrt(np.sum(inverse**2, axis=1)))


def _gaussians(output: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return means (n, t) of normal quantiles, and the inverse (n, t, t) of the precision's Cholesky factor."""
    count = _target_count(output.shape[1])
    factor = np.zeros((len(output), count, count))
    factor[:, *np.tril_indices(count)] = output[:, count:]
    diagonal = np.arange(count)
    logarithms = np.clip(factor[:, diagonal, diagonal], -_LARGEST_LOGARITHM, _LARGEST_LOGARITHM)
    factor[:, diagonal, diagonal] = np.exp(logarithms)
    inverse = np.zeros_like(factor)
    for row in range(count):  # by substitution, since a general solver may find a steep factor singular
        inverse[:, row] = -np.einsum("nk,nkj->nj", factor[:, row, :row], inverse[:, :row])
        inverse[:, row, row] += 1.0
        inverse[:, row] /= factor[:, row, row, np.newaxis]
    return output[:, :count], inverse
