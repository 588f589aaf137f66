"""Dynamic stiffness that a joint gives at real frequencies, continued to complex ones, where damped poles lie."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError

_REACHES = (8.0, 1.6)
"""Factors from the middle of the sampled frequencies to their ends; the second if the joint cannot be evaluated or is
not smooth within the first."""
_SAMPLES = 121
"""Frequencies at which a law is evaluated for its rational function."""
_TOLERANCE = 1e-13
"""Error of the rational functions at the samples, relative to the largest value of an entry."""
_MOST_TERMS = 20
"""A power of frequency takes 13, a Zener model 2. A kink takes more, and its continuation has no meaning."""
_STEP = 1.5
"""Ratio of successive middles: each complex frequency is nearest to one."""

_Rational: TypeAlias = tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128]]
"""Supports [Hz], weights, and values at the supports."""


class ContinuedStiffness:
    """A stack of functions of frequency, known at real frequencies, as rational functions of s = 2 pi i f.

    Parameters
    ----------
    evaluate : callable
        Returns the values (n_freq, ...) at real frequencies (n_freq,) [Hz].
    label : str
        Names the joint in an error.
    tolerance : float
        Error of the rational functions at the samples, relative to the largest value of an entry.

    Notes
    -----
    Values at logarithmically spaced frequencies around |s| / 2 pi determine a rational function by the AAA algorithm
    (Nakatsukasa, Sete, Trefethen, SIAM J. Sci. Comput. 40 (2018) A1494), with supports and weights that all entries
    share (Lietaert, Meerbergen, Perez, Vandereycken, IMA J. Numer. Anal. 42 (2022) 1087). A rational law of frequency
    is continued exactly, up to rounding, a power of frequency with an error below 1e-9.
    """

    def __init__(
        self,
        evaluate: Callable[[NDArray[np.float64]], NDArray[np.complex128]],
        label: str,
        tolerance: float = _TOLERANCE,
    ) -> None:
        self._evaluate, self._label, self._tolerance = evaluate, label, tolerance
        self._known: dict[int, _Rational] = {}

    def at(self, s: complex) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the values at s [1/s] and their derivatives by s.

        Raises
        ------
        DovetailError
            The joint cannot be evaluated near this frequency, or is not a smooth function of it.
        """
        number = round(float(np.log(abs(s) / (2.0 * np.pi)) / np.log(_STEP)))
        if number not in self._known:
            self._known[number] = self._approximated(_STEP**number)
        supports, weights, values = self._known[number]
        from_support = s / (2.0j * np.pi) - supports
        nearest = int(np.argmin(np.abs(from_support)))
        if abs(from_support[nearest]) < 1e-12 * supports[nearest]:
            from_support[nearest] = 1e-12 * supports[nearest]  # 0 / 0; the function hardly changes within that
        shares = weights / from_support
        total = shares.sum()
        value = np.tensordot(shares, values, 1) / total
        slope = np.tensordot(-shares / from_support, values - value, 1) / total
        return value, slope / (2.0j * np.pi)

    def _approximated(self, middle: float) -> _Rational:
        """Return supports [Hz], weights and values at the supports of the rational functions around a frequency."""
        failure: Exception | None = None
        for reach in _REACHES:
            frequency = middle * np.geomspace(1.0 / reach, reach, _SAMPLES)
            try:
                values = self._evaluate(frequency)
            except DovetailError as error:
                failure = error
                continue
            approximated = _rational(frequency, values, self._tolerance)
            if approximated is not None:
                return approximated
        about = f"{self._label} near {middle:.3g} Hz"
        if failure is not None:
            raise DovetailError(f"the poles need {about}, where it fails: {failure}") from failure
        raise DovetailError(f"{about} is not a smooth function of frequency, so that poles are not defined.")


def _rational(frequency: NDArray[np.float64], values: NDArray[np.complex128], tolerance: float) -> _Rational | None:
    """Return supports, weights and the values at the supports; None if no rational function of few terms fits."""
    entries = values.reshape(len(frequency), -1)
    largest = np.abs(entries).max(axis=0)
    left, sizes, _ = np.linalg.svd(entries[:, largest > 0.0] / largest[largest > 0.0], full_matrices=False)
    functions = left * sizes
    functions = functions[:, sizes > tolerance * sizes.max(initial=0.0)]  # few: most entries are multiples of others
    fitted, weights = np.zeros_like(functions), np.ones(1, dtype=np.complex128)
    supports: list[int] = []
    while len(supports) <= _MOST_TERMS:
        error = np.abs(functions - fitted).max(axis=1, initial=0.0)
        if supports and error.max() <= tolerance * max(1.0, np.abs(functions).max(initial=0.0)):
            return frequency[supports], weights, values[supports]
        supports.append(int(np.argmax(error)))
        others = np.setdiff1d(np.arange(len(frequency)), supports)
        cauchy = 1.0 / (frequency[others, np.newaxis] - frequency[supports])
        loewner = (functions[others].T[:, :, np.newaxis] - functions[supports].T[:, np.newaxis]) * cauchy
        if functions.size:
            weights = np.linalg.svd(loewner.reshape(-1, len(supports)), full_matrices=False)[2][-1].conj()
        fitted = functions.copy()
        shares = cauchy * weights
        fitted[others] = shares @ functions[supports] / shares.sum(axis=1, keepdims=True)
    return None
