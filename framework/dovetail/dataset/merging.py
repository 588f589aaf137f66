"""Merging the shards of a dataset into one; their chunks are linked or copied unchanged."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dovetail.atomic_files import new_folder
from dovetail.dataset.samples import Dataset
from dovetail.dataset.storage import ARRAYS
from dovetail.errors import DatasetError, Fault, FileError, listing

_MOST_LISTED = 8
"""Missing blocks that a message lists."""


def merge_datasets(shards: Sequence[str | os.PathLike[str]], path: str | os.PathLike[str]) -> Dataset:
    """Join the shards of a dataset.

    Parameters
    ----------
    shards : sequence of paths
        Folders of `generate` with a `shard` of the same dataset, in any order, that together have all chunks. A
        chunk in several shards is taken from the first.
    path : path
        Folder of the new dataset. On the same file system its chunks are links to those of the shards, and nothing is
        copied; shards and dataset can then be moved or deleted on their own.

    Returns
    -------
    Dataset
        Bit for bit the dataset of a single run.

    Raises
    ------
    DatasetError
        The shards belong to different datasets, lack chunks, or are damaged; `path` exists, or cannot be written.
    """
    if not shards:
        raise DatasetError(Fault("shards", "there are none.", "one folder or more"))
    datasets, target = [Dataset(shard) for shard in shards], Path(path)
    if target.exists():
        raise DatasetError(
            Fault(str(target), "a file or folder of this name already exists.", remedy="Choose another name.")
        )
    for part in datasets[1:]:
        _check_same_dataset(datasets[0], part)
    sources = _sources(datasets)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with new_folder(target) as fresh:
            _assemble(fresh, datasets[0], sources)
    except FileError as error:
        raise DatasetError(*error.faults) from None
    except OSError as error:
        raise DatasetError(Fault(str(target), f"it cannot be written: {error}.")) from error
    return Dataset(target)


def _check_same_dataset(first: Dataset, other: Dataset) -> None:
    differing = [
        "description" if key == "fingerprint" else key
        for key in dict.fromkeys((*first.attributes, *other.attributes))
        if key != "description" and first.attributes.get(key) != other.attributes.get(key)  # its fingerprint counts
    ]
    if not np.array_equal(first.parameters, other.parameters):
        differing.append("parameters")
    if differing:
        problem = f"it is not a shard of the same dataset as '{first.path}': its {listing(differing)} differ."
        raise DatasetError(Fault(str(other.path), problem, remedy="Generate all shards with the same command."))


def _sources(datasets: Sequence[Dataset]) -> list[Dataset]:
    """Return, for each chunk, the first shard that has it whole."""
    complete = np.array([part.amplitude.complete_chunks() for part in datasets])
    missing = np.flatnonzero(~complete.any(axis=0))
    if len(missing):
        for part in datasets:
            part.amplitude.check_chunks(missing)  # a damaged file is reported before missing samples
        rows, samples = datasets[0].amplitude.chunks[0], len(datasets[0])
        listed = [f"{chunk * rows} to {min((chunk + 1) * rows, samples) - 1}" for chunk in missing[:_MOST_LISTED]]
        more = f", and {len(missing) - _MOST_LISTED} further blocks" if len(missing) > _MOST_LISTED else ""
        problem = f"samples {', '.join(listed)}{more} are in none of the {len(datasets)} shards."
        raise DatasetError(Fault(str(datasets[0].path), problem, remedy="Finish the shards with `resume=True`."))
    return [datasets[index] for index in np.argmax(complete, axis=0)]


def _assemble(folder: Path, first: Dataset, sources: Sequence[Dataset]) -> None:
    """Assemble the dataset: chunks and flags from their sources, everything else from the first shard."""
    array = ARRAYS[first.storage][0]
    kept = shutil.ignore_patterns("*.partial")
    for name in ("parameters", "frequency"):
        shutil.copytree(first.path / name, folder / name, ignore=kept)
    for name in (array, "written"):
        (folder / name).mkdir()
        shutil.copy(first.path / name / "zarr.json", folder / name)
    shutil.copy(first.path / "zarr.json", folder)
    for chunk, source in enumerate(sources):
        for file in (Path(array) / "c" / str(chunk) / "0", Path("written") / "c" / str(chunk)):
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            _link(source.path / file, folder / file)


def _link(source: Path, target: Path) -> None:
    """Hard-link a file, or copy it if the file system cannot link."""
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        shutil.copyfile(source, target)
