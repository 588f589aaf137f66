"""Common parts of all networks with torch: samples as tensors, training with Adam, and early stopping."""

from __future__ import annotations

import math
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveInt

import dovetail
from dovetail_plugins.arrays import checked_rows

if TYPE_CHECKING:
    import torch

    Tensors = tuple[torch.Tensor, torch.Tensor]

LARGEST_FEATURE = 8.0
"""Largest feature, in standard deviations, for a distribution: an unusual FRF must not get a certain answer."""
_LARGEST_GRADIENT = 5.0
"""Norm to which gradients are clipped, so that a single batch cannot undo the training."""
_MARGIN = 1e-3
"""Distance from the ends of the range, 0 and 1, to which targets are clipped: three standard deviations."""
_RISE = 0.2
"""Share of a one-cycle training in which the learning rate increases."""
_FEWEST = 3
"""Samples: two to train on and one to validate with."""
_LARGE = 500_000
"""Weights from which several threads train faster than one."""


class TrainingConfig(dovetail.ComponentConfig):
    """Options of training with Adam that ends when the validation loss no longer decreases."""

    dropout: float = Field(
        default=0.1, ge=0.0, lt=1.0, description="Share of hidden units left out at random in each training step."
    )
    weight_decay: float = Field(
        default=1e-5,
        ge=0.0,
        description="Factor of the L2 regularisation of the weights; with 'optimizer: adamw' the share of the learning "
        "rate by which each step shrinks them.",
    )
    optimizer: Literal["adam", "adamw"] = Field(
        default="adam",
        description="How weights are regularised: by the loss, whose gradients Adam scales, so that little is left of "
        "it; or directly, by which a network learns few samples less by heart ('weight_decay' of about 0.2).",
    )
    schedule: Literal["plateau", "one_cycle"] = Field(
        default="plateau",
        description="The learning rate is halved each time the validation loss has not fallen for a third of "
        "`patience`; or it grows in the first fifth of `max_epochs`, all of which are made, and falls like half a "
        "cosine, which reaches nearly the same in a third of the epochs.",
    )
    learning_rate: float = Field(default=1e-3, gt=0.0, description="Of Adam, at its highest.")
    batch_size: PositiveInt = Field(default=256, description="Samples of a training step.")
    max_epochs: PositiveInt = Field(default=200, description="Passes over the training samples at most.")
    patience: PositiveInt = Field(
        default=20, description="Epochs without a better validation loss after which training stops."
    )
    validation_fraction: float = Field(
        default=0.1, gt=0.0, lt=1.0, description="Share of the training samples held back for the validation loss."
    )
    device: Literal["cpu", "auto"] = Field(
        default="cpu",
        description="Where the network is trained: on the processor, or with 'auto' on a GPU (CUDA, MPS) if there is "
        "one. A trained network answers on the processor.",
    )


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
        optimizer = _Optimizer(network, config, began, seconds)
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

    def _train_epoch(
        self, network: torch.nn.Module, samples: Tensors, rows: torch.Tensor, optimizer: _Optimizer
    ) -> None:
        """Make a step with each batch of rows of the samples, in random order."""
        import torch

        network.train()
        batches = torch.split(rows[torch.randperm(len(rows))], self.config.batch_size)
        for number, batch in enumerate(batches):
            if optimizer.set_learning_rate(number / len(batches)) == 1.0:
                break
            optimizer.adam.zero_grad()
            torch.autograd.backward(self.loss(network, *(values[batch] for values in samples)))
            if self.is_distribution:  # one sample far from its mean may outweigh all others
                torch.nn.utils.clip_grad_norm_(network.parameters(), _LARGEST_GRADIENT)
            optimizer.adam.step()

    def _validation_loss(self, network: torch.nn.Module, validation: Tensors) -> float:
        import torch

        network.eval()
        with torch.no_grad():
            return float(self.loss(network, *validation))

    def _diverged(self, epoch: int) -> dovetail.Fault:
        problem = f"the validation loss is no longer finite after epoch {epoch}."
        remedy = f"Choose a 'learning_rate' below {self.config.learning_rate:g}."
        return dovetail.Fault(self.owner, problem, remedy=remedy)


class _Optimizer:
    """Adam, and its learning rate from step to step.

    The rate is halved when the validation loss no longer falls. With `one_cycle` or a time limit it follows a cycle
    instead, down to zero at `max_epochs` or at the limit, whichever comes first, so that training ends in a minimum.

    Parameters
    ----------
    network : torch.nn.Module
    config : TrainingConfig
    began : float
        When the training began, s.
    seconds : float, optional
        Time limit of the training.
    """

    def __init__(self, network: torch.nn.Module, config: TrainingConfig, began: float, seconds: float | None) -> None:
        import torch

        kind = torch.optim.AdamW if config.optimizer == "adamw" else torch.optim.Adam
        self.adam = kind(network.parameters(), config.learning_rate, weight_decay=config.weight_decay, fused=True)
        self.follows_cycle = seconds is not None or config.schedule == "one_cycle"
        self._plateau = torch.optim.lr_scheduler.ReduceLROnPlateau(self.adam, factor=0.5, patience=config.patience // 3)
        self._config, self._began, self._seconds, self._epochs = config, began, seconds, 0

    def set_learning_rate(self, part_of_epoch: float) -> float:
        """Set the rate of the next step, and return the part of the cycle that is over; 0 without a cycle."""
        if not self.follows_cycle:
            return 0.0
        part = (self._epochs + part_of_epoch) / self._config.max_epochs
        if self._seconds is not None:
            part = max(part, min((time.monotonic() - self._began) / self._seconds, 1.0))
        rise = _RISE if self._config.schedule == "one_cycle" else 0.0
        self.adam.param_groups[0]["lr"] = self._config.learning_rate * _cycle(part, rise)
        return part

    def end_epoch(self, validation_loss: float) -> None:
        """Count an epoch, and halve the learning rate if the loss has not fallen for a third of `patience`."""
        self._epochs += 1
        if not self.follows_cycle:
            self._plateau.step(validation_loss)

    def is_out_of_time(self) -> bool:
        """Return whether the time limit is reached."""
        return self._seconds is not None and time.monotonic() - self._began >= self._seconds


def _device(wanted: str) -> torch.device:
    """Return the device for training; an accelerator only if torch finds one."""
    import torch

    found = torch.accelerator.current_accelerator() if wanted == "auto" and torch.accelerator.is_available() else None
    return found or torch.device("cpu")


def _cycle(part: float, rise: float) -> float:
    """Return the learning rate relative to the highest, after a share of the training: up, then half a cosine down."""
    if part < rise:
        return part / rise
    return 0.5 * (1.0 + math.cos(math.pi * (part - rise) / (1.0 - rise)))


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
