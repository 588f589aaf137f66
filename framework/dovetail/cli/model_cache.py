"""Trained models in the user's cache folder, named by a hash of what they were trained from."""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from dovetail.cli.terminal import note, progress_bars

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.identification import Identifier

VARIABLE = "DOVETAIL_CACHE_DIR"
"""Environment variable that names another folder."""


def cache_folder() -> Path:
    """Return the folder of the cache."""
    from platformdirs import user_cache_dir

    return Path(os.environ.get(VARIABLE) or user_cache_dir("dovetail")) / "models"


def kept_model(assembly: Assembly, plugins: Sequence[Path]) -> Identifier | None:
    """Return the cached model of the same description, or None."""
    models = cache_folder()
    if not models.exists() or not _is_private(models):
        return None
    return _kept(models.resolve() / _key(assembly, plugins), assembly, plugins, "it is left out")


def trained_model(assembly: Assembly, plugins: Sequence[Path], *, retrain: bool) -> Identifier:
    """Return a model of an assembly: the cached one of the same description, or a newly trained one.

    Parameters
    ----------
    assembly : Assembly
    plugins : sequence of Path
        The plugin files with its components.
    retrain : bool
        Train even if there is a cached model.

    Returns
    -------
    Identifier
    """
    from dovetail.atomic_files import locked

    models = cache_folder()
    with suppress(OSError):  # without a place for it the work goes on
        models.parent.mkdir(parents=True, exist_ok=True)
        models.mkdir(mode=0o700, exist_ok=True)
    if models.exists() and not _is_private(models):
        return _newly_trained(assembly, "it is not kept")
    folder = models.resolve() / _key(assembly, plugins)

    def waiting(other: str) -> None:
        note(f"{other} is at work on the model of '{assembly.name}'; waiting for it.")

    with locked(folder.with_suffix(".training"), wait=-1, on_wait=waiting):
        model = None if retrain else _kept(folder, assembly, plugins, "training anew")
        if model is None:
            model = _newly_trained(assembly, "it is kept for the next time")
            _keep(model, folder)
        return model


def _newly_trained(assembly: Assembly, what_then: str) -> Identifier:
    from dovetail import train

    samples = assembly.description.identification.samples
    note(f"Training a network for '{assembly.name}' on {samples} simulated FRFs; {what_then}.")
    with progress_bars() as progress:
        return train(assembly, progress=progress)


def _is_private(models: Path) -> bool:
    """Return whether only this user can have put models into a folder; print why if others can.

    A model is trusted as far as whoever wrote it: another user's would give whatever results its author wishes.
    """
    if (user := _user()) is None:  # where a user's folder is the user's own
        return True
    try:
        status = models.stat()
    except OSError as error:
        note(f"The kept models in {models} are not used: {error.strerror}.")
        return False
    if not stat.S_ISDIR(status.st_mode):
        return True  # which is reported where a model is written
    reason, remedy = "", ""
    if status.st_uid != user:
        reason, remedy = "the folder belongs to another user", f"Name a folder of your own by {VARIABLE}"
    elif status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        reason, remedy = "other users can write in the folder", "Remove it, or make it your own by chmod 700"
    if reason:
        note(f"The kept models in {models} are not used: {reason}. {remedy}.")
    return not reason


def _user() -> int | None:
    """Return the id of the user of this process, or None where files have no such owner."""
    ask = getattr(os, "geteuid", None)
    return None if ask is None else int(ask())


def _kept(folder: Path, assembly: Assembly, plugins: Sequence[Path], otherwise: str) -> Identifier | None:
    """Return the cached model in a folder, or None if there is none of this assembly that can be used."""
    from dovetail import load_model
    from dovetail.errors import BundleError

    if not folder.exists():
        return None
    try:
        model = load_model(folder, plugins=plugins)
        is_own = _user() in (None, os.lstat(folder).st_uid)
        if not is_own or model.assembly.description.fingerprint != assembly.description.fingerprint:
            raise BundleError(f"{folder}: this is not the model that was kept for '{assembly.name}'.")
    except BundleError:
        note(f"The model kept in {folder} cannot be used; {otherwise}.")
        return None
    note(f"Using the model trained before from this description ({folder}); --retrain trains anew.")
    return model


def _key(assembly: Assembly, plugins: Sequence[Path]) -> str:
    """Return a hash of everything that the model depends on."""
    from dovetail.interfaces import source_file
    from dovetail.provenance import component_sources, file_hash, package_versions

    settings = assembly.description.identification
    code = sorted({Path(file) for one in (settings.reducer, settings.regressor) if (file := source_file(one))})
    files = (*plugins, *code, *map(Path, assembly.description.files.values()))
    origin = {
        "description": assembly.description.text,
        "dovetail": package_versions().get("dovetail-frf"),
        "components": component_sources(assembly),
        "files": [file_hash(file) for file in files],
    }
    return hashlib.sha256(json.dumps(origin, sort_keys=True).encode()).hexdigest()[:32]


def _keep(model: Identifier, folder: Path) -> None:
    """Save a model in the cache, or print why that is impossible."""
    from dovetail.errors import BundleError

    try:
        model.save(folder)
    except (BundleError, OSError) as error:
        note(f"The model is not kept: {error}")
