"""Cases of which one that fails does not end the others."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager

from dovetail import DovetailError, ParameterError
from dovetail.evaluation import as_dovetail_error


class Failures:
    """Why cases have failed.

    Attributes
    ----------
    reasons : dict of str to str
        By the case's name.
    """

    def __init__(self) -> None:
        self.reasons: dict[str, str] = {}
        self._first: DovetailError | None = None

    @contextmanager
    def of(self, name: str) -> Iterator[None]:
        """Keep what is raised in the block as the failure of a case, but for a fault of the settings of all cases."""
        try:
            yield
        except ParameterError:
            raise
        except Exception as error:  # of a plugin, or a bug: the other cases go on
            self.add(name, as_dovetail_error(error, f"case {name}"))

    def add(self, name: str, error: DovetailError) -> None:
        """Keep why a case failed; it is named even where the error does not name it."""
        text = str(error)
        self.reasons[name] = text if name in text else f"case {name}: {text.strip()}"
        self._first = self._first or error

    def raise_unless(self, done: Collection[object]) -> None:
        """Raise why the first case failed if none is done."""
        if not done and self._first is not None:
            raise self._first
