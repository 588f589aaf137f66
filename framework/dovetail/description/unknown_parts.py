"""Substructures with unknown options, which the synthesis treats as joints, since they depend on parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.description.placed_parts import Placement, placed
from dovetail.errors import DovetailError, Fault, PluginError
from dovetail.interfaces import (
    Coordinates,
    JointModel,
    JointPort,
    Parameter,
    ScaledMatrices,
    SparseMatrices,
    StructuralMatrices,
    SubstructureModel,
    Superposition,
    describes_matrices,
    plugin_errors,
)
from dovetail.synthesis.condensation import inverted_receptance, substructure_constraints, substructure_matrices


class UnknownPart(JointModel):
    """A substructure as a function of some of its options: a joint with all its nodes as a port.

    Parameters
    ----------
    part : SubstructureModel
        With the middles of the ranges as options.
    parameters : sequence of Parameter
        The unknown options, tied ones included, named by their path in the section.
    placement : Placement, optional
        How it lies in the assembly, if its axes are not the assembly's.
    """

    kind = "substructure"  # for messages
    summary = "A substructure with unknown options"

    def __init__(
        self, part: SubstructureModel, parameters: Sequence[Parameter], placement: Placement | None = None
    ) -> None:
        super().__init__()
        self.name = part.name  # type: ignore[misc]  # for messages
        self.part, self.placement = part, placement
        self._parameters = tuple(parameters)
        with plugin_errors(part, f"substructure model '{part.name}'"):
            matrices = substructure_matrices(part)
        self.has_matrices = matrices is not None
        self._internal = 0 if matrices is None else matrices.size - part.node_dofs.size
        self._latest: tuple[NDArray[np.float64], StructuralMatrices] | None = None

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The options, in the order of the description."""
        return self._parameters

    @cached_property
    def ports(self) -> tuple[JointPort, ...]:
        """Each node with DOFs of its own."""
        nodes = placed(self.part, self.placement).nodes
        own = ((number, node) for number, node in enumerate(nodes) if node.carrier is None)
        return tuple(JointPort(f"node_{number}", 1, directions=node.directions) for number, node in own)

    @cached_property
    def _coordinates(self) -> Coordinates | None:
        return None if self.placement is None else self.placement.coordinates(self.part.nodes)

    @property
    def internal_dofs(self) -> int:
        """Number of the part's inner DOFs."""
        return self._internal

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """The unknown options that the part declares as linear."""
        declared = self.part.linear_options if describes_matrices(self.part, "linear_options") else ()
        return tuple(option.name for option in self._parameters if option.name in declared)

    @property
    def scaled_matrices(self) -> ScaledMatrices | None:
        """Those of the part by its other unknown options."""
        others = [option.name for option in self._parameters if option.name not in self.linear_parameters]
        if not others or not describes_matrices(self.part, "scaled_matrices"):
            return None
        scaled = self.part.scaled_matrices(others)
        if scaled is None or self._coordinates is None:
            return scaled
        return scaled.changed(self._coordinates.transformed)

    @cached_property
    def superposition(self) -> Superposition | None:
        """The part's matrices from what it declares about them; None if it does not declare all of them."""
        with plugin_errors(self.part, f"substructure model '{self.part.name}'"):
            return super().superposition

    def refined(self, factor: int) -> UnknownPart | None:
        """Return the same part with a finer mesh and the same options, or None if the model has no mesh."""
        finer = self.part.refined(factor)
        return None if finer is None else type(self)(finer, self._parameters, self.placement)

    def made_with(self, options: Mapping[str, float]) -> SubstructureModel:
        """Return the part with other values of some options, by their paths in the section.

        Raises
        ------
        ValueError
            The part's options do not allow them.
        """
        changed = self.part.config.with_options(options)
        return type(self.part)(type(changed).model_validate(changed.model_dump(by_alias=True, exclude_unset=True)))

    def _each(self, theta: NDArray[np.float64]) -> Iterator[SubstructureModel]:
        """Yield the part with the options of each row."""
        names = [parameter.name for parameter in self._parameters]
        return (self.made_with(dict(zip(names, values, strict=True))) for values in theta.tolist())

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the part's matrices (n, d, d), computed in one batch if the model can do that.

        Those of a single parameter vector are cached, since an FRF and its derivatives need the same ones.
        """
        latest = self._latest
        if latest is not None and np.array_equal(latest[0], theta):
            return latest[1]
        matrices = self._made(theta) if self._parameters else _dense(substructure_matrices(self.part))
        if self._coordinates is not None:
            matrices = self._coordinates.transformed(matrices)
        matrices = _for_each(matrices, len(theta))
        if len(theta) == 1:
            self._latest = theta.copy(), matrices
        return matrices

    def _made(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        options = {parameter.name: theta[:, column] for column, parameter in enumerate(self._parameters)}
        with plugin_errors(self.part, f"substructure model '{self.part.name}'"):
            batch = self.part.batched_matrices(options)
            if batch is not None:
                return _for_each(batch, len(theta))
            single = [_dense(substructure_matrices(part)) for part in self._each(theta)]
            if other := next((one.size for one in single if one.size != self.size), None):
                problem = f"it has {other} DOFs with some values of these options and {self.size} in their middle"
                raise PluginError(f"{problem}; their number must not depend on an unknown option.")
        return StructuralMatrices(*(np.stack([getattr(one, name) for one in single]) for name in "MKCD"))


class UnknownReceptance(UnknownPart):
    """An `UnknownPart` that is known by its FRFs only."""

    _used: tuple[int, ...] | None = None

    def __init__(
        self, part: SubstructureModel, parameters: Sequence[Parameter], placement: Placement | None = None
    ) -> None:
        super().__init__(part, parameters, placement)
        if len(substructure_constraints(part)):
            problem = (
                "its nodes have more DOFs than motions, and what they cannot do changes with its options, so that none "
                "of these can be identified."
            )
            remedy = "Give each of its options a value; an unknown stiffness belongs in the joints that hold the part."
            raise DovetailError(Fault(f"substructure model '{part.name}'", problem, remedy=remedy))

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:  # noqa: ARG002
        """Raise an error, since there are none."""
        raise DovetailError(f"substructure model '{self.part.name}' has no matrices, so the assembly has none either.")

    def dynamic_stiffness(self, frequency: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the inverse of the receptance between the DOFs in use (n, n_freq, d, d), zero at the others."""
        dofs = range(self.size) if self._used is None else self._used
        stiffness = np.zeros((len(theta), len(frequency), self.size, self.size), dtype=np.complex128)
        with plugin_errors(self.part, f"substructure model '{self.part.name}'"):
            for row, part in enumerate(self._each(theta)):
                placed_part = placed(part, self.placement)
                stiffness[row][:, np.array(dofs)[:, None], dofs] = inverted_receptance(placed_part, dofs, frequency)
        return stiffness

    def between(self, dofs: Sequence[int]) -> UnknownReceptance:
        """Return the same part between some of its DOFs only, so that less of its receptance is inverted."""
        part = UnknownReceptance(self.part, self._parameters, self.placement)
        part._used = tuple(dofs)
        return part


def _dense(matrices: StructuralMatrices | SparseMatrices | None) -> StructuralMatrices:
    assert matrices is not None
    if isinstance(matrices, StructuralMatrices):
        return matrices
    return StructuralMatrices(*(getattr(matrices, name).toarray() for name in "MKCD"))


def _for_each(batch: StructuralMatrices, count: int) -> StructuralMatrices:
    """Return matrices (n, d, d), repeating those that do not depend on the options."""
    shape = (count, batch.size, batch.size)
    if batch.K.shape == shape:
        return batch
    return StructuralMatrices(*(np.broadcast_to(getattr(batch, name), shape) for name in "MKCD"))
