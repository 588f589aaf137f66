"""The contract of a substructure: its nodes, and its matrices or receptances."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from numbers import Integral, Real
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, PluginError
from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.matrices import (
    PLANAR,
    NodeDofs,
    ScaledMatrices,
    SparseMatrices,
    StructuralMatrices,
    direction_problem,
)


@dataclass(frozen=True)
class PartNode:
    """A point of a substructure and the directions in which it can move.

    Parameters
    ----------
    label : str
    position : float
        Distance from the origin along the axis of the substructure [m], by which descriptions refer to the node.
    directions : tuple of str
        Some of ``x y z rx ry rz``, in this order.
    point : tuple of three floats, optional
        Coordinates in the substructure [m]; by default on its axis, which runs along -y.
    carrier : int, optional
        Index of a node with all six directions that carries this one, as the points of a rigid body move with one of
        them. The node then has no DOFs of its own.
    """

    label: str
    position: float
    directions: tuple[str, ...] = PLANAR
    point: tuple[float, float, float] | None = None
    carrier: int | None = None

    @property
    def coordinates(self) -> tuple[float, float, float]:
        """Coordinates in the substructure [m]."""
        return (0.0, -self.position, 0.0) if self.point is None else self.point


@dataclass(frozen=True)
class JointPort:
    """One side of a joint, which attaches to a substructure.

    Parameters
    ----------
    name : str
        The key under ``connect:``.
    nodes : int
        Number of nodes of the substructure to which it attaches.
    positions : tuple of float, optional
        Where these nodes lie in the joint's own model [m], increasing, from an origin that all ports share; give them
        if the matrices depend on the distances of the nodes. A description whose nodes are at other distances is
        refused.
    directions : tuple of str
        Directions of each node in which the joint acts: some of ``x y z rx ry rz``, in this order.

    Raises
    ------
    PluginError
        The name is not a text, the number is not a positive integer, there are not as many increasing positions, or
        the directions are not different ones in their order.
    """

    name: str
    nodes: int
    positions: tuple[float, ...] | None = None
    directions: tuple[str, ...] = PLANAR

    def __post_init__(self) -> None:
        where = f"port {self.name!r:.40}"
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise PluginError(Fault(where, "this cannot be a name.", "a text of letters, digits and '_'"))
        if isinstance(self.nodes, bool) or not isinstance(self.nodes, Integral) or self.nodes < 1:
            raise PluginError(Fault(where, f"its number of nodes is {self.nodes!r:.40}.", "a whole number from 1"))
        if self.positions is not None:
            self._check_positions(where)
        if problem := direction_problem(self.directions):
            raise PluginError(Fault(where, f"{problem}.", 'a tuple such as ("x", "rz")'))

    def _check_positions(self, where: str) -> None:
        accepted = f"a tuple of {self.nodes} increasing numbers of metres"
        problem = f"its positions are {self.positions!r:.60}."
        if not isinstance(self.positions, tuple) or len(self.positions) != self.nodes:
            raise PluginError(Fault(where, problem, accepted))
        if not all(isinstance(p, Real) and not isinstance(p, bool) and np.isfinite(float(p)) for p in self.positions):
            raise PluginError(Fault(where, problem, accepted))
        if any(second <= first for first, second in pairwise(self.positions)):
            raise PluginError(Fault(where, problem, accepted))


@dataclass(frozen=True, eq=False)
class Omission:
    """A stiffness that a joint's model omits.

    Parameters
    ----------
    problem : str
        A sentence on what the model omits.
    stiffness : (d, d) array or None
        Its upper limit, over the local DOFs of the joint's ports [N/m, N, N m]; None if unknown.
    """

    problem: str
    stiffness: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class SectionOutline:
    """The outline of a cross-section of a part, across its axis.

    Parameters
    ----------
    height, width : float
        Sizes along the part's x and along its z [m]; both are the diameter of a round section.
    bore : float
        Diameter of a hole in the middle [m].
    center : two floats
        Coordinates x and z of the centroid, from the line of the nodes [m].
    is_round : bool
    """

    height: float
    width: float
    bore: float = 0.0
    center: tuple[float, float] = (0.0, 0.0)
    is_round: bool = False

    def bounds(self, direction: NDArray[np.float64]) -> tuple[float, float]:
        """Return from where to where it reaches along a unit vector (3,) in the part's axes, from the nodes [m]."""
        x, _, z = direction
        sides = np.array([self.height * x, self.width * z])
        half = float(np.linalg.norm(sides) if self.is_round else np.abs(sides).sum()) / 2.0
        middle = float(self.center[0] * x + self.center[1] * z)
        return middle - half, middle + half


class SubstructureModel(Component):
    """A part with known dynamics.

    Its DOFs are those of its nodes (`node_dofs`): node by node, each in the order of its directions. Further DOFs of
    the matrices are inner DOFs, to which no joint and no response can attach.

    Attributes
    ----------
    grounded : bool
        True for a part that does not move.
    """

    kind: ClassVar[Kind] = "substructure"
    grounded: ClassVar[bool] = False

    @property
    def held(self) -> bool:
        """True for a part supported from outside the assembly, whose rigid-body motion is resisted."""
        return False

    def refined(self, factor: int) -> SubstructureModel | None:  # noqa: ARG002
        """Return the same part with a mesh `factor` times as fine, or None if it has no mesh."""
        return None

    def warnings(self, frequency: float) -> Sequence[str]:  # noqa: ARG002
        """Return warnings about this part for frequencies up to `frequency` [Hz]; by default none."""
        return ()

    @property
    def outline(self) -> Sequence[tuple[float, float, float, float]]:
        """The sections to draw, in order: start, stop, outer and inner diameter [m]; none by default."""
        return ()

    def section_at(self, position: float) -> SectionOutline | None:  # noqa: ARG002
        """Return the outline of the cross-section at a position along the part [m]; None, the default, if unknown.

        With it, descriptions whose parts cannot lie where their joint has them are refused or reported.
        """
        return None

    @property
    def absent_dofs(self) -> frozenset[int]:
        """DOFs of the nodes at which a part known by its FRFs has no receptance; none by default.

        A joint exerts no force on the part there, as on the rotation of a mass without rotary inertia.
        """
        return frozenset()

    @property
    def constraints(self) -> NDArray[np.float64]:
        """Linear functions (n, d) of the nodes' DOFs that are zero in any motion of a part known by its FRFs; none.

        The points of an interface whose motion is a sum of few interface modes have more DOFs than motions.
        """
        return np.zeros((0, self.node_dofs.size))

    @property
    def condensation_tolerance(self) -> float:
        """Relative error up to which matrices may be condensed on a reduced basis; 0, the default, is exact."""
        return 0.0

    @property
    @abstractmethod
    def nodes(self) -> tuple[PartNode, ...]:
        """The nodes, in the order of their DOFs."""

    @property
    def node_dofs(self) -> NodeDofs:
        """The numbers of the nodes' DOFs."""
        return NodeDofs.from_nodes(self.nodes)

    @abstractmethod
    def matrices(self) -> StructuralMatrices | SparseMatrices | None:
        """Return the (d, d) matrices of the nodes' DOFs and the inner DOFs; None for a part with FRFs only."""

    def batched_matrices(self, options: Mapping[str, NDArray[np.float64]]) -> StructuralMatrices | None:  # noqa: ARG002
        """Return the matrices for many values of some options, or None, the default.

        It is called if options of the part are to be identified. Without it the part is constructed again for each
        value, which gives the same result and takes longer.

        Parameters
        ----------
        options : mapping of str to (n,) array
            In SI, by their path in the part's section, such as ``"material.young"`` or ``"sections.0.length"``; see
            ``ComponentConfig.with_options``. All others keep their values.

        Returns
        -------
        StructuralMatrices or None
            Of (n, d, d) arrays.
        """
        return None

    @property
    def linear_options(self) -> tuple[str, ...]:
        """Options in which the matrices are linear, each with a slope that no unknown option changes; none by default.

        If such options are to be identified, the part costs no more than a joint with `linear_parameters`. They are
        named as in `batched_matrices`, and the declaration is verified.
        """
        return ()

    def scaled_matrices(self, options: Sequence[str]) -> ScaledMatrices | None:  # noqa: ARG002
        """Return the matrices without the share of unknown `linear_options` as functions of other options, or None.

        It is called if options of the part are to be identified. With it their derivatives are exact, and no matrices
        have to be made for each value. None, the default, if they are known by `matrices` only.

        Parameters
        ----------
        options : sequence of str
            p options, named as in `batched_matrices`; all others keep their values.
        """
        return None

    def receptance(self, frequency: NDArray[np.float64], dofs: Sequence[int]) -> NDArray[np.complex128]:
        """Return the receptance matrix between `dofs`.

        Parameters
        ----------
        frequency : (n_freq,) array
            Hz, positive.
        dofs : sequence of int
            n DOFs of the substructure.

        Returns
        -------
        (n_freq, n, n) complex array
            Displacement [m] or rotation [rad] per force [N] or moment [N m].
        """
        matrices = self.matrices()
        if matrices is None:
            problem = f"'{self.name}' has no matrices, so it must override 'receptance'."
            raise PluginError(Fault(f"substructure model '{self.name}'", problem))
        ports = np.asarray(dofs, dtype=np.intp)
        lines = np.asarray(frequency, dtype=np.float64)
        if isinstance(matrices, SparseMatrices):
            return np.stack([_sparse_receptance(matrices, float(line), ports) for line in lines])
        every = (matrices.M, matrices.K, matrices.C, matrices.D)
        filled = np.any([(matrix != 0).any(axis=0) for matrix in every], axis=0)
        active = np.union1d(np.flatnonzero(filled), ports)
        rows = np.searchsorted(active, ports)
        unit_loads = np.eye(len(active))[:, rows]
        stiffness = (matrices.dynamic_stiffness(line)[0][np.ix_(active, active)] for line in lines[:, None])
        return np.stack([_scaled_solution(Z, unit_loads)[rows] for Z in stiffness])

    def dof_label(self, dof: int) -> str:
        """Return a label of a DOF: the position of its node, or the node's label if positions repeat; its direction."""
        number, direction = self.node_dofs[dof]
        node, positions = self.nodes[number], [node.position for node in self.nodes]
        place = f"{node.position * 1e3:g} mm" if positions.count(node.position) == 1 else f"node '{node.label}'"
        return f"{place} {direction}"


def _scaled_solution(Z: NDArray[np.complex128], loads: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Solve with a diagonal of ones, since the units of displacements and rotations differ."""
    size = np.abs(np.diagonal(Z))
    scale = 1.0 / np.sqrt(np.where(size > 0, size, 1.0))
    return np.asarray(scale[:, None] * np.linalg.solve(scale[:, None] * Z * scale, scale[:, None] * loads))


def _sparse_receptance(matrices: SparseMatrices, frequency: float, ports: NDArray[np.intp]) -> NDArray[np.complex128]:
    """Solve for unit loads on the ports' DOFs at one frequency [Hz], leaving out DOFs without entries."""
    from scipy.sparse.linalg import splu

    Z = matrices.dynamic_stiffness(frequency)
    active = np.union1d(np.flatnonzero(np.diff(Z.indptr)), ports)
    rows = np.searchsorted(active, ports)
    loads = np.zeros((len(active), len(ports)), dtype=np.complex128)
    loads[rows, np.arange(len(ports))] = 1.0
    receptance: NDArray[np.complex128] = splu(Z[active][:, active].tocsc()).solve(loads)[rows]
    return receptance
