"""The contract of a joint: parameters, ports, and matrices as a function of the parameters."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.matrices import DIRECTIONS, StructuralMatrices

__all__ = ["JointModel", "Parameter", "Port", "Scale"]

Scale = Literal["linear", "log"]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a joint and the range in which it is sought.

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
    """

    name: str
    unit: str
    lower: float
    upper: float
    scale: Scale = "linear"
    description: str = ""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.lower) and np.isfinite(self.upper) and self.lower < self.upper):
            raise ValueError(f"{self.name}: the range [{self.lower:g}, {self.upper:g}] is empty or not finite.")
        if self.scale == "log" and self.lower <= 0:
            raise ValueError(f"{self.name}: a logarithmic range must be positive, not from {self.lower:g}.")

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions of the range (0 to 1, on the parameter's scale) to values in `unit`."""
        low, high = self._ends()
        mapped = low + np.asarray(fraction, dtype=np.float64) * (high - low)
        return np.exp(mapped) if self.scale == "log" else mapped

    def to_unit(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map values in `unit` to fractions of the range (0 to 1, on the parameter's scale)."""
        low, high = self._ends()
        given = np.asarray(value, dtype=np.float64)
        return ((np.log(given) if self.scale == "log" else given) - low) / (high - low)

    def _ends(self) -> tuple[float, float]:
        if self.scale == "log":
            return float(np.log(self.lower)), float(np.log(self.upper))
        return self.lower, self.upper


@dataclass(frozen=True)
class Port:
    """Where a joint attaches to a substructure.

    Parameters
    ----------
    name : str
        The key under ``connect:``.
    nodes : int
        How many nodes of the substructure it takes.
    """

    name: str
    nodes: int


class JointModel(Component):
    """A connection whose parameters are sought.

    Its local DOFs are those of its ports, port by port and node by node, x then rz, followed by `internal_dofs`
    of its own.
    """

    kind: ClassVar[Kind] = "joint"

    @property
    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters, in the order of the columns of `theta`."""

    @property
    @abstractmethod
    def ports(self) -> tuple[Port, ...]:
        """What the joint attaches to."""

    @property
    def internal_dofs(self) -> int:
        """Number of DOFs that belong to the joint alone, behind those of its ports."""
        return 0

    @property
    def size(self) -> int:
        """Number d of local DOFs."""
        return self.internal_dofs + len(DIRECTIONS) * sum(port.nodes for port in self.ports)

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of local DOFs that are one and the same, as in a rigid joint."""
        return ()

    @property
    def contact_dofs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of local DOFs that become one when the joint's contacts are taken as rigid.

        By default, the DOFs of two ports with the same number of nodes, in order.
        """
        if len(self.ports) != 2 or self.ports[0].nodes != self.ports[1].nodes:
            raise NotImplementedError(f"joint model '{self.name}' does not say which of its DOFs meet.")
        half = len(DIRECTIONS) * self.ports[0].nodes
        return tuple((dof, half + dof) for dof in range(half))

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
            Of (n, d, d) arrays, symmetric.
        """

    def matrices_jacobian(self, theta: NDArray[np.float64]) -> Sequence[StructuralMatrices]:
        """Return the derivatives of `matrices` by each parameter, by central differences unless overridden.

        Parameters
        ----------
        theta : (n, n_params) array

        Returns
        -------
        sequence of n_params StructuralMatrices
            Of (n, d, d) arrays, per unit of the parameter.
        """
        derivatives = []
        for column, parameter in enumerate(self.parameters):
            step = 1e-5 * np.maximum(np.abs(theta[:, column]), 1e-3 * (parameter.upper - parameter.lower))
            above, below = theta.copy(), theta.copy()
            above[:, column] += step
            below[:, column] -= step
            high, low = self.matrices(above), self.matrices(below)
            width = (above[:, column] - below[:, column])[:, None, None]
            derivatives.append(
                StructuralMatrices(
                    (high.M - low.M) / width,
                    (high.K - low.K) / width,
                    (high.C - low.C) / width,
                    (high.D - low.D) / width,
                )
            )
        return derivatives

    def dynamic_stiffness(self, frequency: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return Z = K + iD + i omega C - omega^2 M; override it for a joint that depends on frequency otherwise.

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
