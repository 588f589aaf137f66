"""A sequential test for changes: how unlike its prediction a file is, as evidence with a specified false-alarm rate.

The statistic of a file is studentised: its deviation from the prediction is compared with the mean and the covariance
of the deviations of earlier files. If deviations are independent and normal, whatever their mean and covariance, it
has an F distribution, and is independent of the statistics of earlier files. A wrong model, a wrong noise level or a
steady drift change the mean and the covariance only.

The evidence of a file is the likelihood ratio of deviations that are `scale` times as large. Its expectation is 1 as
long as nothing changes. The Shiryaev-Roberts sum of the products of all runs of such ratios that end with the present
file grows by 1 a file on average, and so takes on average at least `1 / rate` files to reach `1 / rate`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

SCALES = (1.5, 3.0, 10.0, 100.0)
"""Variance ratios of the alternatives, from a slight to a gross change. They are averaged, and each is valid."""
_LARGEST_LOG = 200.0
"""Logarithm at which evidence is cut off."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Number, mean and scatter matrix of the deviations (d,) of earlier files."""

    count: int
    mean: Array
    scatter: Array

    @staticmethod
    def none(size: int) -> Moments:
        """Return the moments of no files."""
        return Moments(0, np.zeros(size), np.zeros((size, size)))

    def with_file(self, deviation: Array) -> Moments:
        """Return the moments with one more file."""
        count = self.count + 1
        before = deviation - self.mean
        mean = self.mean + before / count
        return Moments(count, mean, self.scatter + np.outer(before, deviation - mean))

    def studentise(self, deviation: Array) -> tuple[float, int, int]:
        """Return the F statistic of a file, and its degrees of freedom."""
        size, count = len(deviation), self.count
        before = deviation - self.mean
        square = float(before @ scipy.linalg.solve(self.scatter, before, assume_a="pos"))  # T^2 / (count - 1)
        below = count - size
        return square * count / (count + 1.0) * below / size, size, below


def file_probability(statistic: float, above: int, below: int) -> float:
    """Return the probability of so large an F statistic if nothing has changed."""
    return float(scipy.special.fdtrc(above, below, statistic))


def log_evidence(statistic: float, above: int, below: int) -> Array:
    """Return the logarithms of the likelihood ratios of all `SCALES` at an F statistic."""
    ratio = above / below
    scales = np.array(SCALES)
    power = 0.5 * (above + below)
    # the density of F is proportional to F^(above/2 - 1) (1 + ratio F)^-power
    return np.asarray(
        -0.5 * above * np.log(scales) + power * (np.log1p(ratio * statistic) - np.log1p(ratio * statistic / scales))
    )


@dataclass(frozen=True, eq=False)
class Detector:
    """The Shiryaev-Roberts sums of the evidence, one for each of `SCALES`.

    Parameters
    ----------
    sums : (k,) array
    """

    sums: Array

    @staticmethod
    def new() -> Detector:
        """Return a detector before the first file."""
        return Detector(np.zeros(len(SCALES)))

    def with_file(self, logarithms: Array) -> Detector:
        """Return the detector after a file with the log evidence (k,)."""
        logs = np.minimum(np.log1p(self.sums) + logarithms, _LARGEST_LOG)
        return Detector(np.exp(logs))

    @property
    def evidence(self) -> float:
        """The mean of the sums; an alarm is raised at 1 over the false-alarm rate."""
        return float(np.mean(self.sums))
