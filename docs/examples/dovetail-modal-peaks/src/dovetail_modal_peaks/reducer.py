"""The reducer 'modal_peaks': an FRF as an engineer reads it, by the frequencies and amplitudes of its resonances."""

from typing import Annotated

import numpy as np
from pydantic import Field

from dovetail import ComponentConfig, DovetailError, FittedReducer, Reducer

FEWEST_LINES = 3


class ModalPeaks(Reducer):
    """Natural frequency [Hz] and feature of the highest peaks of each response, in the order of their frequencies.

    A peak that is missing has the frequency 0 and the feature 0.
    """

    name = "modal_peaks"
    summary = "Frequencies and amplitudes of the highest resonances"

    class Config(ComponentConfig):
        """Which resonances.

        Attributes
        ----------
        peaks : int
            Most resonances of each response.
        """

        peaks: Annotated[int, Field(ge=1, le=100)] = 3

    def fit(self, features, *, seed, context=None):
        """Take the frequency axis and the number of responses from the context; nothing else is learnt."""
        checked(features)
        if features.shape[1] < FEWEST_LINES:
            raise DovetailError(f"reducer 'modal_peaks': {features.shape[1]} lines have no peak.")
        frequency = np.arange(features.shape[1], dtype=float) if context is None else context.frequency
        return FittedModalPeaks(np.array(frequency, dtype=float), features.shape[1], self.config.peaks)

    def restore(self, state):
        """Rebuild what `state` was taken from."""
        return FittedModalPeaks(np.array(state["frequency"]), int(state["width"]), int(state["peaks"]))


class FittedModalPeaks(FittedReducer):
    """Knows the frequency axis."""

    def __init__(self, frequency, width, peaks):
        self.frequency = frequency
        self.width = width
        self.peaks = peaks

    def transform(self, features):
        """Return (n_samples, 2 peaks n_responses): the frequencies, then the features, of each response in turn."""
        rows = np.asarray(checked(features, self.width), dtype=float)
        responses = np.split(rows, self.width // len(self.frequency), axis=1)
        return np.concatenate([self.of_response(response) for response in responses], axis=1).astype(np.float32)

    def of_response(self, rows):
        """Return (n_samples, 2 peaks) of one response; a parabola through three lines gives a peak's top."""
        left, middle, right = rows[:, :-2], rows[:, 1:-1], rows[:, 2:]
        bend = 2.0 * middle - left - right
        is_peak = (middle > left) & (middle >= right) & (bend > 0.0)
        chosen = np.argsort(np.where(is_peak, -middle, np.inf), axis=1, kind="stable")[:, : self.peaks]
        chosen.sort(axis=1)
        at = (np.arange(len(rows))[:, None], chosen)
        shift = 0.5 * (right[at] - left[at]) / np.where(is_peak[at], bend[at], 1.0)
        lines = np.interp(chosen + 1 + shift, np.arange(len(self.frequency)), self.frequency)
        tops = middle[at] + 0.25 * (right[at] - left[at]) * shift
        found = np.concatenate([np.where(is_peak[at], lines, 0.0), np.where(is_peak[at], tops, 0.0)], axis=1)
        short = 2 * self.peaks - found.shape[1]  # fewer lines than peaks are asked for
        return np.pad(found, ((0, 0), (0, short)))

    def state(self):
        """Return what `restore` needs: arrays and plain values."""
        return {"frequency": self.frequency.copy(), "width": self.width, "peaks": self.peaks}


def checked(features, width=None):
    """Return features if they are finite and of the given width."""
    if not np.isfinite(features).all():
        raise DovetailError("reducer 'modal_peaks': a feature is not finite.")
    if width is not None and features.shape[1] != width:
        raise DovetailError(f"reducer 'modal_peaks': {features.shape[1]} features, but it was fitted to {width}.")
    return features
