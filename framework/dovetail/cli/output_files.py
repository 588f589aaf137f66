"""Files that the user names with ``--output``: checks before any work, and what was written."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.terminal import note

_SUFFIXES = (".csv", ".uff", ".unv", ".npz", ".png")

FrfFiles = Annotated[
    list[Path] | None,
    typer.Option("--output", "-o", metavar="FILE", help="File for the FRF: .csv, .uff, .npz or .png. May be repeated."),
]


def check_frf_files(files: Sequence[Path], overwrite: bool) -> None:
    """Check, before any work, that FRFs can be written to `files`."""
    check_new_files(files, _SUFFIXES, overwrite)


def check_new_files(files: Iterable[Path], suffixes: Iterable[str], overwrite: bool) -> None:
    """Check, before any work, that files can be written.

    Parameters
    ----------
    files : iterable of Path
    suffixes : iterable of str
        Accepted suffixes.
    overwrite : bool

    Raises
    ------
    typer.BadParameter
        A suffix is not accepted.
    DovetailError
        A file already exists, or its folder cannot be written.
    """
    from dovetail.atomic_files import check_room
    from dovetail.errors import DovetailError, Fault, listing

    accepted = list(suffixes)
    for file in files:
        if file.suffix.lower() not in accepted:
            raise typer.BadParameter(
                f"'{file}': the suffix says what is written. Accepted: {listing(accepted)}", param_hint="--output"
            )
        if file.exists() and not overwrite:
            raise DovetailError(
                Fault(str(file), "there is such a file already.", remedy="Choose another name, or add --overwrite.")
            )
        check_room(file.resolve().parent)


@contextmanager
def writing(
    folder: Path | None, write: Callable[[Path], None], mark: str = "result.json", kept: Collection[str] = ()
) -> Iterator[None]:
    """Write the files of a run to a folder; after the output of the block, print what was written, or why not.

    Parameters
    ----------
    folder : Path or None
        Nothing is written without one.
    write, mark, kept
        As in `write_folder`.

    Raises
    ------
    FileError
        They cannot be written; the block has run nevertheless.
    """
    from dovetail.report.result_files import MANIFEST, write_folder

    if folder is None:
        yield
        return
    try:
        names = write_folder(folder, write, mark, kept)
    finally:
        yield
    note(f"Written to {folder}: {', '.join((*names, MANIFEST))}")
