"""What a watch has done, in files that survive a kill at any moment.

``state.json`` is replaced atomically after each file, and holds the last lines of the journal. ``files.jsonl`` has a
line for each file and only grows; a line that a killed process has left out or broken off is restored from the state.
Checksums in the state, of the state and of the earlier lines, show whether somebody has altered one of them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dovetail.atomic_files import write_whole
from dovetail.errors import Fault, FileError
from dovetail.monitoring.plain_arrays import from_plain, to_plain
from dovetail.monitoring.tracker import State, state_from

FORMAT = 3
"""Number of the format of the state; another one is refused."""
STATE, JOURNAL = "state.json", "files.jsonl"
_ANEW = "Choose another folder; the files are then read again."
_RESTORE = "Restore the file, or choose another folder."


@dataclass
class Journal:
    """The state and the journal of a watch.

    Parameters
    ----------
    folder : Path
    fingerprint : str
        Of the series and of the options; a state belongs to one.
    state : State
    records : list of dict
        One for each line of the journal.
    """

    folder: Path
    fingerprint: str
    state: State
    records: list[dict[str, Any]] = field(default_factory=list)
    _lines: Any = field(default_factory=hashlib.sha256)

    @staticmethod
    def open(folder: Path, fingerprint: str, start: State) -> Journal:
        """Read the journal in a folder, or begin one.

        Raises
        ------
        FileError
            The folder cannot be made or read, belongs to another series, or is damaged.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            problem = f"the folder cannot be made: {error.strerror or error}."
            raise FileError(Fault(str(folder), problem, remedy="Choose another folder with `output=`.")) from None
        file = folder / STATE
        if not file.exists():
            if (folder / JOURNAL).exists():
                problem = f"it has a journal ({JOURNAL}) and no state ({STATE}), so that the watch cannot go on."
                raise FileError(Fault(str(folder), problem, remedy="Move the journal away, or choose another folder."))
            return Journal(folder, fingerprint, start)
        try:
            plain = json.loads(file.read_text(encoding="utf-8"))
            if plain["format"] != FORMAT:
                raise ValueError(plain["format"])
            is_whole = plain.pop("sha256") == _checksum(plain)
            saved = from_plain(plain)
            same = saved["fingerprint"] == fingerprint
            state, lines, pending = state_from(saved["state"]), int(saved["lines"]), plain["pending"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            problem = f"the state of the watch cannot be read: {type(error).__name__}."
            raise FileError(Fault(str(file), problem, remedy=_ANEW)) from None
        if not is_whole:
            raise FileError(Fault(str(file), "it was altered since the watch wrote it.", remedy=_RESTORE))
        if not same:
            problem = "this is the state of a watch of another series, or with other options."
            raise FileError(Fault(str(file), problem, remedy=_ANEW))
        records = _restored(folder / JOURNAL, lines, pending)
        journal = Journal(folder, fingerprint, state, records)
        for record in records[:-1]:
            journal._lines.update(_line_of(record))
        if journal._lines.hexdigest() != plain["journal"]:
            problem = "a line was altered since the watch wrote it."
            raise FileError(Fault(str(folder / JOURNAL), problem, remedy=_RESTORE))
        journal._lines.update(_line_of(records[-1]))
        return journal

    def add(self, record: Mapping[str, Any], state: State) -> None:
        """Save the state after a file, then its line."""
        line = dict(record)
        saved = {
            "format": FORMAT,
            "fingerprint": self.fingerprint,
            "lines": len(self.records) + 1,
            "pending": [line],
            "journal": self._lines.hexdigest(),
            "state": to_plain(state),
        }
        saved["sha256"] = _checksum(saved)
        content = json.dumps(saved, ensure_ascii=False, allow_nan=False).encode()
        write_whole(self.folder / STATE, content, overwrite=True)
        _append(self.folder / JOURNAL, line)
        self._lines.update(_line_of(line))
        self.state = state
        self.records.append(line)


def _checksum(saved: Mapping[str, Any]) -> str:
    """Return the checksum of plain values, which JSON gives back as they are."""
    return hashlib.sha256(json.dumps(saved, sort_keys=True).encode()).hexdigest()


def _line_of(record: Mapping[str, Any]) -> bytes:
    """Return a line of the journal."""
    return (json.dumps(record, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _append(file: Path, record: Mapping[str, Any]) -> None:
    try:
        with file.open("ab") as stream:
            stream.write(_line_of(record))
    except OSError as error:
        raise FileError(Fault(str(file), f"the journal cannot be written: {error.strerror or error}.")) from None


def _restored(file: Path, lines: int, pending: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the records of a journal, of which the last may be missing or broken off.

    Raises
    ------
    FileError
        Other lines are missing or damaged.
    """
    try:
        text = file.read_text(encoding="utf-8", errors="replace") if file.exists() else ""
    except OSError as error:
        raise FileError(Fault(str(file), f"the journal cannot be read: {error.strerror or error}.")) from None
    whole = text.split("\n")[:-1]
    records = list[dict[str, Any]]()
    for number, line in enumerate(whole[:lines], start=1):
        try:
            records.append(json.loads(line))
        except ValueError:
            if number < lines:
                raise FileError(Fault(f"{file}:{number}", "the line is damaged.", remedy="Restore the file.")) from None
    if len(records) < lines - len(pending):
        problem = f"it has {len(records)} lines, and the state is that after {lines} files."
        raise FileError(Fault(str(file), problem, remedy=_RESTORE))
    if records[lines - 1 :] != pending or len(whole) != lines or not text.endswith("\n"):
        records[lines - 1 :] = pending
        write_whole(file, b"".join(map(_line_of, records)), overwrite=True)
    return records
