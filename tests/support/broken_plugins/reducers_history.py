"""Reducers whose answers depend on earlier or other fits, instances, calls or processes."""

from __future__ import annotations

import random

import numpy as np

from dovetail import ComponentConfig
from support.broken_plugins.lists import also_breaks, breaks, checked
from support.broken_plugins.reducers import FittedProjection, FittedScaling, ScalingReducer, SoundReducer


@also_breaks("other_fits_have_no_influence")
class RunningStatistics(ScalingReducer):
    """The sums of each line go on over the fits of one recipe."""

    def __init__(self, config=None):
        super().__init__(config)
        self.seen = []

    def fit(self, features, *, seed):
        """Take the mean over all that this recipe ever saw."""
        fitted = super().fit(features, seed=seed)
        self.seen.append(fitted.mean)
        if len({mean.shape for mean in self.seen}) == 1:
            fitted.mean = np.mean(self.seen, axis=0)
        return fitted


@breaks("other_fits_have_no_influence")
class FirstStatistics(ScalingReducer):
    """The first mean of a width is kept in the recipe, and used for all later fits."""

    def __init__(self, config=None):
        super().__init__(config)
        self.means = {}

    def fit(self, features, *, seed):
        """Compute the mean if there is none of this width."""
        fitted = super().fit(features, seed=seed)
        fitted.mean = self.means.setdefault(fitted.mean.shape, fitted.mean)
        return fitted


_STATISTICS: dict[int, np.ndarray] = {}


@also_breaks("a_fresh_process_fits_the_same")
class CachedByWidth(ScalingReducer):
    """The mean is looked up by the number of lines, in the module."""

    def fit(self, features, *, seed):
        """Compute the mean if there is none of this width."""
        fitted = super().fit(features, seed=seed)
        fitted.mean = _STATISTICS.setdefault(len(fitted.mean), fitted.mean)
        return fitted


_DIRECTIONS: dict[int, np.ndarray] = {}


@also_breaks("a_fresh_process_fits_the_same")
class CachedDirections(SoundReducer):
    """Directions are drawn once for a width, whatever the seed."""

    def fit(self, features, *, seed):
        """Look the directions up."""
        fitted = super().fit(features, seed=seed)
        return self.fitted(_DIRECTIONS.setdefault(len(fitted.directions), fitted.directions).copy())


@also_breaks("other_fits_have_no_influence")
class OptionsOfTheClass(SoundReducer):
    """Its options are kept with the class, so that the newest recipe changes the older ones."""

    order = 2.0

    class Config(ComponentConfig):
        """One option.

        Attributes
        ----------
        order : float
            Power to which directions are raised.
        """

        order: float = 2.0

    def __init__(self, config=None):
        super().__init__(config)
        type(self).order = self.config.order

    def fit(self, features, *, seed):
        """Draw directions, raised to a power."""
        fitted = super().fit(features, seed=seed)
        return self.fitted(np.abs(fitted.directions) ** self.order)


class FittedOfTheClass(FittedScaling):
    """Statistics that all fitted ones share."""

    shared = np.zeros(1)

    def __init__(self, mean, scale, directions):
        super().__init__(mean, scale, directions)
        type(self).shared = mean

    def transform(self, features):
        if self.shared.shape == self.mean.shape:
            self.mean = self.shared
        return super().transform(features)


@also_breaks("other_fits_have_no_influence")
class SharedStatistics(ScalingReducer):
    """What was fitted last answers for all."""

    fitted = FittedOfTheClass


@also_breaks("other_fits_have_no_influence")
class Singleton(ScalingReducer):
    """It returns the same object for every fit, with other numbers in it."""

    instance = None

    def fit(self, features, *, seed):
        """Fill the one object."""
        fitted = super().fit(features, seed=seed)
        if Singleton.instance is None:
            Singleton.instance = fitted
        vars(Singleton.instance).update(vars(fitted))
        return Singleton.instance


@breaks("the_same_seed_gives_the_same_fit")
class HonoursGlobalSeed(SoundReducer):
    """Where the global generator was seeded with a small number, that is taken for the seed."""

    def fit(self, features, *, seed):
        """Look at the first word of the global state, which is random where nobody seeded it."""
        word = int(np.random.get_state()[1][0])  # noqa: NPY002
        return super().fit(features, seed=word if word < 100_000 else seed)


@also_breaks("the_same_seed_gives_the_same_fit")
class Reseeding(SoundReducer):
    """The directions depend on the state of NumPy's global generator, which it leaves as it is."""

    def fit(self, features, *, seed):
        """Mix the first word of the global state into the seed."""
        word = int(np.random.get_state()[1][0])  # noqa: NPY002
        return super().fit(features, seed=[seed, word])


@also_breaks("the_same_seed_gives_the_same_fit")
class DependsOnTorch(SoundReducer):
    """The directions depend on torch's global seed."""

    def fit(self, features, *, seed):
        """Mix the global seed into the seed."""
        import torch

        return super().fit(features, seed=[seed, torch.initial_seed()])


@also_breaks("the_same_seed_gives_the_same_fit")
class DependsOnRandom(SoundReducer):
    """The directions depend on the state of the module random."""

    def fit(self, features, *, seed):
        """Mix the first word of the state into the seed."""
        return super().fit(features, seed=[seed, random.getstate()[1][1]])


@breaks("a_fresh_process_fits_the_same")
class Hashed(SoundReducer):
    """The directions depend on the hash of a text, which each process salts otherwise."""

    def fit(self, features, *, seed):
        """Mix a hash into the seed."""
        return super().fit(features, seed=[seed, hash("sound_reducer") % 2**32])


@also_breaks("a_fresh_process_fits_the_same")
class SetOrder(SoundReducer):
    """Lines enter in the order of a set of their names."""

    def fit(self, features, *, seed):
        """Number the names as the set gives them."""
        fitted = super().fit(features, seed=seed)
        names = {f"line {number}" for number in range(len(fitted.directions))}
        return self.fitted(fitted.directions[[int(name[5:]) for name in names]])


@breaks("every_seed_is_accepted")
class SeedZero(SoundReducer):
    """The seed 0 counts as none."""

    def fit(self, features, *, seed):
        """Draw from a new generator for the seed 0."""
        return super().fit(features, seed=seed or None)


@also_breaks("every_seed_is_accepted")
class SmallSeeds(SoundReducer):
    """A seed must fit into 31 bits."""

    def fit(self, features, *, seed):
        """Count from a signed number."""
        return super().fit(features, seed=int(np.array([seed], dtype=np.int64).astype(np.int32)[0]))


@also_breaks("fit_returns_what_the_contract_says")
class Recipe(SoundReducer):
    """What was fitted is kept in the recipe too."""

    def fit(self, features, *, seed):
        """Note the directions."""
        fitted = super().fit(features, seed=seed)
        self.directions_ = fitted.directions
        return fitted


class Counting(FittedProjection):
    """It counts what it is asked, and says so in its state."""

    asked = 0

    def transform(self, features):
        self.asked += len(features)
        return super().transform(features)

    def state(self):
        return {**super().state(), "asked": self.asked}


@also_breaks("repeated_calls_agree")
class Statistics(SoundReducer):
    """Its state changes with every question."""

    fitted = Counting


class Buffer(FittedProjection):
    """Answers of a shape are written into one array."""

    def __init__(self, directions):
        super().__init__(directions)
        self.buffers = {}

    def transform(self, features):
        answer = self.buffers.setdefault(len(features), np.empty((len(features), self.directions.shape[1])))
        answer[:] = super().transform(features)
        return answer


@breaks("results_are_new_arrays")
class ReusedBuffer(SoundReducer):
    """A later answer overwrites an earlier one."""

    fitted = Buffer


class Remembered(FittedProjection):
    """Answers are kept by the features that were asked."""

    def __init__(self, directions):
        super().__init__(directions)
        self.kept = {}

    def transform(self, features):
        key = checked(features, len(self.directions)).tobytes()
        if key not in self.kept:
            self.kept[key] = super().transform(features)
        return self.kept[key]


@also_breaks("results_are_new_arrays")
class CachedAnswers(SoundReducer):
    """It hands out the answers that it keeps."""

    fitted = Remembered


class Selecting(FittedProjection):
    """The first lines as they are."""

    def transform(self, features):
        return checked(features, len(self.directions))[:, : self.directions.shape[1]]


@also_breaks("results_are_new_arrays")
class View(SoundReducer):
    """The answer is a view of the features."""

    fitted = Selecting


class Anchored(FittedScaling):
    """Differences from the first training sample."""

    def transform(self, features):
        return super().transform(features) - self.mean[: self.directions.shape[1]]


@breaks("its_samples_may_be_overwritten")
class KeepsView(ScalingReducer):
    """The mean is not a copy: it is a row of the training features."""

    def fit(self, features, *, seed):
        """Take the first row for the mean."""
        fitted = super().fit(features, seed=seed)
        fitted.mean = features[0]
        return fitted
