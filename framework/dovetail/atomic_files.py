"""Bounded reading of a file, and writing that never leaves half a file."""

from __future__ import annotations

import os
import secrets
import stat
from pathlib import Path

from dovetail.errors import Fault, FileError

__all__ = ["LARGEST_FILE", "read_bounded", "write_whole"]

LARGEST_FILE = 100_000_000
"""Bytes; a larger file is refused before it is opened."""


def read_bounded(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    FileError
        Missing, a directory, a device or a pipe, empty, larger than `largest`, or not readable.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            kind = "a directory" if stat.S_ISDIR(status.st_mode) else "a device or a pipe"
            raise FileError(Fault(str(path), f"this is {kind}.", "a file"))
        if status.st_size > largest:
            problem = f"the file has {status.st_size / 1e6:.0f} MB, far more than is read."
            raise FileError(Fault(str(path), problem, f"files of at most {largest // 1_000_000} MB"))
        with path.open("rb") as stream:
            content = stream.read(largest + 1)
    except FileNotFoundError:
        raise FileError(Fault(str(path), "there is no such file.")) from None
    except (OSError, ValueError) as error:
        raise FileError(Fault(str(path), f"the file cannot be read: {_reason(error)}.")) from None
    if not content:
        raise FileError(Fault(str(path), "the file is empty."))
    return content


def write_whole(path: Path, content: bytes, *, overwrite: bool) -> None:
    """Write a file under a temporary name beside `path` and rename it.

    Raises
    ------
    FileError
        The file is there and `overwrite` is false, the folder is missing, or it cannot be written.
    """
    if path.exists() and not overwrite:
        remedy = "Choose another name, or say overwrite=True."
        raise FileError(Fault(str(path), "the file is there already.", remedy=remedy))
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with temporary.open("xb") as stream:
            stream.write(content)
        os.replace(temporary, path)
    except OSError as error:
        raise FileError(Fault(str(path), f"the file cannot be written: {_reason(error)}.")) from None
    finally:
        temporary.unlink(missing_ok=True)


def _reason(error: Exception) -> str:
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
