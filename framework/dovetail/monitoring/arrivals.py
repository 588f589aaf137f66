"""The files of a watched folder: which are complete and new, in which order, and what their names say.

A file is complete when its size and its time of change have not changed between two looks at the folder that are
`settle` seconds apart. It is new if no file with the same content was seen before, under whatever name.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dovetail.atomic_files import read_bounded
from dovetail.errors import DovetailError, Fault, FileError
from dovetail.monitoring.dates import date_of
from dovetail.monitoring.response_names import ResponseNames

_UNFINISHED = (".part", ".partial", ".tmp", ".temp", ".crdownload", ".lock", ".swp", "~")
"""Ends of the names of files that other programs are writing."""
_OLD = 60.0
"""Age in seconds from which a file counts as complete when it is seen for the first time, if that is asked for."""


@dataclass(frozen=True)
class Version:
    """Size and time of change [ns] of a file."""

    size: int
    changed: int


@dataclass(frozen=True)
class Arrival:
    """A complete file with new content.

    Parameters
    ----------
    name : str
    path : Path
    version : Version
    digest : str
        SHA-256 of its content.
    date : str
        ISO 8601, from the name or else the time of the last change (UTC).
    each_response : tuple of Arrival
        The files of the responses, in order, of a measurement in several files; else empty.
    """

    name: str
    path: Path
    version: Version
    digest: str
    date: str
    each_response: tuple[Arrival, ...] = ()

    @staticmethod
    def combined(name: str, arrivals: Sequence[Arrival]) -> Arrival:
        """Return a measurement in several files, one for each response."""
        version = Version(sum(one.version.size for one in arrivals), max(one.version.changed for one in arrivals))
        unread = next((one.digest for one in arrivals if one.digest.startswith("unread: ")), None)
        digest = unread or hashlib.sha256(" ".join(one.digest for one in arrivals).encode()).hexdigest()
        return Arrival(name, arrivals[0].path.with_name(name), version, digest, arrivals[0].date, tuple(arrivals))

    @property
    def files(self) -> tuple[Arrival, ...]:
        """The single files."""
        return self.each_response or (self,)


@dataclass
class Folder:
    """A watched folder.

    Parameters
    ----------
    path : Path
    settle : float
        Seconds for which a file must not have changed.
    known : dict of str to Version
        Files that need no further look, by name.
    clock : callable
        Seconds, which only increase.
    responses : ResponseNames or None
        How the names of the files of one measurement differ, if each response has its own file.
    """

    path: Path
    settle: float = 2.0
    known: dict[str, Version] = field(default_factory=dict)
    clock: Callable[[], float] = time.monotonic
    responses: ResponseNames | None = None
    _since: dict[str, tuple[Version, float]] = field(default_factory=dict)

    def look(self, *, trust_old: bool = False) -> tuple[list[Arrival], bool]:
        """Return the complete files that are not known, by date and name, and whether others still wait.

        Parameters
        ----------
        trust_old : bool
            Whether a file counts as complete when it was changed long ago, at the first look.

        Raises
        ------
        FileError
            The folder is missing, or cannot be read.
        """
        arrivals, waiting, versions = list[Arrival](), False, self._files()
        for name, members in self._measurements(versions).items():
            files = [file for _, file in members]
            if all(self.known.get(file) == versions[file] for file in files):
                continue
            expected = 1 if self.responses is None or name == files[0] else len(self.responses.words)
            is_whole = [response for response, _ in members] == list(range(expected))
            settled = [self._is_settled(file, versions[file], trust_old=trust_old) for file in files]
            can_be_read = is_whole and all(settled)
            read = [self._arrival(file, versions[file]) for file in files] if can_be_read else []
            complete = [arrival for arrival in read if arrival is not None]
            if len(complete) < len(files):
                waiting = True
            else:
                arrivals.append(complete[0] if name == files[0] else Arrival.combined(name, complete))
        return sorted(arrivals, key=lambda one: (one.date, one.name)), waiting

    def _measurements(self, files: Iterable[str]) -> dict[str, list[tuple[int, str]]]:
        """Return the responses and files of each measurement, in the order of the responses, by its name."""
        found: dict[str, list[tuple[int, str]]] = {}
        for file in files:
            name, response = (self.responses and self.responses.place(file)) or (file, 0)
            found.setdefault(name, []).append((response, file))
        return {name: sorted(members) for name, members in found.items()}

    def _is_settled(self, name: str, version: Version, *, trust_old: bool) -> bool:
        """Return whether a file has not changed for long enough."""
        now = self.clock()
        before, since = self._since.get(name, (None, now))
        if before != version:
            since = now
            self._since[name] = (version, now)
        return (trust_old and time.time() - version.changed / 1e9 > _OLD) or now - since >= self.settle

    def settled(self, arrival: Arrival) -> None:
        """Take note that the files of a measurement need no further look until one changes."""
        for file in arrival.files:
            self.known[file.name] = file.version
            self._since.pop(file.name, None)

    def is_unchanged(self, arrival: Arrival) -> bool:
        """Return whether all files are still as they were when their contents were read."""
        return all(_version(file.path) == file.version for file in arrival.files)

    def _files(self) -> dict[str, Version]:
        try:
            with os.scandir(self.path) as entries:
                names = sorted(entry.name for entry in entries if entry.is_file() and not _is_unfinished(entry.name))
        except OSError as error:
            problem = f"the folder cannot be read: {error.strerror or error}."
            raise FileError(Fault(str(self.path), problem, "a folder of measured files")) from None
        versions = {name: _version(self.path / name) for name in names}
        return {name: version for name, version in versions.items() if version is not None}

    def _arrival(self, name: str, version: Version) -> Arrival | None:
        """Return a file with the hash of its content; None if it has changed meanwhile."""
        path = self.path / name
        try:
            digest = hashlib.sha256(read_bounded(path)).hexdigest()
        except DovetailError as error:
            digest = f"unread: {error.faults[0].problem}"
        if _version(path) != version:
            self._since.pop(name, None)
            return None
        return Arrival(name, path, version, digest, date_of(name, version.changed))


def _is_unfinished(name: str) -> bool:
    return name.startswith((".", "~")) or name.lower().endswith(_UNFINISHED)


def _version(path: Path) -> Version | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return Version(status.st_size, status.st_mtime_ns)
