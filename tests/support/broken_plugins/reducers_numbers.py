"""Reducers that fail for some shapes, scales, kinds or layouts of features, and stored states that are incomplete."""

from __future__ import annotations

import numpy as np

from dovetail import DovetailError, FittedReducer
from support.broken_plugins.lists import also_breaks, breaks, checked
from support.broken_plugins.reducers import FittedProjection, FittedScaling, ScalingReducer, SoundReducer


@breaks("one_feature_is_enough_or_refused")
class Covariance(SoundReducer):
    """The covariance of a single line is a number, not a matrix."""

    def fit(self, features, *, seed):
        """Take the leading directions of the covariance."""
        rows = np.ascontiguousarray(checked(features), dtype=float)[:, :200]
        _, directions = np.linalg.eigh(np.cov(rows, rowvar=False))
        return self.fitted(np.pad(directions[:, -4:], [(0, features.shape[1] - len(directions)), (0, 0)]))


@breaks("thirty_samples_are_enough_or_refused")
class ManyCentres(SoundReducer):
    """Directions are the differences of fifty training samples from the first, of which there may be fewer."""

    def fit(self, features, *, seed):
        """Take samples 0 to 49."""
        rows = np.ascontiguousarray(checked(features), dtype=float)
        fitted = super().fit(features, seed=seed)
        weights = np.stack([rows[number] - rows[0] for number in range(50)])
        return self.fitted(fitted.directions + 1e-3 * weights.mean(axis=0)[:, None])


class Lines(FittedReducer):
    """Some of the lines, by their numbers."""

    number = np.int64

    def __init__(self, lines, width):
        self.lines, self.width = lines, width

    def transform(self, features):
        return checked(features, self.width)[:, self.lines].astype(float)

    def state(self):
        return {"lines": self.lines.astype(self.number), "width": self.width}


class Selection(SoundReducer):
    """The lines that vary most; a sound one."""

    fitted = Lines

    def fit(self, features, *, seed):
        """Take four lines."""
        rows = np.ascontiguousarray(checked(features), dtype=float)
        return self.fitted(np.sort(np.argsort(rows.std(axis=0))[-4:]), rows.shape[1])

    def restore(self, state):
        """Take the numbers back."""
        return self.fitted(np.array(state["lines"]).astype(int), int(state["width"]))


class ByteLines(Lines):
    """Numbers of lines up to 255."""

    number = np.uint8


@breaks("five_thousand_features_are_accepted_or_refused")
class ShortNumbers(Selection):
    """Beyond 255 the numbers of lines begin anew in its state."""

    fitted = ByteLines


class Blocks(FittedProjection):
    """In blocks of 256, without what remains."""

    def transform(self, features):
        reduced = super().transform(features)
        if len(features) > 256:
            reduced[len(features) // 256 * 256 :] = 0.0
        return reduced


@also_breaks("single_rows_agree_with_batches")
class LostRemainder(SoundReducer):
    """The last rows of a large batch come back empty."""

    fitted = Blocks


class Coarse(FittedProjection):
    """Large batches in half precision, to save memory."""

    def transform(self, features):
        reduced = super().transform(features)
        return reduced.astype(np.float16).astype(float) if len(features) > 200 else reduced


@also_breaks("single_rows_agree_with_batches")
class CoarseBatches(SoundReducer):
    """Large batches have other answers."""

    fitted = Coarse


class Half(FittedProjection):
    """Answers of half precision."""

    def transform(self, features):
        return super().transform(features).astype(np.float16)


@also_breaks("results_have_a_row_for_each_sample")
class HalfPrecision(SoundReducer):
    """Three digits are left."""

    fitted = Half


class Bytes(FittedProjection):
    """The memory is read as single precision."""

    def transform(self, features):
        rows = np.frombuffer(checked(features).tobytes(), dtype=np.float32).reshape(len(features), -1)
        return super().transform(rows[:, : features.shape[1]])


@breaks("layout_and_precision_do_not_matter")
class SingleOnly(SoundReducer):
    """Features in double precision are read as something else."""

    fitted = Bytes


class InMemoryOrder(FittedProjection):
    """The numbers are taken as they lie in memory."""

    def transform(self, features):
        return super().transform(features.ravel(order="K").reshape(features.shape))


@also_breaks("layout_and_precision_do_not_matter")
class ColumnMajor(SoundReducer):
    """Features in Fortran's order are mixed up."""

    fitted = InMemoryOrder


@also_breaks("layout_and_precision_do_not_matter")
class FortranFit(ScalingReducer):
    """Fitting takes numbers as they lie in memory."""

    def fit(self, features, *, seed):
        """Mix up what is not in C's order."""
        return super().fit(features.ravel(order="K").reshape(features.shape), seed=seed)


class ThereAndBack(FittedProjection):
    """It turns the sign of the caller's features, and back."""

    def transform(self, features):
        features *= -1.0
        reduced = -super().transform(features)
        features *= -1.0
        return reduced


@breaks("read_only_arrays_are_accepted")
class Borrowing(SoundReducer):
    """It computes in the caller's array, and puts it back."""

    fitted = ThereAndBack


@also_breaks("read_only_arrays_are_accepted")
class ThereAndBackFit(ScalingReducer):
    """Fitting sorts nothing, but writes into what may be read-only."""

    def fit(self, features, *, seed):
        """Turn the sign, and back."""
        features *= -1.0
        features *= -1.0
        return super().fit(features, seed=seed)


@breaks("constant_features_are_handled")
class Unguarded(ScalingReducer):
    """A line that does not vary is divided by zero."""

    def deviation(self, rows):
        """Return the bare deviation."""
        return rows.std(axis=0)


class RowScaling(FittedProjection):
    """Each FRF is divided by its own deviation."""

    def transform(self, features):
        rows = checked(features, len(self.directions)).astype(float)
        return ((rows - rows.mean(axis=1, keepdims=True)) / rows.std(axis=1, keepdims=True)) @ self.directions


@also_breaks("constant_features_are_handled")
class FlatRows(SoundReducer):
    """A flat FRF is divided by zero; so is every FRF of one line."""

    fitted = RowScaling

    def fit(self, features, *, seed):
        """Refuse a single line."""
        if checked(features).shape[1] < 2:
            raise DovetailError("one line has no shape.")
        return super().fit(features, seed=seed)


@breaks("features_of_any_size_are_handled")
class HalfStatistics(ScalingReducer):
    """Statistics in half precision: FRFs of stiff parts become zero over zero."""

    def deviation(self, rows):
        """Return the deviation rounded to half precision."""
        return super().deviation(rows).astype(np.float16).astype(float)


@breaks("small_features_stay_different")
class Absolute(SoundReducer):
    """Features are rounded to a millionth, whatever their size."""

    class Fitted(FittedProjection):
        """With a fixed number of digits."""

        def transform(self, features):
            return super().transform(np.round(features.astype(float), 6))

    fitted = Fitted


class Softmax(FittedProjection):
    """Shares of the directions."""

    def transform(self, features):
        weights = np.exp(super().transform(features))
        return weights / weights.sum(axis=1, keepdims=True)


@also_breaks("features_of_any_size_are_handled")
class Overflowing(SoundReducer):
    """Exponentials of large features overflow."""

    fitted = Softmax

    def fit(self, features, *, seed):
        """Draw small directions."""
        return self.fitted(0.01 * super().fit(features, seed=seed).directions)


class Memory(FittedReducer):
    """A projection, with the training samples next to it."""

    def __init__(self, rows, directions):
        self.rows, self.directions = rows, directions

    def transform(self, features):
        return checked(features, self.rows.shape[1]).astype(float) @ self.directions

    def state(self):
        return {"rows": self.rows.copy(), "directions": self.directions.copy()}


@breaks("state_does_not_grow_with_the_samples")
class Memorising(SoundReducer):
    """Its state holds the training set."""

    fitted = Memory

    def fit(self, features, *, seed):
        """Keep all samples."""
        directions = np.random.default_rng(seed).standard_normal((checked(features).shape[1], 1))
        return self.fitted(np.array(features), directions)

    def restore(self, state):
        """Take samples and directions back."""
        return self.fitted(np.array(state["rows"]), np.array(state["directions"]))


class Infinite(FittedProjection):
    """A limit that is none."""

    def state(self):
        return {**super().state(), "limit": float("inf")}


@breaks("state_survives_files")
class InfiniteNumber(SoundReducer):
    """Its state holds a number that JSON does not know."""

    fitted = Infinite


class Inches(FittedProjection):
    """Stored in another unit, with a rounded factor."""

    def state(self):
        return {"directions": self.directions * (25.4 / 25.40001)}


@breaks("storing_twice_changes_nothing")
class Drifting(SoundReducer):
    """Each time that it is stored it changes a little."""

    fitted = Inches


class Weak(FittedProjection):
    """The last direction is a millionth of the others."""

    def state(self):
        kept = self.directions.copy()
        kept[:, -1] = kept[:, -1].round(7)
        return {"directions": kept}


@also_breaks("restoring_gives_the_same_results")
class LosesSmall(SoundReducer):
    """What is small is rounded in its state, though features are standardised afterwards."""

    fitted = Weak

    def fit(self, features, *, seed):
        """Weaken one direction."""
        fitted = super().fit(features, seed=seed)
        fitted.directions[:, -1] *= 1e-6
        return fitted


class Known(FittedProjection):
    """Training samples by their bytes; others are zero."""

    def __init__(self, directions):
        super().__init__(directions)
        self.known = None

    def transform(self, features):
        reduced = super().transform(features)
        return np.where(np.isclose(reduced[:, :1], self.known).any(axis=1)[:, None], reduced, 0.0)

    def state(self):
        return {**super().state(), "known": self.known.copy()}


@breaks("different_samples_stay_different")
class Lookup(SoundReducer):
    """FRFs that were not among the training samples have no features."""

    fitted = Known

    def fit(self, features, *, seed):
        """Note the first coordinate of the samples."""
        fitted = super().fit(features, seed=seed)
        fitted.known = (np.ascontiguousarray(features, dtype=float) @ fitted.directions)[:160, 0]
        return fitted

    def restore(self, state):
        """Take directions and coordinates back."""
        fitted = super().restore(state)
        fitted.known = np.array(state["known"])
        return fitted


@also_breaks("values_that_are_not_finite_are_refused")
class InfinityForgiven(SoundReducer):
    """Infinite features are answered to."""

    class Fitted(FittedProjection):
        """A great number in place of infinity."""

        def transform(self, features):
            return super().transform(np.where(np.isinf(features), 9.0, features))

    fitted = Fitted


class Stored(FittedScaling):
    """The layout that was fitted, if a batch has its length."""

    def __init__(self, mean, scale, directions):
        super().__init__(mean, scale, directions)
        self.layout = None

    def transform(self, features):
        reduced = super().transform(features)
        return reduced if self.layout is None or len(self.layout) != len(reduced) else self.layout.copy()


@also_breaks("the_order_of_rows_does_not_matter")
class TrainingLayout(ScalingReducer):
    """A batch as long as the training set is taken for it."""

    fitted = Stored

    def fit(self, features, *, seed):
        """Keep the answers to the training set."""
        fitted = super().fit(features, seed=seed)
        fitted.layout = fitted.transform(features)
        return fitted
