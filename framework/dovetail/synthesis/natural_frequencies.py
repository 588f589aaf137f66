"""Natural frequencies of the undamped assembly, from dense or from sparse matrices, and poles of the damped one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse.csgraph import connected_components

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices, StructuralMatrices
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.joint_evaluation import Theta, joint_jacobian, joint_matrices, sample_count
from dovetail.synthesis.reference import assembly_matrices

__all__ = ["DampedModes", "elastic_frequencies", "elastic_shapes"]

_RIGID_BODY_MODES = 6
_STRAIN_FLOOR = 1e-13
"""Strain energy of a mode, over the largest possible one with its amplitudes, below which it is a rigid-body mode.
Rounding gives a hundredth of this; a beam of 2500 elements in its first bending mode has twice as much."""
_SHIFT_FLOOR = 1e-14
"""Squared frequency [1/s^2], over the shift, below which it is rounding. A mass that nothing holds has only the strain
of rounding errors in its shape, which relative to its amplitudes may be as large as that of an elastic mode."""
_MOST_DOFS = 1500
"""Largest number of DOFs of an assembly whose poles are computed, with full matrices."""
_SAME_POLE = 1e-6
"""Relative difference below which two poles are the same."""
_LEAST_TURN = 0.5
"""Imaginary part of a pole over its magnitude below which it is overdamped: a damping ratio above 0.87."""
_FEW_DOFS = 16
"""Number of DOFs up to which computing all poles takes less time than iterating from the undamped modes."""
_MOST_ENTRIES = 2**20
"""Entries of the matrices of all parameter vectors that are computed at once."""
_CONVERGED = 1e-6
"""Relative change of a pole in the last step; convergence is cubic, so that another step would change nothing."""
_MOST_ITERATIONS = 12


def elastic_frequencies(matrices: StructuralMatrices | SparseMatrices, count: int) -> NDArray[np.float64]:
    """Return the lowest natural frequencies of the modes that deform the structure.

    Parameters
    ----------
    matrices : StructuralMatrices or SparseMatrices
        (d, d); damping is ignored.
    count : int

    Returns
    -------
    (<= count,) array
        Hz, increasing; fewer if the model has fewer elastic modes.

    Raises
    ------
    DovetailError
        The structure is not stable, since a stiffness or a mass is negative; or Lanczos does not converge.

    Notes
    -----
    Massless DOFs and rigid-body modes need no special treatment. Dense matrices: M phi = mu (K + s M) phi. Sparse ones:
    shift-invert Lanczos with a shift below zero.
    """
    if (matrices.M.diagonal() < 0).any():
        raise DovetailError("there are no natural frequencies: with these parameters a mass is negative.")
    if isinstance(matrices, SparseMatrices):
        return _sparse_elastic_frequencies(matrices, count)
    return np.array([frequency for frequency, _ in islice(_dense_modes(matrices.K, matrices.M), count)])


def elastic_shapes(matrices: StructuralMatrices, count: int) -> list[tuple[float, NDArray[np.float64]]]:
    """Return frequency [Hz] and shape (d,) of the lowest modes that deform the structure, from dense matrices.

    Raises
    ------
    DovetailError
        The structure is not stable.
    """
    return list(islice(_dense_modes(matrices.K, matrices.M), count))


def _dense_modes(K: NDArray[np.float64], M: NDArray[np.float64]) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """Yield frequency [Hz] and shape of each elastic mode of dense matrices."""
    size, active = len(K), _dofs_with_inertia((K != 0) | (M != 0), np.diag(M))
    K, M = K[np.ix_(active, active)], M[np.ix_(active, active)]
    inertia = np.diag(M) > 0
    if not inertia.any():
        return
    with np.errstate(over="ignore", invalid="ignore"):
        shift = 1e-3 * float(np.median(np.diag(K)[inertia] / np.diag(M)[inertia])) or 1.0
        shifted = K + shift * M
    if not np.isfinite(shifted).all():
        raise DovetailError(
            "there are no natural frequencies: a stiffness is too large, or a mass too small, to compute with."
        )
    try:
        mu, shapes = eigh(M, shifted)
    except np.linalg.LinAlgError:
        raise DovetailError(
            "there are no natural frequencies: with these parameters a stiffness or a mass is negative."
        ) from None
    finite = mu > mu[-1] * 1e-14
    for frequency, shape in _elastic_modes(K, M, shapes[:, finite][:, ::-1], _SHIFT_FLOOR * shift):
        whole = np.zeros(size)
        whole[active] = shape
        yield frequency, whole


def _sparse_elastic_frequencies(matrices: SparseMatrices, count: int) -> NDArray[np.float64]:
    from scipy.sparse.linalg import ArpackError, eigsh

    active = _dofs_with_inertia(abs(matrices.K) + abs(matrices.M), matrices.M.diagonal())
    K, M = matrices.K[active][:, active], matrices.M[active][:, active]
    inertia = M.diagonal() > 0
    most = int(inertia.sum()) - 1
    wanted = min(count + _RIGID_BODY_MODES, most)
    start = np.random.default_rng(0).standard_normal(len(active))
    while wanted > 0:
        stiffest = float(np.median(K.diagonal()[inertia] / M.diagonal()[inertia])) or 1.0
        try:
            basis = min(max(2 * wanted + 1, 20), most + 1)  # massless DOFs add no direction
            values, shapes = eigsh(K, wanted, M, sigma=-1e-6 * stiffest, which="LM", v0=start, ncv=basis)
        except (ArpackError, RuntimeError) as error:
            raise DovetailError(f"the natural frequencies of this large model are not found: {error}") from None
        if values.min() < -1e-6 * stiffest:
            raise DovetailError("there are no natural frequencies: with these parameters a stiffness is negative.")
        least = _SHIFT_FLOOR * 1e-6 * stiffest
        ordered = _elastic_modes(K, M, shapes[:, np.argsort(values)], least)
        modes = [frequency for frequency, _ in islice(ordered, count)]
        if len(modes) == count or wanted == most:
            return np.array(modes)
        wanted = min(2 * wanted, most)
    return np.empty(0)


def _dofs_with_inertia(pattern: Any, inertia: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the DOFs that are connected with a mass; the others do not move."""
    if (inertia > 0).all():
        return np.arange(len(inertia))
    _, group = connected_components(pattern, directed=False)
    return np.flatnonzero(np.isin(group, group[inertia > 0]))


def _elastic_modes(
    K: Any, M: Any, shapes: NDArray[np.float64], least: float
) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """Yield the shapes that deform the structure, with their frequencies [Hz]; squares [1/s^2] are above `least`."""
    stiffness = abs(K)
    for shape in shapes.T:
        strain, mass = shape @ K @ shape, shape @ M @ shape
        if strain > least * mass and strain > _STRAIN_FLOOR * (abs(shape) @ stiffness @ abs(shape)):
            yield np.sqrt(strain / mass) / (2.0 * np.pi), shape


class DampedModes:
    """Poles of a damped assembly, and their derivatives.

    Parameters
    ----------
    graph : Graph

    Raises
    ------
    DovetailError
        The assembly is too large, a substructure is known by its FRFs only, or a joint depends on frequency other than
        through matrices.
    """

    def __init__(self, graph: Graph) -> None:
        fixed = assembly_matrices(graph, None)
        size = fixed.M.shape[0]
        if size > _MOST_DOFS:
            problem = f"the assembly has {size:,} DOFs; damped modes are computed for {_MOST_DOFS:,} or fewer."
            raise DovetailError(problem)
        every = [getattr(fixed, name) for name in "MKCD"]
        self._fixed = np.stack([matrix.toarray() if isinstance(fixed, SparseMatrices) else matrix for matrix in every])
        self._joints = [
            (name, connection.model, (graph.joint_dofs(name)[:, None] == np.arange(size)).astype(np.float64))
            for name, connection in graph.connections.items()
        ]
        self._moving: tuple[NDArray[np.bool_], NDArray[np.intp]] | None = None

    def at(
        self, theta: Theta, count: int, *, highest: float = np.inf, differentiate: bool = True
    ) -> Iterator[tuple[NDArray[np.complex128], dict[str, NDArray[np.complex128]]]]:
        """Yield the poles of the lowest elastic modes, and their derivatives, for each parameter vector.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array
            All parameters of each joint, by the joint's name.
        count : int
        highest : float
            Hz; of the modes above it, only the first is computed.
        differentiate : bool
            Whether derivatives are computed.

        Yields
        ------
        poles : (<= count,) array
            1/s, with positive imaginary parts, by increasing magnitude; without overdamped modes.
        derivatives : dict of str to (<= count, n_params) array
            By all parameters of each joint.

        Notes
        -----
        Of (s^2 M + s C + K + iD) x = 0. Of few DOFs, all poles of all vectors are computed at once. Of more, Rayleigh
        quotient iteration starts from each mode of the undamped assembly; if it fails or finds the same pole twice, all
        poles are computed. Derivatives are -x^T (dZ/dp) x / x^T (dZ/ds) x.
        """
        rows = max(1, _MOST_ENTRIES // self._fixed[0].size)
        for first in range(0, sample_count(theta), rows):
            chunk = {name: vectors[first : first + rows] for name, vectors in theta.items()}
            matrices, by_joint = self._matrices(chunk), self._derivatives(chunk) if differentiate else {}
            for row, (poles, X) in enumerate(self._modes(matrices, count, highest)):
                M, _, C, _ = matrices[:, row]
                s = poles[:, np.newaxis]
                slopes = np.sum(X * (X @ C + 2.0 * s * (X @ M)), axis=1)[:, np.newaxis]
                derivatives = {}
                for name, (L, changes) in by_joint.items():
                    x = X @ L.T
                    m, k, c, eta = np.einsum("ni,apij,nj->anp", x, changes[:, :, row], x)
                    derivatives[name] = -(k + 1j * eta + s * (c + s * m)) / slopes
                yield poles, derivatives

    def _matrices(self, theta: Theta) -> NDArray[np.float64]:
        """Return M, K, C and D of the assembly for each parameter vector, (4, n, d, d)."""
        matrices = np.repeat(self._fixed[:, np.newaxis], sample_count(theta), axis=1)
        for name, model, L in self._joints:
            of_joint = joint_matrices(name, model, theta[name]).sets[0]
            for matrix, kind in zip(matrices, "MKCD", strict=True):
                matrix += L.T @ getattr(of_joint, kind) @ L
        return matrices

    def _derivatives(self, theta: Theta) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return each joint's DOFs, rows (j, d), and the derivatives (4, n_params, n, j, j) of its matrices."""
        derivatives = {}
        for name, model, L in self._joints:
            sets = joint_jacobian(name, model, theta[name]).sets if model.parameters else ()
            changes = np.array([[getattr(change, kind) for change in sets] for kind in "MKCD"])
            derivatives[name] = L, changes.reshape(4, len(sets), sample_count(theta), len(L), len(L))
        return derivatives

    def _modes(
        self, matrices: NDArray[np.float64], count: int, highest: float
    ) -> Iterator[tuple[NDArray[np.complex128], NDArray[np.complex128]]]:
        """Yield poles (<= count,) and shapes (<= count, d) for each row of matrices (4, n, d, d)."""
        pattern, few = (matrices != 0).any(axis=0), matrices.shape[-1] <= _FEW_DOFS
        together = few and (pattern == pattern[:1]).all()
        for rows in [slice(None)] if together else [slice(row, row + 1) for row in range(len(pattern))]:
            active = self._active(pattern[rows][0], np.diagonal(matrices[0, rows][0]))
            M, K, C, D = matrices[:, rows][..., active[:, np.newaxis], active]
            modes = _all_poles if few else _lowest_poles
            for poles, shapes in modes(K + 1j * D, C, M, count, highest):
                X = np.zeros((len(poles), matrices.shape[-1]), dtype=np.complex128)
                X[:, active] = shapes
                yield poles, X

    def _active(self, pattern: NDArray[np.bool_], inertia: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the DOFs that move, from the previous call if the same entries are zero."""
        if self._moving is None or not np.array_equal(self._moving[0], pattern):
            self._moving = pattern, _dofs_with_inertia(pattern, inertia)
        return self._moving[1]


def _all_poles(A: Any, C: Any, M: Any, count: int, highest: float) -> Iterator[tuple[Any, Any]]:
    """Yield poles (<= count,) and shapes (<= count, d) of each of the stacked A + s C + s^2 M (n, d, d).

    With s = z + z / v and a positive z, v is an eigenvalue of a companion matrix, also with massless DOFs or rigid
    bodies.
    """
    inertia, stiffness = (np.diagonal(part.real, axis1=1, axis2=2).sum(axis=1) for part in (M, A))
    z = np.sqrt(np.where(stiffness > 0.0, stiffness / inertia, 1.0))[:, np.newaxis, np.newaxis]
    below = -np.linalg.solve(A + z * (C + z * M), np.concatenate([z**2 * M, z * (C + 2.0 * z * M)], axis=2))
    above = np.broadcast_to(np.eye(M.shape[1], 2 * M.shape[1], M.shape[1]), below.shape)
    values, vectors = np.linalg.eig(np.concatenate([above, below], axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):  # massless DOFs have infinite poles
        poles = z[:, 0] * (1.0 + 1.0 / values)
    for s, X, K in zip(poles, vectors[:, : M.shape[1]].swapaxes(1, 2), A.real, strict=True):
        strain, largest = np.sum(X.conj() * (X @ K), axis=1).real, np.sum(np.abs(X) * (np.abs(X) @ np.abs(K)), axis=1)
        turning = np.isfinite(s) & (s.imag > _LEAST_TURN * np.abs(s)) & (strain > _STRAIN_FLOOR * largest)
        lowest = np.flatnonzero(turning)[np.argsort(np.abs(s[turning]))][:count]
        lowest = lowest[: 1 + np.count_nonzero(np.abs(s[lowest]) <= 2.0 * np.pi * highest)]
        yield s[lowest], X[lowest]


def _lowest_poles(A: Any, C: Any, M: Any, count: int, highest: float) -> Iterator[tuple[Any, Any]]:
    """Yield the same as `_all_poles`, where iteration from each mode of the undamped assembly finds as many poles."""
    for row, (stiffness, damping, mass) in enumerate(zip(A, C, M, strict=True)):
        undamped = list(islice(_dense_modes(stiffness.real, mass), count))
        undamped = undamped[: 1 + sum(frequency <= highest for frequency, _ in undamped)]
        starts = np.array([2j * np.pi * frequency for frequency, _ in undamped], dtype=np.complex128)
        shapes = np.array([shape for _, shape in undamped], dtype=np.complex128).reshape(len(undamped), len(mass))
        poles, shapes = _refined(stiffness, damping, mass, starts, shapes)
        apart = np.abs(poles[:, None] - poles) + np.abs(poles) * np.eye(len(poles))
        if (poles.imag > _LEAST_TURN * np.abs(poles)).all() and (apart > _SAME_POLE * np.abs(poles)).all():
            order = np.argsort(np.abs(poles))
            yield poles[order], shapes[order]
        else:
            alone = slice(row, row + 1)
            yield from _all_poles(A[alone], C[alone], M[alone], count, highest)


def _refined(A: Any, C: Any, M: Any, s: Any, X: Any) -> tuple[Any, Any]:
    """Return the poles and shapes from Rayleigh quotient iteration; NaN where it does not converge."""
    s, X, going = s.copy(), X.copy(), np.arange(len(s))
    for _ in range(_MOST_ITERATIONS):
        at, x = s[going, None], X[going]
        Ax, Cx, Mx = x @ A, x @ C, x @ M
        turned = Cx + 2.0 * at * Mx
        change = np.sum(x * (Ax + at * (Cx + at * Mx)), axis=1) / np.sum(x * turned, axis=1)
        s[going] -= change
        unconverged = np.abs(change) > _CONVERGED * np.abs(s[going])
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
