"""Reduction of a part to its interface and some modes with the interface held, and a bound of what it changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail import DovetailError, Fault

_FEW = 400
"""Inner DOFs up to which all modes are computed."""
_LINES = 40
"""Frequencies at which the bound is evaluated."""
_LOOSE = 1e-12
"""Eigenvalue of the stiffness with a diagonal of 1, or square of the lowest frequency over that of the highest computed
one, below which the part moves without deformation; a beam of 1,000 elements that is held has 4e-11."""
_MASSLESS = 1e-12
"""Ratio of an eigenvalue of the mass to the largest one below which a motion of the interface has no mass."""

_Solve: TypeAlias = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""From loads to displacements, in columns."""


@dataclass(frozen=True, eq=False)
class ReducedPart:
    """A part with the DOFs of its interface and one of each mode that is kept.

    Parameters
    ----------
    matrices : mapping of str to (b + n, b + n) array
        M, K and, if there are any, C and D.
    natural_frequencies : (n,) array
        Of the modes that are kept [Hz], with the interface held.
    next_frequency : float
        Of the first mode that is left out [Hz]; infinite if there is none.
    residual : (b, b) array
        Sum of p p' / omega^2 over the modes that are left out, where p are their forces on the held interface by a unit
        acceleration.
    """

    matrices: dict[str, NDArray[np.float64]]
    natural_frequencies: NDArray[np.float64]
    next_frequency: float
    residual: NDArray[np.float64]

    def largest_shift(self, frequency: float) -> float:
        """Return a bound of the relative change of natural frequencies up to `frequency` [Hz] by the reduction.

        It holds for all assemblies with the part, to the first order and without damping: the modes that are left out
        change the dynamic stiffness of the interface by at most ``omega^4 / (1 - omega^2 / omega_next^2)`` times the
        residual, and a natural frequency by half of that over ``omega^2`` and the mass that moves. Infinite where a
        mode that is left out has a lower frequency.

        Parameters
        ----------
        frequency : float

        References
        ----------
        R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA J. 6 (1968) 1313-1319.
        """
        if frequency >= self.next_frequency:
            return np.inf
        omegas = 2.0 * np.pi * np.geomspace(0.02 * frequency, frequency, _LINES)
        return max(self._shift_at(float(omega)) for omega in omegas)

    def _shift_at(self, omega: float) -> float:
        size, M = len(self.residual), self.matrices["M"]
        squares = (2.0 * np.pi * self.natural_frequencies) ** 2
        motion = (omega**2 / (squares - omega**2))[:, None] * M[size:, :size]  # of the modes, with the interface
        cross = M[:size, size:] @ motion
        mass = M[:size, :size] + cross + cross.T + motion.T @ motion
        scale = 1.0 / np.sqrt(np.maximum(np.diag(mass), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(scale[:, None] * mass * scale)
        kept = values > _MASSLESS * values[-1]
        white = scale[:, None] * vectors[:, kept] / np.sqrt(values[kept])
        change = omega**2 / (1.0 - (omega / (2.0 * np.pi * self.next_frequency)) ** 2)
        return float(0.5 * change * np.linalg.eigvalsh(white.T @ self.residual @ white)[-1])


def reduce_part(
    matrices: dict[str, Any], interface: int, where: str, *, modes: int | None, up_to: float | None
) -> ReducedPart:
    """Reduce a part to its interface and the modes with the interface held.

    Parameters
    ----------
    matrices : mapping of str to (d, d) scipy.sparse array
        M, K and perhaps C and D in SI; the DOFs of the interface come first.
    interface : int
        Number of DOFs of the interface.
    where : str
        For messages.
    modes : int, optional
        Number of modes, or
    up_to : float, optional
        the frequency [Hz] up to which they are kept.

    Raises
    ------
    DovetailError
        With the interface held the part still moves as a rigid body, or its modes are not found.
    """
    kept = _connected(matrices, interface)
    inner, boundary = kept[kept >= interface], np.arange(interface)
    M, K = matrices["M"].tocsc(), matrices["K"].tocsc()
    M_ii, K_ii = M[inner][:, inner], K[inner][:, inner]
    solve = _solver(K_ii, where)
    squares, shapes = _modes(M_ii, K_ii, solve, modes, up_to, where) if len(inner) else (np.zeros(0), np.zeros((0, 0)))
    count = len(squares) if modes is None else min(modes, len(squares))
    count = int(np.searchsorted(squares, (2.0 * np.pi * up_to) ** 2)) if up_to is not None else count
    static = -solve(K[inner][:, boundary].toarray())
    load = M_ii @ static + M[inner][:, boundary].toarray()
    shares = load.T @ shapes[:, :count]
    residual = load.T @ solve(load) - (shares / squares[:count]) @ shares.T
    basis = np.zeros((len(kept), interface + count))
    basis[:interface, :interface] = np.eye(interface)
    basis[interface:, :interface], basis[interface:, interface:] = static, shapes[:, :count]
    reduced = {name: basis.T @ (matrix.tocsc()[kept][:, kept] @ basis) for name, matrix in matrices.items()}
    frequencies = np.sqrt(squares) / (2.0 * np.pi)
    return ReducedPart(
        {name: 0.5 * (matrix + matrix.T) for name, matrix in reduced.items()},
        frequencies[:count],
        float(frequencies[count]) if count < len(frequencies) else np.inf,
        0.5 * (residual + residual.T),
    )


def _connected(matrices: dict[str, Any], interface: int) -> NDArray[np.intp]:
    """Return the DOFs that are connected to those of the interface, these first."""
    from scipy.sparse.csgraph import connected_components

    _, group = connected_components(abs(matrices["M"]) + abs(matrices["K"]), directed=False)
    inside = np.isin(group, group[:interface])
    inside[:interface] = True
    return np.flatnonzero(inside)


def _solver(K: Any, where: str) -> _Solve:
    """Return a function from loads on the inner DOFs to their displacements.

    Raises
    ------
    DovetailError
        K is singular.
    """
    from scipy.sparse.linalg import splu

    if not K.shape[0]:
        return lambda loads: loads
    try:
        solve: _Solve = splu(K).solve
    except RuntimeError:
        raise _loose(where) from None
    return solve


def _loose(where: str) -> DovetailError:
    problem = "with the nodes of 'interface' held, the part still moves without deformation."
    return DovetailError(Fault(where, problem, remedy="Add nodes that hold it, or directions of these nodes."))


def _modes(
    M: Any, K: Any, solve: _Solve, modes: int | None, up_to: float | None, where: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return squares of angular frequencies in their order, and mass-normalised shapes, including the next mode."""
    from scipy.linalg import eigh
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    size = K.shape[0]
    if size <= _FEW:
        stiffness = K.toarray()
        scale = 1.0 / np.sqrt(np.maximum(np.diag(stiffness), np.finfo(float).tiny))
        if np.linalg.eigvalsh(scale[:, None] * stiffness * scale)[0] < _LOOSE:
            raise _loose(where)
        inverse, shapes = eigh(M.toarray(), stiffness)
        moving = np.flatnonzero(inverse > _MASSLESS * inverse[-1])[::-1]
        squares = 1.0 / inverse[moving]
        return squares, shapes[:, moving] * np.sqrt(squares)
    inverse_stiffness = LinearOperator(K.shape, solve, dtype=np.float64)
    count = min((modes + 1) if modes is not None else 20, size - 2)
    while True:
        try:
            squares, shapes = eigsh(K, count, M, sigma=0.0, which="LM", OPinv=inverse_stiffness)
        except (ArpackError, RuntimeError) as error:
            raise DovetailError(Fault(where, f"the modes with the interface held are not found: {error}")) from None
        order = np.argsort(squares)
        squares, shapes = squares[order], shapes[:, order]
        if modes is not None or squares[-1] > (2.0 * np.pi * (up_to or 0.0)) ** 2 or count == size - 2:
            if squares[0] <= _LOOSE * squares[-1]:
                raise _loose(where)
            return squares, shapes
        count = min(2 * count, size - 2)
