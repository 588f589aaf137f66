"""The faults of a description, gathered while it is read and raised together."""

from __future__ import annotations

from dovetail.documents.tree import Item, Mark, Path, dotted
from dovetail.errors import DescriptionError, Fault

__all__ = ["MOST_FAULTS", "Findings"]

MOST_FAULTS = 500
"""Where the search for more ends."""


class Findings:
    """Every fault found so far.

    Notes
    -----
    A value that its source could not make sense of is reported once: what later checks say of it is dropped.
    """

    def __init__(self) -> None:
        self.root = Item(Mark(0, 0, 0, ""), {})
        self._found: list[tuple[Mark, Fault]] = []
        self._garbled: set[Path] = set()

    def __len__(self) -> int:
        return len(self._found)

    def add(self, path: Path, found: str, accepted: str = "", remedy: str = "", *, key: bool = False) -> None:
        """Report a fault of the value at `path`, or of its key.

        Parameters
        ----------
        path : Path
            Where it is not there, the nearest section above it gives the position.
        found, accepted, remedy : str
            As in `Fault`.
        key : bool
            Point at the key in place of the value.
        """
        if not any(path[:length] in self._garbled for length in range(len(path) + 1)):
            self.add_at(self._mark(path, key), path, found, accepted, remedy)

    def add_at(self, mark: Mark, path: Path, found: str, accepted: str = "", remedy: str = "") -> None:
        """Report a fault at a known place.

        Raises
        ------
        DescriptionError
            There are so many faults that looking for more is of no use.
        """
        place = f"{mark}  {dotted(path)}" if path else str(mark)
        self._found.append((mark, Fault(place, found, accepted, remedy)))
        if len(self._found) == MOST_FAULTS:
            raise self.error()

    def add_garbled(self, mark: Mark, path: Path, found: str, accepted: str = "", remedy: str = "") -> None:
        """Report a value that is not what it seems, and take no further notice of it."""
        self._garbled.add(path)
        self.add_at(mark, path, found, accepted, remedy)

    def _mark(self, path: Path, key: bool) -> Mark:
        place, item = self.root.mark, self.root
        length = 0
        for length, (place, item) in enumerate(self.root.steps(path), start=1):  # noqa: B007
            pass
        is_scalar = length == len(path) and not item.is_mapping and not isinstance(item.value, (tuple, type(None)))
        return item.mark if is_scalar and not key else place

    def error(self) -> DescriptionError:
        """Return everything found as one error, in the order of the source."""
        faults = [fault for _, fault in sorted(self._found, key=lambda pair: pair[0])]
        if len(faults) >= MOST_FAULTS:
            faults.append(Fault("", f"The search ended at {MOST_FAULTS} faults; there may be more."))
        return DescriptionError(*faults)

    def raise_if_any(self) -> None:
        """Raise what was found.

        Raises
        ------
        DescriptionError
        """
        if self._found:
            raise self.error()
