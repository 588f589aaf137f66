"""A package with a new model, made from templates."""

from __future__ import annotations

import keyword
import re
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import NamedTuple

import dovetail
from dovetail.atomic_files import new_folder
from dovetail.errors import DovetailError, Fault, PluginError
from dovetail.interfaces.component import Kind
from dovetail.registry.catalogue import installed_components
from dovetail.version import __version__

_COMMON = {
    "pyproject.toml": "pyproject.toml",
    "README.md": "README.md",
    "gitignore": ".gitignore",
    "package.py": "src/$package/__init__.py",
    "test_conformance.py": "tests/test_conformance.py",
}
_OWN = {"py": "src/$package/$kind.py", "yaml": "example.yaml", "test.py": "tests/test_example.py"}
"""Files of each kind, by the text after the kind in the name of the template."""


class NewPackage(NamedTuple):
    """A package that was written."""

    folder: Path
    name: str
    """The word after ``model:`` in a description."""
    files: list[str]


def write_plugin_package(kind: Kind, name: str, folder: Path | None = None) -> NewPackage:
    """Write a package with a new model: code, entry point, tests, an example.

    Parameters
    ----------
    kind : str
        Of `KINDS`.
    name : str
        The word after ``model:`` in a description.
    folder : Path, optional
        ``dovetail-NAME`` by default.

    Raises
    ------
    PluginError
        The name is not usable, or taken.
    DovetailError
        The folder exists, or cannot be written.
    """
    words = _words(kind, name)
    folder = folder or Path(words["distribution"])
    return NewPackage(folder, words["name"], _write(folder, words))


def _words(kind: str, wanted: str) -> dict[str, str]:
    """Return the values for the placeholders of the templates."""
    name = wanted.replace("-", "_").lower()
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,49}", name) or keyword.iskeyword(name):
        problem = f"'{wanted:.60}' cannot be the name of a model."
        accepted = "up to 50 letters from a to z, digits and '_', beginning with a letter, and no keyword of Python"
        raise PluginError(Fault("", problem, accepted))
    model = "".join(word.capitalize() for word in name.split("_"))
    if keyword.iskeyword(model) or hasattr(dovetail, model) or model in ("Annotated", "Field"):
        problem = f"'{wanted:.60}' would make a class '{model}', a name that the code of a plugin needs itself."
        raise PluginError(Fault("", problem, remedy="Choose another."))
    for offer in installed_components().named(name):
        if offer.component.kind == kind:
            raise PluginError(Fault("", f"{offer.source} offers a {kind} '{name}' already.", remedy="Choose another."))
    return {
        "kind": kind,
        "name": name,
        "title": name.replace("_", " "),
        "model": model,
        "package": f"dovetail_{name}",
        "distribution": f"dovetail-{name.replace('_', '-')}",
        "version": __version__,
    }


def _write(folder: Path, words: dict[str, str]) -> list[str]:
    """Write the package atomically, and return the names of its files."""
    if folder.exists():
        raise DovetailError(
            Fault(str(folder), "a file or folder of this name already exists.", remedy="Choose another name.")
        )
    templates = files("dovetail.registry") / "plugin_template"
    own_files = {f"{words['kind']}.{suffix}": path for suffix, path in _OWN.items()}
    paths = {source: Template(path).substitute(words) for source, path in {**_COMMON, **own_files}.items()}
    with new_folder(folder) as fresh:
        for source, path in paths.items():
            target = fresh / path
            target.parent.mkdir(parents=True, exist_ok=True)
            text = (templates / f"{source}.template").read_text(encoding="utf-8")
            target.write_text(Template(text).substitute(words), encoding="utf-8")
    return sorted(paths.values())
