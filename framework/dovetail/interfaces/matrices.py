"""Structural matrices, dense or sparse, and the DOFs of their rows: mass, stiffness and damping."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import Any, Literal

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import ArrayLike, NDArray

Direction = Literal["x", "y", "z", "rx", "ry", "rz"]
"""One of `DIRECTIONS`."""
DIRECTIONS: tuple[Direction, ...] = ("x", "y", "z", "rx", "ry", "rz")
"""Displacements along x, y and z [m], and rotations about them by the right-hand rule [rad], in their order."""

ROTATIONS = DIRECTIONS[3:]
PLANAR: tuple[Direction, ...] = ("x", "rz")
"""The directions of a part that bends in one plane.

Its axis runs along -y, so that the rotation about z is the slope of the displacement x along the axis.
"""


def is_rotation(direction: str) -> bool:
    """Return whether a direction is a rotation, in rad, and not a displacement, in m."""
    return direction in ROTATIONS


def direction_problem(directions: object) -> str:
    """Return what is wrong with the directions of a node, or an empty text.

    Parameters
    ----------
    directions : object
        Right are some of `DIRECTIONS`, in their order, as a tuple.
    """
    if not isinstance(directions, tuple) or not directions:
        return f"{directions!r:.60} is not a tuple of directions"
    if strange := [one for one in directions if one not in DIRECTIONS]:
        return f"{strange[0]!r:.40} is not a direction"
    if directions != tuple(one for one in DIRECTIONS if one in directions):
        return f"{directions!r:.60} are not different directions in their order"
    return ""


def cross_matrix(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix (3, 3) whose product with another vector is the cross product of `vector` (3,) with it."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def carried(way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the motion (6, 6) of a point of a rigid body by that of another one, from which `way` (3,) [m] leads."""
    motion = np.eye(len(DIRECTIONS))
    motion[:3, 3:] = cross_matrix(way).T
    return motion


@dataclass(frozen=True)
class NodeDofs:
    """The DOFs of some nodes: node after node, each with its directions in their order.

    Parameters
    ----------
    directions : tuple of tuple of str
        The directions of each node; none of a node that another one carries.
    carriers : mapping of int to (int, three floats)
        The nodes that others carry, as points of one rigid body do: the other node, and the way from there [m].
    """

    directions: tuple[tuple[str, ...], ...]
    carriers: Mapping[int, tuple[int, tuple[float, float, float]]] = field(default_factory=dict, compare=False)

    @staticmethod
    def from_nodes(nodes: Sequence[Any]) -> NodeDofs:
        """Return the DOFs of nodes with `directions`, `coordinates` and `carrier`."""
        carriers = {
            number: (node.carrier, tuple(np.subtract(node.coordinates, nodes[node.carrier].coordinates).tolist()))
            for number, node in enumerate(nodes)
            if node.carrier is not None
        }
        return NodeDofs(tuple(() if node.carrier is not None else node.directions for node in nodes), carriers)

    @cached_property
    def _first(self) -> tuple[int, ...]:
        return tuple(accumulate((len(each) for each in self.directions), initial=0))

    @property
    def size(self) -> int:
        """Number of DOFs."""
        return self._first[-1]

    def at_node(self, node: int) -> range:
        """Return the DOFs of a node."""
        return range(self._first[node], self._first[node + 1])

    def find(self, node: int, direction: str) -> int | None:
        """Return the DOF of a node in a direction; None if the node has no such DOF."""
        if direction not in self.directions[node]:
            return None
        return self._first[node] + self.directions[node].index(direction)

    def among(self, nodes: Iterable[int], directions: Iterable[str]) -> tuple[int, ...]:
        """Return the DOFs of some nodes in some directions, node by node.

        Raises
        ------
        ValueError
            A node has no DOF in one of the directions.
        """
        wanted = tuple(directions)
        return tuple(self._first[node] + self.directions[node].index(each) for node in nodes for each in wanted)

    def terms(self, node: int, weights: Mapping[str, float]) -> tuple[tuple[float, int], ...]:
        """Return the DOFs whose weighted sum is a motion of a node, with their weights.

        Parameters
        ----------
        node : int
        weights : mapping of str to float
            Of the directions of which the motion is the sum.
        """
        if node not in self.carriers:
            return tuple(zip(weights.values(), self.among([node], weights), strict=True))
        carrier, way = self.carriers[node]
        motion = sum(weight * carried(np.asarray(way))[DIRECTIONS.index(each)] for each, weight in weights.items())
        return tuple((float(motion[axis]), self.at_node(carrier)[axis]) for axis in np.flatnonzero(motion))

    @cached_property
    def _owners(self) -> tuple[tuple[int, str], ...]:
        return tuple((node, each) for node, directions in enumerate(self.directions) for each in directions)

    def __getitem__(self, dof: int) -> tuple[int, str]:
        """Return the node and the direction of a DOF."""
        return self._owners[dof]

    def __iter__(self) -> Iterator[tuple[int, str]]:
        """Yield the node and the direction of each DOF."""
        return iter(self._owners)

    @cached_property
    def rotations(self) -> NDArray[np.bool_]:
        """Which of the DOFs are rotations, (size,)."""
        return np.array([is_rotation(direction) for _, direction in self._owners], dtype=bool)


def refuse_complex(name: str, values: Any) -> None:
    """Raise a ValueError for a complex matrix M, K, C or D, whose imaginary part would be lost.

    Parameters
    ----------
    name : str
    values : array, sparse array or nested sequence
    """
    if np.iscomplexobj(values):
        where = "K (1 + i eta) is K and D = eta K" if name in "KD" else "damping has matrices of its own, C and D"
        raise ValueError(f"{name} is complex; M, K, C and D are real: {where}.")


@contextmanager
def refusing_complex_values() -> Iterator[None]:
    """Raise an error if a component writes complex values into real matrices, which would drop the imaginary part."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", np.exceptions.ComplexWarning)
        yield


@dataclass(frozen=True, eq=False, init=False)
class StructuralMatrices:
    """Matrices of the dynamic stiffness Z = K + iD + i omega C - omega^2 M.

    Parameters
    ----------
    M, K, C, D : (..., d, d) arrays
        Mass [kg], stiffness [N/m], viscous damping [N s/m] and structural damping [N/m] for DOFs in m; the
        corresponding units for rotations in rad. `C` and `D` are zero by default. Leading axes form a batch.

    Raises
    ------
    ValueError
        The matrices are complex or not square, or their shapes differ.

    Notes
    -----
    Equation 3 of Processes 14 (2026) 1875, doi:10.3390/pr14121875.
    """

    M: NDArray[np.float64]
    K: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]

    def __init__(self, M: ArrayLike, K: ArrayLike, C: ArrayLike | None = None, D: ArrayLike | None = None) -> None:
        for name, values in (("M", M), ("K", K), ("C", C), ("D", D)):
            if getattr(values, "dtype", None) != np.float64:  # a joint makes many, mostly of such arrays
                refuse_complex(name, values)
        stiffness = np.asarray(K, dtype=np.float64)
        if stiffness.ndim < 2 or stiffness.shape[-1] != stiffness.shape[-2]:
            raise ValueError(f"K has the shape {stiffness.shape}; square matrices (..., d, d) are expected.")
        for name, values in (("M", M), ("K", K), ("C", C), ("D", D)):
            matrix = np.zeros_like(stiffness) if values is None else np.asarray(values, dtype=np.float64)
            if matrix.shape != stiffness.shape:
                raise ValueError(f"{name} has the shape {matrix.shape}, but K has {stiffness.shape}.")
            object.__setattr__(self, name, matrix)

    @classmethod
    def zeros(cls, *shape: int) -> StructuralMatrices:
        """Return matrices of zeros: ``zeros(d)`` or, as a batch, ``zeros(n, d)``."""
        full = (*shape, shape[-1])
        return cls(np.zeros(full), np.zeros(full), np.zeros(full), np.zeros(full))

    def add_contact_layer(
        self,
        pairs: Sequence[tuple[int, int]],
        stiffness: NDArray[np.float64] | float,
        damping: NDArray[np.float64] | float = 0.0,
    ) -> None:
        """Add a spring and a damper of no thickness between each pair of DOFs, in place.

        Parameters
        ----------
        pairs : sequence of (int, int)
            DOFs that face each other.
        stiffness, damping : (...) arrays
            Of each spring and damper [N/m and N s/m, or N m/rad and N m s/rad], a value for each member of the batch.
        """
        for matrix, value in ((self.K, stiffness), (self.C, damping)):
            for first, second in pairs:
                matrix[..., first, first] += value
                matrix[..., second, second] += value
                matrix[..., first, second] -= value
                matrix[..., second, first] -= value

    @property
    def size(self) -> int:
        """Number of DOFs."""
        return int(self.K.shape[-1])

    def dynamic_stiffness(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return Z at each frequency.

        Parameters
        ----------
        frequency : (n_freq,) array
            Hz.

        Returns
        -------
        (..., n_freq, d, d) complex array
        """
        omega = (2.0 * np.pi * np.asarray(frequency, dtype=np.float64))[:, None, None]
        M, K, C, D = (matrix[..., None, :, :] for matrix in (self.M, self.K, self.C, self.D))
        return (K - omega**2 * M) + 1j * (D + omega * C)


@dataclass(frozen=True, eq=False, init=False)
class SparseMatrices:
    """Sparse matrices of the dynamic stiffness Z = K + iD + i omega C - omega^2 M of one substructure.

    Parameters
    ----------
    M, K, C, D : (d, d) scipy sparse arrays or matrices, or arrays
        As in `StructuralMatrices`; stored as csc_array of float64. `C` and `D` are zero by default.

    Raises
    ------
    ValueError
        The matrices are complex or not square, or their shapes differ.
    """

    M: scipy.sparse.csc_array
    K: scipy.sparse.csc_array
    C: scipy.sparse.csc_array
    D: scipy.sparse.csc_array

    def __init__(self, M: Any, K: Any, C: Any = None, D: Any = None) -> None:
        for name, values in (("M", M), ("K", K), ("C", C), ("D", D)):
            refuse_complex(name, values)
        stiffness = scipy.sparse.csc_array(K, dtype=np.float64)
        if stiffness.shape[0] != stiffness.shape[1]:
            raise ValueError(f"K has the shape {stiffness.shape}; a square matrix (d, d) is expected.")
        for name, values in (("M", M), ("K", stiffness), ("C", C), ("D", D)):
            matrix = scipy.sparse.csc_array(stiffness.shape if values is None else values, dtype=np.float64)
            if matrix.shape != stiffness.shape:
                raise ValueError(f"{name} has the shape {matrix.shape}, but K has {stiffness.shape}.")
            object.__setattr__(self, name, matrix)

    @property
    def size(self) -> int:
        """Number of DOFs."""
        return int(self.K.shape[0])

    def dynamic_stiffness(self, frequency: float) -> scipy.sparse.csc_array:
        """Return the (d, d) complex sparse array Z at one frequency [Hz]."""
        omega = 2.0 * np.pi * frequency
        return (self.K - omega**2 * self.M) + 1j * (self.D + omega * self.C)


@dataclass(frozen=True, eq=False)
class ScaledMatrices:
    """A sum of constant matrices, each times a function of p parameters.

    Parameters
    ----------
    matrices : sequence of m StructuralMatrices or SparseMatrices
        Of (d, d) arrays.
    factors : callable
        Values (n, m) of the functions for parameter vectors (n, p).
    slopes : callable
        Their derivatives (n, m, p) by the parameters, for the same vectors.
    """

    matrices: Sequence[StructuralMatrices | SparseMatrices]
    factors: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    slopes: Callable[[NDArray[np.float64]], NDArray[np.float64]]

    def changed(
        self, change: Callable[[StructuralMatrices | SparseMatrices], StructuralMatrices | SparseMatrices]
    ) -> ScaledMatrices:
        """Return the same functions with other matrices."""
        return replace(self, matrices=[change(matrices) for matrices in self.matrices])


def describes_matrices(model: object, attribute: str) -> bool:
    """Return whether an attribute of a model describes its `matrices`.

    It does not if a derived class has other `matrices` and inherits the attribute.

    Parameters
    ----------
    model : JointModel or SubstructureModel
    attribute : str
    """
    classes = type(model).__mro__
    defined = [next(i for i, cls in enumerate(classes) if name in vars(cls)) for name in (attribute, "matrices")]
    return defined[0] <= defined[1]
