"""Options of the training of networks, and Adam with its learning rate from step to step."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Literal

from pydantic import Field, PositiveInt

import dovetail

if TYPE_CHECKING:
    import torch

_RISE = 0.2
"""Share of a one-cycle training in which the learning rate increases."""
_FALL = 1e-4
"""Relative decrease of the validation loss that counts as one."""
_BETAS, _EPSILON = (0.9, 0.999), 1e-8
"""Adam's decay rates of the two moments, and what keeps its steps finite, as they are in torch."""


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


class Adam:
    """Adam, and its learning rate, which is halved when the validation loss no longer falls.

    With `one_cycle` or a time limit the rate follows a cycle instead, down to zero at `max_epochs` or at the limit,
    whichever comes first, so that training ends in a minimum.

    Parameters
    ----------
    network : torch.nn.Module
    config : TrainingConfig
    began : float
        When the training began, s.
    seconds : float, optional
        Time limit of the training.

    Notes
    -----
    The steps are those of `torch.optim.Adam` and `AdamW`. The classes themselves load torch's compiler, which takes
    longer than many trainings.
    """

    def __init__(self, network: torch.nn.Module, config: TrainingConfig, began: float, seconds: float | None) -> None:
        import torch

        self.follows_cycle = seconds is not None or config.schedule == "one_cycle"
        self._config, self._began, self._seconds, self._epochs = config, began, seconds, 0
        self._rate, self._best_loss, self._poor_epochs = config.learning_rate, math.inf, 0
        self._weights = list(network.parameters())
        self._means = [torch.zeros_like(weights) for weights in self._weights]
        self._squares = [torch.zeros_like(weights) for weights in self._weights]
        self._steps = [torch.zeros((), device=weights.device) for weights in self._weights]

    def step(self) -> None:
        """Change the weights by their gradients."""
        import torch
        from torch.optim.adam import adam
        from torch.optim.adamw import adamw

        kind = adamw if self._config.optimizer == "adamw" else adam
        state = zip(self._weights, self._means, self._squares, self._steps, strict=True)
        rows = [(row[0], row[0].grad, *row[1:]) for row in state if row[0].grad is not None]
        weights, gradients, means, squares, steps = (list(column) for column in zip(*rows, strict=True))
        with torch.no_grad():
            kind(
                weights,
                gradients,
                means,
                squares,
                [],
                steps,
                fused=True,
                amsgrad=False,
                beta1=_BETAS[0],
                beta2=_BETAS[1],
                lr=self._rate,
                weight_decay=self._config.weight_decay,
                eps=_EPSILON,
                maximize=False,
            )

    def set_learning_rate(self, part_of_epoch: float) -> float:
        """Set the rate of the next step, and return the part of the cycle that is over; 0 without a cycle."""
        if not self.follows_cycle:
            return 0.0
        part = (self._epochs + part_of_epoch) / self._config.max_epochs
        if self._seconds is not None:
            part = max(part, min((time.monotonic() - self._began) / self._seconds, 1.0))
        rise = _RISE if self._config.schedule == "one_cycle" else 0.0
        self._rate = self._config.learning_rate * _cycle(part, rise)
        return part

    def end_epoch(self, validation_loss: float) -> None:
        """Count an epoch, and halve the learning rate if the loss has not fallen for a third of `patience`."""
        self._epochs += 1
        if validation_loss < self._best_loss * (1.0 - _FALL):
            self._best_loss, self._poor_epochs = validation_loss, 0
        else:
            self._poor_epochs += 1
        if self._poor_epochs > self._config.patience // 3 and not self.follows_cycle:
            self._rate, self._poor_epochs = 0.5 * self._rate, 0

    def is_out_of_time(self) -> bool:
        """Return whether the time limit is reached."""
        return self._seconds is not None and time.monotonic() - self._began >= self._seconds


def _cycle(part: float, rise: float) -> float:
    """Return the learning rate relative to the highest, after a share of the training: up, then half a cosine down."""
    if part < rise:
        return part / rise
    return 0.5 * (1.0 + math.cos(math.pi * (part - rise) / (1.0 - rise)))
