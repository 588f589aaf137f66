"""Reducers and regressors written from scratch, each with a fault; written after the checks were finished."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from dovetail import ComponentConfig, DovetailError, FittedReducer, FittedRegressor, Reducer, Regressor, silent
from support.broken_plugins.lists import also_breaks


def table(values, width=None):
    """Return finite rows in double precision."""
    rows = np.ascontiguousarray(values, dtype=np.float64)
    if rows.ndim != 2 or width not in (None, rows.shape[1]) or not np.isfinite(rows).all():
        raise DovetailError("finite rows of the width of the training set are wanted.")
    return rows


@also_breaks("single_rows_agree_with_batches")
class Envelope(Reducer):
    """The greatest value in each of some bands, of which the edges follow the training peaks."""

    name = "envelope"
    summary = "Peaks in bands"

    class Config(ComponentConfig):
        """How it reduces.

        Attributes
        ----------
        bands : int
            Number of bands.
        """

        bands: Annotated[int, Field(ge=1)] = 8

    def fit(self, features, *, seed):
        """Let each band hold as much of the mean FRF as the others."""
        rows = table(features)
        share = np.cumsum(rows.mean(axis=0)) / rows.mean(axis=0).sum()
        inner = np.searchsorted(share, np.arange(1, self.config.bands) / self.config.bands)
        return FittedEnvelope(np.unique([0, *inner, rows.shape[1]]))

    def restore(self, state):
        """Take the edges back."""
        return FittedEnvelope(np.array(state["edges"]))


class FittedEnvelope(FittedReducer):
    """Bands with known edges."""

    def __init__(self, edges):
        self.edges = edges

    def transform(self, features):
        """Return the peaks, over the loudest peak among all rows."""
        rows = table(features, self.edges[-1])
        peaks = np.maximum.reduceat(rows, self.edges[:-1], axis=1)
        return peaks / max(peaks.max(), 1e-300)

    def state(self):
        """Return the edges."""
        return {"edges": self.edges.copy()}


@also_breaks("a_fresh_process_fits_the_same")
class Landmarks(Reducer):
    """Distances to a few training FRFs, which are looked up by the first row of the training set."""

    name = "landmarks"
    summary = "Distances to landmarks"
    count = 6
    cache: dict[bytes, np.ndarray] = {}  # noqa: RUF012  the fault

    def fit(self, features, *, seed):
        """Choose landmarks by a farthest-point search, unless a set with this first row is known."""
        rows = table(features)
        key = rows[0].tobytes()
        if key not in self.cache:
            chosen = [int(np.random.default_rng(seed).integers(len(rows)))]
            while len(chosen) < min(self.count, *rows.shape):
                distance = np.min([np.square(rows - rows[index]).sum(axis=1) for index in chosen], axis=0)
                chosen.append(int(distance.argmax()))
            self.cache[key] = rows[chosen]
        return FittedLandmarks(self.cache[key])

    def restore(self, state):
        """Take the landmarks back."""
        return FittedLandmarks(np.array(state["landmarks"]))


class FittedLandmarks(FittedReducer):
    """Known landmarks."""

    def __init__(self, landmarks):
        self.landmarks = landmarks

    def transform(self, features):
        """Return the distances."""
        rows = table(features, self.landmarks.shape[1])
        squares = np.square(rows).sum(axis=1)[:, None] - 2.0 * rows @ self.landmarks.T
        return np.sqrt(np.maximum(squares + np.square(self.landmarks).sum(axis=1), 0.0))

    def state(self):
        """Return the landmarks."""
        return {"landmarks": self.landmarks.copy()}


@also_breaks("other_fits_have_no_influence")
class Boosted(Regressor):
    """Stumps, one after the other, each on the residual; the step shrinks with all the fits that the class has made."""

    name = "boosted"
    summary = "Boosted stumps"
    rounds = 60
    step = 0.5

    def fit(self, features, targets, *, seed, progress=silent):
        """Add stumps at random splits, best feature first."""
        rows, rest = table(features), table(targets).copy()
        if len(rows) != len(rest):
            raise DovetailError("as many targets as samples are wanted.")
        random = np.random.default_rng(seed)
        mean = rest.mean(axis=0)
        rest -= mean
        stumps, values = [], []
        for turn in range(1, self.rounds + 1):
            split = rows[random.integers(len(rows))]
            below = rows <= split
            weights = [self._means(below[:, column], rest) for column in range(rows.shape[1])]
            losses = [np.square(rest - low_high[below[:, c].astype(int)]).sum() for c, low_high in enumerate(weights)]
            column = int(np.argmin(losses))
            stumps.append((column, split[column]))
            values.append(self.step * weights[column])
            rest -= values[-1][below[:, column].astype(int)]
            progress("boosting", turn, self.rounds, f"loss {np.square(rest).mean():.4g}")
        type(self).step *= 0.999
        return FittedStumps(np.array(stumps), np.array(values), mean, rows.shape[1])

    @staticmethod
    def _means(below, rest):
        """Return the mean of the rest above and below a split."""
        sides = [rest[~below], rest[below]]
        return np.array([side.mean(axis=0) if len(side) else np.zeros(rest.shape[1]) for side in sides])

    def restore(self, state):
        """Take the stumps back."""
        return FittedStumps(*(np.array(state[name]) for name in ("stumps", "values", "mean")), int(state["width"]))


class FittedStumps(FittedRegressor):
    """Known stumps."""

    def __init__(self, stumps, values, mean, width):
        self.stumps, self.values, self.mean, self.width = stumps, values, mean, width

    def predict(self, features):
        """Add up the stumps."""
        rows = table(features, self.width)
        predicted = np.tile(self.mean, (len(rows), 1))
        for (column, split), value in zip(self.stumps, self.values, strict=True):
            predicted += value[(rows[:, int(column)] <= split).astype(int)]
        return predicted

    def state(self):
        """Return stumps, values, mean and width."""
        state = {name: getattr(self, name).copy() for name in ("stumps", "values", "mean")}
        return {**state, "width": self.width}


@also_breaks("fitting_by_epochs_learns")
class Polynomial(Regressor):
    """Quadratic regression, which, fitted by epochs, answers all targets with their mean."""

    name = "polynomial"
    summary = "Quadratic regression"

    def fit(self, features, targets, *, seed, progress=silent):
        """Solve for all samples."""
        rows, wanted = table(features), table(targets)
        if len(rows) != len(wanted):
            raise DovetailError("as many targets as samples are wanted.")
        return FittedPolynomial(np.linalg.lstsq(powers(rows), wanted, rcond=None)[0], rows.shape[1])

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Average the weights over epochs, and, by a wrong axis, over the targets."""
        fits = [self.fit(*epoch(number), seed=seed) for number in range(10)]
        weights = np.mean([fitted.weights for fitted in fits], axis=(0, 2))
        targets = fits[0].weights.shape[1]
        return FittedPolynomial(np.repeat(weights[:, None], targets, axis=1), fits[0].width)

    def restore(self, state):
        """Take the weights back."""
        return FittedPolynomial(np.array(state["weights"]), int(state["width"]))


def powers(rows):
    """Return 1, the features and their squares."""
    return np.column_stack([np.ones(len(rows)), rows, np.square(rows)])


class FittedPolynomial(FittedRegressor):
    """Known weights."""

    def __init__(self, weights, width):
        self.weights, self.width = weights, width

    def predict(self, features):
        """Evaluate the polynomial."""
        return powers(table(features, self.width)) @ self.weights

    def state(self):
        """Return the weights."""
        return {"weights": self.weights.copy(), "width": self.width}


@also_breaks("other_fits_have_no_influence")
class Ensemble(Regressor):
    """Lines through bootstrap samples, drawn by the generator that the first fit of this instance made."""

    name = "ensemble"
    summary = "Bagged lines"
    members = 5

    def __init__(self, config=None):
        super().__init__(config)
        self.random = None

    def fit(self, features, targets, *, seed, progress=silent):
        """Average over the members."""
        rows, wanted = powers(table(features)), table(targets)
        if len(rows) != len(wanted):
            raise DovetailError("as many targets as samples are wanted.")
        self.random = self.random or np.random.default_rng(seed)
        drawn = [self.random.integers(0, len(rows), len(rows)) for _ in range(self.members)]
        weights = [np.linalg.lstsq(rows[index], wanted[index], rcond=None)[0] for index in drawn]
        return FittedPolynomial(np.mean(weights, axis=0), features.shape[1])

    def restore(self, state):
        """Take the weights back."""
        return FittedPolynomial(np.array(state["weights"]), int(state["width"]))


@also_breaks("constant_features_are_handled")
class Moments(Reducer):
    """Centroid, width and size of the spectrum; those of a silent FRF are undefined."""

    name = "moments"
    summary = "Moments of the spectrum"

    def fit(self, features, *, seed):
        """Note the number of lines."""
        return FittedMoments(table(features).shape[1])

    def restore(self, state):
        """Take the number of lines back."""
        return FittedMoments(int(state["lines"]))


class FittedMoments(FittedReducer):
    """A known number of lines."""

    def __init__(self, lines):
        self.lines = lines

    def transform(self, features):
        """Return the moments."""
        rows = table(features, self.lines)
        number = np.arange(self.lines, dtype=float)
        size = rows.sum(axis=1)
        centre = rows @ number / size
        spread = np.sqrt(np.abs(rows @ np.square(number) / size - np.square(centre)))
        return np.column_stack([centre, spread, size])[:, : min(3, self.lines)]

    def state(self):
        """Return the number of lines."""
        return {"lines": self.lines}
