"""Points that fill a cube more evenly than independent random ones, as by `scipy.stats.qmc`.

Its module takes a second of processor time to load, in every process that begins a fit or a dataset.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray


def latin_hypercube(count: int, size: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return random points (count, size) in the unit cube, one in each of `count` slices of every coordinate.

    As by `scipy.stats.qmc.LatinHypercube`, which draws from a spawned generator.
    """
    within = random.uniform(size=(count, size))
    slices = np.tile(np.arange(1, count + 1), (size, 1))
    for fractions in slices:
        random.shuffle(fractions)
    return np.asarray((slices.T - within) / count)


def halton(count: int, size: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return points (count, size) of a randomised Halton sequence in the unit cube.

    As by `scipy.stats.qmc.Halton`, likewise.

    References
    ----------
    A. B. Owen, A randomized Halton algorithm in R (2017), arXiv:1706.02808.
    """
    return np.stack([_van_der_corput(count, base, random) for base in itertools.islice(_primes(), size)], axis=1)


def _van_der_corput(count: int, base: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return numbers (count,) from 0 to 1 with the digits of 0, 1, 2, ... in reverse order, permuted, to 54 bits."""
    points, numbers = np.zeros(count), np.arange(count)
    for place in range(1, math.ceil(54 / math.log2(base))):
        digits = np.arange(base)
        random.shuffle(digits)
        points += digits[numbers % base] * float(base) ** -place
        numbers //= base
    return points


def _primes() -> Iterator[int]:
    return (number for number in itertools.count(2) if all(number % n for n in range(2, math.isqrt(number) + 1)))
