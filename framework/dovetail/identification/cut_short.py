"""What an identification left out because its time was over, or because the user stopped it."""

from __future__ import annotations

from dataclasses import dataclass

from dovetail.errors import Note, argument, listing
from dovetail.interfaces import TimeLimit


@dataclass(frozen=True)
class CutShort:
    """What a result lacks, and why.

    Parameters
    ----------
    left_out : tuple of str
        The steps that were left out or cut short: ``"62 of 400 samples"``.
    seconds : float
        When the work was complete, since it began.
    limit : float or None
        The time that it had [s]; None without a limit.
    by_user : bool
        Whether the user stopped it, before the time was over.
    """

    left_out: tuple[str, ...]
    seconds: float
    limit: float | None
    by_user: bool

    @staticmethod
    def of(limit: TimeLimit) -> CutShort | None:
        """Return what a time limit left out; None if it left out nothing."""
        if not limit.left_out:
            return None
        return CutShort(limit.left_out, limit.elapsed, limit.seconds, limit.was_stopped)

    @property
    def note(self) -> Note:
        """A sentence about it."""
        limit = 0.0 if self.limit is None else self.limit
        when = f"when you stopped it, after {self.seconds:.2g} s" if self.by_user else f"by the limit of {limit:.3g} s"
        remedy = "Let it run" if self.by_user else f"Allow more time ({argument('seconds')})"
        return Note(f"Cut short {when}: {listing(self.left_out)}. {remedy} for a complete answer.")
