"""Samples through the engine and onto the disk, chunk by chunk."""

from __future__ import annotations

import os
import shutil
from concurrent.futures import Future, ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.dataset.dataset import FORMAT, Dataset
from dovetail.dataset.sampling import latin_hypercube
from dovetail.errors import DatasetError, Fault
from dovetail.interfaces import Progress, silent

__all__ = ["generate"]

_CHUNK_BYTES = 8e6


def generate(
    assembly: Assembly,
    path: str | os.PathLike[str],
    *,
    samples: int | None = None,
    seed: int | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> Dataset:
    """Make a dataset: Latin hypercube samples and the amplitude of the accelerance of each.

    Parameters
    ----------
    assembly : Assembly
    path : path
        Folder of the Zarr group to make.
    samples, seed : int, optional
        By default what the description says.
    resume : bool
        Go on with a dataset that was interrupted; what is there already is not computed again, and the result is
        bit for bit that of one uninterrupted run. A complete one is returned as it is.
    progress : callable

    Returns
    -------
    Dataset

    Raises
    ------
    DatasetError
        The path is taken; what is to be resumed was made with another description, seed or number of samples, or by
        models whose code has changed; or the disk refuses to be written, and what is there can then be resumed.
    """
    settings = assembly.description.identification
    count = settings.samples if samples is None else samples
    its_seed = settings.seed if seed is None else seed
    if not assembly.parameters:
        raise DatasetError(Fault(assembly.description.source, "no joint parameter is sought: nothing to sample."))
    if count < 1:
        raise DatasetError(f"{count} samples were asked for; at least 1 is needed.")
    folder = Path(path)
    try:
        if folder.exists():
            _check_resumable(folder, assembly, count, its_seed, resume)
        else:
            _create(folder, assembly, count, its_seed)
        _fill(folder, assembly, progress)
    except OSError as error:
        remedy = "Make room for it and go on with --resume."
        raise DatasetError(Fault(str(folder), f"it cannot be written: {error}.", remedy=remedy)) from error
    return Dataset(folder)


def _check_resumable(folder: Path, assembly: Assembly, samples: int, seed: int, resume: bool) -> None:
    if not resume:
        raise DatasetError(
            Fault(str(folder), "this path is taken.", remedy="Go on with it by --resume, or choose another name.")
        )
    dataset = Dataset(folder)
    if dataset.attributes["fingerprint"] != assembly.description.fingerprint:
        dataset.require(assembly)
    for name, here, wanted in (("samples", len(dataset), samples), ("seed", dataset.seed, seed)):
        if here != wanted:
            raise DatasetError(Fault(str(folder), f"it was begun with {name} {here}, not {wanted}."))
    dataset.require_same_frfs(assembly)


def _create(folder: Path, assembly: Assembly, samples: int, seed: int) -> None:
    """Lay out the group under a temporary name, so that a dataset is there whole or not at all."""
    import zarr

    lines = len(assembly.frequency)
    chunk = max(1, min(samples, int(_CHUNK_BYTES / (4 * lines))))
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}.new")
    temporary.parent.mkdir(parents=True, exist_ok=True)
    attributes: dict[str, Any] = {
        "dovetail_dataset": FORMAT,
        "dovetail_version": version("dovetail-frf"),
        "name": assembly.name,
        "description": assembly.description.text,
        "fingerprint": assembly.description.fingerprint,
        "parameter_names": [parameter.name for parameter in assembly.parameters],
        "quantity": "amplitude of the accelerance",
        "seed": seed,
    }
    plain: dict[str, Any] = {"compressors": None}
    try:
        group = zarr.open_group(temporary, mode="w", attributes=attributes)
        group.create_array("parameters", data=latin_hypercube(assembly, samples, seed))
        group.create_array("frequency", data=np.asarray(assembly.frequency))
        group.create_array(
            "amplitude", shape=(samples, lines), chunks=(chunk, lines), dtype="float32", fill_value=np.nan, **plain
        )
        group.create_array("written", shape=(-(-samples // chunk),), chunks=(1,), dtype="uint8", **plain)
        temporary.rename(folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _fill(folder: Path, assembly: Assembly, progress: Progress) -> None:
    """Compute the chunks that are missing; the one before is written while the next is computed."""
    import zarr

    for unfinished in folder.rglob("*.partial"):  # what a killed run was writing
        unfinished.unlink(missing_ok=True)
    group: Any = zarr.open_group(folder, mode="r+")
    parameters, amplitude, written = np.asarray(group["parameters"]), group["amplitude"], group["written"]
    chunk, samples = amplitude.chunks[0], len(parameters)
    missing = [int(index) for index in np.flatnonzero(np.asarray(written) == 0)]
    done = samples - sum(min(chunk, samples - index * chunk) for index in missing)
    progress("generate", done, samples)

    def write(index: int, values: NDArray[np.float32]) -> None:
        amplitude[index * chunk : index * chunk + len(values)] = values
        written[index] = 1

    with ThreadPoolExecutor(max_workers=1) as writer:
        pending: Future[None] | None = None
        for index in missing:
            values = assembly.accelerance_amplitude(parameters[index * chunk : (index + 1) * chunk])
            if pending is not None:
                pending.result()
            pending = writer.submit(write, index, values)
            done += len(values)
            progress("generate", done, samples)
        if pending is not None:
            pending.result()
