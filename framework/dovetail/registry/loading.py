"""Loading of plugins, from entry points and single files: any exception of a plugin becomes a PluginError.

Nothing here imports a component or a library for arrays, since the list of commands loads plugins by it too.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

import pluggy

from dovetail.errors import Fault, PluginError, contained, did_you_mean, reason_of
from dovetail.parallel import FILE_MODULE
from dovetail.registry.hookspec import GROUP, HookSpecification

COMPONENTS, DEFAULTS, COMMANDS = HOOKS = ("dovetail_components", "dovetail_defaults", "dovetail_commands")
HOW_TO_OFFER = "A model of your own needs `plugins='FILE.py'` or, in a package, `pip install -e FOLDER` once more."
HINT = f"a function '{COMPONENTS}()' marked with @dovetail.hookimpl that returns a list of component classes"


@dataclass(frozen=True)
class LoadFailure:
    """A plugin, or one of its components or commands, that could not be loaded."""

    source: str
    reason: str


def installed_plugins() -> list[tuple[str, EntryPoint]]:
    """Return the entry points of installed plugins, each with its distribution and version.

    They are in the order of their names, those that ship with Dovetail last: their defaults fill gaps.
    """
    entries = sorted(entry_points(group=GROUP), key=lambda entry: (is_shipped(entry), entry.name, entry.value))
    return [(f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value, entry) for entry in entries]


def is_shipped(entry: EntryPoint) -> bool:
    """Return whether an entry point is one of Dovetail's own distribution."""
    return entry.dist is not None and entry.dist.name == "dovetail-frf"


def load_entry(owner: str, entry: EntryPoint) -> object:
    """Import the object that an entry point names.

    Raises
    ------
    PluginError
        Its code raises anything but KeyboardInterrupt.
    """
    with contained(owner):
        plugin: object = entry.load()
    return plugin


def load_module(path: str | Path) -> ModuleType:
    """Run a plugin file as a module of its own.

    Raises
    ------
    PluginError
        The file is missing, is not a Python file, or fails to run.
    """
    file = Path(path)
    if os.path.isdir(file):
        raise PluginError(Fault(str(path), "this is a folder.", "a file that ends in .py", _advice_on_folder(file)))
    if not os.path.isfile(file):
        raise PluginError(Fault(str(path), "there is no such plugin file."))
    digest = hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:12]
    name = f"{FILE_MODULE}{file.stem}_{digest}"  # files of the same name in two folders are two modules
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise PluginError(Fault(str(path), "this is not a Python file.", "a file that ends in .py"))
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, KeyboardInterrupt):
            raise
        is_own = isinstance(error, ModuleNotFoundError) and str(error.name).split(".")[0] == file.resolve().parent.name
        remedy = _advice_on_package(file) if is_own else ""
        raise PluginError(Fault(_failing_line(error, file), reason_of(error), remedy=remedy)) from error
    return module


def fault_of_path(name: str) -> Fault | None:
    """Return the fault of a folder or a file where the name of a model is expected; None for any other name."""
    if os.path.isdir(name):
        return Fault(name, "this is a folder.", "the name of a model", _advice_on_folder(Path(name)))
    if name.endswith(".py"):
        remedy = _advice_on_package(Path(name)) or f"Give its name, and the file with `plugins='{name}'`."
        return Fault(name, "this is a file.", "the name of a model", remedy)
    return None


def _advice_on_folder(folder: Path) -> str:
    """Return how the plugins in a folder are used."""
    if _has_project(folder):
        return f"Install its package with `pip install -e {folder}`, then name the model: `dovetail check-plugin NAME`."
    return _advice_on_package(folder / "__init__.py") or HOW_TO_OFFER


def _advice_on_package(file: Path) -> str:
    """Return how the package that has a file is used; empty if the file stands alone."""
    package = file.resolve().parent
    if not (package / "__init__.py").is_file():
        return ""
    folder = next((str(folder) for folder in package.parents[:2] if _has_project(folder)), "FOLDER")
    if not file.is_absolute() and folder != "FOLDER":
        folder = os.path.relpath(folder)
    return (
        f"The file is part of the package '{package.name}'. Install it with `pip install -e {folder}`, then name the "
        "model without the file: `dovetail check-plugin NAME`."
    )


def _has_project(folder: Path) -> bool:
    return any((folder / file).is_file() for file in ("pyproject.toml", "setup.py", "setup.cfg"))


def hooks_of(plugin: ModuleType | object, source: str) -> Any:
    """Return the hooks of a plugin module or object, to be called.

    Raises
    ------
    PluginError
        It has neither components nor commands, or a misspelt hook, or cannot be examined.
    """
    manager = pluggy.PluginManager(GROUP)
    manager.add_hookspecs(HookSpecification)
    try:
        with contained(source, "its hooks cannot be examined: ", pluggy.PluginValidationError):
            manager.register(plugin)
            manager.check_pending()
    except pluggy.PluginValidationError as error:
        misspelt = ", ".join(name for name in dir(plugin) if name not in HOOKS and _is_marked(plugin, name))
        problem = f"'{misspelt}' is not a hook of dovetail." if misspelt else str(error)
        raise PluginError(Fault(source, problem, HINT, did_you_mean(misspelt, HOOKS))) from error
    if not any(getattr(manager.hook, name).get_hookimpls() for name in (COMPONENTS, COMMANDS)):
        problem = f"it has no hook '{COMPONENTS}' marked with @dovetail.hookimpl."
        raise PluginError(Fault(source, problem, HINT, _advice_on_package(Path(source))))
    return manager.hook


def returned_list(hooks: Any, name: str, source: str, of: str) -> list[Any]:
    """Return the list that a hook returns; an empty one if the plugin does not have the hook.

    Raises
    ------
    PluginError
        The hook raises, or returns something else.
    """
    hook = getattr(hooks, name)
    if not hook.get_hookimpls():
        return []
    with contained(source, f"its hook '{name}' raised "):
        returned = next(iter(hook()), None)  # pluggy leaves out None
        if isinstance(returned, Iterable) and not isinstance(returned, (str, bytes)):
            return list(returned)
        shown = f"{returned!r:.60}"
    raise PluginError(Fault(source, f"its hook '{name}' returned {shown}, not a list of {of}."))


def _is_marked(plugin: ModuleType | object, name: str) -> bool:
    return hasattr(inspect.getattr_static(plugin, name, None), f"{GROUP}_impl")


def _failing_line(error: BaseException, file: Path) -> str:
    """Return file:line at which a plugin file failed."""
    if isinstance(error, SyntaxError) and error.lineno:
        return f"{file}:{error.lineno}"
    line, trace = 0, error.__traceback__
    while trace:
        if Path(trace.tb_frame.f_code.co_filename).resolve() == file.resolve():
            line = trace.tb_lineno
        trace = trace.tb_next
    return f"{file}:{line}" if line else str(file)
