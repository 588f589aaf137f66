"""What the regressor is trained with, epoch by epoch: reduced, standardised features and targets."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.network.augmentation import NoisyFeatures
from dovetail.identification.network.network import reduce_features
from dovetail.identification.network.preprocessing import TargetScaling, ZScore
from dovetail.interfaces import FittedReducer

__all__ = ["FreshEpochs", "ReducedEpochs", "Reduction"]

Pair = tuple[NDArray[np.float32], NDArray[np.float64]]
"""Features (n, n_components) and targets (n, n_targets)."""

_CHOICE_STREAM = 4
"""Keeps the choice among samples apart from other random numbers of the same seed."""

_MOST_BYTES = 1e9
"""Of the features that are kept to be drawn again."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """How FRFs become what the regressor is trained with.

    Parameters
    ----------
    name : str
        The reducer's.
    reducer : FittedReducer
    features : ZScore
    targets : TargetScaling
    """

    name: str
    reducer: FittedReducer
    features: ZScore
    targets: TargetScaling

    def __call__(self, features: NDArray[np.float32], theta: NDArray[np.float64]) -> Pair:
        """Reduce and standardise features (n, n_responses n_freq); scale parameters (n, n_params)."""
        return self.standardise(reduce_features(self.reducer, self.name, features), theta)

    def standardise(self, reduced: NDArray[np.float32], theta: NDArray[np.float64]) -> Pair:
        """Standardise reduced features, in their place; scale parameters."""
        return self.features.transform(reduced, out=reduced), self.targets.transform(theta)


@dataclass(frozen=True, eq=False)
class ReducedEpochs:
    """The dataset's FRFs, with other noise in every epoch.

    Parameters
    ----------
    noisy : NoisyFeatures
    reduction : Reduction

    Notes
    -----
    If the reduced features of `copies` epochs take no more memory than the FRFs of one, so many epochs are stored and
    used in turn. Otherwise each epoch is made when it is needed.
    """

    noisy: NoisyFeatures
    reduction: Reduction
    _stored: dict[int, Pair] = field(default_factory=dict, init=False)

    def __call__(self, epoch: int) -> Pair:
        """Return features and targets."""
        number = epoch % self.noisy.copies
        if number in self._stored:
            return self._stored[number]
        features, theta = self.noisy(epoch)
        pair = self.reduction(features, theta)
        if self.noisy.copies * pair[0].shape[1] <= features.shape[1]:
            self._stored[number] = pair
        return pair


class FreshEpochs:
    """FRFs of new samples, made while the regressor is trained with those of the epoch before.

    Each epoch after the first replaces one of `reuse` segments of the rows. The rows of the others are drawn from all
    samples that their place has had, so that the first epoch's rows, of which a regressor holds some back for its
    validation, are at their own place or nowhere.

    Parameters
    ----------
    noisy : NoisyFeatures
        Of fresh samples.
    reduction : Reduction
    first : Pair
        Of the first epoch.
    """

    def __init__(self, noisy: NoisyFeatures, reduction: Reduction, first: Pair) -> None:
        self._noisy, self._reduction = noisy, reduction
        reuse = min(noisy.reuse, len(first[0]))
        bounds = np.linspace(0, len(first[0]), reuse + 1).astype(int).tolist()
        self._segments = [slice(start, stop) for start, stop in itertools.pairwise(bounds)]
        most = max(int(_MOST_BYTES / first[0].nbytes), 1) if reuse > 1 else 1
        self._kept = [deque([(first[0][rows], first[1][rows])], maxlen=most) for rows in self._segments]
        self._epoch = 0
        self._maker = ThreadPoolExecutor(1)
        self._next: Future[Pair] | None = None

    @contextmanager
    def running(self) -> Iterator[FreshEpochs]:
        """Make samples as long as they may be asked for."""
        try:
            yield self
        finally:
            self._maker.shutdown(cancel_futures=True)

    def __call__(self, epoch: int) -> Pair:
        """Return features and targets of an epoch, which is the last one that was asked for or a later one."""
        while self._epoch < epoch:
            made = (self._next or self._order()).result()
            self._kept[self._epoch % len(self._segments)].append(made)
            self._epoch += 1
            self._next = self._order()
        if self._next is None:
            self._next = self._order()
        generator = np.random.default_rng([self._noisy.seed, _CHOICE_STREAM, epoch])
        drawn = [_draw(kept, generator) for kept in self._kept]
        features, targets = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
        return features, targets

    def _order(self) -> Future[Pair]:
        rows = self._segments[self._epoch % len(self._segments)]
        return self._maker.submit(self._make, self._epoch + 1, rows.stop - rows.start)

    def _make(self, epoch: int, count: int) -> Pair:
        return self._reduction(*self._noisy(epoch, count))


def _draw(kept: deque[Pair], generator: np.random.Generator) -> Pair:
    """Draw for each row one of the samples that its place has had."""
    features, targets = kept[0][0].copy(), kept[0][1].copy()
    chosen = generator.integers(len(kept), size=len(features))
    for number in range(1, len(kept)):
        rows = chosen == number
        features[rows], targets[rows] = kept[number][0][rows], kept[number][1][rows]
    return features, targets
