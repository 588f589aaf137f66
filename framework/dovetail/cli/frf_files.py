"""Files for FRFs that the user names; the suffix determines the format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.options import check_new_files

if TYPE_CHECKING:
    from dovetail.frf import Frf

_SUFFIXES = (".csv", ".uff", ".unv", ".npz", ".png")

FrfFiles = Annotated[
    list[Path] | None,
    typer.Option("--output", "-o", metavar="FILE", help="File for the FRF: .csv, .uff, .npz or .png. May be repeated."),
]


def check_frf_files(files: Sequence[Path], overwrite: bool) -> None:
    """Check, before any work, that FRFs can be written to `files`."""
    check_new_files(files, _SUFFIXES, overwrite)


def write_frf_files(
    frf: Frf, files: Sequence[Path], natural: Sequence[float], texts: Mapping[Path, str], *, overwrite: bool
) -> None:
    """Write an FRF to each of `files`, together with other files; missing folders are created.

    Parameters
    ----------
    frf : Frf
    files : sequence of Path
    natural : sequence of float
        Natural frequencies [Hz] to mark in figures.
    texts : mapping of Path to str
        The other files; all files appear together.
    overwrite : bool
    """
    from dovetail.atomic_files import new_files

    for file in (*files, *texts):
        file.parent.mkdir(parents=True, exist_ok=True)
    with new_files((*files, *texts), overwrite=overwrite) as staged:
        for file in staged[: len(files)]:
            if file.suffix.lower() == ".png":
                from dovetail.report.figures import save_png, simulated_figure

                save_png(simulated_figure(frf, natural), file)
            else:
                from dovetail import write_frf

                write_frf(frf, file)
        for file, text in zip(staged[len(files) :], texts.values(), strict=True):
            file.write_bytes(text.encode("utf-8", "replace"))
