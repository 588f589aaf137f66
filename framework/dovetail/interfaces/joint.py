"""The contract of a joint: parameters, ports, and matrices as a function of the parameters."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import ClassVar, Literal, NamedTuple, get_args

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import ArrayLike, NDArray

from dovetail.errors import Fault, PluginError, listing
from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.differentiation import Differentiation, differences
from dovetail.interfaces.matrices import NodeDofs, ScaledMatrices, StructuralMatrices, describes_matrices
from dovetail.interfaces.substructure import JointPort, Omission, SubstructureModel
from dovetail.interfaces.superposition import Declaration, Superposition

Scale = Literal["linear", "log"]
Prior = Literal["uniform", "normal"]

_SAMPLES = 4
"""Number of random parameter vectors at which declarations about the matrices are verified."""
_DEVIATIONS = 4.0
"""Standard deviations of a normal prior between the middle and each end of its range; 6e-5 of it lie outside."""
_TAIL = 3.167124183311986e-05  # share of the normal distribution below the range: scipy.special.ndtr(-4.0)
_INSIDE = 1.0 - 2.0 * _TAIL


class RangeMap(NamedTuple):
    """Between fractions and values of parameters with one scale and prior, by the ends of ranges or the logarithms."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    scale: Scale
    prior: Prior

    @staticmethod
    def of(lower: ArrayLike, upper: ArrayLike, scale: Scale, prior: Prior) -> RangeMap:
        """Return the map of ranges in SI."""
        change = np.log if scale == "log" else np.asarray
        return RangeMap(change(lower), change(upper), scale, prior)

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions from 0 to 1, quantiles of the prior within the range, to values."""
        if self.prior == "normal":
            fraction = (scipy.special.ndtri(_TAIL + fraction * _INSIDE) / _DEVIATIONS + 1.0) / 2.0
        mapped = self.low + np.asarray(fraction) * (self.high - self.low)
        return np.asarray(np.exp(mapped) if self.scale == "log" else mapped)

    def to_unit(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map values to fractions from 0 to 1, quantiles of the prior within the range."""
        if self.prior == "uniform":
            return self._part(value)
        return np.asarray((scipy.special.ndtr((2.0 * self._part(value) - 1.0) * _DEVIATIONS) - _TAIL) / _INSIDE)

    def slope(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of `from_unit` by the fraction, at values."""
        width = np.asarray((value if self.scale == "log" else np.ones_like(value)) * (self.high - self.low))
        if self.prior == "normal":
            quantile = (2.0 * self._part(value) - 1.0) * _DEVIATIONS
            width *= _INSIDE * np.sqrt(2.0 * np.pi) * np.exp(quantile**2 / 2.0) / (2.0 * _DEVIATIONS)
        return width

    def _part(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far values lie between the ends, on their scale."""
        return np.asarray(((np.log(value) if self.scale == "log" else value) - self.low) / (self.high - self.low))


@dataclass(frozen=True)
class Parameter:
    """A parameter of a joint and the range in which it is identified.

    Parameters
    ----------
    name : str
    unit : str
        SI unit in pint's spelling, such as ``"N m/rad"``.
    lower, upper : float
        Range, in `unit`.
    scale : {"linear", "log"}
        How the range is sampled, and how the network's target is scaled.
    description : str
    prior : {"uniform", "normal"}
        Distribution of the value over the range, on its scale: uniform, or normal about the middle, with the ends four
        standard deviations away. On a logarithmic scale the latter is log-normal.

    Raises
    ------
    PluginError
        A value of another type, an unknown scale or prior, or a range that is empty, not finite, or not positive on a
        logarithmic scale.
    """

    name: str
    unit: str
    lower: float
    upper: float
    scale: Scale = "linear"
    description: str = ""
    prior: Prior = "uniform"

    def __post_init__(self) -> None:
        if fault := self._fault():
            raise PluginError(fault)

    def _fault(self) -> Fault | None:
        where = f"parameter {self.name!r:.40}"
        for key in ("name", "unit", "scale", "description"):
            if not isinstance(getattr(self, key), str):
                return Fault(where, f"its {key} is {getattr(self, key)!r:.40}.", "a text")
        first, *others = self.name.split(".")
        if not first.isidentifier() or not all(part.isidentifier() or part.isdecimal() for part in others):
            return Fault(where, "this cannot be a name.", "letters, digits and '_', not beginning with a digit")
        for key, known in (("scale", get_args(Scale)), ("prior", get_args(Prior))):
            if getattr(self, key) not in known:
                return Fault(where, f"its {key} is {getattr(self, key)!r:.40}.", listing(known))
        for end in (self.lower, self.upper):
            if isinstance(end, bool) or not isinstance(end, Real) or not np.isfinite(float(end)):
                return Fault(where, f"an end of its range is {end!r:.40}.", f"a finite number in {self.unit}")
        if self.lower >= self.upper:
            return Fault(where, f"its range from {self.lower:g} to {self.upper:g} is empty.", "lower < upper")
        if self.scale == "log" and self.lower <= 0:
            return Fault(where, f"its range on a logarithmic scale begins at {self.lower:g}.", "lower > 0")
        return None

    @staticmethod
    def with_normal_prior(
        name: str, unit: str, middle: float, deviation: float, scale: Scale, description: str
    ) -> Parameter:
        """Return a parameter with a normal prior from its mean and deviation in `unit`; log-normal on scale `log`."""
        half = _DEVIATIONS * deviation
        factor = float(np.exp(half / middle)) if scale == "log" else 1.0
        ends = (middle / factor, middle * factor) if scale == "log" else (middle - half, middle + half)
        return Parameter(name, unit, *ends, scale, description, "normal")

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions from 0 to 1, quantiles of the prior within the range, to values in `unit`."""
        return self._range_map.from_unit(fraction)

    def to_unit(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map values in `unit` to fractions from 0 to 1, quantiles of the prior within the range."""
        return self._range_map.to_unit(value)

    def slope(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of `from_unit` by the fraction, at values in `unit`."""
        return self._range_map.slope(value)

    def normal_residual(self, fraction: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the standard normal residual of fractions under a normal prior, and its derivative."""
        deviations = scipy.special.ndtri(_TAIL + np.asarray(fraction, dtype=np.float64) * _INSIDE)
        return deviations, _INSIDE * np.sqrt(2.0 * np.pi) * np.exp(deviations**2 / 2.0)

    @cached_property
    def _range_map(self) -> RangeMap:
        return RangeMap.of(self.lower, self.upper, self.scale, self.prior)


class JointModel(Component):
    """A connection with parameters to identify.

    Local DOFs: those of its ports' nodes (`node_dofs`) by their directions, and inner ones. Nodes of a layer lie along
    `nodes_along`; facing ones may be apart along x if it `spans_a_distance`. x leads from node to node if it
    `acts_along_its_nodes`, rigid arms if it `carries_its_nodes`. `free_options` may differ where it is predicted. If
    `faces_meet`, facing nodes lie on faces across x, one part on each side. `nested_ports` are pairs, the
    first of which lies in the bore at the second, and the diameter of their contact [m] or None.
    """

    kind: ClassVar[Kind] = "joint"
    spans_a_distance, acts_along_its_nodes, carries_its_nodes, faces_meet = False, False, False, False
    nodes_along: tuple[str, ...] = ()
    free_options: tuple[str, ...] = ()
    nested_ports: tuple[tuple[str, str, float | None], ...] = ()

    @property
    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters, in the order of the columns of `theta`."""

    @property
    @abstractmethod
    def ports(self) -> tuple[JointPort, ...]:
        """The sides of the joint, in the order of their DOFs."""

    @property
    def internal_dofs(self) -> int:
        """Number of DOFs that belong only to the joint, after those of its ports."""
        return 0

    @cached_property
    def node_dofs(self) -> NodeDofs:
        """The numbers of the DOFs of the ports' nodes."""
        return NodeDofs(tuple(port.directions for port in self.ports for _ in range(port.nodes)))

    @cached_property
    def size(self) -> int:
        """Number d of local DOFs."""
        return self.internal_dofs + self.node_dofs.size

    def refined(self, factor: int) -> JointModel | None:  # noqa: ARG002
        """Return the same joint with a mesh `factor` times as fine, or None if it has no mesh."""
        return None

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of local DOFs that are the same DOF, as in a rigid joint."""
        return ()

    @property
    def facing_ports(self) -> tuple[tuple[str, str], ...]:
        """Pairs of ports whose nodes face each other in order, the first facing the first, and so on.

        A description in which the nodes of such a pair have other spacings, or the reverse order, is refused. By
        default, two ports with the same number of nodes; ``()`` if their nodes do not face.
        """
        if len(self.ports) != 2 or self.ports[0].nodes != self.ports[1].nodes:
            return ()
        return ((self.ports[0].name, self.ports[1].name),)

    @property
    def contact_dofs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of local DOFs that become the same DOF when the joint's contacts are taken as rigid.

        By default, the DOFs of two ports with the same number of nodes and the same directions, in order.
        """
        shapes = {(port.nodes, port.directions) for port in self.ports}
        if len(self.ports) != 2 or len(shapes) != 1:
            raise NotImplementedError(f"joint model '{self.name}' does not define its contact_dofs.")
        return tuple((dof, dof + self.node_dofs.size // 2) for dof in range(self.node_dofs.size // 2))

    def omission(
        self,
        substructures: Sequence[SubstructureModel],  # noqa: ARG002
        nodes: Sequence[Sequence[int]],  # noqa: ARG002
    ) -> Omission | None:
        """Return a stiffness between these parts that the model omits, or None, the default.

        ``dovetail check`` shows how much it would change the natural frequencies.

        Parameters
        ----------
        substructures : sequence of SubstructureModel
            The part at each port, in the order of the ports.
        nodes : sequence of sequences of int
            The nodes of that part to which the port attaches.
        """
        return None

    def range_objections(self, lower: Mapping[str, float], upper: Mapping[str, float]) -> Mapping[str, str]:
        """Return objections to ranges that contain impossible values: a sentence by the name of the parameter.

        By default, a parameter whose default range is not negative must not be negative in a description either.
        Override this to relate parameters to each other, or to allow more.

        Parameters
        ----------
        lower, upper : mapping of str to float
            Ends of the ranges in a description, by the parameter's name, in SI; equal for a known value.
        """
        objections = {}
        for parameter in self.parameters:
            name = parameter.name
            if parameter.lower >= 0 > lower[name]:
                ends = dict.fromkeys(f"{end:g}" for end in (lower[name], upper[name]))
                unit = "" if parameter.unit == "1" else f" {parameter.unit}"
                objections[name] = f"{name} must not be negative, but is {' to '.join(ends)}{unit}."
        return objections

    @abstractmethod
    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the joint's matrices for each parameter vector.

        Parameters
        ----------
        theta : (n, n_params) array
            In the order and the units of `parameters`.

        Returns
        -------
        StructuralMatrices
            Symmetric (n, d, d) arrays.
        """

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """Names of parameters in which `matrices` is linear, each with a slope that no parameter changes.

        With it a joint costs a product of constant matrices and these parameters, for any number of vectors. The
        declaration is verified. It does not count for a derived class with other `matrices`.
        """
        return ()

    @property
    def scaled_matrices(self) -> ScaledMatrices | None:
        """The matrices without the share of `linear_parameters`, as functions of all other parameters, in their order.

        With it even these cost no more than their functions, and their derivatives are exact. None, the default, if
        they are known by `matrices` only.
        """
        return None

    @cached_property
    def superposition(self) -> Superposition | None:
        """The matrices from `linear_parameters` and `scaled_matrices`; None if these do not declare all of them.

        Raises
        ------
        PluginError
            One of these declarations is not true.
        """
        return self.declaration.superposition()

    @cached_property
    def declaration(self) -> Declaration:
        """What the model declares about its matrices, not yet verified."""
        linear = self.linear_parameters if describes_matrices(self, "linear_parameters") else ()
        scaled = self.scaled_matrices if describes_matrices(self, "scaled_matrices") else None
        fractions = np.random.default_rng(0).random((_SAMPLES, len(self.parameters)))
        columns = [parameter.from_unit(part) for parameter, part in zip(self.parameters, fractions.T, strict=True)]
        samples = np.stack(columns, axis=1) if columns else fractions
        names = [parameter.name for parameter in self.parameters]
        where = f"{self.kind} model '{self.name}'"
        return Declaration(where, self.matrices, self.size, names, *self._range, samples, linear, scaled)

    def matrices_jacobian(self, theta: NDArray[np.float64]) -> Sequence[StructuralMatrices]:
        """Return the derivatives of `matrices` by each parameter.

        A joint need not override it. The derivatives are exact for `linear_parameters` and `scaled_matrices`, and for a
        parameter in which the matrices are linear over its whole range. Otherwise they are differences of fourth order,
        with an error of about 1e-12 of the entry over the parameter, one-sided at the ends of a range and at a kink.

        Parameters
        ----------
        theta : (n, n_params) array

        Returns
        -------
        sequence of n_params StructuralMatrices
            Of (n, d, d) arrays, per unit of the parameter.
        """
        return (self.superposition or self._differentiation).jacobian(theta)

    @cached_property
    def _range(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper ends of the parameters' ranges, (n_params,) each."""
        ends = [(parameter.lower, parameter.upper) for parameter in self.parameters]
        lower, upper = np.array(ends, dtype=np.float64).reshape(-1, 2).T
        return lower, upper

    @cached_property
    def _differentiation(self) -> Differentiation:
        declared = self.declaration
        slopes = declared.slopes().T.toarray() if len(declared.columns) else ()
        known = dict(zip(declared.columns.tolist(), slopes, strict=True))
        return Differentiation(self.matrices, self.size, *self._range, known)

    def dynamic_stiffness(self, frequency: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return Z = K + iD + i omega C - omega^2 M; override it for a joint with another dependence on frequency.

        Parameters
        ----------
        frequency : (n_freq,) array
            Hz.
        theta : (n, n_params) array

        Returns
        -------
        (n, n_freq, d, d) complex array
        """
        return self.matrices(theta).dynamic_stiffness(frequency)

    def dynamic_stiffness_jacobian(
        self, frequency: NDArray[np.float64], theta: NDArray[np.float64]
    ) -> Iterable[NDArray[np.complex128]]:
        """Return the derivatives of `dynamic_stiffness` by each parameter.

        By default they follow from `matrices_jacobian`; for a joint that overrides `dynamic_stiffness` they are
        differences of fourth order, with an error below 1e-9 of the derivative where the parameter matters.

        Parameters
        ----------
        frequency : (n_freq,) array
            Hz.
        theta : (n, n_params) array

        Returns
        -------
        iterable of n_params (n, n_freq, d, d) complex arrays, per unit of the parameter
        """
        if type(self).dynamic_stiffness is JointModel.dynamic_stiffness:
            return (matrices.dynamic_stiffness(frequency) for matrices in self.matrices_jacobian(theta))

        def stiffness(vectors: NDArray[np.float64]) -> NDArray[np.complex128]:
            return np.asarray(self.dynamic_stiffness(frequency, vectors), dtype=np.complex128)

        return (differences(stiffness, theta, [column], *self._range)[0] for column in range(len(self.parameters)))
