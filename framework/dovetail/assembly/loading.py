"""Assemblies from descriptions, with the installed components and those of plugin files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, TypeAlias

from dovetail.assembly.model import Assembly
from dovetail.description.reader import read_description
from dovetail.errors import Fault, ParameterError
from dovetail.interfaces import logged
from dovetail.load_observers import observe
from dovetail.registry import PluginPaths, components

AssemblySource: TypeAlias = Assembly | str | os.PathLike[str]
"""An assembly, or the path of its description."""


def load(
    source: str | os.PathLike[str] | Mapping[str, Any],
    *,
    plugins: PluginPaths = (),
    files_in: str | os.PathLike[str] | None = None,
) -> Assembly:
    """Read an assembly description.

    Parameters
    ----------
    source : path or mapping
        A YAML file, or the same as a dict.
    plugins : path or iterable of paths
        Plugin files to load in addition to the installed plugins. Their code runs with the rights of the caller.
    files_in : path, optional
        A folder from which the files that the description names are taken, and which they may not leave: no absolute
        path, no ``..``, no link. By default they are relative to the description and may lie anywhere.

    Returns
    -------
    Assembly

    Raises
    ------
    DescriptionError
        Everything that is wrong with the description, at once.
    PluginError
        A plugin file cannot be loaded.
    """
    with logged(__name__, f"description {'' if isinstance(source, Mapping) else os.fspath(source)} read"):
        folder = None if files_in is None else os.fspath(files_in)
        assembly = Assembly(read_description(source, components(plugins), folder))
    observe(assembly)
    return assembly


def as_assembly(source: AssemblySource) -> Assembly:
    """Return an assembly as it is, or read it from the path of its description.

    Raises
    ------
    ParameterError
        It is neither.
    DescriptionError
        As in `load`.
    """
    if isinstance(source, Assembly):
        return source
    if isinstance(source, (str, os.PathLike)):
        return load(source)
    if callable(source):
        problem = "this is a function."
        remedy = (
            "Wrap it with the parameters and the frequencies: dovetail.CallableModel(function, parameters, frequency)."
        )
        raise ParameterError(Fault("assembly", problem, remedy=remedy))
    problem = f"this is an object of the type {type(source).__name__}."
    raise ParameterError(Fault("assembly", problem, "an Assembly, or the path of its description"))
