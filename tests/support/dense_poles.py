"""Damped poles of a whole assembly, densely, from the published formulas; no code of Dovetail is used.

With constant matrices they are eigenvalues of the linearised quadratic problem (Tisseur, Meerbergen, SIAM Rev. 43
(2001) 235), each refined by Newton's method on the Rayleigh functional x^T Z(s) x. If joints depend on frequency, the
linearised problems at many frequencies give the starts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
from scipy.linalg import eig
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from support.dense_solve import DenseAssembly, merged_entries
from support.element_formulas import Element

_TURN = 0.02
"""Imaginary part over magnitude of the least oscillating pole."""
_SAME = 1e-7
_MOST = 20
"""Starts that are refined: six poles are compared, and a few are of rigid-body modes; ten times as many in a sweep."""
_ENOUGH = 12
"""Poles of a sweep after which it ends: twice as many as are compared, from starts by increasing magnitude."""
_NEAR_ZERO = 1e-5
"""Magnitude of a pole, over the root of all stiffness over all mass, below which Newton's steps may end anywhere: with
a damper three poles of free bodies meet at zero, where rounding moves each by its cube root, 6e-6."""
_FAR = 1e7
"""Hz; what is beyond it is infinite."""


class _Problem:
    """Z(s) of the DOFs that a mass moves."""

    def __init__(self, dense: DenseAssembly, theta: Sequence[float], *, rigid: bool) -> None:
        self._dense, self._theta = dense, theta
        self._numbers = dense.numbering(rigid=rigid)
        self._axis = dense.frequency
        self._active = np.arange(int(self._numbers.max(initial=-1)) + 1)
        self._constant = self._sums(dense.elements(theta, varying=False))
        (M, *_), magnitudes = self.matrices(100.0)
        _, group = connected_components(coo_array(sum(magnitudes) > 0), directed=False)
        moving = np.diag(M).real > 0
        self._active = np.flatnonzero(np.isin(group, group[moving]))

    def matrices(self, frequency: complex) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """M, K, C and D at a frequency [Hz], which may be complex, and the sums of the terms' magnitudes."""
        totals, magnitudes = self._constant
        if self._dense.depends_on_frequency():
            self._dense.frequency = np.array([frequency])
            varying = self._sums(self._dense.elements(self._theta, constant=False))
            self._dense.frequency = self._axis
            totals, magnitudes = totals + varying[0], magnitudes + varying[1]
        among = np.ix_(self._active, self._active)
        return [matrix[among] for matrix in totals], [matrix[among].real for matrix in magnitudes]

    def _sums(self, elements: Sequence[Element]) -> tuple[np.ndarray, np.ndarray]:
        """M, K, C and D of some elements over all DOFs, and the sums of the terms' magnitudes."""
        size = int(self._numbers.max(initial=-1)) + 1
        totals, magnitudes = np.zeros((2, 4, size, size), dtype=complex)
        for element in elements:
            distinct, L = merged_entries(element, self._numbers)
            where = np.ix_(distinct, distinct)
            for kind, name in enumerate("MKCD"):
                values = np.asarray(getattr(element, name))
                values = values[0] if values.ndim == 3 else np.broadcast_to(values, (len(element.dofs),) * 2)
                totals[kind][where] += L.T @ values @ L
                magnitudes[kind][where] += L.T @ abs(values) @ L
        return totals, magnitudes

    def largest(self) -> float:
        """Magnitude [1/s] that no pole is far above: the root of all stiffness over all mass."""
        (M, K, *_), _ = self.matrices(100.0)
        return float(np.sqrt(np.trace(K).real / np.trace(M).real))

    def at(self, s: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Z, dZ/ds and the sum of the magnitudes of the terms of Z."""
        (M, K, C, D), sizes = self.matrices(s / (2j * np.pi))
        Z, slope = K + 1j * D + s * (C + s * M), C + 2 * s * M
        if self._dense.depends_on_frequency():
            step = 1e-4 * s
            (_, K1, _, D1), (_, K0, _, D0) = (self.matrices((s + h) / (2j * np.pi))[0] for h in (step, -step))
            slope = slope + (K1 - K0 + 1j * (D1 - D0)) / (2 * step)
        return Z, slope, sizes[1] + sizes[3] + abs(s) * (sizes[2] + abs(s) * sizes[0])


def damped_poles(dense: DenseAssembly, theta: Sequence[float], *, rigid: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Poles [1/s] with positive imaginary parts, and their change by relative changes of one in the elements."""
    problem = _Problem(dense, theta, rigid=rigid)
    poles: list[complex] = []
    rounding: list[float] = []
    sweep = dense.depends_on_frequency()  # in which every pole comes several times
    for s, x in islice(sorted(_starts(problem, sweep), key=lambda start: abs(start[0])), _MOST * (1 + 9 * sweep)):
        if sweep and len(poles) == _ENOUGH:
            break
        if sweep and (abs(np.array(poles) - s) < 1e-3 * abs(s)).any():
            continue
        s, moved = _refined(problem, s, x)
        known = np.array(poles) if sweep else np.empty(0)
        if s.imag > _TURN * abs(s) and not (abs(known - s) < _SAME * abs(s) + 10 * np.finfo(float).eps * moved).any():
            poles.append(s)
            rounding.append(np.inf if sweep and abs(s) < _NEAR_ZERO * problem.largest() else moved)
    order = np.argsort(np.abs(poles))
    return np.array(poles, dtype=complex)[order], np.array(rounding)[order]


def _starts(problem: _Problem, depends: bool) -> Iterator[tuple[complex, np.ndarray]]:
    for frequency in np.geomspace(3.0, 3e5, 11) if depends else [100.0]:
        (M, K, C, D), _ = problem.matrices(frequency)
        if not len(M):
            continue
        own, w = [np.diag(matrix) for matrix in (M, K, C)], 2 * np.pi * 100.0
        scale = 1 / np.sqrt(abs(own[1]) + w * abs(own[2]) + w**2 * abs(own[0]))
        M, K, C, D = (matrix * scale[:, np.newaxis] * scale for matrix in (M, K, C, D))
        zero, one = np.zeros(M.shape), np.eye(len(M))
        w = 1e-2 * np.sqrt(np.linalg.norm(K) / np.linalg.norm(M))
        left = np.block([[zero, one], [-(K + 1j * D), -w * C]])
        right = np.block([[one, zero], [zero, w**2 * M]])
        alpha, vectors = eig(right, left)  # reciprocal, so that the lowest poles are the largest eigenvalues
        with np.errstate(divide="ignore", invalid="ignore"):
            poles = w / alpha
        for s, x in zip(poles, vectors[: len(M)].T, strict=True):
            if np.isfinite(s) and abs(s) < 2 * np.pi * _FAR and s.imag > 0.5 * _TURN * abs(s):
                yield s, x * scale


def _refined(problem: _Problem, s: complex, x: np.ndarray) -> tuple[complex, float]:
    """A pole and its change by relative changes of one in the elements, after a few steps."""
    x = x / np.linalg.norm(x)
    for _ in range(8):
        Z, slope, magnitude = problem.at(s)
        turned = slope @ x
        change = (x @ (Z @ x)) / (x @ turned)
        s = s - change
        if not np.isfinite(s) or abs(change) < 1e-13 * abs(s):
            break
        scale = 1 / np.sqrt(np.diag(magnitude))
        Z = problem.at(s)[0] * scale[:, np.newaxis] * scale
        try:
            x = scale * np.linalg.solve(Z, scale * turned)
        except np.linalg.LinAlgError:
            break
        x = x / np.linalg.norm(x)
    if not abs(change) < 1e-6 * abs(s):  # of a rigid-body mode, towards zero
        return complex(0.0), np.inf
    _, slope, magnitude = problem.at(s)
    return s, float(abs(x) @ magnitude @ abs(x) / abs(x @ slope @ x))
