"""Natural frequencies of the undamped assembly, from dense or from sparse matrices, and poles of the damped one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, eigh
from scipy.sparse.csgraph import connected_components

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices, StructuralMatrices
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.joint_evaluation import joint_jacobian, joint_matrices
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
    shift = 1e-3 * float(np.median(np.diag(K)[inertia] / np.diag(M)[inertia])) or 1.0
    try:
        mu, shapes = eigh(M, K + shift * M)
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
        self._fixed = [matrix.toarray() if isinstance(fixed, SparseMatrices) else matrix for matrix in every]
        self._joints = [
            (name, connection.model, (graph.joint_dofs(name)[:, None] == np.arange(size)).astype(np.float64))
            for name, connection in graph.connections.items()
        ]
        self._moving: tuple[NDArray[np.bool_], NDArray[np.intp]] | None = None

    def at(
        self,
        theta: Mapping[str, NDArray[np.float64]],
        count: int,
        *,
        highest: float = np.inf,
        differentiate: bool = True,
    ) -> tuple[NDArray[np.complex128], dict[str, NDArray[np.complex128]]]:
        """Return the poles of the lowest elastic modes, and their derivatives.

        Parameters
        ----------
        theta : mapping of str to (n_params,) array
            All parameters of each joint, by the joint's name.
        count : int
        highest : float
            Hz; of the modes above it, only the first is computed.
        differentiate : bool
            Whether derivatives are computed.

        Returns
        -------
        poles : (<= count,) array
            1/s, with positive imaginary parts, by increasing magnitude; without overdamped modes.
        derivatives : dict of str to (<= count, n_params) array
            By all parameters of each joint.

        Notes
        -----
        Rayleigh quotient iteration for (s^2 M + s C + K + iD) x = 0 from each mode of the undamped assembly. If it
        fails or finds the same pole twice, the QZ algorithm computes all poles. Derivatives are
        -x^T (dZ/dp) x / x^T (dZ/ds) x.
        """
        matrices = [matrix.copy() for matrix in self._fixed]
        for name, model, L in self._joints:
            of_joint = joint_matrices(name, model, theta[name][None]).sets[0]
            for matrix, kind in zip(matrices, "MKCD", strict=True):
                matrix += L.T @ getattr(of_joint, kind)[0] @ L
        M, K, C, D = matrices
        active = self._active(M, K, C, D)
        M, C, A = (matrix[np.ix_(active, active)] for matrix in (M, C, K + 1j * D))
        undamped = list(islice(_dense_modes(A.real, M), count))
        undamped = undamped[: 1 + sum(frequency <= highest for frequency, _ in undamped)]
        poles, X = _poles(A, C, M, undamped)
        slopes = np.array([x @ (C + 2.0 * s * M) @ x for s, x in zip(poles, X, strict=True)])
        derivatives = {}
        for name, model, L in self._joints if differentiate else ():
            x, columns = X @ L[:, active].T, []
            for d in joint_jacobian(name, model, theta[name][None]).sets if model.parameters else ():
                m, k, c, eta = (np.einsum("ni,ij,nj->n", x, getattr(d, kind)[0], x) for kind in "MKCD")
                columns.append(-(k + 1j * eta + poles * (c + poles * m)) / slopes)
            derivatives[name] = np.stack(columns, axis=-1) if columns else np.empty((len(poles), 0), np.complex128)
        return poles, derivatives

    def _active(self, M: Any, K: Any, C: Any, D: Any) -> NDArray[np.intp]:
        """Return the DOFs that move, from the previous call if the same entries are zero."""
        pattern, inertia = (K != 0) | (M != 0) | (C != 0) | (D != 0), np.diag(M)
        if self._moving is None or not np.array_equal(self._moving[0], pattern):
            self._moving = pattern, _dofs_with_inertia(pattern, inertia)
        return self._moving[1]


def _poles(A: Any, C: Any, M: Any, undamped: list[tuple[float, NDArray[np.float64]]]) -> tuple[Any, Any]:
    """Return poles (n,) and shapes (n, d) of A + s C + s^2 M from the undamped frequencies [Hz] and shapes."""
    starts = np.array([2j * np.pi * frequency for frequency, _ in undamped], dtype=np.complex128)
    shapes = np.array([shape for _, shape in undamped], dtype=np.complex128).reshape(len(undamped), len(M))
    poles, shapes = _refined(A, C, M, starts, shapes)
    apart = np.abs(poles[:, None] - poles) + np.abs(poles) * np.eye(len(poles))
    if not ((poles.imag > _LEAST_TURN * np.abs(poles)).all() and (apart > _SAME_POLE * np.abs(poles)).all()):
        one, zero = np.eye(len(M)), np.zeros_like(M)
        values, vectors = eig(np.block([[zero, one], [-A, -C]]), np.block([[one, zero], [zero, M]]))
        turning = np.isfinite(values) & (values.imag > _LEAST_TURN * np.abs(values))
        kept = turning & (np.abs(values) > np.abs(starts[0]) / 2.0)  # rigid-body modes have poles at or near zero
        poles, shapes = _refined(A, C, M, values[kept], vectors[: len(M), kept].T)
        poles, shapes = poles[np.isfinite(poles)], shapes[np.isfinite(poles)]
    order = np.argsort(np.abs(poles))[: len(undamped)]
    return poles[order], shapes[order]


def _refined(A: Any, C: Any, M: Any, s: Any, X: Any) -> tuple[Any, Any]:
    """Return the poles and shapes from Rayleigh quotient iteration; NaN where it does not converge."""
    s, X, going = s.copy(), X.copy(), np.arange(len(s))
    for _ in range(_MOST_ITERATIONS):
        at, x = s[going, None], X[going]
        Ax, Cx, Mx = x @ A, x @ C, x @ M
        turned = Cx + 2.0 * at * Mx
        change = np.sum(x * (Ax + at * (Cx + at * Mx)), axis=1) / np.sum(x * turned, axis=1)
        s[going] -= change
        left = np.abs(change) > _CONVERGED * np.abs(s[going])
        going, turned = going[left], turned[left]
        try:
            solved = [np.linalg.solve(A + z * (C + z * M), b) for z, b in zip(s[going], turned, strict=True)]
        except np.linalg.LinAlgError:  # exactly at a pole, or no pole at all
            break
        if not solved:
            break
        X[going] = np.array(solved) / np.linalg.norm(solved, axis=1, keepdims=True)
    s[going] = np.nan
    return s, X
