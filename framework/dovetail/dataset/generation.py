"""Samples through the engine and onto the disk, chunk by chunk."""

from __future__ import annotations

import os
import shutil
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self, get_args

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.dataset.dataset import ARRAYS, FORMAT, Dataset, Storage
from dovetail.dataset.sampling import latin_hypercube
from dovetail.errors import DatasetError, Fault, listing
from dovetail.frf import conversion
from dovetail.interfaces import Progress, silent

__all__ = ["complex_accelerance", "generate"]

_CHUNK_BYTES = 8e6


def generate(
    assembly: Assembly,
    path: str | os.PathLike[str],
    *,
    samples: int | None = None,
    seed: int | None = None,
    storage: Storage = "amplitude",
    interpolation: float | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> Dataset:
    """Make a dataset: Latin hypercube samples and the accelerance of each, at all responses side by side.

    Parameters
    ----------
    assembly : Assembly
    path : path
        Folder of the Zarr group to make.
    samples, seed : int, optional
        By default what the description says.
    storage : "amplitude" or "complex"
        Keep the amplitude of each FRF as float32, or amplitude and phase as complex64, which takes twice the room.
        Training takes the amplitude of either; the phase is for an `augmentation.mass` without fresh samples.
    interpolation : float, optional
        Compute some lines of each FRF and interpolate the others up to this relative error, as estimated
        (`Assembly.interpolated`). By default every line is computed.
    resume : bool
        Go on with a dataset that was interrupted; what is there already is not computed again, and the result is
        bit for bit that of one uninterrupted run. Chunks that have gone missing or are cut short are computed anew.
    progress : callable

    Returns
    -------
    Dataset

    Raises
    ------
    DatasetError
        The path is taken; what is to be resumed was made with another description, seed, storage, interpolation or
        number of samples, or by models whose code has changed; or the disk refuses to be written, and what is there
        can then be resumed.
    """
    settings = assembly.description.identification
    plan = _Plan(
        settings.samples if samples is None else samples,
        settings.seed if seed is None else seed,
        storage,
        interpolation,
    )
    if not assembly.parameters:
        raise DatasetError(Fault(assembly.description.source, "no joint parameter is sought: nothing to sample."))
    if plan.samples < 1:
        raise DatasetError(f"{plan.samples} samples were asked for; at least 1 is needed.")
    if storage not in get_args(Storage):
        raise DatasetError(Fault("storage", f"{storage!r} was asked for.", listing(get_args(Storage))))
    if interpolation is not None:
        assembly = assembly.interpolated(interpolation)
    folder = Path(path)
    try:
        if folder.exists():
            _check_resumable(folder, assembly, plan, resume)
        else:
            _create(folder, assembly, plan)
        _fill(folder, assembly, progress)
    except OSError as error:
        remedy = "Make room for it and go on with --resume."
        raise DatasetError(Fault(str(folder), f"it cannot be written: {error}.", remedy=remedy)) from error
    return Dataset(folder)


@dataclass(frozen=True)
class _Plan:
    """What a dataset is begun with, and has to be gone on with."""

    samples: int
    seed: int
    storage: Storage
    interpolation: float | None

    @classmethod
    def of(cls, dataset: Dataset) -> Self:
        interpolation = dataset.attributes.get("interpolation")
        return cls(len(dataset), dataset.seed, dataset.storage, interpolation)


def _check_resumable(folder: Path, assembly: Assembly, plan: _Plan, resume: bool) -> None:
    if not resume:
        raise DatasetError(
            Fault(str(folder), "this path is taken.", remedy="Go on with it by --resume, or choose another name.")
        )
    dataset = Dataset(folder)
    if dataset.attributes["fingerprint"] != assembly.description.fingerprint:
        dataset.require(assembly)
    begun = asdict(_Plan.of(dataset))
    for name, wanted in asdict(plan).items():
        if begun[name] != wanted:
            raise DatasetError(Fault(str(folder), f"it was begun with {name} {begun[name]}, not {wanted}."))
    dataset.require_same_frfs(assembly)


def _create(folder: Path, assembly: Assembly, plan: _Plan) -> None:
    """Lay out the group under a temporary name, so that a dataset is there whole or not at all."""
    import zarr
    from zarr.codecs import Crc32cCodec

    samples, lines = plan.samples, len(assembly.description.responses) * len(assembly.frequency)
    array, dtype = ARRAYS[plan.storage]
    chunk = max(1, min(samples, int(_CHUNK_BYTES / (np.dtype(dtype).itemsize * lines))))
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}.new")
    temporary.parent.mkdir(parents=True, exist_ok=True)
    attributes: dict[str, Any] = {
        "dovetail_dataset": FORMAT,
        "dovetail_version": version("dovetail-frf"),
        "name": assembly.name,
        "description": assembly.description.text,
        "fingerprint": assembly.description.fingerprint,
        "responses": list(assembly.description.response_labels),
        "parameter_names": [parameter.name for parameter in assembly.parameters],
        "quantity": "amplitude of the accelerance" if plan.storage == "amplitude" else "accelerance",
        "storage": plan.storage,
        "interpolation": plan.interpolation,
        "seed": plan.seed,
    }
    checked: dict[str, Any] = {"compressors": [Crc32cCodec()]}
    shape, chunks = (samples, lines), (chunk, lines)
    try:
        group = zarr.open_group(temporary, mode="w", attributes=attributes)
        group.create_array("parameters", data=latin_hypercube(assembly, samples, plan.seed), **checked)
        group.create_array("frequency", data=np.asarray(assembly.frequency), **checked)
        group.create_array(array, shape=shape, chunks=chunks, dtype=dtype, fill_value=np.nan, **checked)
        group.create_array("written", shape=(-(-samples // chunk),), chunks=(1,), dtype="uint8", compressors=None)
        temporary.rename(folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _fill(folder: Path, assembly: Assembly, progress: Progress) -> None:
    """Compute the chunks that are missing; the one before is written while the next is computed."""
    import zarr

    for unfinished in folder.rglob("*.partial"):  # what a killed run was writing
        unfinished.unlink(missing_ok=True)
    group: Any = zarr.open_group(folder, mode="r+")
    there = Dataset(folder)
    parameters, stored, written = there.parameters, group[ARRAYS[there.storage][0]], group["written"]
    compute = Assembly.accelerance_amplitude if there.storage == "amplitude" else complex_accelerance
    chunk, samples = stored.chunks[0], len(parameters)
    missing = [int(index) for index in np.flatnonzero(~there.amplitude.sound())]
    done = samples - sum(min(chunk, samples - index * chunk) for index in missing)
    progress("generate", done, samples)

    def write(index: int, values: NDArray[Any]) -> None:
        stored[index * chunk : index * chunk + len(values)] = values
        written[index] = 1

    with ThreadPoolExecutor(max_workers=1) as writer:
        pending: Future[None] | None = None
        for index in missing:
            values = compute(assembly, parameters[index * chunk : (index + 1) * chunk])
            if pending is not None:
                pending.result()
            pending = writer.submit(write, index, values)
            done += len(values)
            progress("generate", done, samples)
        if pending is not None:
            pending.result()


def complex_accelerance(assembly: Assembly, theta: NDArray[np.float64]) -> NDArray[np.complex64]:
    """Return the accelerance with its phase in single precision, all responses side by side.

    Parameters
    ----------
    assembly : Assembly
    theta : (n, n_params) array
        SI.

    Returns
    -------
    (n, n_responses n_freq) complex64 array
        m/(N s^2).
    """
    each = zip(assembly.each_response, assembly.description.responses, strict=True)
    parts = [
        (one.frf(theta) * conversion(assembly.frequency, response.quantity, "accelerance")).astype(np.complex64)
        for one, response in each
    ]
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
