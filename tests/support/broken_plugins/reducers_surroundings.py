"""Reducers with side effects: on global settings, random numbers, the standard output or the working folder."""

from __future__ import annotations

import os
import random
import sys
import warnings
from pathlib import Path

import numpy as np

from support.broken_plugins.lists import also_breaks, breaks
from support.broken_plugins.reducers import FittedProjection, SoundReducer


@also_breaks("global_random_numbers_are_left_unchanged")
class RandomModule(SoundReducer):
    """It seeds Python's global generator."""

    def fit(self, features, *, seed):
        """Seed the module random."""
        random.seed(seed)
        return super().fit(features, seed=seed)


@also_breaks("global_random_numbers_are_left_unchanged")
class TorchSeed(SoundReducer):
    """It seeds torch's global generator."""

    def fit(self, features, *, seed):
        """Seed torch."""
        import torch

        torch.manual_seed(seed)
        return super().fit(features, seed=seed)


class Jitter(FittedProjection):
    """A random number is drawn and not used."""

    def transform(self, features):
        np.random.random()  # noqa: NPY002
        return super().transform(features)


@also_breaks("global_random_numbers_are_left_unchanged")
class DrawsWhenAsked(SoundReducer):
    """Answers draw from NumPy's global generator."""

    fitted = Jitter


@breaks("global_settings_are_left_unchanged")
class Silencing(SoundReducer):
    """NumPy's warnings are off from then on."""

    def fit(self, features, *, seed):
        """Ignore what overflows."""
        np.seterr(all="ignore")
        return super().fit(features, seed=seed)


class Quiet(FittedProjection):
    """Overflows are ignored from the first answer on."""

    def transform(self, features):
        np.seterr(over="ignore")
        return super().transform(features)


@also_breaks("global_settings_are_left_unchanged")
class SilencingAnswers(SoundReducer):
    """Asking changes NumPy's error handling."""

    fitted = Quiet


@also_breaks("global_settings_are_left_unchanged")
class Printing(SoundReducer):
    """Arrays are printed with three digits from then on."""

    def fit(self, features, *, seed):
        """Set the precision."""
        np.set_printoptions(precision=3, suppress=True)
        return super().fit(features, seed=seed)


@also_breaks("global_settings_are_left_unchanged")
class ThreeThreads(SoundReducer):
    """Torch has three threads from then on."""

    def fit(self, features, *, seed):
        """Set the number of threads."""
        import torch

        torch.set_num_threads(3)
        return super().fit(features, seed=seed)


@also_breaks("global_settings_are_left_unchanged")
class DoublePrecision(SoundReducer):
    """Torch computes in double precision from then on."""

    def fit(self, features, *, seed):
        """Set the default dtype."""
        import torch

        torch.set_default_dtype(torch.float64)
        return super().fit(features, seed=seed)


@also_breaks("global_settings_are_left_unchanged")
class Environment(SoundReducer):
    """It limits the threads of all processes that follow."""

    def fit(self, features, *, seed):
        """Write into the environment."""
        os.environ["SOUND_REDUCER_THREADS"] = "1"
        return super().fit(features, seed=seed)


@also_breaks("global_settings_are_left_unchanged")
class NoWarnings(SoundReducer):
    """Python's warnings are off from then on."""

    def fit(self, features, *, seed):
        """Filter them all."""
        warnings.simplefilter("ignore")
        return super().fit(features, seed=seed)


@breaks("nothing_is_printed")
class Talking(SoundReducer):
    """It prints what it does, into the midst of a table or of JSON."""

    def fit(self, features, *, seed):
        """Say how many samples there are."""
        print(f"fitting to {len(features)} samples")
        return super().fit(features, seed=seed)


class Chatting(FittedProjection):
    """It writes to the standard output."""

    def transform(self, features):
        sys.stdout.write("transforming\n")
        return super().transform(features)


@also_breaks("nothing_is_printed")
class TalkingAnswers(SoundReducer):
    """Asking writes to the screen."""

    fitted = Chatting


@breaks("no_files_are_left")
class Littering(SoundReducer):
    """It leaves a log in the working folder."""

    def fit(self, features, *, seed):
        """Write how many samples there are."""
        Path("sound_reducer.log").write_text(f"{len(features)}\n", encoding="utf-8")
        return super().fit(features, seed=seed)


@also_breaks("global_settings_are_left_unchanged")
class Wandering(SoundReducer):
    """It changes the working folder."""

    def fit(self, features, *, seed):
        """Go to the root."""
        os.chdir("/")
        return super().fit(features, seed=seed)
