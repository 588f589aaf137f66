"""Natural frequencies, damping ratios and shapes of an assembly: its damped poles, and their derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import JointModel, SparseMatrices
from dovetail.synthesis.frequency_laws import ContinuedStiffness
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.joint_evaluation import (
    Theta,
    depends_on_frequency,
    joint_jacobian,
    joint_matrices,
    joint_stiffness,
    joint_stiffness_jacobian,
    sample_count,
)
from dovetail.synthesis.natural_frequencies import lowest_poles, searched_poles
from dovetail.synthesis.pole_search import LEAST_TURN, Pencil, Wanted, all_poles, dofs_with_inertia, few_poles, placed
from dovetail.synthesis.reference import assembly_matrices
from dovetail.synthesis.relative_coordinates import (
    in_coordinates,
    relative_coordinates,
    rounded,
    stiff_springs,
    warn_of_lost_digits,
)

_FEW_DOFS = 16
"""Number of DOFs up to which computing all poles takes less time than iterating from the undamped modes."""
_SPARSE_DOFS = 300
"""Number of DOFs up to which sparse matrices are made dense."""
_DIFFERENCE = 1e-8
"""Error of derivatives by differences, up to which they are smooth functions of frequency."""
_NEGATIVE = 1e-8
"""Eigenvalue of the stiffness, with a diagonal of ones, below which it is negative; rounding gives 1e-15."""
_MOST_ENTRIES = 2**20
"""Entries of the matrices of all parameter vectors that are computed at once."""
_ANY, _ROUNDING = 100.0, 1e-14
"""Frequency [Hz] at which the DOFs that a joint connects are found, and the part of its entries that is rounding."""
_STIFF_DOFS, _RIGID_BODY_MODES = 120, 6
"""Number of DOFs up to which digits of soft parts next to stiff joints are kept, and number of rigid-body modes
computed then."""
_STIFF = 1e9
"""Ratio of the stiffest joint to the softest stiffness above which the latter would lose more than nine digits."""
_SEVERAL = 30.0
"""Strain energy over that of rounding in joints below which a mode is a rigid-body mode."""


@dataclass(frozen=True, eq=False)
class Poles:
    """Poles of one parameter vector by increasing magnitude, with shapes and derivatives.

    Parameters
    ----------
    values : (k,) complex array
        1/s, with positive imaginary parts; none of overdamped motions.
    shapes : (k, d) complex array
        x^T (dZ/ds) x = 1, so that the receptance between two DOFs has the residue x_o x_i at the pole. The DOFs are
        those of the graph, then the inner ones of substructures.
    derivatives : dict of str to (k, n_params) array
        By all parameters of each joint.
    """

    values: NDArray[np.complex128]
    shapes: NDArray[np.complex128]
    derivatives: Mapping[str, NDArray[np.complex128]]


class DampedModes:
    """Poles s of an assembly, where its dynamic stiffness Z(s) = s^2 M + s C + K + iD is singular.

    Parameters
    ----------
    graph : Graph

    Raises
    ------
    DovetailError
        A substructure is known by its FRFs only.

    Notes
    -----
    A joint that depends on frequency adds its own dynamic stiffness, continued from real frequencies to f = s / 2 pi i.
    Structural damping is the constant iD, so that a spring k (1 + i eta) with a mass m has s^2 = -k (1 + i eta) / m: a
    natural frequency of sqrt(k / m) (1 + eta^2)^(1/4) and a damping ratio of eta / 2 for small eta.

    For few DOFs, all poles of all parameter vectors are computed at once. For more, Rayleigh quotient iteration starts
    from each undamped mode. If a pole is far from its start, all poles are computed; for large and sparse matrices, on
    a basis that grows until they are accurate. Derivatives are -x^T (dZ/dp) x / x^T (dZ/ds) x.
    """

    def __init__(self, graph: Graph) -> None:
        models = {name: connection.model for name, connection in graph.connections.items()}
        for name, model in models.items():
            if depends_on_frequency(model) and model.kind == "substructure":
                raise DovetailError(f"substructure '{name}' has no matrices, so the assembly has none either.")
        fixed = assembly_matrices(graph, None)
        size = fixed.M.shape[0]
        self._sparse = isinstance(fixed, SparseMatrices) and size > _SPARSE_DOFS
        every = [getattr(fixed, name) for name in "MKCD"]
        if isinstance(fixed, SparseMatrices) and not self._sparse:
            every = [matrix.toarray() for matrix in every]
        self._fixed: Any = every if self._sparse else np.stack(every)
        self._joints = [(name, model, self._rows(graph.joint_dofs(name), size)) for name, model in models.items()]
        self._moving: tuple[NDArray[np.bool_], NDArray[np.intp]] | None = None

    def _rows(self, numbers: NDArray[np.intp], size: int) -> Any:
        """Return the incidence matrix (j, d), zeros and ones, of a joint's DOFs among all DOFs."""
        if not self._sparse:
            return (numbers[:, None] == np.arange(size)).astype(np.float64)
        moving = np.flatnonzero(numbers >= 0)
        return scipy.sparse.csc_array((np.ones(len(moving)), (moving, numbers[moving])), shape=(len(numbers), size))

    def at(
        self,
        theta: Theta,
        count: int,
        *,
        highest: float = np.inf,
        least_turn: float = LEAST_TURN,
        differentiate: bool = True,
        must_be_stable: bool = False,
    ) -> Iterator[Poles]:
        """Yield the poles of the lowest elastic modes for each parameter vector.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array
            All parameters of each joint, by the joint's name.
        count : int
        highest : float
            Hz; of the modes above it, only the first is computed.
        least_turn : float
            Imaginary part of a pole over its magnitude below which it is overdamped.
        differentiate : bool
            Whether derivatives are computed.
        must_be_stable : bool
            Whether an assembly of few DOFs with a negative stiffness is refused, as one of many always is.

        Raises
        ------
        DovetailError
            The assembly is not stable, or a joint's dynamic stiffness is not a smooth function of frequency.
        """
        wanted = Wanted(count, highest, least_turn)
        rows = 1 if self._sparse else max(1, _MOST_ENTRIES // max(1, self._fixed[0].size))
        for first in range(0, sample_count(theta), rows):
            chunk = {name: vectors[first : first + rows] for name, vectors in theta.items()}
            matrices, by_joint = self._matrices(chunk), self._derivatives(chunk) if differentiate else {}
            if must_be_stable and not self._sparse and len(self._fixed[0]) <= _FEW_DOFS:
                _check_stiffness(matrices[1])
            for row, (s, X) in enumerate(self._modes(matrices, chunk, wanted)):
                M, _, C, _ = (matrix[row] for matrix in matrices)
                slopes = np.sum(X * ((C @ X.T).T + 2.0 * s[:, np.newaxis] * (M @ X.T).T), axis=1)
                for _, (L, stiffness) in self._laws(chunk, row):
                    x = (L @ X.T).T
                    slopes += [form @ stiffness.at(pole)[1] @ form for pole, form in zip(s, x, strict=True)]
                X = X / np.sqrt(slopes[:, np.newaxis].astype(np.complex128))
                derivatives = {
                    name: -self._change(name, s, (L @ X.T).T, changes, chunk, row)
                    for name, (L, changes) in by_joint.items()
                }
                yield Poles(s, X, derivatives)

    def _change(self, name: str, s: Any, x: Any, changes: Any, theta: Theta, row: int) -> NDArray[np.complex128]:
        """Return x^T (dZ/dp) x of a joint for each pole and each parameter, (k, n_params)."""
        if changes is not None:
            m, k, c, eta = np.sum((x @ changes[:, :, row]) * x, axis=-1).swapaxes(1, 2)
            return np.asarray(k + 1j * eta + s[:, np.newaxis] * (c + s[:, np.newaxis] * m))
        model = next(model for joint, model, _ in self._joints if joint == name)
        vector = theta[name][row : row + 1]

        def evaluate(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
            return np.stack([d[0] for d in joint_stiffness_jacobian(name, model, frequency, vector)], axis=1)

        label = f"the derivative of the dynamic stiffness of joint '{name}'"
        continued = ContinuedStiffness(evaluate, label, _DIFFERENCE)
        slopes = [np.einsum("i,pij,j->p", form, continued.at(pole)[0], form) for pole, form in zip(s, x, strict=True)]
        return np.array(slopes, dtype=np.complex128).reshape(len(s), len(model.parameters))

    def _laws(self, theta: Theta, row: int) -> Iterator[tuple[str, tuple[Any, ContinuedStiffness]]]:
        """Yield each frequency-dependent joint's name, DOFs and dynamic stiffness for one parameter vector."""
        for name, model, L in self._joints:
            if depends_on_frequency(model):
                stiffness = partial(_stiffness_of, name, model, theta[name][row : row + 1])
                yield name, (L, ContinuedStiffness(stiffness, f"the dynamic stiffness of joint '{name}'"))

    def _matrices(self, theta: Theta) -> Any:
        """Return M, K, C and D of the assembly for each parameter vector, (4, n, d, d) or four lists of sparse ones."""
        count = sample_count(theta)
        matrices = [[matrix] for matrix in self._fixed] if self._sparse else np.repeat(self._fixed[:, None], count, 1)
        for name, model, L in self._joints:
            if depends_on_frequency(model):
                continue
            joint = joint_matrices(name, model, theta[name]).sets[0]
            for matrix, kind in zip(matrices, "MKCD", strict=True):
                if self._sparse:
                    matrix[0] = matrix[0] + L.T @ scipy.sparse.csc_array(getattr(joint, kind)[0]) @ L
                else:
                    matrix += L.T @ getattr(joint, kind) @ L
        return matrices

    def _derivatives(self, theta: Theta) -> dict[str, tuple[Any, NDArray[np.float64] | None]]:
        """Return each joint's DOFs, rows (j, d), and the derivatives (4, n_params, n, j, j) of its matrices, if any."""
        derivatives: dict[str, tuple[Any, NDArray[np.float64] | None]] = {}
        for name, model, L in self._joints:
            if depends_on_frequency(model):
                derivatives[name] = L, None
                continue
            sets = joint_jacobian(name, model, theta[name]).sets if model.parameters else ()
            changes = np.array([[getattr(change, kind) for change in sets] for kind in "MKCD"])
            derivatives[name] = L, changes.reshape(4, len(sets), sample_count(theta), *L.shape[:1] * 2)
        return derivatives

    def _modes(self, matrices: Any, theta: Theta, wanted: Wanted) -> Iterator[tuple[Any, Any]]:
        """Yield poles (k,) and shapes (k, d) for each parameter vector."""
        laws = any(depends_on_frequency(model) for _, model, _ in self._joints)
        if self._sparse or laws:
            for row in range(len(matrices[0])):
                yield self._single([matrix[row] for matrix in matrices], theta, row, wanted)
            return
        if matrices.shape[-1] <= _STIFF_DOFS and (stiff := self._is_stiff(theta)).any():
            for row, relative in enumerate(stiff):
                single = {name: vectors[row : row + 1] for name, vectors in theta.items()}
                if relative:
                    yield self._relative(single, wanted)
                else:
                    yield next(self._dense_modes(self._matrices(single), wanted))
            return
        yield from self._dense_modes(matrices, wanted)

    def _dense_modes(self, matrices: NDArray[np.float64], wanted: Wanted) -> Iterator[tuple[Any, Any]]:
        """Yield poles (k,) and shapes (k, d) for each row of dense matrices (4, n, d, d)."""
        pattern, few = (matrices != 0).any(axis=0), matrices.shape[-1] <= _FEW_DOFS
        stackable = few and (pattern == pattern[:1]).all()
        for rows in [slice(None)] if stackable else [slice(row, row + 1) for row in range(len(pattern))]:
            inertia = np.diagonal(matrices[0, rows], axis1=1, axis2=2)
            _check_mass(inertia)
            active = self._active(pattern[rows][0], inertia[0])
            M, K, C, D = matrices[:, rows][..., active[:, np.newaxis], active]
            modes = all_poles if few else lowest_poles
            for poles, shapes in modes(K + 1j * D, C, M, wanted) if len(active) else [_NONE] * len(M):
                yield poles, _on_all(shapes, active, matrices.shape[-1])

    def _is_stiff(self, theta: Theta) -> NDArray[np.bool_]:
        """Return for which parameter vectors the stiffest joint takes too many digits from the softest stiffness."""
        fixed = np.diagonal(self._fixed[1])
        stiffest = np.zeros(sample_count(theta))
        softest = np.full(len(stiffest), min(fixed[fixed > 0.0], default=np.inf))
        for name, model, _ in self._joints:
            own = np.diagonal(joint_matrices(name, model, theta[name]).sets[0].K, axis1=1, axis2=2)
            stiffest = np.maximum(stiffest, own.max(axis=1, initial=0.0))
            softest = np.minimum(softest, np.where(own > 0.0, own, np.inf).min(axis=1, initial=np.inf))
        return np.asarray(stiffest > _STIFF * softest)

    def _relative(self, theta: Theta, wanted: Wanted) -> tuple[Any, Any]:
        """Return poles and shapes of one parameter vector, in coordinates relative to one another across springs."""
        matrices = {name: joint_matrices(name, model, theta[name]).sets[0] for name, model, _ in self._joints}
        size = self._fixed.shape[-1]
        numbers = {name: np.where(L.any(axis=1), L.argmax(axis=1), -1) for name, _, L in self._joints}
        others = np.full(size, np.finfo(np.float64).tiny)  # every spring may hide another
        springs = [
            spring
            for name, matrix_set in matrices.items()
            for spring in stiff_springs(matrix_set.K[0], numbers[name], others)
        ]
        T = relative_coordinates(size, springs)
        MKCD = T.T @ self._fixed @ T
        for name, matrix_set in matrices.items():
            rows = np.append(T, np.zeros((1, size)), axis=0)[numbers[name]]
            MKCD += np.stack([in_coordinates(getattr(matrix_set, kind), rows)[0] for kind in "MKCD"])
        _check_mass(np.diagonal(MKCD[0]))
        active = dofs_with_inertia((MKCD != 0).any(axis=0), np.diagonal(MKCD[0]))
        if not len(active):
            return _NONE[0], np.empty((0, size))
        M, K, C, D = MKCD[:, active[:, np.newaxis], active]
        inertia, stiffness = np.diagonal(M), np.diagonal(K)
        both = (inertia > 0.0) & (stiffness > 0.0)
        lowest = min(stiffness[both] / inertia[both], default=1.0)
        scale = 1.0 / np.sqrt(np.where(stiffness > 0.0, stiffness, np.where(inertia > 0.0, lowest * inertia, 1.0)))
        with np.errstate(over="ignore", invalid="ignore"):  # the search refuses what is not finite
            A, C, M = (matrix * scale[:, np.newaxis] * scale for matrix in (K + 1j * D, C, M))
        poles, shapes = few_poles(Pencil(A, C, M), replace(wanted, count=wanted.count + _RIGID_BODY_MODES))
        X = _on_all(shapes * scale, active, size) @ T.T
        strain = np.sum(shapes.conj() * (shapes @ A.real), axis=1).real
        noise = np.zeros(len(X))
        for name, _, L in self._joints:
            noise += np.abs(X @ L.T) ** 2 @ rounded(matrices[name].K[0])
        elastic = np.flatnonzero(strain > _SEVERAL * noise)
        kept = elastic[wanted.lowest(poles[elastic])]
        for pole, lost in zip(poles[kept], noise[kept] / strain[kept], strict=True):
            warn_of_lost_digits(f"the natural frequency {abs(pole) / (2.0 * np.pi):.4g} Hz", float(lost))
        return poles[kept], X[kept]

    def _single(self, MKCD: Any, theta: Theta, row: int, wanted: Wanted) -> tuple[Any, Any]:
        """Return poles and shapes of one parameter vector, if matrices are sparse or joints depend on frequency."""
        laws = [law for _, law in self._laws(theta, row)]
        M, K, C, D = MKCD
        _check_mass(M.diagonal())
        joined, inertia = abs(M) + abs(K) + abs(C) + abs(D), M.diagonal()
        for L, stiffness in laws:
            own = _without_rounding(L, stiffness.at(2j * np.pi * _ANY)[0])
            joined, inertia = joined + own, inertia + own.diagonal()  # which may have masses within
        active = dofs_with_inertia(joined != 0, inertia)
        if not len(active):
            return _NONE[0], np.empty((0, M.shape[0]))
        M, K, C, D = (matrix[active][:, active] for matrix in MKCD)
        pencil = Pencil(K + 1j * D, C, M, [(L[:, active], stiffness) for L, stiffness in laws])
        poles, shapes = searched_poles(pencil, wanted)
        return poles, _on_all(shapes, active, MKCD[0].shape[0])

    def _active(self, pattern: NDArray[np.bool_], inertia: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the DOFs that move, from the previous call if the same entries are zero."""
        if self._moving is None or not np.array_equal(self._moving[0], pattern):
            self._moving = pattern, dofs_with_inertia(pattern, inertia)
        return self._moving[1]


_NONE = np.empty(0, dtype=np.complex128), np.empty((0, 0), dtype=np.complex128)


def _without_rounding(L: Any, value: NDArray[np.complex128]) -> Any:
    """Return the magnitudes of a joint's matrix among all DOFs; those of ends that move together cancel to zero."""
    own = abs(placed(L, value))
    return own * (own > _ROUNDING * placed(L, np.abs(value)))


def _stiffness_of(
    name: str, model: JointModel, vector: NDArray[np.float64], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    return np.asarray(joint_stiffness(name, model, frequency, vector)[0])


def _check_mass(inertia: NDArray[np.float64]) -> None:
    if (inertia < 0).any():
        raise DovetailError("there are no natural frequencies: with these parameters a mass is negative.")


def _check_stiffness(K: NDArray[np.float64]) -> None:
    """Refuse negative stiffness in matrices (n, d, d)."""
    scale = np.sqrt(np.abs(np.diagonal(K, axis1=1, axis2=2)))
    scale = np.where(scale > 0.0, scale, 1.0)
    if (np.linalg.eigvalsh(K / (scale[:, :, np.newaxis] * scale[:, np.newaxis])) < -_NEGATIVE).any():
        raise DovetailError(
            "there are no natural frequencies: with these parameters a stiffness or a mass is negative."
        )


def _on_all(shapes: NDArray[np.complex128], active: NDArray[np.intp], size: int) -> NDArray[np.complex128]:
    X = np.zeros((len(shapes), size), dtype=np.complex128)
    X[:, active] = shapes
    return X
