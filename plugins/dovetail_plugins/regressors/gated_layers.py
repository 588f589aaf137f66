"""A network of gated residual blocks, imported only when needed, since loading torch takes seconds."""

from __future__ import annotations

import timeit
from collections.abc import Sequence
from contextlib import nullcontext

import torch
from torch import nn

_CLEARLY_FASTER = 0.8
"""Ratio of times below which bfloat16 is used, since it costs digits."""


class _Block(nn.Module):
    """A residual block, which adds products of linear and gated units, so that one feature can scale another."""

    def __init__(self, width: int, units: int, dropout: float, mixed: bool) -> None:
        super().__init__()
        self.mixed = mixed
        self.norm = nn.LayerNorm(width)
        self.up, self.dropout, self.down = nn.Linear(width, 2 * units), nn.Dropout(dropout), nn.Linear(units, width)

    def forward(self, stream: torch.Tensor) -> torch.Tensor:
        is_rounded = self.mixed and self.training
        with torch.autocast(stream.device.type, torch.bfloat16) if is_rounded else nullcontext():
            linear, gate = self.up(self.norm(stream)).chunk(2, dim=-1)
            added: torch.Tensor = self.down(self.dropout(linear * nn.functional.silu(gate)))
        return stream + added


class GatedNetwork(nn.Module):
    """Residual blocks between two linear layers; the residual stream is as wide as the first block.

    Parameters
    ----------
    n_features, n_outputs : int
    hidden : sequence of int
        Units of each block.
    dropout : float
    mixed : bool
        Whether the products in blocks are in bfloat16 during training. The stream, its input and its output are always
        in single precision, since rounding would spoil narrow distributions.
    """

    def __init__(self, n_features: int, hidden: Sequence[int], n_outputs: int, dropout: float, mixed: bool) -> None:
        super().__init__()
        width = hidden[0]
        self.first = nn.Linear(n_features, width)
        self.blocks = nn.ModuleList(_Block(width, units, dropout, mixed) for units in hidden)
        self.norm = nn.LayerNorm(width)
        self.last = nn.Linear(width, n_outputs)

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Return the outputs (n, n_outputs) of features (n, n_features)."""
        stream = self.first(inputs)
        for block in self.blocks:
            stream = block(stream)
        outputs: torch.Tensor = self.last(self.norm(stream))
        return outputs

    def layers(self) -> list[tuple[torch.Tensor, torch.Tensor]]:
        """Return weight (n_out, n_in) and bias of all linear layers; norms are merged into the layers after them."""
        layers: list[tuple[torch.Tensor, torch.Tensor]] = [(self.first.weight, self.first.bias)]
        for block in self.blocks:
            assert isinstance(block, _Block)
            layers += [_with_norm(block.norm, block.up), (block.down.weight, block.down.bias)]
        return [*layers, _with_norm(self.norm, self.last)]


def is_faster_in_bfloat16() -> bool:
    """Return whether this processor multiplies matrices clearly faster in bfloat16; many lack instructions for it."""

    def seconds(dtype: torch.dtype) -> float:
        one, other = torch.ones(256, 256, dtype=dtype), torch.ones(256, 256, dtype=dtype)
        return min(timeit.repeat(lambda: one @ other, number=3, repeat=7))

    return seconds(torch.bfloat16) < _CLEARLY_FASTER * seconds(torch.float32)


def _with_norm(norm: nn.LayerNorm, linear: nn.Linear) -> tuple[torch.Tensor, torch.Tensor]:
    return linear.weight * norm.weight, linear.bias + linear.weight @ norm.bias
