"""Poles of Z(s) = A + s C + s^2 M + frequency-dependent joints, of one parameter vector."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.synthesis.frequency_laws import ContinuedStiffness
from dovetail.synthesis.graph import connected_with
from dovetail.synthesis.sparse_condensation import extended_basis

LEAST_TURN = 0.02
"""Imaginary part of a pole over its magnitude below which it is overdamped: a damping ratio above 0.9998. With
structural damping the poles of an overdamped motion are not exactly real: a loss factor of 0.05 gives 0.0125."""
_STRAIN_FLOOR = 1e-13
"""As for undamped modes; see `natural_frequencies`."""
_DOUBTFUL = 1e-9
"""The same, below which a shape may be that of a rigid-body mode with errors of the eigenvector."""
_NEAR_ZERO = 1e-5
"""Magnitude of a pole, over the root of all stiffness over all mass, below which the same holds: a double zero has
errors of the root of rounding, 1e-8, and a free mass has a shape with nothing but the strain of rounding."""
_CONVERGED = 1e-6
"""Relative change of a pole in the last step; convergence is cubic, so that another step would change nothing."""
_MOST_ITERATIONS = 12
"""Steps after which a pole counts as not found."""
_SAME_POLE = 1e-7
"""Relative difference below which two poles are the same."""
_ACCURATE = 1e-11
"""Estimated relative error of the poles from a basis, at which it is large enough."""
_MOST_VECTORS = 500
"""Size of the basis at which the search is given up; solving it takes seconds."""
_RIGID_BODY_MODES, _RIGID_STIFFNESS = 12, 100.0
"""Number of rigid-body modes of a large structure, which are computed too, at most, and frequency [Hz] at which the
stiffness of frequency-dependent joints shows which those are."""
_INDEPENDENT = 1e-8
"""Smallest part of a vector outside the basis, relative to its length, with which it is added to the basis."""
_EXPANSIONS = 1.5
"""Ratio of successive frequencies around which frequency-dependent joints are replaced by quadratic polynomials."""
_FARTHEST = 10.0
"""Ratio of the magnitudes of a pole and of the start of its iteration above which the iteration is given up."""


def placed(L: Any, value: NDArray[Any]) -> Any:
    """Return a joint's matrix (j, j) at its DOFs L (j, d) among all, sparse if L is."""
    return L.T @ (scipy.sparse.csc_array(value) @ L) if scipy.sparse.issparse(L) else L.T @ value @ L


@dataclass(frozen=True)
class Wanted:
    """Which poles are computed: the lowest ones by magnitude, of those that are not overdamped.

    Parameters
    ----------
    count : int
    highest : float
        Hz; of the modes above it, only the first is computed.
    least_turn : float
        Imaginary part over magnitude below which a pole is overdamped.
    sweep : (float, float)
        Hz; between which poles lie if joints depend on frequency.
    """

    count: int
    highest: float = np.inf
    least_turn: float = LEAST_TURN
    sweep: tuple[float, float] = (0.0, np.inf)

    def lowest(self, poles: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return the indices of the wanted ones among some poles, by increasing magnitude."""
        order = np.argsort(np.abs(poles))[: self.count]
        return order[: 1 + np.count_nonzero(np.abs(poles[order]) <= 2.0 * np.pi * self.highest)]

    def complete(self, poles: NDArray[np.complex128]) -> bool:
        """Return whether some poles, all those below a frequency, include all wanted ones."""
        return len(poles) >= self.count or bool((np.abs(poles) > 2.0 * np.pi * self.highest).any())


@dataclass(frozen=True)
class Pencil:
    """The dynamic stiffness as a function of s.

    Parameters
    ----------
    A, C, M : (d, d) arrays or sparse arrays
        A = K + iD.
    joints : sequence of (matrix, ContinuedStiffness)
        Which DOFs (j, d) each frequency-dependent joint has, and its dynamic stiffness (j, j).
    """

    A: Any
    C: Any
    M: Any
    joints: Sequence[tuple[Any, ContinuedStiffness]] = ()

    def at(self, s: complex) -> tuple[Any, Any]:
        """Return Z and dZ/ds."""
        Z, slope = self.A + s * (self.C + s * self.M), self.C + (2.0 * s) * self.M
        for L, stiffness in self.joints:
            value, change = stiffness.at(s)
            Z, slope = Z + placed(L, value), slope + placed(L, change)
        return Z, slope

    def stiffness(self, frequency: float) -> Any:
        """Return the real part of the stiffness, with that which the joints have at a frequency [Hz]."""
        K = self.A.real
        for L, stiffness in self.joints:
            K = K + placed(L, stiffness.at(2.0j * np.pi * frequency)[0].real)
        return K

    def near(self, frequency: float) -> Pencil:
        """Return the pencil in which the joints' dynamic stiffness is a quadratic through three frequencies near one.

        Parameters
        ----------
        frequency : float
            Hz.
        """
        A, C, M = self.A, self.C, self.M
        nodes = 2.0j * np.pi * frequency * np.array([0.8, 1.0, 1.25])
        to_coefficients = np.linalg.inv(np.vander(nodes / abs(nodes[1]), increasing=True))
        for L, stiffness in self.joints:
            values = np.stack([stiffness.at(node)[0] for node in nodes])
            terms = [placed(L, term) for term in np.tensordot(to_coefficients, values, 1)]
            A, C, M = A + terms[0], C + terms[1] / abs(nodes[1]), M + terms[2] / abs(nodes[1]) ** 2
        return Pencil(A, C, M)

    def projected(self, V: NDArray[np.float64]) -> Pencil:
        """Return the pencil in the coordinates of a basis (d, m)."""
        joints = [(L @ V, stiffness) for L, stiffness in self.joints]
        A, C, M = (V.T @ (matrix @ V) for matrix in (self.A, self.C, self.M))
        return Pencil(A, C, M, joints)


def all_poles(A: Any, C: Any, M: Any, wanted: Wanted) -> Iterator[tuple[Any, Any]]:
    """Yield poles (k,) and shapes (k, d) of each of the stacked A + s C + s^2 M (n, d, d), by increasing magnitude.

    With s = z + z / v and a positive z, v is an eigenvalue of a companion matrix, also with massless DOFs or rigid
    bodies. The Rayleigh quotient with its eigenvector gives the pole to rounding.
    """
    inertia, stiffness = (np.diagonal(part.real, axis1=1, axis2=2).sum(axis=1) for part in (M, A))
    idle = ~np.any([(part != 0).any(axis=(0, 1)) for part in (A, C, M)], axis=0)
    A = A + np.diag(idle.astype(np.float64))  # what nothing resists gets an infinite pole, whatever its stiffness
    both = (stiffness > 0.0) & (inertia > 0.0)  # joints that depend on frequency may have less than no mass near one
    with np.errstate(over="ignore", invalid="ignore"):
        z = np.sqrt(np.divide(stiffness, inertia, out=np.ones(len(M)), where=both))[:, np.newaxis, np.newaxis]
        below = -np.linalg.solve(A + z * (C + z * M), np.concatenate([z**2 * M, z * (C + 2.0 * z * M)], axis=2))
    if not np.isfinite(below).all():
        raise DovetailError(
            "there are no natural frequencies: a stiffness is too large, or a mass too small, to compute with."
        )
    above = np.broadcast_to(np.eye(M.shape[1], 2 * M.shape[1], M.shape[1]), below.shape)
    values, vectors = np.linalg.eig(np.concatenate([above, below], axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):  # massless DOFs have infinite poles
        poles = z[:, 0] * (1.0 + 1.0 / values)
    for row, (s, X) in enumerate(zip(poles, vectors[:, : M.shape[1]].swapaxes(1, 2), strict=True)):
        strain, largest = _strain(A[row].real, X)
        turning = np.isfinite(s) & (s.imag > wanted.least_turn * np.abs(s)) & (strain > _STRAIN_FLOOR * largest)
        doubtful = (np.abs(s) < _NEAR_ZERO * z[row, 0]) | (strain <= _DOUBTFUL * largest)
        for index in np.flatnonzero(turning & doubtful):  # iteration finds which are rigid
            s[index], X[index] = iterated(Pencil(A[row], C[row], M[row]), s[index], X[index])
            turning[index] = np.isfinite(s[index]) and bool(_deforms(A[row].real, X[index : index + 1])[0])
        lowest = np.flatnonzero(turning)[wanted.lowest(s[turning])]
        s, X = s[lowest], X[lowest]
        quotient = s - _rayleigh(A[row], C[row], M[row], s, X)
        yield np.where(np.abs(quotient - s) < 1e-3 * np.abs(s), quotient, s), X


def _strain(K: Any, X: NDArray[np.complex128]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the strain energy of each shape (k, d), and the largest possible one with its amplitudes."""
    strain = np.sum(X.conj() * (K @ X.T).T, axis=1).real
    return strain, np.sum(np.abs(X) * (abs(K) @ np.abs(X).T).T, axis=1)


def _deforms(K: Any, X: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Return which shapes (k, d) deform the structure; others are rigid-body modes."""
    strain, largest = _strain(K, X)
    return np.asarray(strain > _STRAIN_FLOOR * largest)


def _rayleigh(A: Any, C: Any, M: Any, s: Any, X: Any) -> Any:
    """Return x^T Z(s) x / x^T (dZ/ds) x for each pole and shape."""
    at = s[:, np.newaxis]
    XC, XM = X @ C, X @ M
    return np.sum(X * (X @ A + at * (XC + at * XM)), axis=1) / np.sum(X * (XC + 2.0 * at * XM), axis=1)


def iterated(pencil: Pencil, s: complex, x: NDArray[np.complex128]) -> tuple[complex, NDArray[np.complex128]]:
    """Return a pole and its shape by Rayleigh quotient iteration; NaN where it does not converge."""
    start = abs(s)
    for iteration in range(_MOST_ITERATIONS):
        Z, slope = pencil.at(s)
        turned = slope @ x
        change = (x @ (Z @ x)) / (x @ turned)
        s = s - change
        if not start / _FARTHEST < abs(s) < start * _FARTHEST:
            break
        if iteration and abs(change) <= _CONVERGED * abs(s):
            return s, x
        Z, _ = pencil.at(s)
        try:
            if scipy.sparse.issparse(Z):
                x = scipy.sparse.linalg.splu(Z.tocsc()).solve(turned)
            else:
                x = np.linalg.solve(Z, turned)
        except (np.linalg.LinAlgError, RuntimeError):  # exactly at a pole, or no pole at all
            break
        x = x / np.linalg.norm(x)
    return complex(np.nan), x


def few_poles(pencil: Pencil, wanted: Wanted) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return poles and shapes (k, d) of a pencil of few DOFs, by increasing magnitude."""
    if pencil.joints:
        return _swept(pencil, wanted)
    A, C, M = (matrix[np.newaxis] for matrix in (pencil.A, pencil.C, pencil.M))
    return next(all_poles(A, C, M, wanted))


def searched(
    pencil: Pencil,
    wanted: Wanted,
    vectors: NDArray[np.float64],
    solve: Callable[[Any], Any],
    accurate: float = _ACCURATE,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the same of a pencil of many DOFs, on a basis that grows until the poles are accurate.

    Parameters
    ----------
    pencil : Pencil
    wanted : Wanted
    vectors : (d, m) array
        From which the basis starts.
    solve : callable
        Approximate solution (d, k) of Z x = loads (d, k) near the poles, by which residuals extend the basis
        (Davidson's method).
    accurate : float
        Estimated relative error of the poles at which the basis is large enough.

    Raises
    ------
    DovetailError
        The basis becomes too large.
    """
    diagonal = np.abs(pencil.A.diagonal())
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, diagonal.max(initial=0.0) or 1.0))[:, np.newaxis]
    basis = extended_basis(np.empty((len(scale), 0)), vectors / scale, _INDEPENDENT)
    K, more = pencil.stiffness(_RIGID_STIFFNESS), replace(wanted, count=wanted.count + _RIGID_BODY_MODES)
    while basis.shape[1] < _MOST_VECTORS:
        V = scale * basis
        poles, within = few_poles(pencil.projected(V), more)
        shapes = within @ V.T
        elastic = _deforms(K, shapes)
        for index in np.flatnonzero(~elastic) if pencil.joints else ():  # masses within joints reduce K there
            own = pencil.stiffness(min(abs(poles[index]) / (2.0 * np.pi), _RIGID_STIFFNESS))
            strain, largest = _strain(own, shapes[index : index + 1])
            elastic[index] = strain[0] > _DOUBTFUL * largest[0]
        order = np.flatnonzero(elastic)[wanted.lowest(poles[elastic])]
        poles, shapes = poles[order], shapes[order]
        added = []
        for s, x in zip(poles, shapes, strict=True):
            Z, slope = pencil.at(s)
            residual = Z @ x
            solution = solve(np.stack([residual.real, residual.imag], axis=1))
            error = abs(residual @ (solution @ np.array([1.0, 1j]))) / abs(s * (x @ (slope @ x)))
            if not error <= accurate:
                added.append(solution / scale)
        size = basis.shape[1]
        if added:
            basis = extended_basis(basis, np.concatenate(added, axis=1), _INDEPENDENT)
        if basis.shape[1] == size:
            return poles, shapes
    raise DovetailError("the damped natural frequencies of this large model are not found: its damping is too strong.")


def _swept(pencil: Pencil, wanted: Wanted) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return poles and shapes of a pencil with frequency-dependent joints, between two frequencies.

    Around each frequency of a sweep the joints are replaced by quadratic polynomials; from the poles near there, the
    iteration with the joints themselves starts.
    """
    poles, shapes = np.empty(0, dtype=np.complex128), np.empty((0, len(pencil.A)), dtype=np.complex128)
    middle, last = wanted.sweep
    while middle <= last and not wanted.complete(poles[np.abs(poles) < 2.0 * np.pi * middle / _EXPANSIONS]):
        local = pencil.near(middle)
        starts, X = few_poles(local, replace(wanted, count=2 * len(pencil.A), highest=np.inf))
        close = np.abs(np.log(np.abs(starts) / (2.0 * np.pi * middle))) <= np.log(_EXPANSIONS)
        for start, x in zip(starts[close], X[close], strict=True):
            s, shape = iterated(pencil, start, x)
            if s.imag > wanted.least_turn * abs(s) and not (np.abs(poles - s) < _SAME_POLE * abs(s)).any():
                poles, shapes = np.append(poles, s), np.concatenate([shapes, shape[np.newaxis]])
        middle *= _EXPANSIONS
    order = wanted.lowest(poles)
    return poles[order], shapes[order]


def dofs_with_inertia(pattern: Any, inertia: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the DOFs that are connected with a mass; the others do not move."""
    return np.flatnonzero(connected_with(inertia > 0, pattern))
