"""The results of a joint or a substructure in a separate process, and the changes that it leaves there."""

from __future__ import annotations

import importlib
import json
import os
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import Component
from dovetail.testing.answers import answers, copied, declarations, varied
from dovetail.testing.fresh_process import WORK, read_request, requested_class, run_in_fresh_process
from dovetail.testing.outcomes import Nonconformity, Reservation
from dovetail.testing.specimen import Specimen
from dovetail.testing.surroundings import changes, surroundings

_LIMIT = 120
"""Seconds after which the process is ended."""
_ENVIRONMENT = dict(os.environ)
"""Environment before any component was called, which may change it."""
_ANSWERS, _REPORT = "answers{}.npz", "report.json"
_THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "2")
"""More than one thread, so that it shows if a component limits them."""


@dataclass(frozen=True, eq=False)
class Report:
    """The report of another process.

    Parameters
    ----------
    answers, declarations : mapping
        Of each component, by its config as JSON.
    changed : list of str
        Global state that was changed.
    imported : list of str
        Modules of other packages that were imported meanwhile, if these may be what changed global state.
    """

    answers: Mapping[str, Mapping[str, NDArray[Any]]]
    declarations: Mapping[str, Mapping[str, str]]
    changed: list[str]
    imported: list[str]


def written(config: Any) -> str:
    """Return options as JSON."""
    return str(config.model_dump_json(by_alias=True))


def report_of_another_process(specimen: Specimen) -> Report:
    """Evaluate all examples, and varied options, in a process with another hash seed and working directory.

    Raises
    ------
    Nonconformity
        A component cannot be constructed there, or fails.
    Reservation
        The class is not at the top of a module, so that no other process can import it.
    """
    module = sys.modules.get(specimen.model.__module__)
    at_top: Any = module
    for name in specimen.model.__qualname__.split("."):
        at_top = getattr(at_top, name, None)
    if at_top is not specimen.model or not getattr(module, "__file__", None):
        raise Reservation(
            f"no other process can import {specimen.model.__qualname__}, so this was not checked.",
            "Put the class at the top of a module.",
        )
    options = set()
    for each in (specimen, *specimen.companions):
        other = varied(each.component)
        options |= {json.dumps(dict(each.options), default=str), *([written(other.config)] if other else [])}
    report = _report_of(specimen.model, tuple(sorted(options)), ())
    return _report_of(specimen.model, tuple(sorted(options)), tuple(report.imported)) if report.imported else report


@lru_cache(maxsize=2)  # two checks look at the same report, and a package that is imported late makes another
def _report_of(model: type[Component], options: tuple[str, ...], imports: tuple[str, ...]) -> Report:
    request = {"options": list(options), "imports": list(imports)}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if reason := run_in_fresh_process(__name__, model, request, folder, {**_ENVIRONMENT, **_THREADS}, _LIMIT):
            raise Nonconformity(f"it fails in a fresh process: {reason}", "Compute everything from the options only.")
        content = json.loads((folder / _REPORT).read_text(encoding="utf-8"))
        arrays = {}
        for index, config in enumerate(content["configs"]):
            with np.load(folder / _ANSWERS.format(index), allow_pickle=False) as archive:
                arrays[config] = dict(archive)
    declared = dict(zip(content["configs"], content["declarations"], strict=True))
    return Report(arrays, declared, content["changed"], content["imported"])


def main() -> None:
    """Process the request in the folder given on the command line."""
    folder, request = read_request()
    for name in request["imports"]:
        with suppress(Exception):  # it was imported by another one, in a way of its own
            importlib.import_module(name)
    loaded, before, threads = set(sys.modules), surroundings(), _threads()
    model = requested_class(request)
    declared, configs = [], []
    for index, options in enumerate(request["options"]):
        component = model(model.Config.model_validate_json(options))
        configs.append(written(component.config))
        declared.append(declarations(component))
        arrays: dict[str, Any] = copied(answers(component))
        np.savez(folder / _ANSWERS.format(index), **arrays)
    changed = changes(before, surroundings())
    if any(_threads().get(library, count) != count for library, count in threads.items()):
        changed.append("the number of threads of the linear algebra")
    if (folder / WORK).exists() and any((folder / WORK).iterdir()):
        changed.append("the working directory, where it leaves a file,")
    report = {
        "configs": configs,
        "declarations": declared,
        "changed": changed,
        "imported": _imported_since(loaded, model) if changed or _imported("torch", loaded) else [],
    }
    (folder / _REPORT).write_text(json.dumps(report), encoding="utf-8")


def _imported(name: str, loaded: set[str]) -> bool:
    return name in sys.modules and name not in loaded


def _imported_since(loaded: set[str], model: type[Component]) -> list[str]:
    """Return the modules that were imported meanwhile, without those of the component's own package."""
    own = model.__module__.partition(".")[0]
    return [name for name in sys.modules if name not in loaded and name.partition(".")[0] != own]


def _threads() -> dict[str, int]:
    """Return the number of threads of each library of linear algebra that is loaded."""
    from threadpoolctl import threadpool_info

    return {library["filepath"]: library["num_threads"] for library in threadpool_info()}
