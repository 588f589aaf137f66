"""The faults of a document, collected while it is read and raised together."""

from __future__ import annotations

from dovetail.documents.tree import Item, Mark, Path, format_path
from dovetail.errors import DescriptionError, Fault

MOST_FAULTS = 500
"""Number of faults at which the search for more ends."""


class FaultList:
    """The faults of a document, and the tree in which they lie.

    Notes
    -----
    A value that cannot be read is reported once; later faults at the same place are dropped.
    """

    def __init__(self) -> None:
        self.root = Item(Mark(0, 0, 0, ""), {})
        self._faults: list[tuple[Mark, Fault]] = []
        self._garbled: set[Path] = set()
        self.files_in: str | None = None
        """Folder that must contain all files named by the document; any folder by default."""
        self.files: dict[Path, str] = {}
        """Files named by the document, by their paths in it."""

    def __len__(self) -> int:
        return len(self._faults)

    def add(self, path: Path, problem: str, accepted: str = "", remedy: str = "", *, key: bool = False) -> None:
        """Report a fault of the value at `path`, or of its key.

        Parameters
        ----------
        path : Path
            If nothing is at `path`, the nearest section above it gives the position.
        problem, accepted, remedy : str
            As in `Fault`.
        key : bool
            Point at the key instead of the value.
        """
        if not any(path[:length] in self._garbled for length in range(len(path) + 1)):
            self.add_at(self._mark(path, key), path, problem, accepted, remedy)

    def add_at(self, mark: Mark, path: Path, problem: str, accepted: str = "", remedy: str = "") -> None:
        """Report a fault at a known position.

        Raises
        ------
        DescriptionError
            `MOST_FAULTS` is reached.
        """
        where = f"{mark}  {format_path(path)}" if path else str(mark)
        self._faults.append((mark, Fault(where, problem, accepted, remedy)))
        if len(self._faults) == MOST_FAULTS:
            raise self.error()

    def extend(self, others: FaultList) -> None:
        """Add the faults of another list."""
        self._garbled |= others._garbled
        for mark, fault in others._faults:
            self._faults.append((mark, fault))

    def add_garbled(self, mark: Mark, path: Path, problem: str, accepted: str = "", remedy: str = "") -> None:
        """Report a value that cannot be read, and drop all later faults at its place."""
        self._garbled.add(path)
        self.add_at(mark, path, problem, accepted, remedy)

    def _mark(self, path: Path, key: bool) -> Mark:
        steps = [(self.root.mark, self.root), *self.root.steps(path)]
        mark, item = steps[-1]
        is_scalar = len(steps) > len(path) and isinstance(item.value, (str, int, float))
        return item.mark if is_scalar and not key else mark

    def error(self) -> DescriptionError:
        """Return all faults as one error, in the order of the document."""
        faults = [fault for _, fault in sorted(self._faults, key=lambda pair: pair[0])]
        if len(faults) >= MOST_FAULTS:
            faults.append(Fault("", f"The search ended at {MOST_FAULTS} faults; there may be more."))
        return DescriptionError(*faults)

    def raise_if_any(self) -> None:
        """Raise all faults as one error.

        Raises
        ------
        DescriptionError
        """
        if self._faults:
            raise self.error()
