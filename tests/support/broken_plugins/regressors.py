"""A sound regressor, and one with a single fault for each check of the kit that regressors alone have."""

from __future__ import annotations

import numpy as np

from dovetail import FittedRegressor, Regressor, TargetDistribution, silent
from support.broken_plugins.lists import also_breaks, breaks, checked


class FittedLine(FittedRegressor):
    """Known weights."""

    def __init__(self, weights, mean):
        self.weights, self.mean = weights, mean

    def predict(self, features):
        return checked(features, len(self.weights)).astype(float) @ self.weights + self.mean

    def state(self):
        return {"weights": self.weights.copy(), "mean": self.mean.copy()}


class SoundRegressor(Regressor):
    """Least squares."""

    name = "sound_regressor"
    summary = "Linear regression"

    def fit(self, features, targets, *, seed, progress=silent):
        """Solve for the weights."""
        mean = checked(targets).mean(axis=0)
        weights = np.linalg.lstsq(checked(features).astype(float), targets - mean, rcond=None)[0]
        progress("regressor", 1, 1, "done")
        return FittedLine(weights, mean)

    def restore(self, state):
        """Take the weights back."""
        return FittedLine(np.array(state["weights"]), np.array(state["mean"]))


@also_breaks(
    "every_target_is_learned", "one_target_is_learned", "seven_targets_are_learned", "fitting_by_epochs_learns"
)
class WrongSign(SoundRegressor):
    """It learns the opposite."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Turn the sign."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        return FittedLine(-fitted.weights, fitted.mean)


@breaks("targets_are_left_unchanged")
class Overwriting(SoundRegressor):
    """It centres the caller's targets in place where it may."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Change the targets when done."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        if targets.flags.writeable:
            targets -= targets.mean(axis=0)
        return fitted


@breaks("progress_is_reported_in_order")
class Backwards(SoundRegressor):
    """It counts down."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Report the residual."""
        progress("regressor", 3, 3)
        return super().fit(features, targets, seed=seed, progress=progress)


@also_breaks("fitting_by_epochs_learns")
class NoEpochs(SoundRegressor):
    """It returns nothing from epochs."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Fit, and forget to return."""
        super().fit_epochs(epoch, seed=seed, progress=progress)


@breaks("a_distribution_belongs_to_its_row")
class OfTheBatch(SoundRegressor):
    """Its intervals are those of the whole batch."""

    class Fitted(FittedLine):
        """Known weights."""

        def predict_distribution(self, features):
            predicted = self.predict(features)
            scatter = np.random.default_rng(0).standard_normal((100, predicted.shape[1])) * predicted.std(axis=0)
            return TargetDistribution(predicted[:, None] + 0.1 * (scatter - scatter.mean(axis=0)))

    def fit(self, features, targets, *, seed, progress=silent):
        """Solve for the weights."""
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        return self.Fitted(fitted.weights, fitted.mean)

    def restore(self, state):
        """Take the weights back."""
        return self.Fitted(np.array(state["weights"]), np.array(state["mean"]))
