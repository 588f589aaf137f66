"""The verdict of the check for model misspecification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["Misspecification"]


@dataclass(frozen=True)
class Misspecification:
    """Whether the model can have produced a measurement, and what explains it if not.

    Parameters
    ----------
    flagged : bool
        Whether the model cannot have produced it. The identified parameters are then not to be relied on.
    statistic : float
        Significance of the largest deviation from the model, over its limit: above 1 the measurement is flagged.
    looks_like : str
        What explains the measurement, as a sentence; empty if nothing that was tried does.
    reasons : tuple of str
        Why it is flagged, as sentences.
    bands : tuple of (float, float)
        Frequency bands [Hz] in which it deviates, the worst first.
    """

    flagged: bool
    statistic: float
    looks_like: str = ""
    reasons: tuple[str, ...] = ()
    bands: tuple[tuple[float, float], ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, fit for JSON."""
        return {
            "flagged": self.flagged,
            "statistic": self.statistic,
            "looks_like": self.looks_like,
            "reasons": list(self.reasons),
            "bands_Hz": [list(band) for band in self.bands],
        }
