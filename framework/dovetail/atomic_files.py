"""Bounded reading of a measured file, and writing that never leaves half a file."""

from __future__ import annotations

import os
import secrets
import stat
from pathlib import Path

from dovetail.errors import Fault, MeasurementError

__all__ = ["LARGEST_FILE", "read_bounded", "write_whole"]

LARGEST_FILE = 100_000_000
"""Bytes; a larger file is refused before it is opened."""


def read_bounded(path: Path) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    MeasurementError
        Missing, a device or a pipe, empty, larger than `LARGEST_FILE`, or not readable.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise MeasurementError(Fault(str(path), "this is a device or a pipe.", "one measured file"))
        if status.st_size > LARGEST_FILE:
            raise MeasurementError(
                Fault(
                    str(path),
                    f"the file has {status.st_size / 1e6:.0f} MB, far more than one FRF needs.",
                    f"files of at most {LARGEST_FILE // 1_000_000} MB",
                    "Export the one FRF that is wanted.",
                )
            )
        with path.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        raise MeasurementError(Fault(str(path), "there is no such file.")) from None
    except (OSError, ValueError) as error:
        raise MeasurementError(Fault(str(path), f"the file cannot be read: {_reason(error)}.")) from None
    if not content:
        raise MeasurementError(Fault(str(path), "the file is empty."))
    return content


def write_whole(path: Path, content: bytes, *, overwrite: bool) -> None:
    """Write a file under a temporary name beside `path` and rename it.

    Raises
    ------
    MeasurementError
        The file is there and `overwrite` is false, the folder is missing, or it cannot be written.
    """
    if path.exists() and not overwrite:
        raise MeasurementError(
            Fault(str(path), "the file is there already.", remedy="Choose another name, or say overwrite=True.")
        )
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with temporary.open("xb") as stream:
            stream.write(content)
        os.replace(temporary, path)
    except OSError as error:
        raise MeasurementError(Fault(str(path), f"the file cannot be written: {_reason(error)}.")) from None
    finally:
        temporary.unlink(missing_ok=True)


def _reason(error: Exception) -> str:
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
