"""A sequential test for changes: how unlike its prediction a file is, as evidence with a specified false-alarm rate.

The statistic of a file is studentised: its deviation from the prediction is compared with what is usual, which the
deviations of earlier files show: their mean, their covariance, and how each depends on the one before. A wrong model, a
wrong noise level, a steady drift, or a filter whose steps are not those of the parameters change only these. Deviations
that are normal given the one before have a statistic with an F distribution, independent of those of earlier files.

The evidence of a file is the likelihood ratio of deviations that are `scale` times as large. Its expectation is 1 as
long as nothing changes. The Shiryaev-Roberts sum of the products of all runs of such ratios that end with the present
file grows by 1 a file on average, and so takes on average at least `1 / rate` files to reach `1 / rate`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

SCALES = (1.5, 3.0, 10.0, 100.0)
"""Variance ratios of the alternatives, from a slight to a gross change. They are averaged, and each is valid."""
_LARGEST_LOG = 200.0
"""Logarithm at which evidence is cut off."""


@dataclass(frozen=True)
class Settings:
    """How deviations are compared with earlier ones; chosen on simulated clamped rods and random structures."""

    memory: float = 150.0
    """Files over which the weight of a deviation falls to 1/e: the usual deviations change as parameters move."""
    dependence: float = 0.2
    """Standard deviation of the prior of the regression on the deviation before, of standardised deviations."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class UsualDeviations:
    """The deviations (d,) of earlier files: a linear regression of each on the one before.

    Parameters
    ----------
    centre : (d,) array
        Mean of the first files.
    root : (d, d) array
        Lower triangle by which deviations are standardised: the Cholesky factor of the covariance of the first files.
    count : float
        Number of files, each by its weight.
    sums : (1 + 2 d, 1 + 2 d) array
        Weighted sums of the products of 1, the deviation before, and the deviation.
    last : (d,) array
        Standardised deviation of the last file; 0 if the next one follows a change.

    Notes
    -----
    The coefficients of the regression have a normal prior about 0, the mean and the covariance have none: the
    prediction is Student's distribution of a regression with conjugate priors (C. M. Bishop, Pattern Recognition and
    Machine Learning, 2006, section 3.3).
    """

    centre: Array
    root: Array
    count: float
    sums: Array
    last: Array

    @staticmethod
    def of(deviations: Array) -> UsualDeviations:
        """Return those of the first files (n, d), of which there must be more than d."""
        size = deviations.shape[1]
        covariance = np.atleast_2d(np.cov(deviations.T))
        root = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        sums = np.zeros((1 + 2 * size, 1 + 2 * size))
        usual = UsualDeviations(deviations.mean(axis=0), root, 0.0, sums, np.zeros(size))
        for deviation in deviations:
            usual = usual.with_file(deviation)
        return usual

    def with_file(self, deviation: Array) -> UsualDeviations:
        """Return the deviations with one more file."""
        standard, weight = self._standardised(deviation), 1.0 - 1.0 / _SETTINGS.memory
        row = np.concatenate([[1.0], self.last, standard])
        sums = weight * self.sums + np.outer(row, row)
        return replace(self, count=weight * self.count + 1.0, sums=sums, last=standard)

    def after_change(self) -> UsualDeviations:
        """Return the deviations for a file that does not depend on the one before."""
        return replace(self, last=np.zeros_like(self.last))

    def studentise(self, deviation: Array) -> tuple[float, int, float]:
        """Return the F statistic of a file, and its degrees of freedom."""
        size, below = len(deviation), self.count - len(deviation)
        mean, scatter = self._forecast()
        difference = self._standardised(deviation) - mean
        square = float(difference @ scipy.linalg.solve(scatter, difference, assume_a="pos"))
        return square * below / size, size, below

    def deviation_of_last(self, deviation: Array) -> float:
        """Return by how many standard deviations the last of a file's values deviates from what is usual."""
        mean, scatter = self._forecast()
        difference = self.root[-1] @ (self._standardised(deviation) - mean)
        return float(difference / np.sqrt(self.root[-1] @ scatter @ self.root[-1] / max(self.count - 1.0, 1.0)))

    def _standardised(self, deviation: Array) -> Array:
        return np.asarray(scipy.linalg.solve_triangular(self.root, deviation - self.centre, lower=True))

    def _forecast(self) -> tuple[Array, Array]:
        """Return the mean (d,) of the next deviation, and the scatter (d, d) with the uncertainty of that mean."""
        known = 1 + len(self.last)
        prior = np.full(known, _SETTINGS.dependence**-2)
        prior[0] = 0.0
        gram, cross = self.sums[:known, :known] + np.diag(prior), self.sums[:known, known:]
        given = np.append(1.0, self.last)
        solved = scipy.linalg.solve(gram, np.column_stack([cross, given]), assume_a="pos")
        coefficients, spread = solved[:, :-1], 1.0 + float(given @ solved[:, -1])
        return given @ coefficients, (self.sums[known:, known:] - cross.T @ coefficients) * spread


def file_probability(statistic: float, above: int, below: float) -> float:
    """Return the probability of so large an F statistic if nothing has changed."""
    return float(scipy.special.fdtrc(above, below, statistic))


def log_evidence(statistic: float, above: int, below: float) -> Array:
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
