"""Components written from scratch, each with a fault its author overlooked; written after the checks were finished."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from dovetail import (
    ComponentConfig,
    InUnit,
    JointModel,
    JointPort,
    Parameter,
    PartNode,
    StructuralMatrices,
    SubstructureModel,
)
from support.broken_plugins.lists import also_breaks


@lru_cache
def spring_pattern(size):
    """Return the pattern of a spring between the first and the third DOF."""
    pattern = np.zeros((size, size))
    pattern[[0, 0, 2, 2], [0, 2, 0, 2]] = 1.0, -1.0, -1.0, 1.0
    return pattern


@also_breaks("stiffness_is_positive_semidefinite")
class CachedPattern(JointModel):
    """A pattern that is kept, and that the first call writes into."""

    name = "cached_pattern"
    summary = "Spring by a pattern"
    parameters = (Parameter("k", "N/m", 1e5, 1e6, "log", "stiffness"),)
    ports = (JointPort("a", 1), JointPort("b", 1))

    def matrices(self, theta):
        """Add a grounded preload to the pattern, each time."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        pattern = spring_pattern(self.size)
        pattern -= 1e-9 * np.diag([1.0, 0.0, 1.0, 0.0])
        joint.K[:] = theta[:, 0, None, None] * pattern
        return joint


@also_breaks("dynamic_stiffness_has_its_shape")
class TableLaw(JointModel):
    """Its law is a table from 10 Hz to 5 kHz, and nothing outside."""

    name = "table_law"
    summary = "Spring with a tabulated loss"
    parameters = (Parameter("k", "N/m", 1e5, 1e6, "log", "stiffness"),)
    ports = (JointPort("a", 1), JointPort("b", 1))

    def matrices(self, theta):
        """Return the spring."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer([(0, 2)], theta[:, 0])
        return joint

    def dynamic_stiffness(self, frequency, theta):
        """Interpolate the loss."""
        loss = np.interp(frequency, [10.0, 100.0, 5000.0], [0.01, 0.05, 0.08], left=np.nan, right=np.nan)
        return self.matrices(theta).K[:, None] * (1.0 + 1j * loss)[:, None, None]


@also_breaks("small_steps_show")
class TorchLayer(JointModel):
    """A layer that torch computes, as torch likes it."""

    name = "torch_layer"
    summary = "Contact layer computed with torch"
    parameters = (
        Parameter("k", "N/m", 1e5, 1e6, "log", "stiffness"),
        Parameter("c", "N s/m", 1.0, 10.0, "log", "damping"),
    )
    ports = (JointPort("a", 1), JointPort("b", 1))

    def matrices(self, theta):
        """Multiply on the device."""
        import torch

        k, c = torch.tensor(theta, dtype=torch.float32).T
        pattern = torch.tensor(spring_pattern(8)[:4, :4].round(), dtype=torch.float32)
        K, C = (np.asarray(each[:, None, None] * pattern, dtype=np.float64) for each in (k, c))
        return StructuralMatrices(np.zeros_like(K), K, C)


@also_breaks("damping_is_positive_semidefinite")
class LossAroundZero(JointModel):
    """A loss factor whose range begins below zero, so that it can come out as none."""

    name = "loss_around_zero"
    summary = "Lossy spring"
    parameters = (
        Parameter("k", "N/m", 1e5, 1e6, "log", "stiffness"),
        Parameter("eta", "1", -0.001, 0.1, "linear", "loss factor"),
    )
    ports = (JointPort("a", 1), JointPort("b", 1))

    def matrices(self, theta):
        """Return K and eta K."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer([(0, 2)], theta[:, 0])
        joint.D[:] = theta[:, 1, None, None] * joint.K
        return joint


@also_breaks("jacobian_meets_differences")
class LogarithmicDerivative(JointModel):
    """Derivatives by the logarithm of a parameter, where its scale is logarithmic."""

    name = "logarithmic_derivative"
    summary = "Spring in x and in rz"
    parameters = (
        Parameter("k", "N/m", 0.5, 2.0, "log", "stiffness, soft"),
        Parameter("kr", "N m/rad", 1.0, 2.0, "linear", "tilting stiffness"),
    )
    ports = (JointPort("a", 1), JointPort("b", 1))

    def matrices(self, theta):
        """Return both springs."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer([(0, 2)], theta[:, 0])
        joint.add_contact_layer([(1, 3)], theta[:, 1])
        return joint

    def matrices_jacobian(self, theta):
        """Return dK/d(log k) and dK/dkr."""
        by_k, by_kr = StructuralMatrices.zeros(len(theta), 4), StructuralMatrices.zeros(len(theta), 4)
        by_k.add_contact_layer([(0, 2)], theta[:, 0])
        by_kr.add_contact_layer([(1, 3)], 1.0)
        return [by_k, by_kr]


@also_breaks("units_agree_with_the_matrices")
class SwappedColumns(JointModel):
    """It reads its columns in the order of the alphabet."""

    name = "swapped_columns"
    summary = "Spring and damper"
    parameters = (
        Parameter("stiffness", "N/m", 1e5, 1e6, "log", "of the spring"),
        Parameter("damping", "N s/m", 1e5, 1e6, "log", "of the damper"),
    )
    ports = (JointPort("a", 1), JointPort("b", 1))

    def matrices(self, theta):
        """Sort the names."""
        values = dict(zip(sorted(parameter.name for parameter in self.parameters), theta.T, strict=True))
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer([(0, 2)], values["stiffness"], values["damping"])
        return joint


class Chain(SubstructureModel):
    """Masses in a row with springs between them, sound."""

    name = "chain"
    summary = "Masses in a row"

    class Config(ComponentConfig):
        """Dimensions and properties.

        Attributes
        ----------
        masses : int
            How many.
        mass : float
            Of all [kg].
        stiffness : float
            Of all springs in a row [N/m].
        length : float
            From the first to the last [m].
        """

        masses: Annotated[int, Field(ge=2)] = 3
        mass: Annotated[float, Field(gt=0), InUnit("kg")] = 2.0
        stiffness: Annotated[float, Field(gt=0), InUnit("N/m")] = 1e7
        length: Annotated[float, Field(gt=0), InUnit("m")] = 0.3

    @property
    def nodes(self):
        """One for each mass."""
        count = self.config.masses
        return tuple(PartNode(f"m{index}", self.config.length * index / (count - 1)) for index in range(count))

    def matrices(self):
        """Return the matrices; nothing turns."""
        count, chain = self.config.masses, StructuralMatrices.zeros(2 * self.config.masses)
        for index in range(count - 1):
            pair = (2 * index, 2 * index + 2)
            chain.add_contact_layer([pair], self.config.stiffness * (count - 1))
            for dof in pair:
                chain.M[dof, dof] += 0.5 * self.config.mass / (count - 1)
        chain.D[:] = 0.01 * chain.K
        return chain


@also_breaks("global_state_is_left_unchanged")
class LeavesAFile(Chain):
    """It keeps its matrices in a file, wherever it is."""

    def matrices(self):
        """Write the file."""
        chain = super().matrices()
        np.save(Path.cwd() / "chain_cache.npy", chain.K)
        return chain


@also_breaks("refinement_converges")
class RefinesItself(Chain):
    """A finer mesh is made in place."""

    def __init__(self, config=None):
        super().__init__(config)
        self.count = self.config.masses

    @property
    def nodes(self):
        """One for each mass."""
        return tuple(PartNode(f"m{i}", self.config.length * i / (self.count - 1)) for i in range(self.count))

    def matrices(self):
        """Return those of the present mesh."""
        return Chain(self.config.model_copy(update={"masses": self.count})).matrices()

    def refined(self, factor):
        """Change the mesh, and return itself."""
        self.count = factor * (self.count - 1) + 1
        return self


@also_breaks("mass_is_symmetric_and_positive")
class TurnedOrder(Chain):
    """Its matrices have rz before x."""

    def matrices(self):
        """Exchange the DOFs of each node."""
        chain = super().matrices()
        order = np.arange(chain.size).reshape(-1, 2)[:, ::-1].ravel()
        return StructuralMatrices(*(getattr(chain, part)[np.ix_(order, order)] for part in "MKCD"))


@also_breaks("global_state_is_left_unchanged")
class LimitsThreads(Chain):
    """It sets the threads of the linear algebra for all."""

    def receptance(self, frequency, dofs):
        """Set them, and leave them so."""
        from threadpoolctl import threadpool_limits

        self.limit = threadpool_limits(limits=1)
        return super().receptance(frequency, dofs)
