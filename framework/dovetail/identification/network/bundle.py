"""The model bundle: a folder with a manifest in JSON and arrays in safetensors, nothing that could be code."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import SAME, Assembly, PluginPaths, largest_difference, load
from dovetail.errors import BundleError, DescriptionError, Fault, PluginError, listing
from dovetail.identification.network.manifest import (
    FORMAT,
    LATER,
    MANIFEST,
    PARTS,
    VERSION,
    Manifest,
    Part,
    Plain,
    TensorFile,
    is_bundle,
    read_manifest,
)
from dovetail.identification.network.network import Network
from dovetail.identification.network.novelty import Novelty
from dovetail.identification.network.preprocessing import TargetScaling, ZScore
from dovetail.identification.network.trained_network import TrainedNetwork
from dovetail.identification.provenance import component_sources, package_versions
from dovetail.interfaces import State

__all__ = ["read_bundle", "write_bundle"]

_CHECK_FRACTIONS = (0.3, 0.5, 0.7)
"""Where in the parameters' ranges the answers lie that a bundle carries to be compared after loading."""

_CHECK_TOLERANCE = 0.01
"""Part of a parameter's range by which those answers may differ on another machine."""

_REMEDY = "Train the model again, or get a fresh copy."


def write_bundle(trained: TrainedNetwork, path: str | Path) -> Path:
    """Write a model to the folder `path`, complete or not at all.

    Raises
    ------
    BundleError
        Something else than a model is at `path`, or it cannot be written.
    PluginError
        A component's state is more than arrays and plain values.
    """
    target = Path(path)
    _check_replaceable(target)
    states = _states(trained)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}-") as workplace:
            fresh = Path(workplace) / "new"
            fresh.mkdir()
            _write(fresh, trained, states)
            _put(fresh, target, Path(workplace) / "old")
    except (OSError, ValueError) as error:
        raise BundleError(Fault(str(target), f"the model cannot be written: {error}.")) from error
    return target


def read_bundle(path: str | Path, *, plugins: PluginPaths = ()) -> TrainedNetwork:
    """Read the model that `write_bundle` wrote; parameters and errors as `dovetail.load_model` has them."""
    folder = Path(path)
    manifest = read_manifest(folder)
    parts = [part for part in PARTS if manifest.version >= LATER.get(part, 1)]
    states = {part: _read_state(folder, manifest, part) for part in parts}
    assembly = _assembly(folder, manifest, plugins)
    try:
        network = _network(assembly, states)
        novelty = Novelty.restore(states["novelty"]) if "novelty" in states else None
        differences = _check(assembly, network, states["check"])
    except Exception as error:  # a component may raise anything on a state that is not its own
        reason = f"{type(error).__name__}: {error}"
        problem = f"the model cannot be rebuilt from its arrays ({reason})."
        raise BundleError(Fault(str(folder), problem, remedy=_REMEDY)) from error
    if not np.all(differences <= _CHECK_TOLERANCE):
        worst = float(np.max(differences))
        problem = f"the model's answers differ from those it gave when it was trained, by {worst:.3g} of a range."
        raise BundleError(Fault(str(folder), problem, remedy=f"{_made_with(manifest)} {_REMEDY}"))
    _check_frfs(folder, manifest, assembly, states["check"])
    return TrainedNetwork(assembly, network, manifest.evaluation, novelty)


def _made_with(manifest: Manifest) -> str:
    return f"It was trained with {', '.join(f'{name} {version}' for name, version in manifest.packages.items())}."


def _check_frfs(folder: Path, manifest: Manifest, assembly: Assembly, state: Mapping[str, Any]) -> None:
    """Compute again the FRFs that were put to the network when the model was saved."""
    fractions = _check_vectors(assembly)
    difference = largest_difference(assembly, assembly.from_unit(fractions), state["amplitude"])
    if difference > SAME:
        sources = listing(f"{name} ({source})" for name, source in manifest.components.items())
        problem = (
            "the assembly gives other FRFs now than when the model was trained (they differ by up to "
            f"{100 * difference:.2g} %): the code of a component has changed."
        )
        remedy = f"Train the model again, or go back to what it was made with: {sources}."
        raise BundleError(Fault(str(folder), problem, remedy=remedy))


def _check_vectors(assembly: Assembly) -> NDArray[np.float64]:
    """Return the parameter vectors of the FRFs that a bundle carries, as fractions of the ranges."""
    return np.repeat(np.array(_CHECK_FRACTIONS)[:, np.newaxis], len(assembly.parameters), axis=1)


def _check_replaceable(target: Path) -> None:
    if not target.exists() or is_bundle(target) or (target.is_dir() and not any(target.iterdir())):
        return
    raise BundleError(
        Fault(str(target), "something else than a model is there already.", remedy="Choose another folder.")
    )


def _put(fresh: Path, target: Path, old: Path) -> None:
    """Move a complete folder to its place; what was there stays there if that fails."""
    if not target.exists():
        fresh.rename(target)
        return
    target.rename(old)
    try:
        fresh.rename(target)
    except BaseException:  # Ctrl-C too: the model that was there comes back
        old.rename(target)
        raise


def _write(folder: Path, trained: TrainedNetwork, states: Mapping[Part, State]) -> None:
    files: dict[Part, TensorFile] = {}
    values: dict[Part, dict[str, Plain]] = {}
    for part, state in states.items():
        arrays, values[part] = _parted(part, state)
        files[part] = _write_tensors(folder / f"{part}.safetensors", arrays)
    manifest = Manifest(
        format=FORMAT,
        version=VERSION if trained.novelty is not None else 1,
        description=trained.assembly.description.text,
        parameters=tuple(parameter.name for parameter in trained.assembly.parameters),
        components=component_sources(trained.assembly),
        packages=package_versions(),
        values=values,
        files=files,
        evaluation=trained.evaluation,
    )
    text = json.dumps(manifest.model_dump(), indent=1, allow_nan=False)
    (folder / MANIFEST).write_text(text + "\n", encoding="utf-8")
    for part in states:  # safetensors lets only the owner read
        shutil.copymode(folder / MANIFEST, folder / f"{part}.safetensors")


def _states(trained: TrainedNetwork) -> dict[Part, State]:
    network = trained.network
    states: dict[Part, State] = {
        "reducer": network.reducer.state(),
        "feature_scaling": network.feature_scaling.state(),
        "regressor": network.regressor.state(),
        "target_scaling": network.target_scaling.state(),
        "check": _answers(trained),
    }
    if trained.novelty is not None:
        states["novelty"] = trained.novelty.state()
    return states


def _answers(trained: TrainedNetwork) -> State:
    """Return a few FRFs of the assembly and what the network answers to them."""
    assembly = trained.assembly
    amplitude = assembly.accelerance_amplitude(assembly.from_unit(_check_vectors(assembly)))
    return {"amplitude": amplitude, "theta": trained.predict_parameters(amplitude)}


def _parted(part: str, state: State) -> tuple[dict[str, NDArray[np.generic]], dict[str, Plain]]:
    """Part a state into arrays and plain values, and refuse anything else."""
    arrays: dict[str, NDArray[np.generic]] = {}
    values: dict[str, Plain] = {}
    for name, value in state.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            arrays[name] = np.asarray(value, dtype=value.dtype.newbyteorder("<"), order="C")
        elif isinstance(value, (bool, int, float, str)):
            values[name] = value
        else:
            kind = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
            raise PluginError(
                Fault(
                    f"state of the {part}",
                    f"'{name}' is {kind}, which a bundle cannot hold.",
                    "arrays of numbers, int, float, str and bool",
                )
            )
    return arrays, values


def _write_tensors(file: Path, arrays: Mapping[str, NDArray[np.generic]]) -> TensorFile:
    from safetensors.numpy import save_file

    save_file(dict(arrays), file)
    return TensorFile(sha256=_digest(file), arrays=_shapes(arrays))


def _shapes(arrays: Mapping[str, NDArray[np.generic]]) -> dict[str, str]:
    return {name: f"{array.dtype.name}{list(array.shape)}" for name, array in arrays.items()}


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _read_state(folder: Path, manifest: Manifest, part: Part) -> dict[str, Any]:
    """Return the arrays and plain values of one part."""
    from safetensors import SafetensorError
    from safetensors.numpy import load_file

    file = folder / f"{part}.safetensors"
    if part not in manifest.files or part not in manifest.values:
        raise BundleError(Fault(str(folder / MANIFEST), f"the manifest does not list the {part}.", remedy=_REMEDY))
    if not file.is_file():
        raise BundleError(Fault(str(file), "this file of the model is missing.", remedy=_REMEDY))
    try:
        if _digest(file) != manifest.files[part].sha256:
            raise BundleError(Fault(str(file), "the file is not the one the manifest describes.", remedy=_REMEDY))
        arrays = load_file(file)
    except (OSError, SafetensorError, ValueError, TypeError, KeyError) as error:
        raise BundleError(Fault(str(file), f"the file cannot be read: {error}.", remedy=_REMEDY)) from None
    if _shapes(arrays) != manifest.files[part].arrays:
        raise BundleError(Fault(str(file), "its arrays have other shapes than the manifest says.", remedy=_REMEDY))
    return {**arrays, **manifest.values[part]}


def _assembly(folder: Path, manifest: Manifest, plugins: PluginPaths) -> Assembly:
    place = str(folder / MANIFEST)
    try:
        description = json.loads(manifest.description)
    except (ValueError, RecursionError) as error:
        raise BundleError(Fault(place, f"its description is not JSON: {error}.", remedy=_REMEDY)) from None
    if not isinstance(description, dict):
        raise BundleError(Fault(place, "its description is not a JSON object.", remedy=_REMEDY))
    if "extends" in description:
        raise BundleError(Fault(place, "its description refers to a file outside the model.", remedy=_REMEDY))
    try:
        assembly = load(description, plugins=plugins)
    except DescriptionError as error:
        strangers = [
            f"{name} ({source})" for name, source in manifest.components.items() if "dovetail-frf" not in source
        ]
        remedy = f"The model uses {listing(strangers)}: install it, or name its plugin file." if strangers else _REMEDY
        faults = [Fault(f"{place}  {fault.where}", fault.problem, fault.accepted, remedy) for fault in error.faults]
        raise BundleError(*faults) from error
    names = tuple(parameter.name for parameter in assembly.parameters)
    if names != manifest.parameters:
        problem = f"the model's parameters ({listing(manifest.parameters)}) are not those of its description."
        raise BundleError(Fault(place, problem, listing(names), _REMEDY))
    return assembly


def _network(assembly: Assembly, states: Mapping[Part, Mapping[str, Any]]) -> Network:
    settings = assembly.description.identification
    return Network(
        settings.reducer.restore(states["reducer"]),
        ZScore.restore(states["feature_scaling"]),
        settings.regressor.restore(states["regressor"]),
        TargetScaling.restore(states["target_scaling"]),
        (settings.reducer, settings.regressor),
    )


def _check(assembly: Assembly, network: Network, state: Mapping[str, Any]) -> NDArray[np.float64]:
    """Ask again what was answered when the model was saved; return the differences as parts of the ranges."""
    amplitude, theta = state["amplitude"], state["theta"]
    shape = len(_CHECK_FRACTIONS), len(assembly.description.responses) * len(assembly.frequency)
    if amplitude.shape != shape or theta.shape != (len(amplitude), len(assembly.parameters)):
        raise ValueError(f"answers of the shape {theta.shape} to FRFs of the shape {amplitude.shape}")
    return np.abs(assembly.to_unit(network.predict(amplitude)) - assembly.to_unit(theta))
