"""Regressors that fail for some targets, features or samples, or that keep references to their arguments."""

from __future__ import annotations

import numpy as np

from dovetail import FittedRegressor, silent
from support.broken_plugins.lists import also_breaks, breaks, checked
from support.broken_plugins.regressors import FittedLine, SoundRegressor


@breaks("every_target_is_learned")
class PairSwapped(SoundRegressor):
    """Two targets come back in each other's place, unless fitted by epochs."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Turn a pair."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        return FittedLine(fitted.weights[:, ::-1], fitted.mean[::-1]) if targets.shape[1] == 2 else fitted

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Fit to three epochs as one should."""
        features, targets = (np.concatenate(rows) for rows in zip(*map(epoch, range(3)), strict=True))
        return super().fit(features, targets, seed=seed, progress=progress)


@also_breaks("every_target_is_learned")
class OnlyFirst(SoundRegressor):
    """It learns the first target; the others are their means."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Forget all weights but the first column."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        fitted.weights[:, 1:] = 0.0
        return fitted


@also_breaks("every_target_is_learned")
class OneConstant(SoundRegressor):
    """The last target is always one half."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Overwrite the last column."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        fitted.weights[:, -1], fitted.mean[-1] = 0.0, 0.5
        return fitted


@breaks("seven_targets_are_learned")
class TwoAtMost(SoundRegressor):
    """It learns two targets, however many there are."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Forget all weights beyond the second column."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        fitted.weights[:, 2:] = 0.0
        return fitted


@also_breaks("seven_targets_are_learned")
class OnePerFeature(SoundRegressor):
    """No more targets than features."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Cut the weights to a square."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        square = fitted.weights[:, : max(len(fitted.weights), 2)]
        return FittedLine(square, fitted.mean[: square.shape[1]])


class Squeezing(FittedLine):
    """A single target loses its axis."""

    def predict(self, features):
        predicted = super().predict(features)
        return predicted[:, 0] if predicted.shape[1] == 1 else predicted


@breaks("one_target_is_learned")
class FlatTarget(SoundRegressor):
    """One target is returned as a vector."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Fit."""
        return Squeezing(*vars(super().fit(features, targets, seed=seed, progress=progress)).values())

    def restore(self, state):
        """Take the weights back."""
        return Squeezing(*vars(super().restore(state)).values())


@also_breaks("every_target_is_learned")
class Swapped(SoundRegressor):
    """The targets come back in the opposite order."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Turn the columns."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        return FittedLine(fitted.weights[:, ::-1].copy(), fitted.mean[::-1].copy())


class FittedTable(FittedRegressor):
    """Targets of known rows, and the mean."""

    def __init__(self, rows, targets):
        self.rows, self.targets = rows, targets

    def predict(self, features):
        distance = np.abs(checked(features, self.rows.shape[1])[:, None, :] - self.rows).max(axis=2)
        known = distance.min(axis=1) < 1e-6
        return np.where(known[:, None], self.targets[distance.argmin(axis=1)], self.targets.mean(axis=0))

    def state(self):
        return {"rows": self.rows.copy(), "targets": self.targets.copy()}


@also_breaks("every_target_is_learned")
class Table(SoundRegressor):
    """It knows its training samples by heart, and nothing else."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Keep at most 160 samples."""
        return FittedTable(np.array(checked(features))[:160].astype(float), np.array(targets)[:160])

    def restore(self, state):
        """Take the table back."""
        return FittedTable(np.array(state["rows"]), np.array(state["targets"]))


class Nearest(FittedTable):
    """The target of the nearest training sample."""

    def predict(self, features):
        rows = checked(features, self.rows.shape[1]).astype(float)
        return self.targets[np.square(rows[:, None, :] - self.rows).sum(axis=2).argmin(axis=1)]


@also_breaks("state_does_not_grow_with_the_samples")
class NearestNeighbour(SoundRegressor):
    """Its state holds the training set."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Keep all samples."""
        return Nearest(np.array(checked(features), dtype=float), np.array(targets))

    def restore(self, state):
        """Take the samples back."""
        return Nearest(np.array(state["rows"]), np.array(state["targets"]))


@also_breaks("its_samples_may_be_overwritten")
class BorrowedTargets(SoundRegressor):
    """The samples that it keeps, 100 at most, are the caller's."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Keep views."""
        return Nearest(checked(features)[:100], targets[:100])

    def restore(self, state):
        """Take the samples back."""
        return Nearest(np.array(state["rows"]), np.array(state["targets"]))


@breaks("targets_that_do_not_fit_are_refused")
class UncheckedTargets(SoundRegressor):
    """A target that is not a number counts as zero."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Replace what is not finite."""
        return super().fit(features, np.nan_to_num(targets), seed=seed, progress=progress)


@also_breaks("targets_that_do_not_fit_are_refused")
class Zipped(SoundRegressor):
    """Where there are fewer targets than features, the rest is left out in silence."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Cut both to the same length."""
        rows = min(len(features), len(targets))
        return super().fit(features[:rows], targets[:rows], seed=seed, progress=progress)


@also_breaks("constant_features_are_handled")
class Singular(SoundRegressor):
    """The normal equations have no solution where a feature is constant."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Invert them."""
        rows, mean = checked(features).astype(float), targets.mean(axis=0)
        return FittedLine(np.linalg.inv(rows.T @ rows) @ rows.T @ (targets - mean), mean)


@also_breaks("one_feature_is_enough_or_refused")
class OneFeature(SoundRegressor):
    """A single feature loses its axis."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Squeeze."""
        rows = checked(features).squeeze().astype(float)
        mean = targets.mean(axis=0)
        return FittedLine(np.linalg.pinv(rows.T @ rows) @ rows.T @ (targets - mean), mean)


class Experts(FittedLine):
    """Each feature decides how much the line counts."""

    def predict(self, features):
        line = super().predict(features)
        vote = np.exp(features.astype(float))
        return line * (vote / vote.sum(axis=1, keepdims=True)).sum(axis=1, keepdims=True)


@also_breaks("features_of_any_size_are_handled")
class NaiveExperts(SoundRegressor):
    """Exponentials of large features overflow."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Fit."""
        return Experts(*vars(super().fit(features, targets, seed=seed, progress=progress)).values())

    def restore(self, state):
        """Take the weights back."""
        return Experts(*vars(super().restore(state)).values())


_START: dict[tuple[int, ...], np.ndarray] = {}


@also_breaks("a_fresh_process_fits_the_same")
class CachedStart(SoundRegressor):
    """Its start is drawn once for a shape, by whoever was first."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Add a small start that depends on the seed."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        shape = fitted.weights.shape
        start = _START.setdefault(shape, 0.01 * np.random.default_rng(seed).standard_normal(shape))
        return FittedLine(fitted.weights + start, fitted.mean)


@also_breaks("global_settings_are_left_unchanged")
class NoGradients(SoundRegressor):
    """Torch computes no gradients from then on."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Switch them off."""
        import torch

        torch.set_grad_enabled(False)
        return super().fit(features, targets, seed=seed, progress=progress)


class Smoothed(FittedLine):
    """Each row is mixed with the one before it in large batches."""

    def predict(self, features):
        predicted = super().predict(features)
        if len(predicted) > 300:
            predicted[1:] = 0.9 * predicted[1:] + 0.1 * predicted[:-1]
        return predicted


@also_breaks("single_rows_agree_with_batches")
class Smoothing(SoundRegressor):
    """Neighbours in a large batch are taken for neighbours in time."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Fit."""
        return Smoothed(*vars(super().fit(features, targets, seed=seed, progress=progress)).values())

    def restore(self, state):
        """Take the weights back."""
        return Smoothed(*vars(super().restore(state)).values())
