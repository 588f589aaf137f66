"""Joints whose matrices are derived from those of their model."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import (
    JointModel,
    JointPort,
    Parameter,
    ScaledMatrices,
    SparseMatrices,
    StructuralMatrices,
    describes_matrices,
)


class ChangedJoint(JointModel):
    """A joint between the same nodes as another one, by the same parameters, with other matrices.

    Parameters
    ----------
    model : JointModel
        It gives matrices, and not its own dynamic stiffness.
    """

    def __init__(self, model: JointModel) -> None:
        super().__init__()
        self.name, self.summary = model.name, model.summary  # type: ignore[misc]  # for messages
        self.spans_a_distance, self.nodes_along = model.spans_a_distance, model.nodes_along
        self.acts_along_its_nodes, self.carries_its_nodes = model.acts_along_its_nodes, model.carries_its_nodes
        self.faces_meet, self.nested_ports, self.free_options = model.faces_meet, model.nested_ports, model.free_options
        self.Config, self.config = model.Config, model.config  # those of the description
        self.model = model

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of the model."""
        return self.model.parameters

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """Those of the model."""
        return self.model.ports

    @property
    def internal_dofs(self) -> int:
        """Those of the model."""
        return self.model.internal_dofs

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """Those of the model."""
        return self.model.merged_dofs

    @property
    def facing_ports(self) -> tuple[tuple[str, str], ...]:
        """Those of the model."""
        return self.model.facing_ports

    @property
    def axes(self) -> NDArray[np.float64]:
        """Those of the model in the assembly, in columns (3, 3)."""
        return axes_of(self.model)

    @property
    def contact_dofs(self) -> tuple[tuple[int, int], ...]:
        """Those of the model."""
        return self.model.contact_dofs

    def pair_functions(self, *, contacts: bool = False) -> NDArray[np.float64]:
        """Return the linear functions (k, d) of the DOFs that are zero: those of the model."""
        return pair_functions(self.model, contacts=contacts)


class MappedJoint(ChangedJoint):
    """A joint whose matrices are a linear map of those of its model."""

    @overload
    def mapped(self, matrices: StructuralMatrices) -> StructuralMatrices: ...
    @overload
    def mapped(self, matrices: SparseMatrices) -> SparseMatrices: ...
    @abstractmethod
    def mapped(self, matrices: StructuralMatrices | SparseMatrices) -> StructuralMatrices | SparseMatrices:
        """Return the matrices (..., d, d) of this joint from those of the model."""

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """Those of the model."""
        return self.model.linear_parameters if describes_matrices(self.model, "linear_parameters") else ()

    @cached_property
    def scaled_matrices(self) -> ScaledMatrices | None:
        """Those of the model, mapped."""
        scaled = self.model.scaled_matrices if describes_matrices(self.model, "scaled_matrices") else None
        return None if scaled is None else scaled.changed(self.mapped)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return those of the model (n, d, d), mapped."""
        return self.mapped(self.model.matrices(theta))

    def matrices_jacobian(self, theta: NDArray[np.float64]) -> Sequence[StructuralMatrices]:
        """Return their derivatives by each parameter, per unit of it."""
        return [self.mapped(derivative) for derivative in self.model.matrices_jacobian(theta)]


def pair_functions(model: JointModel, *, contacts: bool = False) -> NDArray[np.float64]:
    """Return the linear functions (k, d) of a joint's DOFs that are zero: differences of pairs of its model's DOFs.

    Parameters
    ----------
    model : JointModel
    contacts : bool
        Whether its contacts are rigid too.
    """
    if isinstance(model, ChangedJoint):
        return model.pair_functions(contacts=contacts)
    pairs = [*model.merged_dofs, *(model.contact_dofs if contacts else ())]
    functions = np.zeros((len(pairs), model.size))
    for row, (first, second) in enumerate(pairs):
        functions[row, first], functions[row, second] = 1.0, -1.0
    return functions


def axes_of(model: JointModel) -> NDArray[np.float64]:
    """Return the axes of a joint in the assembly, in columns (3, 3)."""
    return model.axes if isinstance(model, ChangedJoint) else np.eye(3)
