"""Progress of long computations."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Progress", "silent"]


class Progress(Protocol):
    """Function that is called from time to time with the steps done, their total number, and a note."""

    def __call__(self, stage: str, done: int, total: int, note: str = "") -> None:
        """Report `done` of `total` steps of `stage`."""


def silent(stage: str, done: int, total: int, note: str = "") -> None:
    """Report nothing."""
