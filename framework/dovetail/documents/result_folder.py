"""A folder of results: the names of its files, and the hashes that are listed in it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

RESULT_FILE = "result.json"
"""The result of an identification."""
MANIFEST = "SHA256SUMS"
"""File with the names and hashes of all files of a run."""


def listed_hashes(folder: Path) -> dict[str, str]:
    """Return the files that the manifest in a folder of results lists, with their hashes."""
    listed: dict[str, str] = {}
    with suppress(OSError, ValueError):
        for line in (folder / MANIFEST).read_text(encoding="utf-8").splitlines():
            digest, _, name = line.partition("  ")
            listed[name] = digest
    return listed
