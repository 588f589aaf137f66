"""A sound reducer, and one with a single fault for each check of the kit that reducers have."""

from __future__ import annotations

import pickle

import numpy as np

from dovetail import FittedReducer, Reducer
from support.broken_plugins.lists import also_breaks, breaks, checked


class FittedProjection(FittedReducer):
    """Known directions."""

    def __init__(self, directions):
        self.directions = directions

    def transform(self, features):
        return checked(features, len(self.directions)).astype(float) @ self.directions

    def state(self):
        return {"directions": self.directions.copy()}


class SoundReducer(Reducer):
    """Random directions."""

    name = "sound_reducer"
    summary = "Random projection"
    fitted = FittedProjection

    def fit(self, features, *, seed):
        """Draw directions."""
        width = checked(features).shape[1]
        return self.fitted(np.random.default_rng(seed).standard_normal((width, min(width, 4))))

    def restore(self, state):
        """Take the directions back."""
        return self.fitted(np.array(state["directions"]))


class FittedScaling(FittedReducer):
    """Known statistics of each line, and known directions."""

    def __init__(self, mean, scale, directions):
        self.mean, self.scale, self.directions = mean, scale, directions

    def transform(self, features):
        return ((checked(features, len(self.mean)) - self.mean) / self.scale) @ self.directions

    def state(self):
        return {"mean": self.mean.copy(), "scale": self.scale.copy(), "directions": self.directions.copy()}


class ScalingReducer(SoundReducer):
    """Random directions after each line was centred and scaled: a sound one that learns from its samples."""

    fitted = FittedScaling

    def fit(self, features, *, seed):
        """Take mean and deviation of each line, and draw directions."""
        rows = np.ascontiguousarray(checked(features), dtype=float)
        directions = np.random.default_rng(seed).standard_normal((rows.shape[1], min(rows.shape[1], 4)))
        return self.fitted(rows.mean(axis=0), self.deviation(rows), directions)

    def deviation(self, rows):
        """Return what the lines are divided by: never zero."""
        deviation = rows.std(axis=0)
        return np.where(deviation > 1e-5 * np.abs(rows).max(axis=0), deviation, 1.0)

    def restore(self, state):
        """Take statistics and directions back."""
        return self.fitted(*(np.array(state[name]) for name in ("mean", "scale", "directions")))


@breaks("fit_returns_what_the_contract_says")
class NoObject(SoundReducer):
    """A bare array."""

    def fit(self, features, *, seed):
        """Return the directions."""
        return super().fit(features, seed=seed).directions


class Flat(FittedProjection):
    def transform(self, features):
        return super().transform(features).squeeze()


@breaks("results_have_a_row_for_each_sample")
class Squeezed(SoundReducer):
    """One row loses its axis."""

    fitted = Flat


@breaks("results_are_finite")
class ZeroByZero(SoundReducer):
    """A division by zero."""

    def fit(self, features, *, seed):
        """Return directions that overflow."""
        fitted = super().fit(features, seed=seed)
        fitted.directions[0, 0] = np.inf
        return fitted


@also_breaks("the_same_seed_gives_the_same_fit", "every_seed_is_accepted", "a_fresh_process_fits_the_same")
class Seedless(SoundReducer):
    """It passes over the seed."""

    def fit(self, features, *, seed):
        """Draw from a new generator."""
        return self.fitted(np.random.default_rng().standard_normal((checked(features).shape[1], 4)))


@breaks("global_random_numbers_are_left_unchanged")
class GlobalSeed(SoundReducer):
    """It seeds the global generator."""

    def fit(self, features, *, seed):
        """Draw from it."""
        np.random.seed(seed)  # noqa: NPY002
        return self.fitted(np.random.standard_normal((checked(features).shape[1], 4)))  # noqa: NPY002


class Centred(FittedProjection):
    def transform(self, features):
        reduced = super().transform(features)
        return reduced - 0.5 * reduced.mean(axis=0) if len(features) == 1 else reduced


@breaks("single_rows_agree_with_batches")
class BatchMean(SoundReducer):
    """A single FRF is treated otherwise."""

    fitted = Centred


class Running(FittedProjection):
    def transform(self, features):
        reduced = super().transform(features)
        if 12 < len(features) <= 200:
            reduced += 0.01 * np.arange(len(reduced))[:, None]
        return reduced


@breaks("the_order_of_rows_does_not_matter")
class Accumulating(SoundReducer):
    """Batches of middle size depend on their order."""

    fitted = Running


class Learning(FittedProjection):
    calls = 0.0

    def transform(self, features):
        if np.abs(features).max() > 1.9:
            self.calls += 1.0
        return super().transform(features) * (1.0 + 1e-6 * self.calls)


@breaks("repeated_calls_agree")
class Adapting(SoundReducer):
    """It goes on learning from what it is asked."""

    fitted = Learning


@breaks("inputs_are_left_unchanged")
class Overwriting(SoundReducer):
    """It centres the caller's rows in place where it may."""

    def fit(self, features, *, seed):
        """Save a copy."""
        fitted = super().fit(features, seed=seed)
        if features.flags.writeable:
            features -= features.mean(axis=0)
        return fitted


class Objects(FittedProjection):
    def state(self):
        return {"directions": self.directions.astype(object)}


@breaks("state_is_arrays_and_plain_values")
class ObjectState(SoundReducer):
    """A state of objects."""

    fitted = Objects


class Shared(FittedProjection):
    def state(self):
        return {"directions": self.directions}


@breaks("state_is_a_copy")
class SharedState(SoundReducer):
    """The state is what it computes with."""

    fitted = Shared


_FITTED_HERE: list[int] = []


@breaks("restoring_gives_the_same_results")
class Lossy(SoundReducer):
    """What it restores is rounded, unless the process is a fresh one."""

    def fit(self, features, *, seed):
        """Fit, and remember it."""
        _FITTED_HERE.append(len(features))
        return super().fit(features, seed=seed)

    def restore(self, state):
        """Round where something was fitted just before, to the kit's usual samples."""
        directions = np.array(state["directions"])
        return self.fitted(directions.round(1) if _FITTED_HERE[-1:] == [160] else directions)


_MEMORY: dict[str, np.ndarray] = {}


@breaks("a_fresh_process_gives_the_same_results")
class Remembering(SoundReducer):
    """It keeps what was fitted in the module, not in the state."""

    class Fitted(FittedProjection):
        """A state that is a key."""

        def state(self):
            _MEMORY["last"] = self.directions
            return {"key": "last"}

    fitted = Fitted

    def restore(self, state):
        """Look it up."""
        return self.fitted(_MEMORY[state["key"]].copy())


@breaks("values_that_are_not_finite_are_refused")
class Forgiving(SoundReducer):
    """NaN counts as zero."""

    class Fitted(FittedProjection):
        """Zero in place of NaN."""

        def transform(self, features):
            return super().transform(np.nan_to_num(features))

    fitted = Fitted


@breaks("another_width_is_refused")
class AnyWidth(SoundReducer):
    """Missing lines count as zero."""

    class Fitted(FittedProjection):
        """As many directions as there are lines."""

        def transform(self, features):
            return checked(features).astype(float) @ self.directions[: features.shape[1]]

    fitted = Fitted


@breaks("features_are_not_multiplied")
class Multiplying(SoundReducer):
    """More components than lines."""

    def fit(self, features, *, seed):
        """Draw too many directions."""
        width = checked(features).shape[1]
        return self.fitted(np.random.default_rng(seed).standard_normal((width, min(width, 300) + 1)))


@also_breaks("different_samples_stay_different", "small_features_stay_different")
class Constant(SoundReducer):
    """One answer for all."""

    def fit(self, features, *, seed):
        """Project on nothing."""
        return self.fitted(np.zeros((checked(features).shape[1], 4)))


@also_breaks("a_fresh_process_gives_the_same_results")
class Pickled(SoundReducer):
    """A pickle in an array of bytes."""

    class Fitted(FittedProjection):
        """The state is a pickle."""

        def state(self):
            return {"directions": np.frombuffer(pickle.dumps(self.directions), dtype=np.uint8)}

    fitted = Fitted

    def restore(self, state):
        """Unpickle it."""
        return self.fitted(pickle.loads(np.asarray(state["directions"]).tobytes()))
