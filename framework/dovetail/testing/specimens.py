"""Components under test, constructed from their examples, with input and their results for it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import (
    Component,
    JointModel,
    SparseMatrices,
    StructuralMatrices,
    SubstructureModel,
)
from dovetail.testing.answers import has_receptance
from dovetail.testing.fitted_specimens import ReducerSpecimen, RegressorSpecimen
from dovetail.testing.law_checks import LawSpecimen
from dovetail.testing.linear_algebra import dense
from dovetail.testing.matrix_reader_checks import MatrixReaderSpecimen
from dovetail.testing.method_checks import MethodSpecimen
from dovetail.testing.reader_checks import ReaderSpecimen
from dovetail.testing.specimen import SEED, Specimen

FREQUENCY: NDArray[np.float64] = np.geomspace(20.0, 2000.0, 9)
"""Lines [Hz] at which components are evaluated; the examples of substructures known by FRFs must cover them."""

WIDE: NDArray[np.float64] = np.geomspace(1.0, 20e3, 14)
"""Lines [Hz] at which joints, and substructures with matrices, are evaluated."""


@dataclass(frozen=True)
class Settings:
    """Number of parameter vectors at which joints are evaluated.

    Attributes
    ----------
    random : int
        Vectors drawn from the whole ranges. A fault in one per cent of their volume is found with near certainty
        (1 - 0.99^1000 = 0.99996), and one evaluation of a bundled joint for all of them takes 0.03 s.
    corners : int
        Corners of the ranges: all for up to eight parameters, this number of random ones for more.
    memory : float
        Bytes of one matrix for all vectors, which limits the number of vectors for joints with hundreds of DOFs.
    """

    random: int = 1000
    corners: int = 256
    memory: float = 6.4e7


SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class JointSpecimen(Specimen):
    """A joint and its matrices over its ranges."""

    component: JointModel

    @cached_property
    def inner(self) -> NDArray[np.float64]:
        """Parameter vectors (n, n_params): the middle of the ranges, and random ones."""
        count = len(self.component.parameters)
        fractions = np.random.default_rng(SEED).random(
            (max(8, min(SETTINGS.random, int(0.8 * self._largest_batch))), count)
        )
        fractions[0] = 0.5
        return self.vectors(fractions)

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """Parameter vectors (n, n_params): corners of the ranges, including the lowest and the highest."""
        count, most = len(self.component.parameters), max(2, min(SETTINGS.corners, int(0.2 * self._largest_batch)))
        if 2**count <= most:
            return self.vectors(np.array(list(itertools.product((0.0, 1.0), repeat=count))))
        fractions = np.random.default_rng(SEED).integers(0, 2, (most, count)).astype(np.float64)
        fractions[0], fractions[1] = 0.0, 1.0
        return self.vectors(fractions)

    @cached_property
    def theta(self) -> NDArray[np.float64]:
        """Parameter vectors (n, n_params): the inner ones, then the corners."""
        return np.concatenate([self.inner, self.corners])

    @property
    def _largest_batch(self) -> float:
        return SETTINGS.memory / (8.0 * max(1, self.component.size) ** 2)

    def vectors(self, fractions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameter vectors (n, n_params) at fractions of the ranges."""
        theta = np.empty(fractions.shape)
        for column, parameter in enumerate(self.component.parameters):
            values = parameter.from_unit(fractions[:, column])
            theta[:, column] = np.clip(values, parameter.lower, parameter.upper)
        return theta

    def some(self, count: int) -> NDArray[np.float64]:
        """Return up to `count` of the vectors: the middle and others within the ranges, and as many corners."""
        corners = self.corners[np.linspace(0, len(self.corners) - 1, min(count // 2, len(self.corners))).astype(int)]
        return np.concatenate([self.inner[: count - len(corners)], corners])

    @cached_property
    def matrices(self) -> StructuralMatrices:
        """Copies of the joint's matrices for `theta`."""
        answer = self.component.matrices(self.theta.copy())
        return StructuralMatrices(*(np.array(getattr(answer, part)) for part in "MKCD"))

    def stiffness(self, frequency: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return a copy of the dynamic stiffness (n, n_freq, d, d)."""
        return np.array(self.component.dynamic_stiffness(frequency.copy(), theta.copy()))

    def shown(self, vector: NDArray[np.float64]) -> str:
        """Return a parameter vector as text for a message."""
        pairs = zip(self.component.parameters, vector, strict=True)
        values = [(f"{parameter.name} = {value:.4g}", parameter.unit) for parameter, value in pairs]
        return ", ".join(value if unit == "1" else f"{value} {unit}" for value, unit in values)

    @property
    def lines(self) -> NDArray[np.float64]:
        """Lines [Hz] at which it is evaluated."""
        return WIDE

    @property
    def own_law(self) -> bool:
        """Whether it defines its dynamic stiffness itself."""
        return self.model.dynamic_stiffness is not JointModel.dynamic_stiffness  # type: ignore[attr-defined]


@dataclass(frozen=True, eq=False)
class SubstructureSpecimen(Specimen):
    """A substructure with its matrices and receptance."""

    component: SubstructureModel

    @cached_property
    def matrices(self) -> StructuralMatrices | SparseMatrices | None:
        """Its matrices."""
        return self.component.matrices()

    @cached_property
    def dofs(self) -> list[int]:
        """A few active DOFs of the nodes, evenly spaced in their list."""
        taking_part = np.arange(self.component.node_dofs.size)
        if self.matrices is not None:
            parts = (dense(getattr(self.matrices, name)) for name in "MKCD")
            filled = np.logical_or.reduce([(part != 0).any(axis=0) for part in parts])
            taking_part = taking_part[filled[: len(taking_part)]]
        chosen = np.linspace(0, len(taking_part) - 1, min(len(taking_part), 5)).round().astype(int)
        return [int(dof) for dof in taking_part[chosen]]

    @cached_property
    def has_receptance(self) -> bool:
        """Whether forces move it by finite amounts."""
        return has_receptance(self.component, self.matrices)

    @property
    def lines(self) -> NDArray[np.float64]:
        """Lines [Hz] at which it is evaluated: 1 Hz to 20 kHz or, if known by FRFs only, those that it must cover."""
        return FREQUENCY if self.matrices is None else WIDE

    @cached_property
    def receptance(self) -> NDArray[np.complex128]:
        """Copy of the receptance (n_freq, n, n) between `dofs` at `lines`."""
        return np.array(self.component.receptance(self.lines.copy(), list(self.dofs)))


def specimen_of(model: type[Component], options: Mapping[str, Any]) -> Specimen:
    """Construct a component from options as in a description."""
    component = model(model.Config.model_validate(dict(options)))
    kinds = {
        "joint": JointSpecimen,
        "substructure": SubstructureSpecimen,
        "reducer": ReducerSpecimen,
        "regressor": RegressorSpecimen,
        "reader": ReaderSpecimen,
        "matrix_reader": MatrixReaderSpecimen,
        "method": MethodSpecimen,
        "law": LawSpecimen,
    }
    specimen: Specimen = kinds[model.kind](model, options, component)
    return specimen
