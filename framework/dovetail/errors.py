"""One error family: where, what was found, what is accepted, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

__all__ = [
    "BundleError",
    "DatasetError",
    "DescriptionError",
    "DovetailError",
    "Fault",
    "MeasurementError",
    "ParameterError",
    "PluginError",
    "UnitError",
    "did_you_mean",
    "listing",
]

_LEAST_ALIKE = 0.4
"""Ratio of letters in common from which a spelling is suggested."""
_LONGEST_WORD = 100


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with what the user gave.

    Parameters
    ----------
    where : str
        The place, most often ``file:line:column  path.in.the.file``.
    problem : str
        One sentence: what stands there and why it cannot be used.
    accepted : str, optional
        What may stand there instead.
    remedy : str, optional
        What to do, as a sentence of its own.
    """

    where: str
    problem: str
    accepted: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        lines = [self.where] if self.where else []
        lines.append(f"  {self.problem}")
        advice = [self.remedy] if self.remedy else []
        if self.accepted:
            advice.append(f"Accepted: {self.accepted}")
        if advice:
            lines.append("  " + "  ".join(advice))
        return "\n".join(lines)


class DovetailError(Exception):
    """Base of every error that Dovetail explains; the command line prints it without a traceback.

    Parameters
    ----------
    *faults : Fault or str
        Everything that is wrong, in the order in which it stands. A string is a fault without a place.
    """

    def __init__(self, *faults: Fault | str) -> None:
        self.faults = tuple(Fault("", fault) if isinstance(fault, str) else fault for fault in faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))


class DescriptionError(DovetailError):
    """An assembly description that cannot be used."""


class PluginError(DovetailError):
    """A component that is missing, broken, or offered twice."""


class ParameterError(DovetailError):
    """Parameter values that the assembly cannot take."""


class MeasurementError(DovetailError):
    """A measured file that cannot be read, or that does not fit the assembly."""


class DatasetError(DovetailError):
    """A dataset that cannot be read, or that does not belong to the assembly."""


class BundleError(DovetailError):
    """A model bundle that is damaged, of another format, or lacks its components."""


class UnitError(DovetailError, ValueError):
    """A quantity that has no unit of the wanted dimension."""


def did_you_mean(word: str, accepted: Iterable[str]) -> str:
    """Return ``"Did you mean 'x'?"`` for the accepted spelling nearest to `word`, or an empty string."""
    given = word[:_LONGEST_WORD].lower()
    nearest, highest = "", (_LEAST_ALIKE, 0)
    for candidate in accepted:
        ratio = difflib.SequenceMatcher(None, given, candidate.lower()).ratio()
        score = ratio, len(set(given) & set(candidate.lower()))
        if score > highest:
            nearest, highest = candidate, score
    return f"Did you mean '{nearest}'?" if nearest else ""


def listing(names: Iterable[str], limit: int = 12) -> str:
    """Join `names` with commas, the tail beyond `limit` as a count."""
    items = list(names)
    shown = ", ".join(items[:limit])
    return f"{shown}, and {len(items) - limit} more" if len(items) > limit else shown
