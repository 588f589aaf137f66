"""Whether the model can have made a measurement at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["Foreign"]


@dataclass(frozen=True)
class Foreign:
    """What speaks for or against a measurement being of the structure that was described.

    Parameters
    ----------
    flagged : bool
        Whether the model cannot have made it: no identified number is then to be believed.
    statistic : float
        How far it is from all that the model makes: above 1 it is flagged.
    looks_like : str
        What explains it, as a sentence; empty where nothing that was tried does.
    reasons : tuple of str
        Why, as sentences.
    bands : tuple of (float, float)
        Where in frequency [Hz] it is off, the worst first.
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
