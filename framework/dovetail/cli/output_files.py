"""Files that the user names with ``--output``: checks before any work, and what was written."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.terminal import note

_FrfFile = typer.Option(
    "--output",
    "-o",
    metavar="FILE",
    help="File for the FRF: .csv, .uff, .npz, .png, or the format of a plugin. May be repeated.",
)
FrfFiles = Annotated[list[Path] | None, _FrfFile]
RequiredFrfFiles = Annotated[list[Path], _FrfFile]


def check_frf_files(
    files: Sequence[Path],
    overwrite: bool,
    plugins: Sequence[Path] | None,
    *,
    figures: Sequence[str] = (".png",),
    option: str = "--output",
) -> None:
    """Check, before any work, that FRFs can be written to `files`.

    Parameters
    ----------
    files : sequence of Path
    overwrite : bool
    plugins : sequence of Path, optional
        Plugin files, which may write further formats.
    figures : sequence of str
        Suffixes of figures that the command can draw.
    option : str
        The option or argument that names the files.

    Raises
    ------
    typer.BadParameter, DovetailError
        As `check_new_files` does.
    """
    from dovetail.measurement import written_suffixes

    if files:
        remedy = "For a format that a plugin file writes, add --plugin."
        check_new_files(files, (*written_suffixes(plugins or ()), *figures), overwrite, option=option, remedy=remedy)


def check_new_files(
    files: Iterable[Path], suffixes: Iterable[str], overwrite: bool, *, option: str = "--output", remedy: str = ""
) -> None:
    """Check, before any work, that files can be written.

    Parameters
    ----------
    files : iterable of Path
    suffixes : iterable of str
        Accepted suffixes.
    overwrite : bool
    option : str
        The option or argument that names the files, for messages.
    remedy : str
        A sentence that ends the message on a suffix that is not accepted.

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
            problem = f"'{file}': the suffix determines the format. Accepted: {listing(accepted)}"
            raise typer.BadParameter(f"{problem}. {remedy}" if remedy else problem, param_hint=option)
        if file.exists() and not overwrite:
            raise DovetailError(
                Fault(
                    str(file), "a file of this name already exists.", remedy="Choose another name, or add --overwrite."
                )
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
    from dovetail.documents.result_folder import MANIFEST
    from dovetail.report.result_files import write_folder

    if folder is None:
        yield
        return
    try:
        names = write_folder(folder, write, mark, kept)
    finally:
        yield
    note(f"Written to {folder}: {', '.join((*names, MANIFEST))}")
