"""A network of gated residual blocks; it is imported where torch is needed, which takes seconds."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import nn

__all__ = ["GatedNetwork"]


class _Block(nn.Module):
    """What is added to a stream: products of linear and gated units, so that one feature scales another."""

    def __init__(self, width: int, units: int, dropout: float) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.up, self.dropout, self.down = nn.Linear(width, 2 * units), nn.Dropout(dropout), nn.Linear(units, width)

    def forward(self, stream: torch.Tensor) -> torch.Tensor:
        linear, gate = self.up(self.norm(stream)).chunk(2, dim=-1)
        added: torch.Tensor = self.down(self.dropout(linear * nn.functional.silu(gate)))
        return stream + added


class GatedNetwork(nn.Module):
    """Blocks with so many units each, between two linear layers; the stream is as wide as the first block.

    Parameters
    ----------
    n_features, n_outputs : int
    hidden : sequence of int
    dropout : float
    """

    def __init__(self, n_features: int, hidden: Sequence[int], n_outputs: int, dropout: float) -> None:
        super().__init__()
        width = hidden[0]
        self.first = nn.Linear(n_features, width)
        self.blocks = nn.ModuleList(_Block(width, units, dropout) for units in hidden)
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
        """Return weight (n_out, n_in) and bias of all linear layers; norms are part of those behind them."""
        layers: list[tuple[torch.Tensor, torch.Tensor]] = [(self.first.weight, self.first.bias)]
        for block in self.blocks:
            assert isinstance(block, _Block)
            layers += [_with_norm(block.norm, block.up), (block.down.weight, block.down.bias)]
        return [*layers, _with_norm(self.norm, self.last)]


def _with_norm(norm: nn.LayerNorm, linear: nn.Linear) -> tuple[torch.Tensor, torch.Tensor]:
    return linear.weight * norm.weight, linear.bias + linear.weight @ norm.bias
