"""What a model bundle says about itself, checked before anything is believed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from dovetail.errors import BundleError, Fault
from dovetail.identification.metrics import Evaluation

__all__ = [
    "FORMAT",
    "LATER",
    "MANIFEST",
    "PARTS",
    "VERSION",
    "Manifest",
    "Part",
    "Plain",
    "TensorFile",
    "is_bundle",
    "read_manifest",
]

MANIFEST = "manifest.json"
FORMAT: Final = "dovetail-model"
VERSION: Final = 2

Part = Literal["reducer", "feature_scaling", "regressor", "target_scaling", "check", "novelty"]
PARTS: tuple[Part, ...] = get_args(Part)
"""Each part keeps its arrays in ``<part>.safetensors`` and its plain values in the manifest."""

LATER: Mapping[Part, int] = {"novelty": 2}
"""Parts that bundles of an earlier version than this do not have."""

_LONGEST = 16 * 2**20
"""Bytes; the manifest of a real model stays far below."""

Plain = bool | int | float | str


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
        What kind of bundle this is; version 1 has no `novelty`.
    description : str
        The assembly's description as JSON.
    parameters : tuple of str
        Names, in the order of the network's outputs.
    components, packages : dict of str to str
        Who offers each component, and the versions the model was made with.
    values : dict of str to dict
        Plain values of each part's state.
    files : dict of str to TensorFile
        Arrays of each part's state.
    evaluation : Evaluation
    """

    format: Literal["dovetail-model"]
    version: Literal[1, 2]
    description: str
    parameters: tuple[str, ...]
    components: dict[str, str]
    packages: dict[str, str]
    values: dict[Part, dict[str, Plain]]
    files: dict[Part, TensorFile]
    evaluation: Evaluation


def is_bundle(folder: Path) -> bool:
    """Return whether a folder says that it is a model bundle, sound or not."""
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
    place = str(folder / MANIFEST)
    if header.get("format") != FORMAT:
        problem = f"this is not a model of dovetail (its format is {header.get('format')!r})."
        raise BundleError(Fault(place, problem, f"the folder that 'dovetail train' wrote, of the format '{FORMAT}'"))
    version = header.get("version")
    if type(version) is int and version > VERSION:
        made = header.get("packages", {})
        maker = made.get("dovetail-frf", "a newer dovetail") if isinstance(made, dict) else "a newer dovetail"
        problem = f"the model has the format version {version}, written by dovetail-frf {maker}."
        raise BundleError(
            Fault(place, problem, f"version {VERSION}", "Upgrade dovetail-frf, or train the model again.")
        )
    try:
        return Manifest.model_validate_json(json.dumps(header))
    except (ValidationError, ValueError, RecursionError) as error:
        raise BundleError(*_faults(place, error)) from None


def _header(folder: Path) -> dict[str, Any]:
    file = folder / MANIFEST
    if not folder.is_dir():
        raise BundleError(Fault(str(folder), "there is no such model folder."))
    if not file.is_file():
        raise BundleError(Fault(str(folder), f"this folder has no {MANIFEST}, so it is not a model of dovetail."))
    try:
        if file.stat().st_size > _LONGEST:
            raise BundleError(Fault(str(file), f"the manifest is longer than {_LONGEST} bytes."))
        header = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise BundleError(Fault(str(file), f"the manifest cannot be read: {error}.", remedy=_AGAIN)) from None
    if not isinstance(header, dict):
        raise BundleError(Fault(str(file), "the manifest is not a JSON object.", remedy=_AGAIN))
    return header


def _faults(place: str, error: Exception) -> list[Fault]:
    if not isinstance(error, ValidationError):
        return [Fault(place, f"the manifest cannot be used: {error}.", remedy=_AGAIN)]
    return [
        Fault(f"{place}  {'.'.join(str(key) for key in fault['loc'])}", f"{fault['msg']}.", remedy=_AGAIN)
        for fault in error.errors()
    ]


_AGAIN = "Train the model again, or get a fresh copy."
