"""Trained models in the user's cache folder, named by a hash of what they were trained from."""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from platformdirs import user_cache_dir

from dovetail.assembly import Assembly
from dovetail.atomic_files import locked
from dovetail.errors import BundleError
from dovetail.interfaces import source_file
from dovetail.network.bundle import TrainedNetwork, read_bundle, write_bundle
from dovetail.provenance import component_sources, file_hash, package_versions

VARIABLE = "DOVETAIL_CACHE_DIR"
"""Environment variable that names another folder."""


def cache_folder() -> Path:
    """Return the folder of the cache."""
    return Path(os.environ.get(VARIABLE) or user_cache_dir("dovetail")) / "models"


class ModelCache:
    """The trained models of this user.

    Parameters
    ----------
    on_note : callable
        Called with a sentence for the user: which model is used, or why a cached one is not.
    """

    def __init__(self, on_note: Callable[[str], object]) -> None:
        self._note = on_note
        self._models = cache_folder()

    def find(self, assembly: Assembly, plugins: Sequence[Path]) -> TrainedNetwork | None:
        """Return the cached model of the same description, or None."""
        if not self._models.exists() or not self._is_private():
            return None
        return self._kept(self._models.resolve() / _key(assembly, plugins), assembly, plugins, "it is left out")

    def find_or_train(
        self,
        assembly: Assembly,
        plugins: Sequence[Path],
        train: Callable[[], TrainedNetwork],
        *,
        retrain: bool = False,
    ) -> TrainedNetwork:
        """Return the cached model of the same description, or a newly trained one, which is then kept.

        Parameters
        ----------
        assembly : Assembly
        plugins : sequence of Path
            The plugin files with its components.
        train : callable
            Trains a model of the assembly.
        retrain : bool
            Train even if there is a cached model.
        """
        with suppress(OSError):  # without a place for it the work goes on
            self._models.parent.mkdir(parents=True, exist_ok=True)
            self._models.mkdir(mode=0o700, exist_ok=True)
        if self._models.exists() and not self._is_private():
            return self._newly_trained(assembly, train, "it is not kept")
        folder = self._models.resolve() / _key(assembly, plugins)

        def waiting(other: str) -> None:
            self._note(f"{other} is training the model of '{assembly.name}'; waiting for it.")

        with locked(folder.with_suffix(".training"), wait=-1, on_wait=waiting):
            model = None if retrain else self._kept(folder, assembly, plugins, "training anew")
            if model is None:
                model = self._newly_trained(assembly, train, "it is kept for the next time")
                self._keep(model, folder)
            return model

    def _newly_trained(self, assembly: Assembly, train: Callable[[], TrainedNetwork], then: str) -> TrainedNetwork:
        samples = assembly.description.identification.samples
        self._note(f"Training a network for '{assembly.name}' on {samples} simulated FRFs; {then}.")
        return train()

    def _is_private(self) -> bool:
        """Return whether only this user can have put models into a folder; report why if others can.

        A model is trusted as far as whoever wrote it: another user's would give whatever results its author wishes.
        """
        if (user := _user()) is None:  # where a user's folder is the user's own
            return True
        try:
            status = self._models.stat()
        except OSError as error:
            self._note(f"The kept models in {self._models} are not used: {error.strerror}.")
            return False
        if not stat.S_ISDIR(status.st_mode):
            return True  # which is reported where a model is written
        reason, remedy = "", ""
        if status.st_uid != user:
            reason, remedy = "the folder belongs to another user", f"Name a folder of your own by {VARIABLE}"
        elif status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            reason, remedy = "other users can write in the folder", "Remove it, or make it your own by chmod 700"
        if reason:
            self._note(f"The kept models in {self._models} are not used: {reason}. {remedy}.")
        return not reason

    def _kept(self, folder: Path, assembly: Assembly, plugins: Sequence[Path], otherwise: str) -> TrainedNetwork | None:
        """Return the cached model in a folder, or None if there is none of this assembly that can be used."""
        if not folder.exists():
            return None
        try:
            model = read_bundle(folder, plugins=plugins)
            is_own = _user() in (None, os.lstat(folder).st_uid)
            if not is_own or model.assembly.description.fingerprint != assembly.description.fingerprint:
                raise BundleError(f"{folder}: this is not the model that was kept for '{assembly.name}'.")
        except BundleError:
            self._note(f"The model kept in {folder} cannot be used; {otherwise}.")
            return None
        self._note(f"Using the model trained before from this description ({folder}); `retrain=True` trains anew.")
        return model

    def _keep(self, model: TrainedNetwork, folder: Path) -> None:
        """Save a model in the cache, or report why that is impossible."""
        try:
            write_bundle(model, folder)
        except (BundleError, OSError) as error:
            self._note(f"The model is not kept: {error}")


def _user() -> int | None:
    """Return the id of the user of this process, or None where files have no such owner."""
    ask = getattr(os, "geteuid", None)
    return None if ask is None else int(ask())


def _key(assembly: Assembly, plugins: Sequence[Path]) -> str:
    """Return a hash of everything that the model depends on."""
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
