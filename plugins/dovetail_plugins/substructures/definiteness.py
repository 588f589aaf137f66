"""Whether imported matrices can be those of a body: no negative mass, stiffness or damping, and no mechanism."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import DovetailError, Fault

_FEW = 400
"""DOFs up to which all eigenvalues are computed; signs of pivots are counted beyond."""
_WORK = 2e9
"""Size times squared bandwidth up to which a matrix is factorised, which takes seconds: a chain of a million DOFs, a
solid of twenty thousand. Beyond, Lanczos steps look for negative motions and zero modes are not counted."""
_STEPS = 150
"""Lanczos steps; a wrong sign or a doubled coupling is a local fault, and its eigenvalue is found in ten to fifty."""
_ROUNDED = 1e-5
"""Negative eigenvalue of a matrix with a diagonal of 1 that may be due to entries printed with six digits."""
_ZERO = 1e-13
"""Eigenvalue of a matrix with a diagonal of 1 that is zero but for rounding; a beam of 1,000 elements has 4e-11."""
_NOISE = 1e-14
"""Entry, relative to the largest one, that is the rounding error of a zero after a transformation of coordinates."""
_NAMES = {"M": "mass", "K": "stiffness", "C": "viscous damping", "D": "structural damping"}


@dataclass(frozen=True)
class _Negative:
    """A motion in which a matrix is negative: the DOF that moves most, and the value relative to its diagonal entry."""

    dof: int
    ratio: float


def check_definiteness(
    matrices: Mapping[str, Any],
    where: Mapping[str, Any],
    label: Callable[[int], str],
    reached: Collection[int],
    rigid_body_motions: int,
) -> None:
    """Raise an error if the matrices cannot be those of a body.

    Parameters
    ----------
    matrices : mapping of str to (d, d) sparse array
        M, K and, optionally, C and D: symmetric, of finite numbers.
    where : mapping of str to str
        File of each matrix, for messages.
    label : callable
        Gives a row, from 0, in words.
    reached : collection of int
        Rows to which joints and responses may attach.
    rigid_body_motions : int
        Largest number of motions of the body without deformation.

    Raises
    ------
    DovetailError
        M, K, C or D is not positive semidefinite, or K has more zero modes than `rigid_body_motions`.

    Notes
    -----
    Rows without mass and without an entry on the diagonal of K are Lagrange multipliers: with them K is positive
    semidefinite in the motions that they allow. Rows without any entry are left out.
    """
    matrices = {name: _without_noise(matrix) for name, matrix in matrices.items()}
    M, K = matrices["M"], matrices["K"]
    masses = abs(M).sum(axis=0)
    ties = (masses == 0) & (K.diagonal() == 0) & (abs(K).sum(axis=0) > 0)
    bodies = np.flatnonzero(~ties)
    for name, matrix in matrices.items():
        part = _tied(K, bodies, np.flatnonzero(ties)) if name == "K" else matrix[bodies][:, bodies]
        rows = bodies[np.asarray(abs(part).sum(axis=0)).ravel() > 0]
        scaled, problem = _unit_diagonal(part, bodies, rows)
        negative = problem or _negative(scaled, rows)
        if negative is not None:
            raise _not_definite(name, matrix, negative, where[name], label)
    _check_mechanism(M, K, ties, where["K"], label, reached, rigid_body_motions)


def check_mass(M: Any, rows: NDArray[np.intp], directions: Sequence[str], where: str) -> None:
    """Raise an error if a motion of all DOFs of one direction has no kinetic energy, as with the stiffness for M.

    Parameters
    ----------
    M : (d, d) sparse array
    rows : (n,) int array
        Rows of M in the table of DOFs.
    directions : sequence of str
        Of each of them, in the words of the table.
    where : str
        The file.

    Raises
    ------
    DovetailError
    """
    words = np.asarray(directions)
    for word in dict.fromkeys(directions):
        moving = rows[words == word]
        part = M.tocsr()[moving][:, moving]
        if len(moving) > 1 and abs(part).sum() > 0 and part.sum() <= _ROUNDED * abs(part).sum():
            problem = f"a motion of all nodes along '{word}' has the mass {part.sum():g}."
            remedy = "Are mass and stiffness exchanged, or directions in the table?"
            raise DovetailError(Fault(where, problem, "more than 0", remedy))


def _without_noise(matrix: Any) -> Any:
    """Return a sparse matrix without entries that are rounding errors."""
    clean = matrix.copy()
    clean.data[np.abs(clean.data) <= _NOISE * np.abs(clean.data).max(initial=0.0)] = 0.0
    clean.eliminate_zeros()
    return clean


def _tied(K: Any, bodies: NDArray[np.intp], ties: NDArray[np.intp]) -> Any:
    """Return the stiffness of the DOFs that are not multipliers, with stiff springs in place of the multipliers."""
    from scipy.sparse import diags_array

    free = K[bodies][:, bodies]
    if not ties.size:
        return free
    tie = K[ties][:, bodies]
    largest = abs(tie).max(axis=1).toarray().ravel()
    weight = abs(free).max() / np.maximum(largest, np.finfo(float).tiny) ** 2
    return free + tie.T @ diags_array(weight) @ tie


def _unit_diagonal(part: Any, bodies: NDArray[np.intp], rows: NDArray[np.intp]) -> tuple[Any, _Negative | None]:
    """Return a matrix over the rows with entries, scaled to a diagonal of 1, and a DOF or pair that is negative."""
    from scipy.sparse import diags_array

    kept = np.searchsorted(bodies, rows)
    filled = part[kept][:, kept].tocsc()
    diagonal = filled.diagonal()
    if len(rows) and diagonal.min() <= 0.0:
        worst = int(np.argmin(diagonal))
        return filled, _Negative(int(rows[worst]), -1.0 if diagonal[worst] < 0 else 0.0)
    scale = diags_array(1.0 / np.sqrt(diagonal), format="csc")
    scaled = (scale @ filled @ scale).tocsc()
    coupling = scaled - diags_array(scaled.diagonal(), format="csc")
    if coupling.nnz and abs(coupling).max() > 1.0 + _ROUNDED:
        largest = abs(coupling).tocoo()
        entry = int(np.argmax(largest.data))
        return scaled, _Negative(int(rows[largest.row[entry]]), 1.0 - float(largest.data[entry]))
    return scaled, None


def _negative(scaled: Any, rows: NDArray[np.intp]) -> _Negative | None:
    """Return a motion in which a matrix with a diagonal of 1 is negative beyond rounding, or None."""
    if not len(rows):
        return None
    if len(rows) > _FEW and _is_cheap(scaled):
        pivots, order = _pivots(scaled, _ROUNDED)
        below = np.flatnonzero(pivots < 0)
        return _Negative(int(rows[order[below[0]]]), float(pivots[below[0]])) if below.size else None
    if len(rows) > _FEW:
        least, motion = _lanczos(scaled)
    else:
        values, vectors = np.linalg.eigh(scaled.toarray())
        least, motion = float(values[0]), vectors[:, 0]
    return _Negative(int(rows[np.argmax(np.abs(motion))]), least) if least < -_ROUNDED else None


def _is_cheap(scaled: Any) -> bool:
    """Return whether a matrix can be factorised in seconds."""
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    place = np.empty(scaled.shape[0], dtype=np.intp)
    place[reverse_cuthill_mckee(scaled, symmetric_mode=True)] = np.arange(len(place))
    entries = scaled.tocoo()
    bandwidth = float(np.max(np.abs(place[entries.row] - place[entries.col]), initial=0))
    return len(place) * (1.0 + bandwidth) ** 2 <= _WORK


def _lanczos(scaled: Any) -> tuple[float, NDArray[np.float64]]:
    """Return an upper bound of the smallest eigenvalue, and the motion that gives it.

    By the three-term recursion without reorthogonalisation: copies of eigenvalues that it finds again do no harm.
    """
    from scipy.linalg import eigh_tridiagonal

    start = np.random.default_rng(0).standard_normal(scaled.shape[0])
    start /= np.linalg.norm(start)

    def steps() -> Iterator[tuple[NDArray[np.float64], float, float]]:
        before, vector, beta = np.zeros_like(start), start, 0.0
        for _ in range(_STEPS):
            product = scaled @ vector - beta * before
            alpha = float(vector @ product)
            product -= alpha * vector
            beta = float(np.linalg.norm(product))
            yield vector, alpha, beta
            if beta <= np.finfo(float).eps:
                return
            before, vector = vector, product / beta

    alphas, betas = np.array([(alpha, beta) for _, alpha, beta in steps()]).T
    values, vectors = eigh_tridiagonal(alphas, betas[:-1], select="i", select_range=(0, 0))
    motion = np.zeros_like(start)
    for weight, (vector, _, _) in zip(vectors[:, 0], steps(), strict=True):
        motion += weight * vector
    return float(values[0]), motion


def _pivots(scaled: Any, shift: float) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the pivots of scaled + shift I, of which as many are negative as eigenvalues, and the rows they belong to.

    By Sylvester's law of inertia for an elimination that takes its pivots from the diagonal.
    """
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    shifted = (scaled + shift * eye_array(scaled.shape[0])).tocsc()
    factors = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return factors.U.diagonal(), np.argsort(factors.perm_c)


def _not_definite(
    name: str, matrix: Any, negative: _Negative, where: str, label: Callable[[int], str]
) -> DovetailError:
    """Return the error about a matrix that is negative in some motion."""
    dof, value = negative.dof, matrix.diagonal()[negative.dof]
    row = abs(matrix[[dof]]).toarray().ravel()
    row[dof] = 0.0
    other = int(np.argmax(row))
    problem = f"the {_NAMES[name]} matrix {name} is not positive semidefinite: "
    if value < 0:
        problem += f"its diagonal entry of {label(dof)} is {value:g}."
    else:
        problem += (
            f"in a motion with {label(dof)} it is negative. That row has {value:g} on the diagonal and "
            f"{matrix[dof, other]:g} to {label(other)}."
        )
    meaning = {"M": "Kinetic energy is never negative", "K": "Strain energy is never negative"}
    reason = meaning.get(name, "Damping never adds energy")
    remedy = f"{reason}: are all signs right, and are the entries of both halves stored once?"
    return DovetailError(Fault(where, problem, remedy=remedy))


def _check_mechanism(
    M: Any,
    K: Any,
    ties: NDArray[np.bool_],
    where: str,
    label: Callable[[int], str],
    reached: Collection[int],
    allowed: int,
) -> None:
    """Raise an error if what can be reached has more motions without stiffness than a body."""
    from scipy.sparse.csgraph import connected_components

    _, group = connected_components(abs(M) + abs(K), directed=False)
    inside = np.isin(group, group[np.fromiter(reached, dtype=np.intp)])
    bodies = np.flatnonzero(inside & ~ties)
    tied = _tied(K, bodies, np.flatnonzero(inside & ties))
    stiff = np.asarray(abs(tied).sum(axis=0)).ravel() > 0
    loose = bodies[~stiff & (np.asarray(abs(M).sum(axis=0)).ravel()[bodies] > 0)]
    scaled, _ = _unit_diagonal(tied, bodies, bodies[stiff])
    count, dof = _zero_modes(scaled, bodies[stiff])
    if count + len(loose) > allowed:
        dof = int(loose[0]) if len(loose) else dof
        problem = (
            f"the stiffness matrix K has {count + len(loose)} motions without any stiffness, and a body has at most "
            f"{allowed} without deformation. One of them moves {label(dof)}."
        )
        remedy = "Are entries missing, or is this more than one body? Import each body as a part of its own."
        raise DovetailError(Fault(where, problem, remedy=remedy))


def _zero_modes(scaled: Any, rows: NDArray[np.intp]) -> tuple[int, int]:
    """Return how many eigenvalues of a positive semidefinite matrix are zero, and a row that moves in such a mode."""
    if not len(rows):
        return 0, -1
    if len(rows) <= _FEW:
        values, vectors = np.linalg.eigh(scaled.toarray())
        count = int(np.count_nonzero(values < _ZERO))
        moving = (vectors[:, :count] ** 2).sum(axis=1)
        return count, int(rows[np.argmax(moving)])
    if not _is_cheap(scaled):
        return 0, -1
    pivots, order = _pivots(scaled, -_ZERO)
    below = np.flatnonzero(pivots < 0)
    return len(below), int(rows[order[below[0]]]) if below.size else -1
