"""The training data of the regressor, epoch by epoch: `ReducedEpochs` of a dataset, `FreshEpochs` of new samples."""

from __future__ import annotations

import itertools
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Self

import numpy as np

from dovetail.errors import Fault, PluginError
from dovetail.network.augmentation import NoisyFeatures
from dovetail.network.pipeline import Pair, Reduction

_CHOICE_STREAM = 4
"""Separates the choice among samples from other random numbers with the same seed."""

_MOST_BYTES = 1e9
"""Memory [bytes] of the features that are kept to be drawn again."""


class ReducedEpochs:
    """The dataset's FRFs, with new noise in every epoch.

    Use it as a context, at whose end no epoch is computed any more.

    Parameters
    ----------
    noisy : NoisyFeatures
    reduction : Reduction
    first : Pair
        Features and targets of the first epoch.

    Notes
    -----
    If the reduced features of `copies` epochs take no more memory than the FRFs of one, so many epochs are stored and
    used in turn; each is computed while the regressor is trained with the one before. Otherwise each epoch is computed
    when it is needed.
    """

    def __init__(self, noisy: NoisyFeatures, reduction: Reduction, first: Pair) -> None:
        self._noisy, self._reduction = noisy, reduction
        self._is_stored = noisy.copies * first[0].shape[1] <= noisy.clean.shape[1]
        self._pool, done = ThreadPoolExecutor(1), Future[Pair]()
        done.set_result(first)
        self._pairs = {0: done}
        self._begin_after(0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def __call__(self, epoch: int) -> Pair:
        """Return features and targets."""
        if not self._is_stored:
            known = self._pairs.pop(epoch, None)
            return self._computed(epoch) if known is None else known.result()
        number = epoch % self._noisy.copies
        pair = self._begun(number).result()
        self._begin_after(number)
        return pair

    def _begin_after(self, number: int) -> None:
        if self._is_stored and number + 1 < self._noisy.copies:
            self._begun(number + 1)

    def _begun(self, number: int) -> Future[Pair]:
        if number not in self._pairs:
            self._pairs[number] = self._pool.submit(self._computed, number)
        return self._pairs[number]

    def _computed(self, epoch: int) -> Pair:
        return self._reduction(*self._noisy(epoch))


class FreshEpochs:
    """FRFs of new samples, computed on demand, because training and computation both use all cores.

    Each epoch after the first replaces one of `reuse` segments of the rows. The rows of the other segments are drawn
    from all samples that these rows have had. A row of the first epoch therefore never moves to another row, and a
    regressor may reserve some rows for validation.

    Parameters
    ----------
    noisy : NoisyFeatures
        Draws fresh samples.
    reduction : Reduction
    first : Pair
        Features and targets of the first epoch.
    """

    def __init__(self, noisy: NoisyFeatures, reduction: Reduction, first: Pair) -> None:
        self._noisy, self._reduction = noisy, reduction
        reuse = min(noisy.reuse, len(first[0]))
        bounds = np.linspace(0, len(first[0]), reuse + 1).astype(int).tolist()
        self._segments = [slice(start, stop) for start, stop in itertools.pairwise(bounds)]
        most = max(int(_MOST_BYTES / first[0].nbytes), 1) if reuse > 1 else 1
        self._kept = [deque([(first[0][rows], first[1][rows])], maxlen=most) for rows in self._segments]
        self._epoch = 0

    def __call__(self, epoch: int) -> Pair:
        """Return features and targets of an epoch, which must not precede the last requested one."""
        if epoch < self._epoch:
            problem = f"fit_epochs requested the epoch {epoch} after {self._epoch}, but earlier samples are not kept."
            raise PluginError(Fault("", problem, remedy="Request epochs in order."))
        while self._epoch < epoch:
            number = self._epoch % len(self._segments)
            self._epoch += 1
            rows = self._segments[number]
            self._kept[number].append(self._reduction(*self._noisy(self._epoch, rows.stop - rows.start)))
        generator = np.random.default_rng([self._noisy.seed, _CHOICE_STREAM, epoch])
        drawn = [_draw(kept, generator) for kept in self._kept]
        features, targets = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
        return features, targets


def _draw(kept: deque[Pair], generator: np.random.Generator) -> Pair:
    """Draw for each row one of the samples that it has had."""
    features, targets = kept[0][0].copy(), kept[0][1].copy()
    chosen = generator.integers(len(kept), size=len(features))
    for number in range(1, len(kept)):
        rows = chosen == number
        features[rows], targets[rows] = kept[number][0][rows], kept[number][1][rows]
    return features, targets
