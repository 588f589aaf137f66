"""Valid but unusual parts: connected by dampers only, known by few modes, with coincident nodes."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from pydantic import Field

import dovetail
from dovetail import (
    Component,
    ComponentConfig,
    InUnit,
    JointModel,
    JointPort,
    Parameter,
    PartNode,
    StructuralMatrices,
    SubstructureModel,
)


class Dashpots(SubstructureModel):
    """Two masses of 1 kg, joined by a spring, and by two dampers in series with a node between them."""

    name = "dashpots"
    summary = "Dampers in series"

    class Config(ComponentConfig):
        """No options."""

    @property
    def nodes(self) -> tuple[PartNode, ...]:
        """Left, between the dampers, right."""
        return PartNode("left", 0.0), PartNode("middle", 0.1), PartNode("right", 0.2)

    def matrices(self) -> StructuralMatrices:
        """Return the matrices; nothing turns."""
        matrices = StructuralMatrices.zeros(6)
        matrices.add_contact_layer([(0, 4)], 1e6)
        matrices.add_contact_layer([(0, 2)], 0.0, 100.0)
        matrices.add_contact_layer([(2, 4)], 0.0, 300.0)
        matrices.M[0, 0] = matrices.M[4, 4] = 1.0
        return matrices


class FewModes(SubstructureModel):
    """A bar of 2 kg and 0.4 m known by its FRFs at four nodes: two rigid-body modes and one that bends it."""

    name = "few_modes"
    summary = "FRFs of few modes"

    class Config(ComponentConfig):
        """Options.

        Attributes
        ----------
        first : float
            Natural frequency of the elastic mode [Hz].
        """

        first: Annotated[float, Field(gt=0), InUnit("Hz")] = 200.0

    @property
    def nodes(self) -> tuple[PartNode, ...]:
        """Evenly spread."""
        return tuple(PartNode(f"p{index}", 0.4 * index / 3.0) for index in range(4))

    def matrices(self) -> None:
        """Return None: only FRFs are known."""
        return

    def receptance(self, frequency: np.ndarray, dofs: Any) -> np.ndarray:
        """Return the sum over the modes."""
        return receptance_of_few_modes(frequency, list(dofs), self.config.first)


def receptance_of_few_modes(frequency: np.ndarray, dofs: list[int], first: float) -> np.ndarray:
    """Return the receptances (n_freq, n, n) of the bar between some of its DOFs."""
    positions = np.linspace(-0.2, 0.2, 4)
    shapes = np.zeros((8, 3))
    shapes[::2] = np.stack([np.ones(4), positions * np.sqrt(12.0) / 0.4, np.cos(np.pi * positions / 0.2)], axis=1)
    shapes[1::2] = np.gradient(shapes[::2], positions, axis=0)
    omega2 = (2.0 * np.pi * np.asarray(frequency)) ** 2
    natural = (2.0 * np.pi * np.array([0.0, 0.0, first])) ** 2 * (1.0 + 0.01j)
    modal = 1.0 / (2.0 * (natural - omega2[:, np.newaxis]))
    return np.einsum("im,fm,jm->fij", shapes[dofs], modal, shapes[dofs])


class Twin(SubstructureModel):
    """Two strings of masses side by side, whose nodes are at the same places; the lower one is heavier."""

    name = "twin"
    summary = "Two strings in one place"

    class Config(ComponentConfig):
        """Options.

        Attributes
        ----------
        pieces : int
            Of each string.
        """

        pieces: Annotated[int, Field(ge=1)] = 2

    @property
    def nodes(self) -> tuple[PartNode, ...]:
        """Upper ones, then the lower ones."""
        places = np.linspace(0.0, 0.2, self.config.pieces + 1)
        return tuple(PartNode(f"{row}{index}", float(x)) for row in "ul" for index, x in enumerate(places))

    def matrices(self) -> StructuralMatrices:
        """Return a string of equal masses and springs, twice."""
        count = self.config.pieces + 1
        matrices = StructuralMatrices.zeros(4 * count)
        for row, mass in enumerate((1.0, 3.0)):
            dofs = [2 * (row * count + index) for index in range(count)]
            matrices.add_contact_layer(list(pairwise(dofs)), 1e6 * self.config.pieces)
            matrices.M[dofs, dofs] = mass / count
        matrices.add_contact_layer([(0, 2 * count)], 1e6)
        return matrices

    def refined(self, factor: int) -> Twin:
        """Return one of more pieces."""
        return Twin(self.Config(pieces=factor * self.config.pieces))


class KnownBefore(JointModel):
    """A spring whose stiffness is known beforehand, as a log-normal distribution."""

    name = "known_before"
    summary = "Spring known beforehand"
    ports = (JointPort("a", 1), JointPort("b", 1))
    parameters = (Parameter("k", "N/m", 1e5, 1e7, "log", "stiffness", prior="normal"),)
    contact_dofs = ((0, 2),)

    class Config(ComponentConfig):
        """No options."""

    def matrices(self, theta: np.ndarray) -> StructuralMatrices:
        """Return a spring."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer([(0, 2)], theta[:, 0])
        return joint


@dovetail.hookimpl
def dovetail_components() -> list[type[Component]]:
    """Return the components of this file."""
    return [Dashpots, FewModes, Twin, KnownBefore]
