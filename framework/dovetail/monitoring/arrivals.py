"""The files of a watched folder: which are complete and new, in which order, and what their names say.

A file is complete when its size and its time of change have not changed between two looks at the folder that are
`settle` seconds apart. It is new if no file with the same content was seen before, under whatever name.
"""

from __future__ import annotations

import hashlib
import os
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from dovetail.atomic_files import read_bounded
from dovetail.errors import DovetailError, Fault, FileError, UnitError
from dovetail.series.description import Covariate
from dovetail.units import to_si

_UNFINISHED = (".part", ".partial", ".tmp", ".temp", ".crdownload", ".lock", ".swp", "~")
"""Ends of the names of files that other programs are writing."""
_DATE = re.compile(r"(\d{4})-?(\d\d)-?(\d\d)(?:[T_ -]?(\d\d)[:h.-]?(\d\d)(?:[:m.-]?(\d\d))?)?(?!\d)")
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
    """

    name: str
    path: Path
    version: Version
    digest: str
    date: str


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
    """

    path: Path
    settle: float = 2.0
    known: dict[str, Version] = field(default_factory=dict)
    clock: Callable[[], float] = time.monotonic
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
        arrivals, waiting, now = list[Arrival](), False, self.clock()
        for name, version in self._files().items():
            if self.known.get(name) == version:
                continue
            before, since = self._since.get(name, (None, now))
            if before != version:
                since = now
                self._since[name] = (version, now)
            is_old = trust_old and time.time() - version.changed / 1e9 > _OLD
            if not (is_old or now - since >= self.settle):
                waiting = True
                continue
            arrival = self._arrival(name, version)
            if arrival is None:
                waiting = True
            else:
                arrivals.append(arrival)
        return sorted(arrivals, key=lambda one: (one.date, one.name)), waiting

    def settled(self, arrival: Arrival) -> None:
        """Take note that a file needs no further look until it changes."""
        self.known[arrival.name] = arrival.version
        self._since.pop(arrival.name, None)

    def is_unchanged(self, arrival: Arrival) -> bool:
        """Return whether a file is still as it was when its content was read."""
        return _version(arrival.path) == arrival.version

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


def date_of(name: str, changed: int) -> str:
    """Return the date in a file's name, such as ``2026-03-01`` or ``20260301T0800``, or that of its change [ns]."""
    for match in _DATE.finditer(name):
        year, month, day, hour, minute, second = (int(part or 0) for part in match.groups())
        try:
            date = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
            return date.replace(tzinfo=None).isoformat(timespec="seconds")
        except ValueError:
            continue
    return datetime.fromtimestamp(changed / 1e9, UTC).replace(tzinfo=None).isoformat(timespec="microseconds")


def covariates_of(name: str, covariates: Mapping[str, Covariate]) -> dict[str, float]:
    """Return the covariates in a file's name, such as ``torque=40`` or ``torque=40 N m``, SI.

    Raises
    ------
    FileError
        A value is not a quantity of the covariate's dimension.
    """
    values = {}
    stem = Path(name).stem if re.search(r"\.[A-Za-z]\w*$", name) else name
    for covariate in covariates.values():
        match = re.search(rf"(?:^|[^A-Za-z0-9]){re.escape(covariate.name)}=([^=,;_]+?)(?=$|[,;_]| \w+=)", stem)
        if match is None:
            continue
        try:
            values[covariate.name] = to_si(match[1].strip(), covariate.unit)
        except UnitError as error:
            accepted = f"'{covariate.name}=' and a number, or a quantity in {covariate.unit}"
            raise FileError(Fault(name, error.faults[0].problem, accepted)) from None
    return values
