"""A bushing: springs and dampers in all six directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    DIRECTIONS,
    ComponentConfig,
    Direction,
    JointModel,
    JointPort,
    Parameter,
    ScaledMatrices,
    StructuralMatrices,
)

_Pair = tuple[Direction, Direction]


class Bushing(JointModel):
    """A massless spring and damper between two nodes in each direction of the joint's own axes.

    The stiffness of one direction can act on another (`cross`), as between radial motion and tilting in a bearing with
    an inclined contact. Forces and moments are linear in relative displacements and rotations; the nodes lie at one
    place.
    """

    name = "bushing"
    summary = "Bushing: stiffness and damping in up to six directions, with cross terms"

    class Config(ComponentConfig):
        """The directions in which it acts, and pairs of them that are coupled.

        Attributes
        ----------
        directions : sequence of directions
            Some of x, y, z, rx, ry, rz, in this order; all by default.
        cross : sequence of pairs of directions
            Such as [x, rz]. Each adds a stiffness between the two, r times the geometric mean of their own ones.
        """

        directions: tuple[Direction, ...] = DIRECTIONS
        cross: tuple[_Pair, ...] = ()

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return one in all directions, and one in a plane with a cross term."""
        return {}, {"directions": ["x", "rz"], "cross": [["x", "rz"]]}

    def __init__(self, config: Any = None) -> None:
        super().__init__(config)
        for number, pair in enumerate(self.config.cross):
            first, second = pair
            if first == second or not {*pair} <= {*self.config.directions}:
                raise ValueError(f"cross.{number} is not a pair of two of the directions {self.config.directions}")
            if {*pair} in [{*other} for other in self.config.cross[:number]]:
                raise ValueError(f"cross.{number} is there twice")

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Stiffness k and damping c by direction, then the ratios of the cross stiffnesses."""
        stiffness, damping = [], []
        for direction in self.config.directions:
            turns = direction.startswith("r")
            about = f"{'about' if turns else 'along'} {direction[-1]}"
            k = (1e2, 1e7, "N m/rad") if turns else (1e4, 1e10, "N/m")
            c = (1e-3, 1e2, "N m s/rad") if turns else (1.0, 1e4, "N s/m")
            stiffness.append(Parameter(f"k_{direction}", k[2], k[0], k[1], "log", f"stiffness {about}"))
            damping.append(Parameter(f"c_{direction}", c[2], c[0], c[1], "log", f"damping {about}"))
        ratios = (
            Parameter(f"r_{one}_{other}", "1", -0.5, 0.5, "linear", f"stiffness between {one} and {other}, see cross")
            for one, other in self.config.cross
        )
        return (*stiffness, *damping, *ratios)

    @cached_property
    def _coupled(self) -> tuple[Direction, ...]:
        """The directions that are coupled to others."""
        return tuple(each for each in self.config.directions if any(each in pair for pair in self.config.cross))

    @cached_property
    def linear_parameters(self) -> tuple[str, ...]:
        """All but the stiffnesses that are coupled and the ratios."""
        others = {f"k_{direction}" for direction in self._coupled} | {f"r_{a}_{b}" for a, b in self.config.cross}
        return tuple(parameter.name for parameter in self.parameters if parameter.name not in others)

    @cached_property
    def scaled_matrices(self) -> ScaledMatrices | None:
        """The coupled stiffnesses, each alone, and the cross stiffnesses r sqrt(k k')."""
        if not self.config.cross:
            return None
        pairs: list[_Pair] = [(direction, direction) for direction in self._coupled] + list(self.config.cross)
        matrices = []
        for pair in pairs:
            matrix = StructuralMatrices.zeros(self.size)
            self._add_stiffness(matrix, pair, 1.0)
            matrices.append(matrix)
        return ScaledMatrices(matrices, self._stiffnesses, self._stiffness_slopes)

    def _stiffnesses(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the coupled stiffnesses and the cross stiffnesses, for the former and the ratios (n, p)."""
        direct, ratios = np.split(theta, [len(self._coupled)], axis=1)
        return np.concatenate([direct, ratios * self._means(direct)], axis=1)

    def _means(self, direct: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the geometric mean of the two stiffnesses of each pair, (n, n_pairs)."""
        return np.asarray(
            np.sqrt(np.stack([np.prod(direct[:, self._columns(pair)], axis=1) for pair in self.config.cross], 1))
        )

    def _columns(self, pair: _Pair) -> list[int]:
        return [self._coupled.index(direction) for direction in pair]

    def _stiffness_slopes(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n, m, p) of `_stiffnesses`."""
        count = len(self._coupled)
        direct, ratios = np.split(theta, [count], axis=1)
        means, slopes = self._means(direct), np.zeros((len(theta), theta.shape[1], theta.shape[1]))
        slopes[:, range(count), range(count)] = 1.0
        for number, pair in enumerate(self.config.cross):
            slopes[:, count + number, count + number] = means[:, number]
            for column in self._columns(pair):
                slopes[:, count + number, column] = ratios[:, number] * means[:, number] / (2.0 * direct[:, column])
        return slopes

    @cached_property
    def ports(self) -> tuple[JointPort, ...]:
        """The two sides, a and b."""
        directions = tuple(self.config.directions)
        return JointPort("a", 1, directions=directions), JointPort("b", 1, directions=directions)

    def range_objections(self, lower: Mapping[str, float], upper: Mapping[str, float]) -> Mapping[str, str]:
        """Object also to ratios with which a deformation could release energy."""
        objections = dict(super().range_objections(lower, upper))
        size = len(self.config.directions)
        ratios = np.zeros((size, size))
        for pair in self.config.cross:
            name, (one, other) = f"r_{pair[0]}_{pair[1]}", map(self.config.directions.index, pair)
            ratios[one, other] = ratios[other, one] = max(abs(lower[name]), abs(upper[name]))
        if np.linalg.eigvalsh(ratios)[-1] > 1.0:
            for one_way, other_way in self.config.cross:
                name = f"r_{one_way}_{other_way}"
                objections[name] = f"{name} may be so large that a deformation of the bushing releases energy."
        return objections

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the (n, d, d) matrices for theta (n, n_params)."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        directions, count = list(self.config.directions), len(self.config.directions)
        for number, direction in enumerate(directions):
            self._add_stiffness(joint, (direction, direction), theta[:, number])
            joint.add_contact_layer([(number, count + number)], 0.0, theta[:, count + number])
        for pair, ratio in zip(self.config.cross, theta[:, 2 * count :].T, strict=True):
            one, other = map(directions.index, pair)
            self._add_stiffness(joint, pair, ratio * np.sqrt(theta[:, one] * theta[:, other]))
        return joint

    def _add_stiffness(self, joint: StructuralMatrices, pair: _Pair, value: NDArray[np.float64] | float) -> None:
        """Add a stiffness between the deformations in two directions, or in one."""
        first, second = (self.contact_dofs[self.config.directions.index(direction)] for direction in pair)
        if first == second:
            joint.add_contact_layer([first], value)
        else:
            add_cross_stiffness(joint, first, second, value)


def add_cross_stiffness(
    joint: StructuralMatrices,
    first: tuple[int, int],
    second: tuple[int, int],
    stiffness: NDArray[np.float64] | float,
) -> None:
    """Add a stiffness between two relative motions, each given by the DOFs of both sides, in place."""
    for side, one in enumerate(first):
        for other_side, other in enumerate(second):
            value = stiffness if side == other_side else -stiffness
            joint.K[..., one, other] += value
            joint.K[..., other, one] += value
