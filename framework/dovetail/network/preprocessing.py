"""FRFs of training and test, their features, and the scaling of features and targets, fitted to training data only.

The equations are those of Processes 14 (2026) 1875, doi:10.3390/pr14121875: features Eq. 12, z-score Eq. 13, targets
Eq. 14.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.dataset import Dataset, complex_accelerance
from dovetail.errors import DatasetError, Fault
from dovetail.interfaces import Parameter, Progress

_SPLIT_STREAM = 1
"""Separates the random numbers of the split from those of the samples, which have the same seed."""

_FEWEST_SAMPLES = 2
"""Smallest size of either part, for a standard deviation to exist."""

BLOCK_ROWS = 2048
"""Rows handled at a time: 50,000 FRFs are never copied to double precision as a whole."""


def blocks(rows: int) -> Iterator[slice]:
    """Cut `rows` rows into slices small enough to work on."""
    for start in range(0, rows, BLOCK_ROWS):
        yield slice(start, min(start + BLOCK_ROWS, rows))


def accelerances(assembly: Assembly, theta: NDArray[np.float64], *, phase: bool) -> NDArray[np.number]:
    """Return accelerances (n, n_responses n_freq) of an assembly, complex if phases are needed, or their amplitudes."""
    return complex_accelerance(assembly, theta) if phase else assembly.accelerance_amplitude(theta)


def log10p1(amplitude: NDArray[np.floating], out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Return log10(x + 1) of the accelerance's amplitude, in single precision (Eq. 12).

    Parameters
    ----------
    amplitude : (..., n_freq) array
        m/(N s^2), not negative.
    out : (..., n_freq) float32 array, optional
        Where to write the features; `amplitude` itself, if it is single precision.

    Returns
    -------
    (..., n_freq) float32 array
    """
    features = np.asarray(np.log1p(amplitude, out=out, dtype=np.float32), dtype=np.float32)
    features *= np.float32(1.0 / np.log(10.0))
    return features


@dataclass(frozen=True, eq=False)
class ZScore:
    """Mean 0 and standard deviation 1, column by column (Eq. 13).

    Parameters
    ----------
    mean, deviation : (n_features,) arrays
        Of the training features. The deviation of a column that does not vary is 1, so that it stays finite.
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]

    @classmethod
    def fit(cls, features: NDArray[np.float32]) -> Self:
        """Take mean and standard deviation from training features (n_samples, n_features)."""
        count, width = features.shape
        mean, variance = np.zeros(width), np.zeros(width)
        for rows in blocks(count):
            mean += features[rows].sum(axis=0, dtype=np.float64) / count
        for rows in blocks(count):
            variance += ((features[rows] - mean) ** 2).sum(axis=0) / count
        deviation = np.sqrt(variance)
        precision = features.dtype if features.dtype.kind == "f" else np.dtype(np.float64)
        rounding = 4.0 * np.finfo(precision).eps * np.abs(mean)
        return cls(mean, np.where(deviation > rounding, deviation, 1.0))

    def transform(self, features: NDArray[np.float32], out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Standardise features (n_samples, n_features), into `out` (which may be `features`) if it is given."""
        scaled = np.empty(features.shape, dtype=np.float32) if out is None else out
        for rows in blocks(len(features)):
            scaled[rows] = (features[rows] - self.mean) / self.deviation
        return scaled

    def state(self) -> dict[str, NDArray[np.generic]]:
        """Return the arrays that `restore` needs."""
        return {"mean": self.mean, "deviation": self.deviation}

    @classmethod
    def restore(cls, state: Mapping[str, NDArray[np.generic]]) -> Self:
        """Rebuild the object from its `state`.

        Raises
        ------
        ValueError
            The arrays are inconsistent.
        """
        mean, deviation = _doubles(state, "mean", "deviation")
        if not np.all(deviation > 0):
            raise ValueError("a standard deviation is not positive.")
        return cls(mean, deviation)


@dataclass(frozen=True, eq=False)
class TargetScaling:
    """Parameter values to 0..1 over the training targets, on each parameter's scale (Eq. 14).

    Parameters
    ----------
    lower, upper : (n_params,) arrays
        Least and greatest training target: the value, or its natural logarithm for a logarithmic parameter.
    logarithmic : (n_params,) bool array
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    logarithmic: NDArray[np.bool_]

    @classmethod
    def fit(cls, theta: NDArray[np.float64], parameters: Sequence[Parameter]) -> Self:
        """Take the extremes of training targets `theta` (n_samples, n_params), in SI units."""
        logarithmic = np.array([parameter.scale == "log" for parameter in parameters])
        on_scale = _on_scale(theta, logarithmic)
        lower, upper = on_scale.min(axis=0), on_scale.max(axis=0)
        return cls(lower, np.where(upper > lower, upper, lower + 1.0), logarithmic)

    def transform(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map SI values (n_samples, n_params) to targets of the regressor."""
        return (_on_scale(theta, self.logarithmic) - self.lower) / (self.upper - self.lower)

    def inverse(self, targets: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map the regressor's predictions (n_samples, n_params) to SI values."""
        theta = self.lower + np.asarray(targets, dtype=np.float64) * (self.upper - self.lower)
        with np.errstate(over="ignore"):
            theta[:, self.logarithmic] = np.exp(theta[:, self.logarithmic])
        return theta

    def slope(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of SI values (n_samples, n_params) by the targets."""
        return (self.upper - self.lower) * np.where(self.logarithmic, theta, 1.0)

    def state(self) -> dict[str, NDArray[np.generic]]:
        """Return the arrays that `restore` needs."""
        return {"lower": self.lower, "upper": self.upper, "logarithmic": self.logarithmic}

    @classmethod
    def restore(cls, state: Mapping[str, NDArray[np.generic]]) -> Self:
        """Rebuild the object from its `state`.

        Raises
        ------
        ValueError
            The arrays are inconsistent.
        """
        lower, upper = _doubles(state, "lower", "upper")
        logarithmic = np.asarray(state["logarithmic"], dtype=np.bool_)
        if logarithmic.shape != lower.shape or not np.all(upper > lower):
            raise ValueError("the extremes of the targets are inconsistent.")
        return cls(lower, upper, logarithmic)


def _on_scale(theta: NDArray[np.float64], logarithmic: NDArray[np.bool_]) -> NDArray[np.float64]:
    on_scale = np.array(theta, dtype=np.float64)
    on_scale[:, logarithmic] = np.log(on_scale[:, logarithmic])
    return on_scale


def _doubles(
    state: Mapping[str, NDArray[np.generic]], first: str, second: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two vectors of a state that must have one length and finite numbers."""
    a, b = (np.asarray(state[name], dtype=np.float64) for name in (first, second))
    if a.ndim != 1 or a.shape != b.shape:
        raise ValueError(f"'{first}' and '{second}' have the shapes {a.shape} and {b.shape}.")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError(f"'{first}' or '{second}' is not finite.")
    return a, b


def draw_test_samples(samples: int, test_fraction: float, seed: int) -> NDArray[np.bool_]:
    """Draw the test part.

    Returns
    -------
    (samples,) bool array
        True for the samples of the test part, a fraction `test_fraction` of all.

    Raises
    ------
    DatasetError
        One of the two parts would be too small.
    """
    test_samples = round(test_fraction * samples)
    if min(test_samples, samples - test_samples) < _FEWEST_SAMPLES:
        problem = f"{samples} samples leave {samples - test_samples} for training and {test_samples} for the test."
        remedy = "Generate more samples, or change 'identification.test_fraction'."
        raise DatasetError(Fault("", problem, f"at least {_FEWEST_SAMPLES} of each", remedy))
    order = np.random.default_rng([seed, _SPLIT_STREAM]).permutation(samples)
    is_test = np.zeros(samples, dtype=np.bool_)
    is_test[order[:test_samples]] = True
    return is_test


def read_frfs(
    dataset: Dataset, selected: NDArray[np.bool_], progress: Progress, *, phase: bool = False
) -> NDArray[Any]:
    """Read the FRFs of some samples.

    Parameters
    ----------
    dataset : Dataset
    selected : (n_samples,) bool array
    progress : callable
    phase : bool
        Read them with their phases.

    Returns
    -------
    (n, n_responses n_freq) array
        float32 amplitudes, or complex64 [m/(N s^2)].

    Raises
    ------
    DatasetError
        An FRF is not finite, a chunk is damaged, or the phases are not stored.
    """
    stored, dtype = (dataset.accelerance, np.complex64) if phase else (dataset.amplitude, np.float32)
    frfs = np.empty((np.count_nonzero(selected), dataset.amplitude.shape[1]), dtype=dtype)
    count = 0
    for rows in blocks(len(dataset)):
        block = np.asarray(stored[rows], dtype=dtype)
        if not np.isfinite(block).all():
            raise DatasetError(f"the dataset has amplitudes that are not finite in samples {rows.start}-{rows.stop}.")
        block = block[selected[rows]]
        frfs[count : count + len(block)] = block
        count += len(block)
        progress("features", rows.stop, len(dataset))
    return frfs
