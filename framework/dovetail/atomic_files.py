"""Bounded reading of a file, and writing that never leaves half a file or half a folder.

New content is written next to its target, under a name that cannot be guessed, until it is complete. Only one process
at a time writes a target: it holds a lock of the operating system, which ends with the process. Whoever holds the lock
removes the remains of killed processes.
"""

from __future__ import annotations

import ctypes
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

from dovetail.errors import DovetailError, Fault, FileError, argument

LARGEST_FILE = 100_000_000
"""Bytes; a larger file is refused before it is opened."""

_LEAST_ROOM = 5_000_000
"""Bytes that must be free before any work begins; a folder of results takes less."""
_LONGEST_WRITING = 60.0
"""Longest wait in seconds for another process that writes the same file."""
_MOST_NAMES, _NEAR = 1000, 0.75
"""Names of a folder that are compared with that of a missing file, and the similarity from which one is suggested."""
_CURRENT_FOLDER, _EXCHANGE = -100, 2
"""AT_FDCWD and RENAME_EXCHANGE of Linux's ``renameat2``; RENAME_SWAP of macOS's ``renamex_np`` is 2 too."""


def missing_file(path: str | os.PathLike[str]) -> Fault:
    """Return the fault of a path where nothing is, with the file of its folder whose name is nearest."""
    name, folder = os.path.basename(path), os.path.dirname(path) or os.curdir
    remedy = ""
    try:
        near = get_close_matches(name, islice(sorted(os.listdir(folder)), _MOST_NAMES), 1, _NEAR)
        remedy = f"Did you mean '{os.path.join(os.path.dirname(path), near[0])}'?" if near else ""
    except FileNotFoundError:
        remedy = f"There is no folder '{folder}'" + ("." if os.path.isabs(folder) else f" in '{os.getcwd()}'.")
    except (OSError, ValueError):
        pass
    return Fault(str(path), "there is no such file.", remedy=remedy)


def read_bounded(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """Return the bytes of a file that may come from an untrusted source.

    Parameters
    ----------
    path : Path
    largest : int
        Bytes that the file may have.

    Returns
    -------
    bytes

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
            content = stream.read(status.st_size + 1)
    except FileNotFoundError:
        raise FileError(missing_file(path)) from None
    except (OSError, ValueError) as error:
        raise FileError(Fault(str(path), f"the file cannot be read: {_reason(error)}.")) from None
    if not content:
        raise FileError(Fault(str(path), "the file is empty."))
    return content


def write_whole(path: Path, content: bytes, *, overwrite: bool) -> None:
    """Write a file under a temporary name next to `path` and rename it.

    Raises
    ------
    FileError
        The file is there and `overwrite` is false, the folder is missing, or it cannot be written.
    """
    if path.exists() and not overwrite:
        remedy = f"Choose another name, or add {argument('overwrite', True)}."
        raise FileError(Fault(str(path), "the file already exists.", remedy=remedy))
    with locked(path):
        temporary = temporary_path(path)
        try:
            with temporary.open("xb") as stream:
                stream.write(content)
            os.replace(temporary, path)
        except OSError as error:
            raise FileError(Fault(str(path), f"the file cannot be written: {_reason(error)}.")) from None
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


@contextmanager
def new_folder(target: Path, replaced: Container[str] = (), first: str = "", last: str = "") -> Iterator[Path]:
    """Yield an empty folder next to `target`, which replaces it in one step if the block ends without an error.

    Parameters
    ----------
    target : Path
        Its files that the block does not write are kept.
    replaced : container of str
        Names in `target` that are not kept.
    first, last : str
        The first and the last file to be moved, where the files must be moved one by one.

    Raises
    ------
    FileError
        It cannot be written, or another process keeps writing it.

    Notes
    -----
    The working folder of this process, and the root of a disk, cannot be moved. The files are then written within it
    and moved one by one. The last of them, the manifest, is removed before any other file is replaced: a folder that
    has a manifest is complete.
    """
    target = target.resolve()
    with suppress(OSError):  # what it means is seen below
        target.parent.mkdir(parents=True, exist_ok=True)
    hidden = target / "results" if _must_stay(target) else target
    with locked(hidden):
        fresh = temporary_path(hidden)
        try:
            fresh.mkdir()
            yield fresh
            if hidden != target:
                _move_into(target, fresh, replaced, first, last)
                return
            if target.exists():
                shutil.copymode(target, fresh)
                _keep_others(target, fresh, replaced)
            _replace_folder(fresh, target)
        except FileError as error:  # names a file in the hidden folder
            raise FileError(Fault(str(target), error.faults[0].problem)) from None
        except OSError as error:
            raise FileError(Fault(str(target), f"the folder cannot be written: {_reason(error)}.")) from None
        finally:
            shutil.rmtree(fresh, ignore_errors=True)


def _must_stay(folder: Path) -> bool:
    return folder.is_dir() and (os.path.ismount(folder) or Path.cwd().is_relative_to(folder))


def _move_into(folder: Path, fresh: Path, replaced: Container[str], first: str, last: str) -> None:
    names = sorted((file.name for file in fresh.iterdir()), key=lambda name: (name == last, name != first))
    if last:
        (folder / last).unlink(missing_ok=True)
    for entry in list(folder.iterdir()):
        if entry.name in replaced and entry.name not in names:
            entry.unlink()
    for name in names:
        os.replace(fresh / name, folder / name)


@contextmanager
def new_files(targets: Sequence[Path], *, overwrite: bool) -> Iterator[list[Path]]:
    """Yield temporary paths for files of these names; when all are written, they are moved one right after the other.

    Raises
    ------
    FileError
        One of them is there and `overwrite` is false, or cannot be written.
    """
    with ExitStack() as places:
        staged = {target: places.enter_context(_staged(target)) for target in dict.fromkeys(targets)}
        yield [staged[target] for target in targets]
        for target, file in staged.items():
            if target.exists() and not overwrite:
                raise FileError(Fault(str(target), "the file already exists."))
            os.replace(file, target)


@contextmanager
def _staged(target: Path) -> Iterator[Path]:
    with locked(target):
        folder = temporary_path(target)
        staged = folder / target.name
        try:
            folder.mkdir()
            yield staged
        except DovetailError as error:
            named = (
                replace(fault, where=str(target)) if fault.where == str(staged) else fault for fault in error.faults
            )
            raise type(error)(*named) from None
        except OSError as error:
            raise FileError(Fault(str(target), f"the file cannot be written: {_reason(error)}.")) from None
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _keep_others(old: Path, fresh: Path, replaced: Container[str]) -> None:
    for entry in old.iterdir():
        kept = fresh / entry.name
        if entry.name in replaced or kept.exists():
            continue
        if entry.is_dir() and not entry.is_symlink():
            shutil.copytree(entry, kept, symlinks=True, copy_function=_link)
        else:
            _link(entry, kept)


def _link(source: str | Path, target: str | Path) -> None:
    """Make a hard link to a file, or copy it where that is not possible."""
    try:
        if os.path.islink(source):
            raise OSError
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target, follow_symlinks=False)


def _replace_folder(fresh: Path, target: Path) -> None:
    """Move a folder to its target; what was there is then at `fresh` or removed. If this fails, it stays as it was."""
    if not target.exists():
        fresh.rename(target)
    elif not _exchange(fresh, target):
        old = fresh.with_suffix(".old")
        target.rename(old)
        try:
            fresh.rename(target)
        except BaseException:  # Ctrl-C too
            old.rename(target)
            raise
        shutil.rmtree(old, ignore_errors=True)


def _exchange(first: Path, second: Path) -> bool:
    """Exchange two folders atomically; return False if the system cannot."""
    names = os.fsencode(first), os.fsencode(second)
    if sys.platform == "linux" and hasattr(library := ctypes.CDLL(None), "renameat2"):
        return bool(library.renameat2(_CURRENT_FOLDER, names[0], _CURRENT_FOLDER, names[1], _EXCHANGE) == 0)
    if sys.platform == "darwin":
        return bool(ctypes.CDLL(None).renamex_np(*names, _EXCHANGE) == 0)
    return False


@contextmanager
def locked(path: Path, wait: float = _LONGEST_WRITING, on_wait: Callable[[str], None] | None = None) -> Iterator[None]:
    """Keep other processes of Dovetail from writing a path, and remove the remains of killed ones next to it.

    Parameters
    ----------
    path : Path
    wait : float
        Seconds to wait for another process; if negative, without limit.
    on_wait : callable, optional
        Called with the name of the other process before waiting.

    Raises
    ------
    FileError
        Another process holds it.

    Notes
    -----
    On a disk that has no locks, or that cannot be written, there is no protection.
    """
    from filelock import FileLock, Timeout

    place = path.absolute()
    if not place.parent.is_dir():  # the lock would make it
        yield
        return
    marker = place.with_name(f".{place.name}.lock")
    lock = FileLock(marker)
    try:
        try:
            lock.acquire(timeout=0)
        except Timeout:
            if on_wait is not None:
                on_wait(_holder(marker))
            lock.acquire(timeout=wait)
    except Timeout:
        remedy = "Wait until it has ended."
        raise FileError(Fault(str(path), f"{_holder(marker)} is writing it.", remedy=remedy)) from None
    except OSError:
        pass
    try:
        if lock.is_locked:
            with suppress(OSError):
                _sweep(place)
            with suppress(OSError):
                _write_process_id(marker)
        yield
    finally:
        if lock.is_locked:
            with suppress(OSError):  # Windows removes it itself
                marker.unlink()
            lock.release()


def _write_process_id(marker: Path) -> None:
    """Write this process's id into a lock file, after the byte that Windows locks."""
    with marker.open("r+b", buffering=0) as stream:
        stream.seek(1)
        stream.write(f"{os.getpid():<12}".encode())


def _holder(marker: Path) -> str:
    with suppress(OSError, ValueError), marker.open("rb") as stream:
        stream.seek(1)
        return f"process {int(stream.read(12))}"
    return "another process"


def temporary_path(target: Path) -> Path:
    """Return a temporary name next to `target` that cannot be guessed; the next holder of `target` removes its file."""
    return target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")


def _sweep(path: Path) -> None:
    """Remove the remains that killed processes have left next to `path`; if they had moved it away, move it back."""
    start = f".{path.name}."
    remains = re.compile(re.escape(start) + r"[0-9a-f]{16}\.(part|old)")
    for name in os.listdir(path.parent):  # of ten thousand files perhaps
        if not name.startswith(start) or not remains.fullmatch(name):
            continue
        entry = path.parent / name
        if entry.suffix == ".old" and not path.exists():
            entry.rename(path)
        elif entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            entry.unlink(missing_ok=True)


def check_target(target: Path) -> None:
    """Make sure, before any work, that a folder can be written at `target`, or replaced as a whole.

    Raises
    ------
    FileError
        The folder cannot be moved; or as in `check_room`.
    """
    folder = target.resolve()
    if _must_stay(folder):
        problem = "the folder in which you work, or a disk of its own, cannot be replaced as a whole."
        raise FileError(Fault(str(target), problem, remedy="Name a folder within it."))
    check_room(folder.parent)


def check_room(folder: Path, room: int = _LEAST_ROOM) -> None:
    """Make sure, before any work, that files can be written in a folder, which need not exist yet.

    Raises
    ------
    FileError
        It cannot be written, or its disk has less than `room` bytes left.
    """
    existing = next(place for place in (folder, *folder.parents) if place.exists())
    try:
        with tempfile.TemporaryFile(dir=existing):
            free = shutil.disk_usage(existing).free
    except OSError as error:
        remedy = "Choose another folder."
        raise FileError(Fault(str(folder), f"nothing can be written here: {_reason(error)}.", remedy=remedy)) from None
    if free < room:
        problem = f"its disk has {free / 1e6:.1f} MB left, and {room / 1e6:.1f} MB are needed."
        raise FileError(Fault(str(folder), problem, remedy="Make room, or choose another folder."))


def _reason(error: Exception) -> str:
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
