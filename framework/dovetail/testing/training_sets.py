"""Training samples with which the kit fits reducers and regressors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import FeatureContext, fit_in_context

_FIRST_LINE, _LAST_LINE = 50.0, 1000.0
"""Hz."""
_LINES = 120
"""Number of lines in a regressor's context."""


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """Features, and the targets from which they were computed.

    Parameters
    ----------
    features : (n_samples, n_features) float32 array
    targets : (n_samples, n_targets) array
        From 0 to 1.
    """

    features: NDArray[np.float32]
    targets: NDArray[np.float64]

    def copy(self) -> TrainingSet:
        """Return the same numbers in new, writeable arrays in C order."""
        return TrainingSet(np.array(self.features, order="C"), np.array(self.targets, order="C"))

    def scaled(self, factor: float) -> TrainingSet:
        """Return the samples with features multiplied by `factor`."""
        return TrainingSet(np.asarray(factor * self.features, dtype=np.float32), self.targets.copy())


def frf_samples(samples: int, *, lines: int, seed: int) -> TrainingSet:
    """Return features as a reducer gets them: log10(A + 1) of oscillators with random frequency and damping.

    Parameters
    ----------
    samples, lines : int
    seed : int
        Of the two unknowns of each sample.
    """
    unknown = np.random.default_rng(seed).random((samples, 2))
    natural, damping = 300.0 + 400.0 * unknown[:, :1], 0.01 + 0.05 * unknown[:, 1:]
    ratio = np.linspace(_FIRST_LINE, _LAST_LINE, lines)[None, :] / natural
    accelerance = ratio**2 / np.hypot(1.0 - ratio**2, 2.0 * damping * ratio)
    return TrainingSet(np.asarray(np.log10(accelerance + 1.0), dtype=np.float32), _scaled(unknown))


def fit(component: Any, samples: TrainingSet, seed: int) -> Any:
    """Fit a reducer or a regressor, with the context of the samples if it takes one."""
    is_reducer = component.kind == "reducer"
    lines = samples.features.shape[1] if is_reducer else _LINES
    names = tuple(f"unknown{number}" for number in range(samples.targets.shape[1]))
    context = FeatureContext(np.linspace(_FIRST_LINE, _LAST_LINE, lines), ("response",), names)
    arrays = (samples.features,) if is_reducer else (samples.features, samples.targets)
    return fit_in_context(component.fit, *arrays, context=context, seed=seed)


def regression_samples(samples: int, *, features: int, targets: int, seed: int) -> TrainingSet:
    """Return features and targets as a regressor gets them: smooth functions of the targets, standardised.

    Parameters
    ----------
    samples, features, targets : int
    seed : int
        Of the targets; the functions are always the same, so that samples with another seed test what was learned.
    """
    unknown = np.random.default_rng(seed).random((samples, targets))
    generator = np.random.default_rng(features + 100 * targets)
    if targets > features:  # what the features do not show is the mean of all targets: R2 of each is less than 1
        columns = np.column_stack([np.ones(targets), generator.standard_normal((targets, features))])
        mixing = np.linalg.qr(columns)[0][:, 1:]
    else:
        mixing = np.linalg.qr(generator.standard_normal((features, targets)))[0].T
    values = np.tanh((2.0 * unknown - 1.0) @ mixing)
    expected = np.tanh((2.0 * np.random.default_rng(0).random((1000, targets)) - 1.0) @ mixing)
    standardised = (values - expected.mean(axis=0)) / expected.std(axis=0)
    return TrainingSet(np.asarray(standardised, dtype=np.float32), unknown)


def _scaled(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
    least, greatest = unknown.min(axis=0), unknown.max(axis=0)
    scaled: NDArray[np.float64] = (unknown - least) / (greatest - least)
    return scaled
