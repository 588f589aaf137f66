"""Common parts of all networks with torch: samples as tensors, training with Adam, and early stopping."""

from __future__ import annotations

import math
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

import dovetail
from dovetail_plugins.arrays import checked_rows
from dovetail_plugins.regressors.training import Adam, TrainingConfig

if TYPE_CHECKING:
    import torch

    Tensors = tuple[torch.Tensor, torch.Tensor]

LARGEST_FEATURE = 8.0
"""Largest feature, in standard deviations, for a distribution: an unusual FRF must not get a certain answer."""
_LARGEST_GRADIENT = 5.0
"""Norm to which gradients are clipped, so that a single batch cannot undo the training."""
_MARGIN = 1e-3
"""Distance from the ends of the range, 0 and 1, to which targets are clipped: three standard deviations."""
_FEWEST = 3
"""Samples: two to train on and one to validate with."""
_LARGE = 500_000
"""Weights from which several threads train faster than one."""


class NetworkRegressor(dovetail.Regressor):
    """Base class of networks with torch; subclasses define the network, the loss and the fitted regressor."""

    config: TrainingConfig
    name: ClassVar[str]

    @property
    def owner(self) -> str:
        """Name in messages."""
        return f"regressor '{self.name}'"

    @property
    @abstractmethod
    def is_distribution(self) -> bool:
        """Whether it learns a distribution, for which features and gradients are clipped."""

    @abstractmethod
    def network(self, n_features: int, n_targets: int) -> torch.nn.Module:
        """Return the network before training."""

    @abstractmethod
    def loss(self, network: torch.nn.Module, inputs: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
        """Return the mean loss of some samples."""

    @abstractmethod
    def fitted(self, network: torch.nn.Module) -> dovetail.FittedRegressor:
        """Return the fitted regressor of a trained network."""

    def calibrated(
        self,
        fitted: dovetail.FittedRegressor,
        held_back: Tensors,  # noqa: ARG002
    ) -> dovetail.FittedRegressor:
        """Return a fitted regressor calibrated with the samples of its validation loss; unchanged by default."""
        return fitted

    def fit(
        self,
        features: NDArray[np.float32],
        targets: NDArray[np.float64],
        *,
        seed: int,
        progress: dovetail.Progress = dovetail.silent,
        context: dovetail.FeatureContext | None = None,
    ) -> dovetail.FittedRegressor:
        """Fit to features (n_samples, n_features) and targets (n_samples, n_targets).

        Raises
        ------
        DovetailError
            The two differ in length, contain values that are not finite, or are too few for a validation part.
        """
        samples = self._tensors(features, targets)
        return self._fit(lambda _: samples, seed, progress, context)

    def fit_epochs(
        self,
        epoch: dovetail.TrainingEpoch,
        *,
        seed: int,
        progress: dovetail.Progress = dovetail.silent,
        context: dovetail.FeatureContext | None = None,
    ) -> dovetail.FittedRegressor:
        """Fit to samples whose features change from epoch to epoch.

        The validation part is taken from the first epoch; its rows are left out of all others.

        Raises
        ------
        DovetailError
            As in `fit`.
        """
        return self._fit(lambda number: self._tensors(*epoch(number)), seed, progress, context)

    def _fit(
        self,
        epoch: Callable[[int], Tensors],
        seed: int,
        progress: dovetail.Progress,
        context: dovetail.FeatureContext | None,
    ) -> dovetail.FittedRegressor:
        with _own_torch(seed):
            network, held_back = self._train(epoch, progress, None if context is None else context.seconds)
            return self.calibrated(self.fitted(network), held_back)

    def _tensors(self, features: NDArray[np.float32], targets: NDArray[np.float64]) -> Tensors:
        import torch

        inputs = np.require(checked_rows(features, self.owner), np.float32, ["C", "W"])
        outputs = np.require(checked_rows(targets, f"{self.owner}, targets"), np.float32, ["C", "W"])
        if len(inputs) != len(outputs):
            problem = f"it was given {len(inputs)} rows of features and {len(outputs)} of targets."
            raise dovetail.DovetailError(dovetail.Fault(self.owner, problem))
        if len(inputs) < _FEWEST:
            problem = f"{len(inputs)} samples are too few to train on and to validate with."
            raise dovetail.DovetailError(dovetail.Fault(self.owner, problem, f"{_FEWEST} or more"))
        limit = LARGEST_FEATURE if self.is_distribution else math.inf
        return torch.from_numpy(inputs).clamp(-limit, limit), torch.from_numpy(outputs)

    def _train(
        self, samples: Callable[[int], Tensors], progress: dovetail.Progress, seconds: float | None
    ) -> tuple[torch.nn.Module, Tensors]:
        """Return the network with the lowest validation loss, and the samples of this loss."""
        import torch

        config, began, device = self.config, time.monotonic(), _device(self.config.device)
        inputs, outputs = (part.to(device) for part in samples(0))
        order = torch.randperm(len(inputs))
        held_back = min(max(round(config.validation_fraction * len(inputs)), 1), len(inputs) - 1)
        validation, training = (inputs[order[:held_back]], outputs[order[:held_back]]), order[held_back:]
        network = self.network(inputs.shape[1], outputs.shape[1]).to(device)
        _choose_threads(network)
        optimizer = Adam(network, config, began, seconds)
        best_loss, best_epoch, best = float("inf"), 0, _copied(network)
        for epoch in range(1, config.max_epochs + 1):
            if epoch > 1:
                inputs, outputs = (part.to(device) for part in samples(epoch - 1))
            self._train_epoch(network, (inputs, outputs), training, optimizer)
            loss = self._validation_loss(network, validation)
            if not math.isfinite(loss):
                raise dovetail.DovetailError(self._diverged(epoch))
            optimizer.end_epoch(loss)
            if loss < best_loss:
                best_loss, best_epoch, best = loss, epoch, _copied(network)
            progress("regressor", epoch, config.max_epochs, f"validation loss {loss:.6g}")
            if optimizer.is_out_of_time() or (not optimizer.follows_cycle and epoch - best_epoch >= config.patience):
                break
        network.load_state_dict(best)
        return network.cpu(), (validation[0].cpu(), validation[1].cpu())

    def _train_epoch(self, network: torch.nn.Module, samples: Tensors, rows: torch.Tensor, optimizer: Adam) -> None:
        """Make a step with each batch of rows of the samples, in random order."""
        import torch

        network.train()
        batches = torch.split(rows[torch.randperm(len(rows))], self.config.batch_size)
        for number, batch in enumerate(batches):
            if optimizer.set_learning_rate(number / len(batches)) == 1.0:
                break
            network.zero_grad()
            torch.autograd.backward(self.loss(network, *(values[batch] for values in samples)))
            if self.is_distribution:  # one sample far from its mean may outweigh all others
                torch.nn.utils.clip_grad_norm_(network.parameters(), _LARGEST_GRADIENT)
            optimizer.step()

    def _validation_loss(self, network: torch.nn.Module, validation: Tensors) -> float:
        import torch

        network.eval()
        with torch.no_grad():
            return float(self.loss(network, *validation))

    def _diverged(self, epoch: int) -> dovetail.Fault:
        problem = f"the validation loss is no longer finite after epoch {epoch}."
        remedy = f"Choose a 'learning_rate' below {self.config.learning_rate:g}."
        return dovetail.Fault(self.owner, problem, remedy=remedy)


def _device(wanted: str) -> torch.device:
    """Return the device for training; an accelerator only if torch finds one."""
    import torch

    found = torch.accelerator.current_accelerator() if wanted == "auto" and torch.accelerator.is_available() else None
    return found or torch.device("cpu")


def normal_quantiles(targets: torch.Tensor) -> torch.Tensor:
    """Return the normal quantiles of targets from 0 to 1, which are standard normal if nothing is known of a target."""
    import torch

    quantiles: torch.Tensor = torch.special.ndtri(targets.clamp(_MARGIN, 1.0 - _MARGIN))
    return quantiles


@contextmanager
def _own_torch(seed: int) -> Iterator[None]:
    """Seed torch, and restore the caller's random numbers and threads afterwards."""
    import torch

    with _own_threads(), torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        yield


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch use only this thread."""
    import torch

    with _own_threads():
        torch.set_num_threads(1)
        yield


@contextmanager
def _own_threads() -> Iterator[None]:
    import torch

    threads = torch.get_num_threads()
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _choose_threads(network: torch.nn.Module) -> None:
    """Train a small network on one thread, a large one on all.

    Threads wait for each other after every product. A small network gains little from them on an idle machine, and if
    another process needs a core, an epoch takes up to fifty times as long; for a large one the factor is 1.6.
    """
    import torch

    weights = sum(parameter.numel() for parameter in network.parameters())
    if weights < _LARGE:
        torch.set_num_threads(1)


def _copied(network: torch.nn.Module) -> dict[str, torch.Tensor]:
    return {name: values.detach().clone() for name, values in network.state_dict().items()}
