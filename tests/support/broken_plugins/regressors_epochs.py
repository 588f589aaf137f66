"""Regressors whose own `fit_epochs` reports falsely or cannot be stopped."""

from __future__ import annotations

import contextlib
import os

import numpy as np

from dovetail import silent
from support.broken_plugins.lists import also_breaks, breaks
from support.broken_plugins.regressors import FittedLine, SoundRegressor

_EPOCHS = 5


class Epochs(SoundRegressor):
    """Least squares over five epochs; a sound one."""

    epochs = tuple(range(_EPOCHS))

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Fit to the rows of all epochs."""
        collected = []
        for done, number in enumerate(self.epochs, start=1):
            collected.append(epoch(number))
            progress("epochs", done, len(self.epochs), "loss 0.1")
        return self.fit(*(np.concatenate(rows) for rows in zip(*collected, strict=True)), seed=seed)


@also_breaks("epochs_are_counted_from_zero")
class FirstEpochOnly(Epochs):
    """It asks for the first epoch only."""

    epochs = (0,)


@also_breaks("epochs_are_counted_from_zero")
class FromOne(Epochs):
    """It counts epochs from 1."""

    epochs = (1, 2, 3, 4)


@breaks("epochs_are_counted_from_zero")
class Skipping(Epochs):
    """It leaves every other epoch out."""

    epochs = (0, 2, 4)


@breaks("every_epoch_counts")
class Ignoring(Epochs):
    """It asks for many epochs, and learns from the first."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Throw what follows away."""
        first, *_ = [epoch(number) for number in range(_EPOCHS)]
        return self.fit(*first, seed=seed, progress=progress)


@also_breaks("fitting_by_epochs_learns")
class OneBuffer(Epochs):
    """Targets of all epochs are taken to be those of the first."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Ask for the targets once."""
        _, targets = epoch(0)
        features = [epoch(number)[0] for number in range(_EPOCHS)]
        return self.fit(np.concatenate(features), np.tile(targets, (_EPOCHS, 1)), seed=seed, progress=progress)


@breaks("the_same_epochs_give_the_same_fit")
class SeedlessEpochs(Epochs):
    """It starts from random weights of its own."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Add what no seed fixes."""
        fitted = super().fit_epochs(epoch, seed=seed, progress=progress)
        return FittedLine(
            fitted.weights + 1e-3 * np.random.default_rng().standard_normal(fitted.weights.shape), fitted.mean
        )


@breaks("fitting_by_epochs_learns")
class LearnsNothing(Epochs):
    """From epochs it learns the mean."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Forget the weights."""
        fitted = super().fit_epochs(epoch, seed=seed, progress=progress)
        return FittedLine(0.0 * fitted.weights, fitted.mean)


@also_breaks("fitting_by_epochs_learns")
class FirstTargetFromEpochs(Epochs):
    """From epochs it learns the first target."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Forget the other weights."""
        fitted = super().fit_epochs(epoch, seed=seed, progress=progress)
        return FittedLine(fitted.weights * (np.arange(fitted.weights.shape[1]) == 0), fitted.mean)


@breaks("training_can_be_stopped")
class Stubborn(Epochs):
    """Ctrl-C ends the training, and passes for its end."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Return what is there."""
        try:
            return super().fit_epochs(epoch, seed=seed, progress=progress)
        except KeyboardInterrupt:
            return self.fit(*epoch(0), seed=seed)


@also_breaks("training_can_be_stopped")
class StubbornFit(SoundRegressor):
    """Ctrl-C while it fits passes for its end."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Go on whatever the listener says."""

        def deaf(*args):
            with contextlib.suppress(BaseException):
                progress(*args)

        return super().fit(features, targets, seed=seed, progress=deaf)


@also_breaks("training_can_be_stopped")
class Untidy(Epochs):
    """Stopped before its end, it leaves NumPy's errors switched off."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Switch them on again at the end."""
        before = np.seterr(all="ignore")
        fitted = super().fit(features, targets, seed=seed, progress=progress)
        np.seterr(**before)
        return fitted


@also_breaks("progress_is_reported_in_order")
class UndefinedLoss(SoundRegressor):
    """It reports a loss that is not a number."""

    def fit(self, features, targets, *, seed, progress=silent):
        """Report the loss of no samples."""
        progress("regressor", 1, 2, f"loss {float('nan')}")
        return super().fit(features, targets, seed=seed)


@also_breaks("progress_is_reported_in_order")
class BackwardsEpochs(Epochs):
    """Epochs are counted down."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Report the residual."""

        def turned(stage, done, total, note=""):
            progress(stage, total - done, total, note)

        return super().fit_epochs(epoch, seed=seed, progress=turned)


@breaks("epochs_are_left_unchanged")
class CentringEpochs(Epochs):
    """It centres the features of each epoch in place."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Write into what the epoch gave."""

        def centred(number):
            features, targets = epoch(number)
            fitted_to = features.copy(), targets.copy()
            features -= features.mean(axis=0)
            return fitted_to

        return super().fit_epochs(centred, seed=seed, progress=progress)


@also_breaks("epochs_are_counted_from_zero")
class NumberedOtherwise(Epochs):
    """It asks for epochs by floating-point numbers."""

    epochs = (0.0, 1.0, 2.0)


@also_breaks("the_same_epochs_give_the_same_fit")
class EpochEnvironment(Epochs):
    """Fitting by epochs writes into the environment."""

    def fit_epochs(self, epoch, *, seed, progress=silent):
        """Limit the threads of processes that follow."""
        os.environ["SOUND_REGRESSOR_THREADS"] = "1"
        return super().fit_epochs(epoch, seed=seed, progress=progress)
