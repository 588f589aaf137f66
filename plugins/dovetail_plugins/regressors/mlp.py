"""A multilayer perceptron, whose answer is a value or, with `uncertainty: gaussian`, a distribution."""

from __future__ import annotations

import itertools
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveInt
from scipy.special import expit, ndtr

import dovetail
from dovetail_plugins.arrays import checked_rows, state_array

if TYPE_CHECKING:
    import torch

    Tensors = tuple[torch.Tensor, torch.Tensor]

__all__ = ["MLP", "FittedMLP"]

Layers = list[tuple[NDArray[Any], NDArray[Any]]]
"""Weight (n_in, n_out) and bias (n_out,) of each layer."""

Activation = Literal["relu", "silu"]

_OWNER = "regressor 'mlp'"
_GAUSSIAN, _ACTIVATION = "gaussian", "activation"
_MARGIN = 1e-3
"""How near to the ends of the targets' range, 0 and 1, normal quantiles are taken: three standard deviations."""
_LARGEST_LOGARITHM = 10.0
"""Of a precision's Cholesky factor: a standard deviation of a twenty-thousandth."""
_LARGEST_GRADIENT = 5.0
_LARGEST_FEATURE = 8.0
"""Standard deviations beyond which features tell a Gaussian no more: what is unlike all else gets no sure answer."""
_DRAWS = 500
_FEWEST = 3
_LARGE = 500_000
_BLOCK = 4096


class FittedMLP(dovetail.FittedRegressor):
    """Hidden layers and a linear output.

    Parameters
    ----------
    weights : sequence of (n_in, n_out) arrays
    biases : sequence of (n_out,) arrays
    activation : {"relu", "silu"}
        Of the hidden units.
    is_gaussian : bool
        Whether the output is a Gaussian of the normal quantiles of the targets: means, then the lower triangle of the
        precision's Cholesky factor, row by row, with logarithms on its diagonal.

    Notes
    -----
    The forward pass is NumPy in double precision: three matrix products need no torch, and a row's answer does not
    depend on the other rows.
    """

    def __init__(
        self,
        weights: list[NDArray[Any]],
        biases: list[NDArray[Any]],
        activation: Activation = "relu",
        is_gaussian: bool = False,
    ) -> None:
        self._activation: Activation = activation
        self._is_gaussian = is_gaussian
        self._weights = [np.ascontiguousarray(weight, dtype=np.float64) for weight in weights]
        self._biases = [np.asarray(bias, dtype=np.float64) for bias in biases]

    def predict(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Predict targets (n_samples, n_targets) from features (n_samples, n_features)."""
        output = self._output(features)
        if not self._is_gaussian:
            return output
        mean, inverse = _gaussians(output)
        variance = np.sum(inverse**2, axis=1)  # the mean of a normal quantile's probability has a closed form
        return np.asarray(ndtr(mean / np.sqrt(1.0 + variance)))

    def predict_distribution(self, features: NDArray[np.float32]) -> dovetail.TargetDistribution | None:
        """Return draws of the targets of each row, or None without `uncertainty`."""
        if not self._is_gaussian:
            return None
        mean, inverse = _gaussians(self._output(features))
        normal = dovetail.spread_normal(_DRAWS, mean.shape[1])
        return dovetail.TargetDistribution(ndtr(mean[:, np.newaxis] + normal @ inverse))

    def _output(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        rows = checked_rows(features, _OWNER, width=self._weights[0].shape[0])
        if self._is_gaussian:
            rows = np.clip(rows, -_LARGEST_FEATURE, _LARGEST_FEATURE)
        blocks = [self._forward(rows[start : start + _BLOCK]) for start in range(0, len(rows), _BLOCK)]
        return np.concatenate(blocks)

    def state(self) -> dovetail.State:
        """Return the weights and biases of all layers, and what the hidden units and the output are."""
        weights = {f"weight{i}": weight.astype(np.float32) for i, weight in enumerate(self._weights)}
        biases = {f"bias{i}": bias.astype(np.float32) for i, bias in enumerate(self._biases)}
        activation = {} if self._activation == "relu" else {_ACTIVATION: self._activation}
        return {**weights, **biases, **activation, **({_GAUSSIAN: True} if self._is_gaussian else {})}

    def _forward(self, rows: NDArray[Any]) -> NDArray[np.float64]:
        activation = rows.astype(np.float64)
        for weight, bias in zip(self._weights[:-1], self._biases[:-1], strict=True):
            activation = activation @ weight + bias
            activation = np.maximum(activation, 0.0) if self._activation == "relu" else activation * expit(activation)
        result: NDArray[np.float64] = activation @ self._weights[-1] + self._biases[-1]
        return result


class MLP(dovetail.Regressor):
    """A multilayer perceptron: hidden layers, linear output, mean squared error or likelihood, Adam.

    Notes
    -----
    With `uncertainty: gaussian` the output is a Gaussian with its own mean and full covariance for each FRF, of the
    normal quantiles of the targets (so that what an FRF does not tell keeps its even distribution over the range), and
    the loss is its negative log-likelihood.

    Against overfitting: L2 regularisation of the weights, dropout after each hidden layer, and early stopping on a
    part of the training samples that is held back, with the best weights kept.
    """

    name = "mlp"
    summary = "multilayer perceptron (torch), with intervals on request"
    references = (
        "Kingma and Ba, Adam: a method for stochastic optimization, ICLR 2015",
        "Dorta, Vicente, Agapito, Campbell and Simpson, Structured uncertainty prediction networks, CVPR 2018",
    )

    class Config(dovetail.ComponentConfig):
        """Options of the network and its training.

        Attributes
        ----------
        hidden : one to eight int
            Units of each hidden layer.
        uncertainty : {"none", "gaussian"}
            What is predicted: values alone, or a Gaussian with a full covariance.
        activation : {"relu", "silu"}
            Of the hidden units: rectified linear, or x / (1 + exp(-x)), which learns a smooth map from fewer samples.
        dropout : float
            Share of hidden units left out at random in each training step.
        weight_decay : float
            Factor of the L2 regularisation of the weights.
        learning_rate : float
            Of Adam, at the start; halved each time the validation loss has not fallen for a third of `patience`.
        batch_size : int
            Samples of a training step.
        max_epochs : int
            Passes over the training samples at most.
        patience : int
            Epochs without a better validation loss after which training stops.
        validation_fraction : float
            Share of the training samples held back for the validation loss.
        """

        hidden: Annotated[tuple[PositiveInt, ...], Field(min_length=1, max_length=8)] = (512, 256)
        uncertainty: Literal["none", "gaussian"] = "none"
        activation: Activation = "relu"
        dropout: float = Field(default=0.1, ge=0.0, lt=1.0)
        weight_decay: float = Field(default=1e-5, ge=0.0)
        learning_rate: float = Field(default=1e-3, gt=0.0)
        batch_size: PositiveInt = 256
        max_epochs: PositiveInt = 200
        patience: PositiveInt = 20
        validation_fraction: float = Field(default=0.1, gt=0.0, lt=1.0)

    def fit(
        self,
        features: NDArray[np.float32],
        targets: NDArray[np.float64],
        *,
        seed: int,
        progress: dovetail.Progress = dovetail.silent,
        context: dovetail.FeatureContext | None = None,
    ) -> FittedMLP:
        """Fit to features (n_samples, n_features) and targets (n_samples, n_targets).

        Raises
        ------
        DovetailError
            The two differ in length, hold values that are not finite, or are too few for a validation part.
        """
        samples = self._tensors(features, targets)
        return self._fit(lambda _: samples, seed, progress, context)

    def fit_epochs(
        self,
        epoch: dovetail.Epoch,
        *,
        seed: int,
        progress: dovetail.Progress = dovetail.silent,
        context: dovetail.FeatureContext | None = None,
    ) -> FittedMLP:
        """Fit to samples whose features change from epoch to epoch.

        The validation part is taken from the first epoch; its rows are left out of all others.

        Raises
        ------
        DovetailError
            As `fit`.
        """
        return self._fit(lambda number: self._tensors(*epoch(number)), seed, progress, context)

    def _fit(
        self,
        epoch: Callable[[int], Tensors],
        seed: int,
        progress: dovetail.Progress,
        context: dovetail.FeatureContext | None,
    ) -> FittedMLP:
        with _own_torch(seed):
            layers = self._train(epoch, progress, None if context is None else context.seconds)
        weights, biases = ([pair[i] for pair in layers] for i in (0, 1))
        return FittedMLP(weights, biases, self.config.activation, self.config.uncertainty == _GAUSSIAN)

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a quick training, and a small network with intervals."""
        options = {"activation": "silu", "hidden": [64], "max_epochs": 60, "learning_rate": 3e-3}
        return {"max_epochs": 40}, {"uncertainty": _GAUSSIAN, **options}

    def restore(self, state: dovetail.State) -> FittedMLP:
        """Rebuild the network from its weights and biases."""
        activation = next((one for one in get_args(Activation) if one == state.get(_ACTIVATION, "relu")), None)
        if activation is None:
            problem = f"its state holds the activation {state[_ACTIVATION]!r}."
            raise dovetail.DovetailError(dovetail.Fault(_OWNER, problem, ", ".join(get_args(Activation))))
        weights: list[NDArray[Any]] = []
        layers = {name.removeprefix("weight").removeprefix("bias") for name in state} - {_GAUSSIAN, _ACTIVATION}
        for i in range(len(layers)):
            rows = weights[-1].shape[1] if weights else None
            weights.append(state_array(state, f"weight{i}", _OWNER, (rows, None)))
        biases = [state_array(state, f"bias{i}", _OWNER, (weight.shape[1],)) for i, weight in enumerate(weights)]
        return FittedMLP(weights, biases, activation, bool(state.get(_GAUSSIAN, False)))

    def _tensors(self, features: NDArray[np.float32], targets: NDArray[np.float64]) -> Tensors:
        inputs, outputs = _tensors(features, targets)
        limit = _LARGEST_FEATURE if self.config.uncertainty == _GAUSSIAN else math.inf
        return inputs.clamp(-limit, limit), outputs

    def _network(self, n_features: int, n_targets: int) -> torch.nn.Sequential:
        from torch import nn

        layers: list[nn.Module] = []
        for width in self.config.hidden:
            unit = nn.ReLU() if self.config.activation == "relu" else nn.SiLU()
            layers += [nn.Linear(n_features, width), unit, nn.Dropout(self.config.dropout)]
            n_features = width
        is_gaussian = self.config.uncertainty == _GAUSSIAN
        outputs = n_targets + n_targets * (n_targets + 1) // 2 if is_gaussian else n_targets
        return nn.Sequential(*layers, nn.Linear(n_features, outputs))

    def _train(self, samples: Callable[[int], Tensors], progress: dovetail.Progress, seconds: float | None) -> Layers:
        """Return the layers at the epoch of the lowest validation loss.

        Within a time the learning rate falls like half a cosine, so that the end of it is a minimum.
        """
        import torch

        config, began = self.config, time.monotonic()
        inputs, outputs = samples(0)
        widths = (inputs.shape[1], *config.hidden)
        _choose_threads(sum(one * other for one, other in itertools.pairwise(widths)))
        loss_of = _negative_log_likelihood if config.uncertainty == _GAUSSIAN else torch.nn.functional.mse_loss
        order = torch.randperm(len(inputs))
        held_back = min(max(round(config.validation_fraction * len(inputs)), 1), len(inputs) - 1)
        validation, training = order[:held_back], order[held_back:]
        validation_inputs, validation_outputs = inputs[validation], outputs[validation]
        network = self._network(inputs.shape[1], outputs.shape[1])
        optimizer = torch.optim.Adam(
            network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay, fused=True
        )
        schedule = torch.optim.lr_scheduler.ReduceLROnPlateau(optimizer, factor=0.5, patience=config.patience // 3)
        best_loss, best_epoch, best = float("inf"), 0, _layers(network)
        for epoch in range(1, config.max_epochs + 1):
            if epoch > 1:
                inputs, outputs = samples(epoch - 1)
            network.train()
            for batch in torch.split(training[torch.randperm(len(training))], config.batch_size):
                if seconds is not None:
                    part = min((time.monotonic() - began) / seconds, 1.0)
                    optimizer.param_groups[0]["lr"] = 0.5 * config.learning_rate * (1.0 + math.cos(math.pi * part))
                    if part == 1.0:
                        break
                optimizer.zero_grad()
                loss = loss_of(network(inputs[batch]), outputs[batch])
                torch.autograd.backward(loss)
                if config.uncertainty == _GAUSSIAN:  # one sample far from its mean may tell more than all others
                    torch.nn.utils.clip_grad_norm_(network.parameters(), _LARGEST_GRADIENT)
                optimizer.step()
            network.eval()
            with torch.no_grad():
                current = float(loss_of(network(validation_inputs), validation_outputs))
            if not math.isfinite(current):
                raise dovetail.DovetailError(_diverged(epoch, config.learning_rate))
            if seconds is None:
                schedule.step(current)
            if current < best_loss:
                best_loss, best_epoch, best = current, epoch, _layers(network)
            progress("regressor", epoch, config.max_epochs, f"validation loss {current:.6g}")
            is_over = seconds is not None and time.monotonic() - began >= seconds
            if is_over or (seconds is None and epoch - best_epoch >= config.patience):
                break
        return best


def _negative_log_likelihood(output: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
    """Return the mean negative log-likelihood of the normal quantiles of targets (n, t), but for a constant."""
    import torch

    count = targets.shape[1]
    quantiles = torch.special.ndtri(targets.clamp(_MARGIN, 1.0 - _MARGIN))
    rows, columns = torch.tril_indices(count, count)
    factor = output.new_zeros(len(output), count, count)
    factor[:, rows, columns] = output[:, count:]
    logarithms = torch.diagonal(factor, dim1=1, dim2=2).clamp(-_LARGEST_LOGARITHM, _LARGEST_LOGARITHM)
    factor = factor.tril(-1) + torch.diag_embed(torch.exp(logarithms))
    white = torch.einsum("nij,ni->nj", factor, quantiles - output[:, :count])
    return (0.5 * white.square().sum(dim=1) - logarithms.sum(dim=1)).mean()


def _gaussians(output: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return means (n, t) of normal quantiles, and the inverse (n, t, t) of the precision's Cholesky factor."""
    count = round((math.sqrt(9.0 + 8.0 * output.shape[1]) - 3.0) / 2.0)
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


def _tensors(features: NDArray[np.float32], targets: NDArray[np.float64]) -> Tensors:
    import torch

    inputs = np.require(checked_rows(features, _OWNER), np.float32, ["C", "W"])
    outputs = np.require(checked_rows(targets, f"{_OWNER}, targets"), np.float32, ["C", "W"])
    if len(inputs) != len(outputs):
        problem = f"it was given {len(inputs)} rows of features and {len(outputs)} of targets."
        raise dovetail.DovetailError(dovetail.Fault(_OWNER, problem))
    if len(inputs) < _FEWEST:
        problem = f"{len(inputs)} samples are too few to train on and to validate with."
        raise dovetail.DovetailError(dovetail.Fault(_OWNER, problem, f"{_FEWEST} or more"))
    return torch.from_numpy(inputs), torch.from_numpy(outputs)


def _diverged(epoch: int, learning_rate: float) -> dovetail.Fault:
    problem = f"the validation loss is no longer finite after epoch {epoch}."
    return dovetail.Fault(_OWNER, problem, remedy=f"Choose a 'learning_rate' below {learning_rate:g}.")


@contextmanager
def _own_torch(seed: int) -> Iterator[None]:
    """Seed torch; the caller's random numbers and threads are afterwards as they were."""
    import torch

    threads = torch.get_num_threads()
    try:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            yield
    finally:
        torch.set_num_threads(threads)


def _choose_threads(weights: int) -> None:
    """Train a small network on one thread, a large one on half of the cores.

    More gain little on an idle machine, and where anything else wants a core an epoch takes up to fifty times as long,
    since threads wait for each other after every product.
    """
    import torch

    wanted = 1 if weights < _LARGE else max(1, (os.cpu_count() or 1) // 2)
    torch.set_num_threads(min(torch.get_num_threads(), wanted))


def _layers(network: torch.nn.Sequential) -> Layers:
    """Return copies of the (n_in, n_out) weight and the bias of each linear layer."""
    from torch import nn

    linear = [layer for layer in network if isinstance(layer, nn.Linear)]
    return [(layer.weight.detach().numpy().T.copy(), layer.bias.detach().numpy().copy()) for layer in linear]
