"""The manifest of a model bundle: the description of a bundle, checked before use."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from dovetail.errors import BundleError, Fault
from dovetail.network.evaluation import Evaluation

MANIFEST = "manifest.json"
_ACCEPTED = "a folder that 'dovetail train' wrote, or a description (YAML)"
FORMAT: Final = "dovetail-model"
VERSION: Final = 3
"""Of the format; a model of a later one is refused."""

TRAIN_AGAIN = "Train the model again, or get a fresh copy."

Section = Literal["reducer", "feature_scaling", "regressor", "target_scaling", "check", "novelty", "corrections"]
SECTIONS: tuple[Section, ...] = get_args(Section)
"""Each section keeps its arrays in ``<section>.safetensors`` and its plain values in the manifest."""
OPTIONAL = ("novelty", "corrections")
"""Sections that only some models have."""

_LARGEST_MANIFEST = 16 * 2**20
"""Bytes; far above the manifest of any real model."""

PlainValue = bool | int | float | str


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class TensorFile(_Strict):
    """A safetensors file: its SHA-256, and each array in it as ``float32[10, 64]``."""

    sha256: str
    arrays: dict[str, str]


class Manifest(_Strict):
    """The manifest of a bundle.

    Attributes
    ----------
    format, version
        Format and its version.
    description : str
        The assembly's description as JSON.
    parameters : tuple of str
        Names, in the order of the network's outputs.
    components, packages : dict of str to str
        Source of each component, and versions of the packages at training.
    values : dict of str to dict
        Plain values of each section's state.
    files : dict of str to TensorFile
        Arrays of each section's state.
    evaluation : Evaluation
    sha256 : str
        Hash of all other entries. It detects damage and manual changes, but not deliberate forgery.
    """

    format: Literal["dovetail-model"]
    version: Literal[3]
    description: str
    parameters: tuple[str, ...]
    components: dict[str, str]
    packages: dict[str, str]
    values: dict[Section, dict[str, PlainValue]]
    files: dict[Section, TensorFile]
    evaluation: Evaluation
    sha256: str | None = None

    @property
    def sections(self) -> tuple[Section, ...]:
        """The sections that the bundle must have."""
        return tuple(section for section in SECTIONS if section not in OPTIONAL or section in self.files)


def manifest_hash(manifest: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a manifest's entries but the hash itself."""
    entries = {key: entry for key, entry in manifest.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()


def is_bundle(folder: Path) -> bool:
    """Return whether a folder has the manifest of a model bundle, sound or damaged."""
    try:
        return _header(folder).get("format") == FORMAT
    except BundleError:
        return False


def read_manifest(folder: Path) -> Manifest:
    """Read and check the manifest of a bundle.

    Raises
    ------
    BundleError
        It is missing, damaged, of another program or of a newer format.
    """
    header = _header(folder)
    where = str(folder / MANIFEST)
    if header.get("format") != FORMAT:
        problem = f"this is not a model of dovetail (its format is {header.get('format')!r})."
        raise BundleError(Fault(where, problem, f"the folder that 'dovetail train' wrote, of the format '{FORMAT}'"))
    version = header.get("version")
    if type(version) is int and version > VERSION:
        packages = header.get("packages", {})
        maker = packages.get("dovetail-frf", "a newer dovetail") if isinstance(packages, dict) else "a newer dovetail"
        problem = f"the model has the format version {version}, written by dovetail-frf {maker}."
        remedy = "Upgrade dovetail-frf, or train the model again."
        raise BundleError(Fault(where, problem, f"version {VERSION}", remedy))
    try:
        manifest = Manifest.model_validate_json(json.dumps(header))
    except (ValidationError, ValueError, RecursionError) as error:
        raise BundleError(*_faults(where, error)) from None
    if manifest.sha256 != manifest_hash(header):
        raise damaged(folder / MANIFEST, "the manifest is not the one that was written with the model.")
    return manifest


def damaged(file: Path, problem: str) -> BundleError:
    """Return the error for a bundle that cannot be used, because of one of its files."""
    return BundleError(Fault(str(file), problem, remedy=TRAIN_AGAIN))


def _header(folder: Path) -> dict[str, Any]:
    file = folder / MANIFEST
    if not folder.is_dir():
        raise BundleError(Fault(str(folder), "there is no such model folder."))
    if not file.is_file():
        raise BundleError(
            Fault(str(folder), f"this folder has no {MANIFEST}, so it is not a trained network.", _ACCEPTED)
        )
    try:
        if file.stat().st_size > _LARGEST_MANIFEST:
            raise BundleError(Fault(str(file), f"the manifest is longer than {_LARGEST_MANIFEST} bytes."))
        header = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise damaged(file, f"the manifest cannot be read: {error}.") from None
    if not isinstance(header, dict):
        raise damaged(file, "the manifest is not a JSON object.")
    return header


def _faults(where: str, error: Exception) -> list[Fault]:
    if not isinstance(error, ValidationError):
        return [Fault(where, f"the manifest cannot be used: {error}.", remedy=TRAIN_AGAIN)]
    return [
        Fault(f"{where}  {'.'.join(str(key) for key in fault['loc'])}", f"{fault['msg']}.", remedy=TRAIN_AGAIN)
        for fault in error.errors()
    ]
