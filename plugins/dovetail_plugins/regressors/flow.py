"""A conditional normalising flow (with zuko), which predicts a distribution of any shape for each FRF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray
from pydantic import Field, PositiveInt

import dovetail
from dovetail_plugins.arrays import checked_rows, state_array
from dovetail_plugins.regressors.network_regressor import (
    LARGEST_FEATURE,
    NetworkRegressor,
    normal_quantiles,
    one_thread,
)
from dovetail_plugins.regressors.training import TrainingConfig

if TYPE_CHECKING:
    import torch

_OWNER = "regressor 'flow'"
_SIZES = "sizes"
_DRAWS, _DRAWS_OF_MEAN = 500, 32
"""Number of draws of a distribution, and for its mean only, which is needed for thousands of FRFs."""
_DRAWN_AT_ONCE = 4000
"""Number of draws at a time, for all rows: with twelve targets they need about 300 MB."""
_MOST_UNITS, _MOST_LAYERS = 10_000, 20
_PASSES = 2
"""Passes of a transform: couplings change half of the targets at a time, so that drawing is as fast as training."""


class FittedFlow(dovetail.FittedRegressor):
    """A flow with trained weights.

    Parameters
    ----------
    network : torch.nn.Module
        As `Flow.network` returns it.
    sizes : sequence of int
        Number of features, targets, transforms, units in their hidden layers, bins, then of hidden units of the
        network.
    """

    def __init__(self, network: torch.nn.Module, sizes: Sequence[int]) -> None:
        self._network: Any = network.eval()
        self._sizes = np.array(sizes, dtype=np.int64)

    def predict(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Predict targets (n_samples, n_targets) from features (n_samples, n_features)."""
        return self._drawn(features, _DRAWS_OF_MEAN, lambda draws: draws.mean(axis=1))

    def predict_distribution(self, features: NDArray[np.float32]) -> dovetail.TargetDistribution:
        """Return draws of the targets of each row."""
        return dovetail.TargetDistribution(self._drawn(features, _DRAWS, lambda draws: draws))

    def _drawn(self, features: NDArray[np.float32], count: int, kept: Any) -> NDArray[np.float64]:
        """Return the results of a function of draws (n, count, n_targets), computed in blocks of rows."""
        import torch

        rows = checked_rows(features, _OWNER, width=int(self._sizes[0])).astype(np.float32)
        rows = np.clip(rows, -LARGEST_FEATURE, LARGEST_FEATURE)
        normal = torch.from_numpy(dovetail.spread_normal(count, int(self._sizes[1]))).float()
        blocks, step = [], _DRAWN_AT_ONCE // count
        with one_thread(), torch.inference_mode():  # a forked process would wait for other threads without end
            for start in range(0, len(rows), step):
                context = self._network.trunk(torch.from_numpy(rows[start : start + step]))
                transform = self._network.flow(context[:, None]).transform
                draws = transform.inv(normal.expand(len(context), -1, -1)).double().numpy()
                blocks.append(kept(scipy.special.ndtr(draws)))
        return np.concatenate(blocks)

    def state(self) -> dovetail.ComponentState:
        """Return the weights, and the sizes that are needed to rebuild the network."""
        weights = {name: values.detach().numpy().copy() for name, values in self._network.named_parameters()}
        return {**weights, _SIZES: self._sizes.copy()}


class Flow(NetworkRegressor):
    """A conditional normalising flow (neural spline flow with couplings), which predicts distributions of any shape.

    Notes
    -----
    Hidden layers compute a context from the features. Given this context, the flow maps the normal quantiles of the
    targets to independent normal numbers, by monotonic splines of one half of them that depend on the other half.
    Trained with the negative log-likelihood, it learns curved or multimodal distributions, which a Gaussian cannot
    represent. It needs the package zuko.
    """

    name = "flow"
    summary = "conditional normalising flow (zuko): intervals also of bent distributions"
    references = (
        "Durkan, Bekasov, Murray and Papamakarios, Neural spline flows, NeurIPS 2019",
        "Rozet et al., Zuko: normalizing flows in PyTorch, doi:10.5281/zenodo.7625672",
    )

    class Config(TrainingConfig):
        """Options of the flow and its training.

        Attributes
        ----------
        hidden : one to eight int
            Units of each hidden layer between the features and the flow.
        transforms : int
            Number of successive transforms of the flow.
        units : int
            Units in each of the two hidden layers that compute a transform's splines.
        bins : int
            Bins of each spline.
        """

        hidden: Annotated[tuple[PositiveInt, ...], Field(min_length=1, max_length=8)] = (256, 128)
        transforms: Annotated[int, Field(ge=1, le=_MOST_LAYERS)] = 4
        units: Annotated[int, Field(ge=1, le=_MOST_UNITS)] = 64
        bins: Annotated[int, Field(ge=2, le=100)] = 8

    config: Config

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a small flow that learns quickly."""
        flow = {"hidden": [64], "transforms": 1, "units": 32, "bins": 4, "dropout": 0.0}
        return ({**flow, "max_epochs": 20, "learning_rate": 2e-2, "batch_size": 64},)

    @property
    def is_distribution(self) -> bool:
        """Whether it predicts a distribution: always."""
        return True

    def network(self, n_features: int, n_targets: int) -> torch.nn.Module:
        """Return hidden layers and flow before training."""
        network: torch.nn.Module = _network(self._sizes(n_features, n_targets), self.config.dropout)
        return network

    def _sizes(self, n_features: int, n_targets: int) -> list[int]:
        config = self.config
        return [n_features, n_targets, config.transforms, config.units, config.bins, *config.hidden]

    def loss(self, network: Any, inputs: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
        """Return the mean negative log-likelihood of the targets' normal quantiles."""
        likelihood: torch.Tensor = network.flow(network.trunk(inputs)).log_prob(normal_quantiles(targets))
        return -likelihood.mean()

    def fitted(self, network: Any) -> FittedFlow:
        """Return the fitted regressor of a trained network."""
        n_features = network.trunk[0].in_features
        return FittedFlow(network, self._sizes(n_features, network.n_targets))

    def restore(self, state: dovetail.ComponentState) -> FittedFlow:
        """Rebuild the network from its weights."""
        import torch

        sizes = state_array(state, _SIZES, _OWNER, (None,)).tolist()
        limits = [_MOST_UNITS, _MOST_UNITS, _MOST_LAYERS, _MOST_UNITS, _MOST_UNITS, *[_MOST_UNITS] * _MOST_LAYERS]
        if not 6 <= len(sizes) <= len(limits) or any(
            size != int(size) or not 1 <= size <= limit for size, limit in zip(sizes, limits, strict=False)
        ):
            raise dovetail.DovetailError(dovetail.Fault(_OWNER, f"its state has the sizes {sizes!r:.100}."))
        network = _network([int(size) for size in sizes], 0.0)
        with torch.no_grad():
            for name, values in network.named_parameters():
                values.copy_(torch.from_numpy(state_array(state, name, _OWNER, tuple(values.shape)).astype(np.float32)))
        return FittedFlow(network, sizes)


def _network(sizes: Sequence[int], dropout: float) -> Any:
    """Return a network of hidden layers, `trunk`, and a flow of the targets given their output, `flow`.

    Raises
    ------
    DovetailError
        Zuko is not installed.
    """
    try:
        import zuko
    except ImportError:
        remedy = 'Install it by: pip install "dovetail-frf[flow]"'
        problem = "this needs the package zuko, which is not installed."
        raise dovetail.DovetailError(dovetail.Fault(_OWNER, problem, remedy=remedy)) from None
    import torch

    n_features, n_targets, transforms, units, bins, *hidden = sizes
    layers: list[torch.nn.Module] = []
    for width in hidden:
        layers += [torch.nn.Linear(n_features, width), torch.nn.SiLU(), torch.nn.Dropout(dropout)]
        n_features = width
    network: Any = torch.nn.Module()
    network.n_targets = n_targets
    network.trunk = torch.nn.Sequential(*layers)
    network.flow = zuko.flows.NSF(
        n_targets, n_features, bins=bins, transforms=transforms, passes=_PASSES, hidden_features=(units, units)
    )
    return network
