"""A trained network, and its bundle: a folder with a manifest in JSON and arrays in safetensors, no code."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly import FRF_TOLERANCE, Assembly, largest_frf_difference, load
from dovetail.atomic_files import new_folder
from dovetail.errors import BundleError, DescriptionError, Fault, FileError, MeasurementError, PluginError, listing
from dovetail.interfaces import ComponentState, FittedReducer, FittedRegressor, Reducer, Regressor, plugin_errors
from dovetail.interfaces.component import check_contract, component_label
from dovetail.network.correction import correction_states, restore_corrections
from dovetail.network.evaluation import Evaluation
from dovetail.network.known_noise import KnownNoise
from dovetail.network.manifest import (
    FORMAT,
    MANIFEST,
    SECTIONS,
    TRAIN_AGAIN,
    Manifest,
    PlainValue,
    Section,
    TensorFile,
    damaged,
    is_bundle,
    manifest_hash,
    read_manifest,
)
from dovetail.network.novelty import Novelty
from dovetail.network.pipeline import Network
from dovetail.network.preprocessing import TargetScaling, ZScore
from dovetail.provenance import component_sources, file_hash, package_versions
from dovetail.registry import PluginPaths

FILES = "files"
"""Folder of the files that the description names, each under its SHA-256."""
_CHECK_FRACTIONS = (0.3, 0.5, 0.7)
"""Fractions of the parameters' ranges at which FRFs and predictions are stored, to be compared after loading."""

_CHECK_TOLERANCE = 0.01
"""Part of a parameter's range by which those predictions may differ on another machine."""


@dataclass(frozen=True, eq=False)
class TrainedNetwork:
    """A trained network with the assembly it was trained for.

    Parameters
    ----------
    assembly : Assembly
    network : Network
    evaluation : Evaluation
        Its accuracy on the test part of its dataset.
    novelty : Novelty or None
        Statistics of its training FRFs; None with several responses.
    """

    assembly: Assembly
    network: Network
    evaluation: Evaluation
    novelty: Novelty | None = None

    @cached_property
    def known_noise(self) -> KnownNoise | None:
        """The noise of its training; None if the file of a measured noise is missing."""
        with suppress(MeasurementError, FileError):
            return KnownNoise.from_description(self.assembly)
        return None

    def predict_parameters(self, amplitude: ArrayLike) -> NDArray[np.float64]:
        """Predict parameters from the amplitude of the accelerance, on the assembly's frequencies.

        Parameters
        ----------
        amplitude : (n_samples, n_responses n_freq) array
            m/(N s^2); the lines of a second response follow those of the first.

        Returns
        -------
        (n_samples, n_params) array
            SI values, in the order of ``assembly.parameters``; not confined to their ranges.

        Raises
        ------
        MeasurementError
            The shape is wrong, or values are negative or not finite.
        """
        return self.network.predict(self._checked(amplitude))

    def predict_samples(self, amplitude: ArrayLike) -> NDArray[np.float64] | None:
        """Draw samples of the parameters from the amplitude of one FRF's accelerance.

        Parameters
        ----------
        amplitude : (n_responses n_freq,) array
            m/(N s^2), as a row of those that `predict_parameters` takes.

        Returns
        -------
        (n_draws, n_params) array or None
            SI values of equal weight; None if the regressor predicts values without a distribution.

        Raises
        ------
        MeasurementError
            As in `predict_parameters`.
        """
        return self.network.predict_samples(self._checked(np.asarray(amplitude)[np.newaxis])[0])

    def _checked(self, amplitude: ArrayLike) -> NDArray[np.float32]:
        rows = np.asarray(amplitude, dtype=np.float32)
        lines = len(self.assembly.description.responses) * len(self.assembly.frequency)
        if rows.ndim != 2 or rows.shape[0] == 0 or rows.shape[1] != lines:
            raise MeasurementError(
                Fault("", f"the amplitudes have the shape {rows.shape}.", f"(n_samples, {lines}), one row an FRF")
            )
        if not (np.isfinite(rows).all() and np.all(rows >= 0)):
            raise MeasurementError("an amplitude is negative or not finite.")
        return rows


def write_bundle(trained: TrainedNetwork, path: str | Path) -> Path:
    """Write a model to the folder `path`, complete or not at all.

    Raises
    ------
    BundleError
        `path` is not a model, or cannot be written.
    PluginError
        A component's state contains other objects than arrays and plain values.
    """
    from safetensors import SafetensorError

    target = Path(path)
    check_replaceable(target)
    states = _states(trained)
    try:
        arrays = {f"{section}.safetensors" for section in SECTIONS}
        with new_folder(target, arrays, last=MANIFEST) as fresh:
            _write(fresh, trained, states)
    except (FileError, SafetensorError, ValueError) as error:
        reason = error.faults[0].problem if isinstance(error, FileError) else f"{error}."
        raise BundleError(Fault(str(target), f"the model cannot be written: {reason}")) from error
    return target


def read_bundle(path: str | Path, *, plugins: PluginPaths) -> TrainedNetwork:
    """Read the model that `write_bundle` wrote; parameters and errors as `dovetail.load_model` has them."""
    folder = Path(path)
    manifest = read_manifest(folder)
    states = {section: _read_state(folder, manifest, section) for section in manifest.sections}
    assembly = _assembly(folder, manifest, plugins)
    try:
        network = _network(assembly, states)
        novelty = Novelty.restore(states["novelty"]) if "novelty" in states else None
        differences = _prediction_differences(assembly, network, states["check"])
    except (Exception, SystemExit) as error:  # a component may raise anything on a foreign state
        reason = f"{type(error).__name__}: {error}"
        raise damaged(folder, f"the model cannot be rebuilt from its arrays ({reason}).") from error
    if not np.all(differences <= _CHECK_TOLERANCE):
        worst = float(np.max(differences))
        problem = f"the model's predictions differ from those after its training, by {worst:.3g} of a range."
        packages = ", ".join(f"{name} {version}" for name, version in manifest.packages.items())
        raise BundleError(Fault(str(folder), problem, remedy=f"It was trained with {packages}. {TRAIN_AGAIN}"))
    _check_frfs(folder, manifest, assembly, states["check"])
    return TrainedNetwork(assembly, network, manifest.evaluation, novelty)


def _check_frfs(folder: Path, manifest: Manifest, assembly: Assembly, state: Mapping[str, Any]) -> None:
    """Check that the assembly still has the FRFs that are stored in the bundle."""
    fractions = _check_vectors(assembly)
    difference = largest_frf_difference(assembly, assembly.from_unit(fractions), state["amplitude"])
    if difference > FRF_TOLERANCE:
        sources = listing(f"{name} ({source})" for name, source in manifest.components.items())
        problem = (
            "the assembly has other FRFs than when the model was trained (they differ by up to "
            f"{100 * difference:.2g} %): the code of a component has changed."
        )
        remedy = f"Train the model again, or use the versions that made it: {sources}."
        raise BundleError(Fault(str(folder), problem, remedy=remedy))


def _check_vectors(assembly: Assembly) -> NDArray[np.float64]:
    """Return the parameter vectors of the FRFs in a bundle, as fractions of the ranges."""
    return np.repeat(np.array(_CHECK_FRACTIONS)[:, np.newaxis], len(assembly.parameters), axis=1)


def check_replaceable(target: Path) -> None:
    """Raise BundleError if `target` exists and is not a model."""
    if target.exists() and not is_bundle(target) and not (target.is_dir() and not any(target.iterdir())):
        problem = "this path exists and is not a model."
        raise BundleError(Fault(str(target), problem, remedy="Choose another folder."))


def _write(folder: Path, trained: TrainedNetwork, states: Mapping[Section, ComponentState]) -> None:
    files: dict[Section, TensorFile] = {}
    values: dict[Section, dict[str, PlainValue]] = {}
    for section, state in states.items():
        arrays, values[section] = _split_state(f"state of the {section}", state)
        files[section] = _write_tensors(folder / f"{section}.safetensors", arrays)
    manifest = Manifest(
        format=FORMAT,
        version=3,
        description=_packed_description(folder, trained.assembly),
        parameters=tuple(parameter.name for parameter in trained.assembly.parameters),
        components=component_sources(trained.assembly),
        packages=package_versions(),
        values=values,
        files=files,
        evaluation=trained.evaluation,
    )
    entries = manifest.model_dump()
    text = json.dumps({**entries, "sha256": manifest_hash(entries)}, indent=1, allow_nan=False)
    (folder / MANIFEST).write_text(text + "\n", encoding="utf-8")
    for section in states:  # safetensors lets only the owner read
        shutil.copymode(folder / MANIFEST, folder / f"{section}.safetensors")


def _packed_description(folder: Path, assembly: Assembly) -> str:
    """Copy the files of a description into the model, and return the description with their new names."""
    whole = json.loads(assembly.description.text)
    for (*steps, option), file in assembly.description.files.items():
        section = reduce(lambda parent, step: parent[step], steps, whole)
        copy = folder / FILES / f"{file_hash(Path(file))}{Path(file).suffix.lower()}"
        copy.parent.mkdir(exist_ok=True)
        shutil.copyfile(file, copy)
        section[option] = f"{FILES}/{copy.name}"
    return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False)


def _states(trained: TrainedNetwork) -> dict[Section, ComponentState]:
    network = trained.network
    states: dict[Section, ComponentState] = {
        "reducer": _plugin_state(network.reducer, network.recipes[0]),
        "feature_scaling": network.feature_scaling.state(),
        "regressor": _plugin_state(network.regressor, network.recipes[1]),
        "target_scaling": network.target_scaling.state(),
        "check": _check_state(trained),
    }
    if network.corrections:
        for correction in network.corrections:
            _plugin_state(correction.regressor, network.recipes[1])
        states["corrections"] = correction_states(network.corrections)
    if trained.novelty is not None:
        states["novelty"] = trained.novelty.state()
    return states


def _plugin_state(fitted: FittedReducer | FittedRegressor, recipe: Reducer | Regressor) -> ComponentState:
    """Return the state of a plugin's fitted object, after checking that it can be restored.

    Raises
    ------
    PluginError
        `state` or `restore` fails, or the state contains other objects than arrays and plain values by name.
    """
    label = component_label(recipe)
    with plugin_errors(fitted, label):
        state = fitted.state()
        if not isinstance(state, Mapping) or not all(isinstance(name, str) for name in state):
            names = [repr(name) for name in state] if isinstance(state, Mapping) else []
            problem = f"its state has the names {listing(names)}." if names else f"its state is {state!r:.60}."
            raise PluginError(Fault(label, problem, "a dict from names to arrays and plain values"))
        arrays, values = _split_state(label, state)
        if "__metadata__" in arrays:
            raise PluginError(Fault(label, "a state cannot contain the name '__metadata__'.", "another name"))
        for name, value in values.items():
            if isinstance(value, float) and not math.isfinite(value):
                raise PluginError(Fault(label, f"'{name}' of its state is {value}.", "a finite number, or an array"))
            json.dumps(value, ensure_ascii=False).encode()
    with plugin_errors(recipe, label):
        restored = recipe.restore({**arrays, **values})
        check_contract(restored, recipe, type(fitted), "restore")
    return state


def _check_state(trained: TrainedNetwork) -> ComponentState:
    """Return a few FRFs of the assembly and the network's predictions from them."""
    assembly = trained.assembly
    amplitude = assembly.accelerance_amplitude(assembly.from_unit(_check_vectors(assembly)))
    return {"amplitude": amplitude, "theta": trained.predict_parameters(amplitude)}


def _split_state(where: str, state: ComponentState) -> tuple[dict[str, NDArray[np.generic]], dict[str, PlainValue]]:
    """Split a state into arrays and plain values, and refuse anything else, with a fault at `where`."""
    arrays: dict[str, NDArray[np.generic]] = {}
    values: dict[str, PlainValue] = {}
    for name, value in state.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            arrays[name] = np.asarray(value, dtype=value.dtype.newbyteorder("<"), order="C")
        elif isinstance(value, (bool, int, float, str)):
            values[name] = value
        else:
            kind = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
            problem = f"'{name}' is {kind}, which a bundle cannot store."
            accepted = "arrays of numbers, int, float, str and bool"
            raise PluginError(Fault(where, problem, accepted))
    return arrays, values


def _write_tensors(file: Path, arrays: Mapping[str, NDArray[np.generic]]) -> TensorFile:
    from safetensors.numpy import save_file

    save_file(dict(arrays), file)
    return TensorFile(sha256=file_hash(file), arrays=_shapes(arrays))


def _shapes(arrays: Mapping[str, NDArray[np.generic]]) -> dict[str, str]:
    return {name: f"{array.dtype.name}{list(array.shape)}" for name, array in arrays.items()}


def _read_state(folder: Path, manifest: Manifest, section: Section) -> dict[str, Any]:
    """Return the arrays and plain values of one section."""
    from safetensors import SafetensorError
    from safetensors.numpy import load_file

    file = folder / f"{section}.safetensors"
    if section not in manifest.files or section not in manifest.values:
        raise damaged(folder / MANIFEST, f"the manifest does not list the {section}.")
    if not file.is_file():
        raise damaged(file, "this file of the model is missing.")
    try:
        if file_hash(file) != manifest.files[section].sha256:
            raise damaged(file, "the file does not match the manifest.")
        arrays = load_file(file)
    except (OSError, SafetensorError, ValueError, TypeError, KeyError) as error:
        raise damaged(file, f"the file cannot be read: {error}.") from None
    if _shapes(arrays) != manifest.files[section].arrays:
        raise damaged(file, "its arrays have other shapes than in the manifest.")
    return {**arrays, **manifest.values[section]}


def _assembly(folder: Path, manifest: Manifest, plugins: PluginPaths) -> Assembly:
    file = folder / MANIFEST
    try:
        description = json.loads(manifest.description)
    except (ValueError, RecursionError) as error:
        raise damaged(file, f"its description is not JSON: {error}.") from None
    if not isinstance(description, dict):
        raise damaged(file, "its description is not a JSON object.")
    if "extends" in description:
        raise damaged(file, "its description refers to a file outside the model.")
    for copy in (folder / FILES).glob("*"):
        if not copy.is_file() or file_hash(copy) != copy.stem:
            raise damaged(copy, "the content of the file does not match its name.")
    try:
        assembly = load(description, plugins=plugins, files_in=folder)
    except DescriptionError as error:
        components = [
            f"{name} ({source})" for name, source in manifest.components.items() if "dovetail-frf" not in source
        ]
        remedy = f"The model uses {listing(components)}: install it, or name its plugin file."
        remedy = remedy if components else TRAIN_AGAIN
        faults = [Fault(f"{file}  {fault.where}", fault.problem, fault.accepted, remedy) for fault in error.faults]
        raise BundleError(*faults) from error
    names = tuple(parameter.name for parameter in assembly.parameters)
    if names != manifest.parameters:
        problem = f"the model's parameters ({listing(manifest.parameters)}) are not those of its description."
        raise BundleError(Fault(str(file), problem, listing(names), TRAIN_AGAIN))
    return assembly


def _network(assembly: Assembly, states: Mapping[Section, Mapping[str, Any]]) -> Network:
    settings = assembly.description.identification
    target_scaling = TargetScaling.restore(states["target_scaling"])
    return Network(
        settings.reducer.restore(states["reducer"]),
        ZScore.restore(states["feature_scaling"]),
        settings.regressor.restore(states["regressor"]),
        target_scaling,
        (settings.reducer, settings.regressor),
        restore_corrections(states.get("corrections", {}), assembly, target_scaling, settings.regressor),
    )


def _prediction_differences(assembly: Assembly, network: Network, state: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the differences of predictions from the stored ones, in fractions of the ranges."""
    amplitude, theta = state["amplitude"], state["theta"]
    shape = len(_CHECK_FRACTIONS), len(assembly.description.responses) * len(assembly.frequency)
    if amplitude.shape != shape or theta.shape != (len(amplitude), len(assembly.parameters)):
        raise ValueError(f"predictions of the shape {theta.shape} for FRFs of the shape {amplitude.shape}")
    return np.abs(assembly.to_unit(network.predict(amplitude)) - assembly.to_unit(theta))
