"""Generation of a dataset: samples are computed by the engine and written to disk, chunk by chunk."""

from __future__ import annotations

import os
import shutil
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self, get_args

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, AssemblySource, as_assembly
from dovetail.atomic_files import check_room, locked, temporary_path
from dovetail.dataset.samples import FORMAT, Dataset
from dovetail.dataset.sampling import check_sample_count, latin_hypercube
from dovetail.dataset.storage import ARRAYS, Storage
from dovetail.errors import DatasetError, Fault, FileError, argument, listing
from dovetail.frf import conversion
from dovetail.interfaces import Progress, logged, progress_reporter
from dovetail.parallel import on_cluster, require_cluster

_CHUNK_BYTES = 8e6
"""Size of a chunk of FRFs on disk."""
_CONTINUE = f"Choose another name, or continue an interrupted dataset with {argument('resume', True)}."


def generate(
    assembly: AssemblySource,
    path: str | os.PathLike[str],
    *,
    samples: int | None = None,
    seed: int | None = None,
    storage: Storage = "amplitude",
    interpolation: float | None = None,
    resume: bool = False,
    shard: tuple[int, int] = (1, 1),
    scheduler: str | None = None,
    progress: Progress | bool | None = None,
) -> Dataset:
    """Generate a dataset: Latin hypercube samples and the accelerance of each, for all responses.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description.
    path : path
        Folder of the new Zarr group.
    samples, seed : int, optional
        By default those of the description.
    storage : "amplitude" or "complex"
        Store the amplitude of each FRF as float32, or amplitude and phase as complex64, which takes twice the space.
        Training uses the amplitude of either. An `augmentation.mass` without fresh samples needs the phase.
    interpolation : float, optional
        Compute some lines of each FRF and interpolate the others up to this estimated relative error
        (`Assembly.interpolated`). By default every line is computed.
    resume : bool
        Continue a dataset that was interrupted. Complete chunks are not computed again, and the result is bit for bit
        that of an uninterrupted run. Missing or truncated chunks are computed again.
    shard : (int, int)
        Number of a part, from 1, and number of parts; only the chunks of this part are computed.
        `merge_datasets` joins the parts, also from different machines, to the dataset that a single run makes.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://host:8786``, whose workers compute the FRFs. They are written here.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    Dataset

    Raises
    ------
    DatasetError
        The path exists; there is no such shard; the dataset to resume was begun with another description, seed,
        storage, interpolation or number of samples, or with models whose code has changed; another process is writing
        it; or the disk is full or cannot be written, after which the dataset can be resumed.
    """
    assembly = as_assembly(assembly)
    settings = assembly.description.identification
    plan = _Plan(
        settings.samples if samples is None else samples,
        settings.seed if seed is None else seed,
        storage,
        interpolation,
    )
    if not (isinstance(plan.seed, (int, np.integer)) and plan.seed >= 0):
        raise DatasetError(Fault("seed", f"{plan.seed!r:.40} is not a seed.", "a whole number of 0 or more"))
    if not assembly.parameters:
        raise DatasetError(Fault(assembly.description.source, "there are no parameters to sample."))
    if plan.samples < 1:
        raise DatasetError(f"{plan.samples} samples were requested; at least 1 is needed.")
    check_sample_count(assembly, plan.samples)
    if not 1 <= shard[0] <= shard[1]:
        raise DatasetError(Fault("shard", f"there is no shard {shard[0]} of {shard[1]}.", "1/1, or i/n with i up to n"))
    if storage not in get_args(Storage):
        raise DatasetError(Fault("storage", f"{storage!r} is not a storage.", listing(get_args(Storage))))
    if interpolation is not None:
        assembly = assembly.interpolated(interpolation)
    if scheduler is not None:
        require_cluster(scheduler)  # before a folder is made
    folder = Path(path)
    try:
        written = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
        check_room(folder.resolve().parent, max(plan.bytes(assembly) // shard[1] - written, 0))
        folder.parent.mkdir(parents=True, exist_ok=True)
        step = logged(__name__, f"{plan.samples} samples of {assembly.name} into {folder}")
        with locked(folder, wait=0), step, progress_reporter(progress) as report:
            if folder.exists():
                _check_resumable(folder, assembly, plan, resume)
            else:
                _create(folder, assembly, plan)
            _fill(folder, assembly, shard, scheduler, report)
    except FileError as error:
        raise DatasetError(*error.faults) from None
    except OSError as error:
        remedy = "Make room for it and continue with `resume=True`."
        raise DatasetError(Fault(str(folder), f"it cannot be written: {error}.", remedy=remedy)) from error
    return Dataset(folder)


@dataclass(frozen=True)
class _Plan:
    """Settings of a dataset, which must be the same when it is resumed."""

    samples: int
    seed: int
    storage: Storage
    interpolation: float | None

    @classmethod
    def from_dataset(cls, dataset: Dataset) -> Self:
        interpolation = dataset.attributes.get("interpolation")
        return cls(len(dataset), dataset.seed, dataset.storage, interpolation)

    def bytes(self, assembly: Assembly) -> int:
        """Return the disk space of the arrays."""
        lines = len(assembly.description.responses) * len(assembly.frequency)
        return self.samples * (np.dtype(ARRAYS[self.storage][1]).itemsize * lines + 8 * len(assembly.parameters))


def _check_resumable(folder: Path, assembly: Assembly, plan: _Plan, resume: bool) -> None:
    if not resume:
        raise DatasetError(Fault(str(folder), "a file or folder of this name already exists.", remedy=_CONTINUE))
    dataset = Dataset(folder)
    if dataset.attributes["fingerprint"] != assembly.description.fingerprint:
        dataset.require(assembly)
    begun = asdict(_Plan.from_dataset(dataset))
    for name, wanted in asdict(plan).items():
        if begun[name] != wanted:
            problem = f"it was begun with {name} {begun[name]}, not {wanted}."
            raise DatasetError(Fault(str(folder), problem, remedy="Go on with that one, or choose another name."))
    dataset.require_same_frfs(assembly)


def _create(folder: Path, assembly: Assembly, plan: _Plan) -> None:
    """Create the group under a temporary name and rename it, so that no incomplete group is ever visible."""
    import zarr
    from zarr.codecs import Crc32cCodec

    samples, lines = plan.samples, len(assembly.description.responses) * len(assembly.frequency)
    array, dtype = ARRAYS[plan.storage]
    chunk = max(1, min(samples, int(_CHUNK_BYTES / (np.dtype(dtype).itemsize * lines))))
    temporary = temporary_path(folder)
    temporary.mkdir()  # an error where something is there, be it a link
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


def _fill(folder: Path, assembly: Assembly, shard: tuple[int, int], scheduler: str | None, progress: Progress) -> None:
    """Compute the missing chunks of a shard, every n-th. Each is written while the next is computed."""
    import zarr

    for unfinished in folder.rglob("*.partial"):  # files of a killed run
        unfinished.unlink(missing_ok=True)
    dataset = Dataset(folder)
    group: Any = zarr.open_group(folder, mode="r+", zarr_format=3, use_consolidated=False)
    parameters, frfs, flags = dataset.parameters, group[ARRAYS[dataset.storage][0]], group["written"]
    compute = Assembly.accelerance_amplitude if dataset.storage == "amplitude" else complex_accelerance
    chunk, samples = frfs.chunks[0], len(parameters)
    complete = dataset.amplitude.complete_chunks()
    chunk_numbers = range(shard[0] - 1, len(complete), shard[1])
    missing = [index for index in chunk_numbers if not complete[index]]
    size = sum(min(chunk, samples - index * chunk) for index in chunk_numbers)
    done = size - sum(min(chunk, samples - index * chunk) for index in missing)
    progress("generate", done, size)

    def write(index: int, values: NDArray[Any]) -> None:
        frfs[index * chunk : index * chunk + len(values)] = values
        flags[index] = 1

    work, blocks = partial(compute, assembly), (parameters[index * chunk : (index + 1) * chunk] for index in missing)
    local = ((number, work(block)) for number, block in enumerate(blocks))
    computed = local if scheduler is None else on_cluster(work, blocks, scheduler)
    with closing(computed), ThreadPoolExecutor(max_workers=1) as writer:
        pending: Future[None] | None = None
        for number, values in computed:
            if pending is not None:
                pending.result()
            pending = writer.submit(write, missing[number], values)
            done += len(values)
            progress("generate", done, size)
        if pending is not None:
            pending.result()


def complex_accelerance(assembly: Assembly, theta: NDArray[np.float64]) -> NDArray[np.complex64]:
    """Return the complex accelerance in single precision, for all responses.

    Parameters
    ----------
    assembly : Assembly
    theta : (n, n_params) array
        SI.

    Returns
    -------
    (n, n_responses n_freq) complex64 array
        m/(N s^2); the lines of the first response, then those of the second.
    """
    frfs = []
    for at_response, response in zip(assembly.each_response, assembly.description.responses, strict=True):
        factor = conversion(at_response.frequency, response.quantity, "accelerance")
        frfs.append((at_response.frf(theta) * factor).astype(np.complex64))
    return frfs[0] if len(frfs) == 1 else np.concatenate(frfs, axis=1)
