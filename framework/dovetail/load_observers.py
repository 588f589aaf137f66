"""Functions that see every assembly that is loaded from a description, wherever that happens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_observers: list[Callable[[Any], None]] = []


@contextmanager
def observing_loads(observer: Callable[[Any], None]) -> Iterator[None]:
    """Call a function with each assembly that this process loads in the meantime.

    Parameters
    ----------
    observer : callable
        Takes an `Assembly`.
    """
    _observers.append(observer)
    try:
        yield
    finally:
        _observers.remove(observer)


@contextmanager
def unobserved() -> Iterator[None]:
    """Show no assembly to the observers in the meantime."""
    kept = _observers[:]
    _observers.clear()
    try:
        yield
    finally:
        _observers[:] = kept


def observe(assembly: Any) -> None:
    """Show an assembly that was just loaded to all observers."""
    for observer in _observers:
        observer(assembly)
