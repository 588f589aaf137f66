"""Undamped modes, from dense or from sparse matrices, and the search for damped poles that starts from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.synthesis.pole_search import Pencil, Wanted, dofs_with_inertia, few_poles, searched

_BASIS_DOFS, _DENSE_DOFS = 40, 120
"""Numbers of DOFs up to which all poles are computed if the iteration does not find them, and if neither does one from
the poles on a basis; with 120 that takes 0.2 s."""
_ROUGH = 0.1
"""Estimated relative error of the poles from a basis at which the iteration starts from them, and how far it may lead,
over the distance to the nearest other pole."""
_SWEPT_DOFS = 24
"""The same, where joints depend on frequency and all poles are computed at each frequency of a sweep."""
_CONVERGED = 1e-6
"""Relative change of a pole in the last step; convergence is cubic, so that another step would change nothing."""
_MOST_ITERATIONS = 12
"""Steps after which a pole counts as not found."""
_NEAR = 0.5
"""Distance of a pole from that without damping, over the distance to the nearest other one, up to which the two belong
to each other. If all do, no pole lies between them."""
_RESISTED = 1e-9
"""Power of dampers in a rigid-body motion, over the largest possible one with its amplitudes, above which they resist
it."""
_FURTHER = 6
"""Undamped modes beyond twice the wanted ones from which the search for poles starts."""
_FIRST, _ROUNDS, _LOWEST = 100.0, 8, 1e-3
"""Frequency [Hz] at which the search for the first mode with frequency-dependent joints starts, how often it is
computed with the stiffness that they have at its frequency, and the lowest of these."""
_SETTLED = 0.5
"""Ratio of two such frequencies above which the lower end of the sweep is known, in view of the next ratio."""
_BELOW, _ABOVE, _HIGHEST = 20.0, 20.0, 1e6
"""Ratios of the undamped modes' frequencies to the ends of the sweep, and a frequency [Hz] that it reaches at least if
it does not find enough poles: a joint may have a mass within its dynamic stiffness."""
_MOST_COLUMNS = 60
"""Number of DOFs of viscous dampers up to which the response to their forces is in the first basis."""
_STRAIN_FLOOR = 1e-13
"""Strain energy of a mode, over the largest possible one with its amplitudes, below which it is a rigid-body mode.
Rounding gives a hundredth of this; a beam of 2500 elements in its first bending mode has twice as much."""
_SINGULAR = 1e-9
"""Part of the diagonal that is added where massless DOFs are connected only by dampers."""
_SHIFT_FLOOR = 1e-14
"""Squared frequency [1/s^2], over the shift, below which it is rounding. A free mass has only the strain
of rounding errors in its shape, which relative to its amplitudes may be as large as that of an elastic mode."""


def dense_modes(K: NDArray[np.float64], M: NDArray[np.float64]) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """Yield frequency [Hz] and shape of each elastic mode of dense matrices.

    Raises
    ------
    DovetailError
        The structure is not stable.
    """
    return ((frequency, shape) for frequency, shape in _dense_motions(K, M) if frequency)


def _dense_motions(K: NDArray[np.float64], M: NDArray[np.float64]) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """Yield the same, and rigid-body modes with the frequency 0, by increasing frequency."""
    size, active = len(K), dofs_with_inertia((K != 0) | (M != 0), np.diag(M))
    K, M = K[np.ix_(active, active)], M[np.ix_(active, active)]
    if not len(active):
        return
    shapes, shift = _dense_shapes(K, M)
    for frequency, shape in zip(_frequencies(K, M, shapes, _SHIFT_FLOOR * shift), shapes.T, strict=True):
        whole = np.zeros(size)
        whole[active] = shape
        yield frequency, whole


def lowest_modes(
    K: Any, M: Any, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], Callable[[NDArray[np.float64]], NDArray[np.float64]]]:
    """Return the lowest modes of dense or sparse matrices in which every DOF is connected with a mass.

    Parameters
    ----------
    K, M : (d, d) arrays or sparse arrays
    count : int

    Returns
    -------
    frequencies : (k,) array
        Hz; 0 for rigid-body modes.
    shapes : (d, k) array
    solve : callable
        Returns (K + shift M)^-1 of loads (d, n), with a small positive shift.

    Raises
    ------
    DovetailError
        The structure is not stable, or Lanczos does not converge.
    """
    if scipy.sparse.issparse(K):
        shift = 1e-6 * _median_square(K, M)
        factors = _factorised(K, M, shift)
        inertia = int(np.count_nonzero(M.diagonal() > 0))
        shapes = _sparse_shapes(K, M, min(count, inertia - 1), shift, factors)
        solve: Any = factors.solve
    else:
        shapes, shift = _dense_shapes(K, M)
        shapes = shapes[:, :count]
        shifted = K + shift * M
        diagonal = np.diag(shifted)
        solve = partial(
            scipy.linalg.cho_solve,
            scipy.linalg.cho_factor(shifted + _SINGULAR * np.diag(np.where(diagonal > 0.0, diagonal, 1.0))),
        )
    return np.array(list(_frequencies(K, M, shapes, _SHIFT_FLOOR * shift))), shapes, solve


def _median_square(K: Any, M: Any) -> float:
    """Return the median of stiffness over mass of the DOFs with inertia [1/s^2], 1 if none has inertia."""
    inertia = M.diagonal() > 0
    if not inertia.any():
        return 1.0
    return float(np.median(K.diagonal()[inertia] / M.diagonal()[inertia])) or 1.0


def _dense_shapes(K: NDArray[np.float64], M: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the shapes (d, k) of all modes, from the lowest, and the shift [1/s^2] with which K + s M is positive."""
    with np.errstate(over="ignore", invalid="ignore"):
        shift = 1e-3 * _median_square(K, M)
        shifted = K + shift * M
    if not np.isfinite(shifted).all():
        raise DovetailError(
            "there are no natural frequencies: a stiffness is too large, or a mass too small, to compute with."
        )
    try:
        mu, shapes = scipy.linalg.eigh(M, shifted)
    except np.linalg.LinAlgError:
        diagonal = np.diag(shifted)
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        if (diagonal < 0.0).any() or np.linalg.eigvalsh(shifted * scale[:, np.newaxis] * scale)[0] < -_SINGULAR:
            problem = "with these parameters a stiffness or a mass is negative."
            raise DovetailError(f"there are no natural frequencies: {problem}") from None
        shifted += _SINGULAR * np.diag(1.0 / scale**2)  # DOFs that only dampers connect
        mu, shapes = scipy.linalg.eigh(M, shifted)
    return shapes[:, mu > mu[-1] * 1e-14][:, ::-1], shift


def _factorised(K: Any, M: Any, shift: float) -> Any:
    from scipy.sparse.linalg import splu

    try:
        return splu((K + shift * M).tocsc())
    except RuntimeError as error:
        raise DovetailError(f"the natural frequencies of this large model are not found: {error}") from None


def _sparse_shapes(K: Any, M: Any, count: int, shift: float, factors: Any) -> NDArray[np.float64]:
    """Return the shapes (d, count) of the lowest modes."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    if count <= 0:
        return np.empty((M.shape[0], 0))
    start = np.random.default_rng(0).standard_normal(M.shape[0])
    basis = min(max(2 * count + 1, 20), int(np.count_nonzero(M.diagonal() > 0)))  # massless DOFs add no direction
    inverse = LinearOperator(M.shape, factors.solve, dtype=np.float64)
    try:
        values, shapes = eigsh(K, count, M, sigma=-shift, which="LM", v0=start, ncv=basis, OPinv=inverse)
    except (ArpackError, RuntimeError) as error:
        raise DovetailError(f"the natural frequencies of this large model are not found: {error}") from None
    if values.min() < -shift:
        raise DovetailError("there are no natural frequencies: with these parameters a stiffness is negative.")
    return np.asarray(shapes[:, np.argsort(values)])


def _frequencies(K: Any, M: Any, shapes: NDArray[np.float64], least: float) -> Iterator[float]:
    """Yield the frequency [Hz] of each shape; 0 if it does not deform the structure or its square is below `least`."""
    stiffness = abs(K)
    for shape in shapes.T:
        strain, mass = shape @ K @ shape, shape @ M @ shape
        elastic = strain > least * mass and strain > _STRAIN_FLOOR * (abs(shape) @ stiffness @ abs(shape))
        yield np.sqrt(strain / mass) / (2.0 * np.pi) if elastic else 0.0


def lowest_poles(A: Any, C: Any, M: Any, wanted: Wanted) -> Iterator[tuple[Any, Any]]:
    """Yield the same as `all_poles`, where iteration from each mode of the undamped assembly finds as many poles."""
    for stiffness, damping, mass in zip(A, C, M, strict=True):
        undamped = _undamped_modes(stiffness.real, damping, mass, wanted.count + 1)
        if undamped is None:
            yield searched_poles(Pencil(stiffness, damping, mass), wanted)
            continue
        frequencies = np.array([frequency for frequency, _ in undamped])
        starts = np.asarray(2j * np.pi * frequencies)
        number = len(wanted.lowest(starts))
        X = np.array([x for _, x in undamped[:number]], dtype=np.complex128).reshape(number, len(mass))
        poles, shapes = _refined(stiffness, damping, mass, starts[:number], X)
        spacing = np.diff(frequencies, prepend=0.0, append=np.inf)
        nearest = 2.0 * np.pi * np.minimum(spacing[:-1], spacing[1:])[:number]
        if (np.abs(poles - starts[:number]) < _NEAR * nearest).all():
            order = wanted.lowest(poles)
            yield poles[order], shapes[order]
        else:
            yield searched_poles(Pencil(stiffness, damping, mass), wanted)


def _undamped_modes(
    K: NDArray[np.float64], C: NDArray[np.float64], M: NDArray[np.float64], count: int
) -> list[tuple[float, NDArray[np.float64]]] | None:
    """Return frequency and shape of the lowest elastic modes without damping.

    None if dampers resist a rigid-body motion: a part that they hold may turn at a low frequency.
    """
    modes = []
    for frequency, shape in _dense_motions(K, M):
        if frequency:
            modes.append((frequency, shape))
        elif shape @ C @ shape > _RESISTED * (abs(shape) @ abs(C) @ abs(shape)):
            return None
        if len(modes) == count:
            break
    return modes


def _refined(A: Any, C: Any, M: Any, s: Any, X: Any) -> tuple[Any, Any]:
    """Return the poles and shapes from Rayleigh quotient iteration; NaN where it does not converge."""
    s, X, going = s.copy(), X.copy(), np.arange(len(s))
    for iteration in range(_MOST_ITERATIONS):
        at, x = s[going, None], X[going]
        Ax, Cx, Mx = x @ A, x @ C, x @ M
        turned = Cx + 2.0 * at * Mx
        change = np.sum(x * (Ax + at * (Cx + at * Mx)), axis=1) / np.sum(x * turned, axis=1)
        s[going] -= change
        unconverged = (np.abs(change) > _CONVERGED * np.abs(s[going])) | (iteration == 0)  # a start has no change
        going, turned = going[unconverged], turned[unconverged]
        try:
            solved = [np.linalg.solve(A + z * (C + z * M), b) for z, b in zip(s[going], turned, strict=True)]
        except np.linalg.LinAlgError:  # exactly at a pole, or no pole at all
            break
        if not solved:
            break
        X[going] = np.array(solved) / np.linalg.norm(solved, axis=1, keepdims=True)
    s[going] = np.nan
    return s, X


def searched_poles(pencil: Pencil, wanted: Wanted) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return all wanted poles and shapes, for any damping."""
    size = pencil.M.shape[0]
    if not pencil.joints and not scipy.sparse.issparse(pencil.M) and size <= _BASIS_DOFS:
        return few_poles(pencil, wanted)
    modes = _UndampedModes(pencil, 2 * min(wanted.count, size) + _FURTHER)
    if pencil.joints:
        wanted = replace(wanted, sweep=modes.sweep)
        if not scipy.sparse.issparse(pencil.M) and size <= _SWEPT_DOFS:
            return few_poles(pencil, wanted)
    forces = [L.T.toarray() if scipy.sparse.issparse(L) else L.T for L, _ in pencil.joints]
    damped = np.flatnonzero(abs(pencil.C).sum(axis=0))
    if len(damped) <= _MOST_COLUMNS:
        forces.append((np.arange(size)[:, np.newaxis] == damped).astype(np.float64))
    responses = [modes.solve(force) for force in forces]
    vectors = np.concatenate([modes.shapes, *responses], axis=1)
    if not pencil.joints and not scipy.sparse.issparse(pencil.M):
        starts, X = searched(pencil, wanted, vectors, modes.solve, _ROUGH)
        poles, shapes = _refined(pencil.A, pencil.C, pencil.M, starts, X)
        spacing = np.abs(starts[:, np.newaxis] - starts) + np.diag(np.full(len(starts), np.inf))
        if (np.abs(poles - starts) < _ROUGH * spacing.min(axis=1, initial=np.inf)).all():
            order = wanted.lowest(poles)
            return poles[order], shapes[order]
        if size <= _DENSE_DOFS:
            return few_poles(pencil, wanted)
    return searched(pencil, wanted, vectors, modes.solve)


def _lowest_with_dampers(pencil: Pencil, frequency: float, count: int) -> float:
    """Return a frequency [Hz] below which no pole turns that is not overdamped, at most the given one.

    Dampers hold a structure that moves freely without them, and so make low modes. With its shape, a turning pole s has
    k/m = |s|^2 and c/m < 2 |s|. The lowest natural frequency of K + w C, which falls with w, is then below sqrt(3) w at
    w = |s|.
    """
    for _ in range(_ROUNDS):
        try:
            damped = pencil.stiffness(frequency) + (2.0 * np.pi * frequency) * pencil.C
            frequencies = lowest_modes(damped, pencil.M, count)[0]
        except DovetailError:
            break
        lower = float(min(frequencies[frequencies > 0.0], default=np.inf)) / np.sqrt(3.0)
        if lower > _SETTLED * frequency or frequency < _LOWEST:
            break
        frequency = lower
    return frequency


class _UndampedModes:
    """Lowest modes without damping, with the stiffness that frequency-dependent joints have at the first elastic one.

    Parameters
    ----------
    pencil : Pencil
    count : int
        With rigid-body modes.

    Attributes
    ----------
    shapes : (d, k) array
    solve : callable
        Returns (K + z^2 M)^-1 of loads (d, n), with a small z.
    sweep : (float, float)
        Hz; between which the poles lie.
    """

    def __init__(self, pencil: Pencil, count: int) -> None:
        frequency, frequencies = _FIRST, None
        for _ in range(_ROUNDS if pencil.joints else 1):
            K = pencil.stiffness(frequency)
            try:
                frequencies, self.shapes, self.solve = lowest_modes(K, pencil.M, count)
            except DovetailError:  # beyond a resonance within a joint its dynamic stiffness is negative
                if frequencies is not None:
                    break
                if frequency < _LOWEST or not pencil.joints:
                    raise
                frequency /= 10.0
                continue
            elastic = frequencies[frequencies > 0.0]
            frequency = float(min(elastic, default=frequency))
        assert frequencies is not None
        if pencil.joints:
            frequency = _lowest_with_dampers(pencil, frequency, count)
        self.sweep = frequency / _BELOW, max(_HIGHEST, _ABOVE * float(max(frequencies, default=0.0)))
