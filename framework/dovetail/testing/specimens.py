"""Components to look at: made from their own examples, with input of the kit's and what they answer to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import (
    Component,
    FittedReducer,
    FittedRegressor,
    JointModel,
    Reducer,
    Regressor,
    SparseMatrices,
    StructuralMatrices,
    SubstructureModel,
)

__all__ = [
    "FREQUENCY",
    "JointSpecimen",
    "ReducerSpecimen",
    "RegressorSpecimen",
    "Specimen",
    "SubstructureSpecimen",
    "dense",
    "sample_features",
    "sample_targets",
    "specimen_of",
]

FREQUENCY: NDArray[np.float64] = np.geomspace(20.0, 2000.0, 9)
"""Lines at which components are asked [Hz]; substructures known by FRFs must cover them in their examples."""

SEED = 7
_VECTORS = 24
_SAMPLES, _LINES = 160, 120


@dataclass(frozen=True, eq=False)
class Specimen:
    """A component made from one set of options.

    Parameters
    ----------
    model : type[Component]
    options : mapping
        As a description has them.
    component : Component
    """

    model: type[Component]
    options: Mapping[str, Any]
    component: Any

    @property
    def label(self) -> str:
        """How messages name the component."""
        return f"{self.model.kind} '{self.model.name}'"


@dataclass(frozen=True, eq=False)
class JointSpecimen(Specimen):
    """A joint and its matrices over its ranges."""

    component: JointModel

    @cached_property
    def theta(self) -> NDArray[np.float64]:
        """Parameter vectors (n, n_params): both corners of the ranges, their middle, and random ones between."""
        parameters = self.component.parameters
        random = np.random.default_rng(SEED).random((_VECTORS, len(parameters)))
        fractions = np.concatenate([np.zeros((1, len(parameters))), np.ones((1, len(parameters))), random])
        fractions[2] = 0.5
        columns = [parameter.from_unit(fractions[:, i]) for i, parameter in enumerate(parameters)]
        return np.stack(columns, axis=1) if columns else np.empty((len(fractions), 0))

    @cached_property
    def matrices(self) -> StructuralMatrices:
        """What the joint answers to `theta`."""
        return self.component.matrices(self.theta.copy())

    @property
    def own_law(self) -> bool:
        """Whether it gives its dynamic stiffness itself."""
        return self.model.dynamic_stiffness is not JointModel.dynamic_stiffness  # type: ignore[attr-defined]


@dataclass(frozen=True, eq=False)
class SubstructureSpecimen(Specimen):
    """A substructure with its matrices and receptance."""

    component: SubstructureModel

    @cached_property
    def matrices(self) -> StructuralMatrices | SparseMatrices | None:
        """What it answers."""
        return self.component.matrices()

    @cached_property
    def dofs(self) -> list[int]:
        """A few of the nodes' DOFs that take part, ends and middle of the list."""
        taking_part = np.arange(2 * len(self.component.nodes))
        if self.matrices is not None:
            parts = (dense(getattr(self.matrices, name)) for name in "MKCD")
            filled = np.logical_or.reduce([(part != 0).any(axis=0) for part in parts])
            taking_part = taking_part[filled[: len(taking_part)]]
        chosen = np.linspace(0, len(taking_part) - 1, min(len(taking_part), 5)).round().astype(int)
        return [int(dof) for dof in taking_part[chosen]]

    @cached_property
    def receptance(self) -> NDArray[np.complex128]:
        """(n_freq, n, n) between `dofs` at `FREQUENCY`."""
        return self.component.receptance(FREQUENCY.copy(), self.dofs)


@dataclass(frozen=True, eq=False)
class ReducerSpecimen(Specimen):
    """A reducer, fitted once."""

    component: Reducer

    @cached_property
    def features(self) -> NDArray[np.float32]:
        """Training features (n_samples, n_features)."""
        return sample_features()

    def fit(self, features: NDArray[np.float32] | None = None) -> Any:
        """Fit to the kit's samples, or to others."""
        return self.component.fit(self.features.copy() if features is None else features, seed=SEED)

    @cached_property
    def fitted(self) -> FittedReducer:
        """What fitting gave."""
        fitted: FittedReducer = self.fit()
        return fitted

    def answer(self, fitted: Any, features: NDArray[np.float32]) -> NDArray[Any]:
        """Return what something fitted makes of features."""
        answer: NDArray[Any] = fitted.transform(features)
        return answer


@dataclass(frozen=True, eq=False)
class RegressorSpecimen(Specimen):
    """A regressor, fitted once."""

    component: Regressor

    @cached_property
    def features(self) -> NDArray[np.float32]:
        """Training features (n_samples, 6), standardised."""
        return _standardised()

    @cached_property
    def targets(self) -> NDArray[np.float64]:
        """Training targets (n_samples, 2), from 0 to 1."""
        return sample_targets()

    def fit(self, features: NDArray[np.float32] | None = None) -> Any:
        """Fit to the kit's samples, or to other features of them."""
        given = self.features.copy() if features is None else features
        return self.component.fit(given, self.targets[: len(given)].copy(), seed=SEED)

    @cached_property
    def fitted(self) -> FittedRegressor:
        """What fitting gave."""
        fitted: FittedRegressor = self.fit()
        return fitted

    def answer(self, fitted: Any, features: NDArray[np.float32]) -> NDArray[Any]:
        """Return what something fitted predicts."""
        answer: NDArray[Any] = fitted.predict(features)
        return answer


def dense(matrix: Any) -> NDArray[np.float64]:
    """Return a matrix as an array, whether it is sparse or not."""
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix, dtype=np.float64)


def specimen_of(model: type[Component], options: Mapping[str, Any]) -> Specimen:
    """Make a component from options as a description has them."""
    component = model(model.Config.model_validate(dict(options)))
    kinds = {
        "joint": JointSpecimen,
        "substructure": SubstructureSpecimen,
        "reducer": ReducerSpecimen,
        "regressor": RegressorSpecimen,
    }
    specimen: Specimen = kinds[model.kind](model, options, component)
    return specimen


def _unknowns() -> NDArray[np.float64]:
    return np.random.default_rng(SEED).random((_SAMPLES, 2))


def sample_features() -> NDArray[np.float32]:
    """Return features (160, 120) as a reducer gets them: log10(A + 1) of unlike oscillators."""
    unknown = _unknowns()
    natural, damping = 300.0 + 400.0 * unknown[:, :1], 0.01 + 0.05 * unknown[:, 1:]
    ratio = np.linspace(50.0, 1000.0, _LINES)[None, :] / natural
    accelerance: NDArray[np.float64] = ratio**2 / np.hypot(1.0 - ratio**2, 2.0 * damping * ratio)
    return np.asarray(np.log10(accelerance + 1.0), dtype=np.float32)


def _standardised() -> NDArray[np.float32]:
    lines = sample_features()[:, ::20].astype(np.float64)
    return np.asarray((lines - lines.mean(axis=0)) / lines.std(axis=0), dtype=np.float32)


def sample_targets() -> NDArray[np.float64]:
    """Return targets (160, 2) as a regressor gets them: what the features came from, from 0 to 1."""
    unknown = _unknowns()
    least, greatest = unknown.min(axis=0), unknown.max(axis=0)
    targets: NDArray[np.float64] = (unknown - least) / (greatest - least)
    return targets
