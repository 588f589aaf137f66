"""How long work tells the caller how far it is."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Progress", "silent"]


class Progress(Protocol):
    """Called now and then with what is done, out of how much, and a note for the reader."""

    def __call__(self, stage: str, done: int, total: int, note: str = "") -> None:
        """Report `done` of `total` steps of `stage`."""


def silent(stage: str, done: int, total: int, note: str = "") -> None:
    """Report nothing."""
