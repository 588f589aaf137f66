"""Unusual reducers, regressors and a reader: some that a plugin may have, and some that it may not."""

from __future__ import annotations

import json
from typing import Any, Literal

import numpy as np
from pydantic import Field

import dovetail


class FittedLine(dovetail.FittedRegressor):
    """A linear function of the features; `fault` says what is wrong with its state or with what it shows."""

    def __init__(self, weights: np.ndarray, fault: str = "") -> None:
        self.weights, self.fault = weights, fault

    def predict(self, features: Any) -> Any:
        return np.asarray(features, dtype=float) @ self.weights[:-1] + self.weights[-1]

    def state(self) -> Any:
        match self.fault:
            case "raises":
                raise RuntimeError("no state today")
            case "none":
                return None
            case "number":
                return {0: self.weights}
            case "incomplete":
                return {}
            case "metadata":
                return {"__metadata__": self.weights}
            case "surrogate":
                return {"weights": self.weights, "text": "\ud800"}
            case "nan":
                return {"weights": self.weights, "number": float("nan")}
        return {"weights": self.weights}


class FittedSpread(FittedLine):
    """The same with a distribution that reaches far beyond the range."""

    def predict_distribution(self, features: Any) -> dovetail.TargetDistribution:
        if self.fault == "reports nothing":
            raise RuntimeError("none today")
        mean = self.predict(features)
        return dovetail.TargetDistribution.gaussian(mean, np.repeat(0.05 * np.eye(2)[None], len(mean), axis=0))


class Line(dovetail.Regressor):
    """Least squares."""

    name, summary = "line", "Least squares"

    class Config(dovetail.ComponentConfig):
        """`scale` is not shown by `repr`."""

        scale: float = Field(1.0, repr=False)
        spread: bool = False
        fault: str = ""

    def _fitted(self, weights: Any) -> FittedLine:
        return (FittedSpread if self.config.spread else FittedLine)(np.array(weights), self.config.fault)

    def fit(self, features: Any, targets: Any, *, seed: int, progress: Any = dovetail.silent) -> FittedLine:
        columns = np.column_stack([np.asarray(features, dtype=float), np.ones(len(features))])
        return self._fitted(np.linalg.lstsq(columns, targets, rcond=None)[0] * self.config.scale)

    def restore(self, state: Any) -> FittedLine:
        return self._fitted(state["weights"])


class LineInContext(Line):
    """One that must get the context."""

    name = "line_in_context"

    def fit(
        self, features: Any, targets: Any, *, seed: int, context: Any, progress: Any = dovetail.silent
    ) -> FittedLine:
        assert context.frequency.size
        return super().fit(features, targets, seed=seed)


class LineOfEpochs(Line):
    """One that goes back to the first epoch."""

    name = "line_of_epochs"

    def fit_epochs(self, epoch: Any, *, seed: int, progress: Any = dovetail.silent) -> FittedLine:
        first = epoch(0)
        epoch(1)
        return self.fit(*(first if np.array_equal(first[0], epoch(0)[0]) else epoch(1)), seed=seed)


class FittedOffset(dovetail.FittedReducer):
    """Projections and an offset, in double precision."""

    def __init__(self, directions: np.ndarray, offset: float) -> None:
        self.directions, self.offset = directions, offset

    def transform(self, features: Any) -> Any:
        return np.asarray(features, dtype=float) @ self.directions + self.offset

    def state(self) -> Any:
        return {"directions": self.directions, "offset": self.offset}


class Offset(dovetail.Reducer):
    """Principal components far from zero."""

    name, summary = "offset", "Principal components far from zero"

    class Config(dovetail.ComponentConfig):
        """A number that is added to each component."""

        offset: float = 0.0

    def fit(self, features: Any, *, seed: int) -> FittedOffset:
        centred = np.asarray(features, dtype=float) - np.mean(features, axis=0, dtype=float)
        return FittedOffset(np.linalg.svd(centred, full_matrices=False)[2][:8].T.copy(), self.config.offset)

    def restore(self, state: Any) -> FittedOffset:
        return FittedOffset(np.array(state["directions"]), float(state["offset"]))


class OneDof(dovetail.FrfReader):
    """A file that shows where the response is, and nothing of the force."""

    name, summary, suffixes = "one_dof", "A response without a force", (".one",)

    def sniff(self, content: bytes) -> bool:
        return content.startswith(b'{"response"')

    def read(self, path: Any, content: bytes) -> list[dovetail.RecordedFrf]:
        reported = json.loads(content)["response"]
        return [dovetail.RecordedFrf(np.arange(1.0, 5.0), np.full(4, 1j), unit="m/s^2/N", response=reported)]

    def samples(self, folder: Any) -> list[Any]:
        (folder / "a.one").write_text('{"response": "1-x"}')
        return [folder / "a.one"]


@dovetail.hookimpl
def dovetail_components() -> list[type[dovetail.Component]]:
    return [Line, LineInContext, LineOfEpochs, Offset, OneDof]


@dovetail.hookimpl
def dovetail_defaults() -> dict[Literal["identification"], Any]:
    return {"identification": {"reducer": {"model": "pca", "n_components": 7}}}
