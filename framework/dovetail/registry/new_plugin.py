"""A package with a new model, made from templates."""

from __future__ import annotations

import keyword
import re
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import NamedTuple

import dovetail
from dovetail.atomic_files import new_folder, write_whole
from dovetail.errors import DovetailError, Fault, PluginError, listing
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


_HOOK = '''

@dovetail.hookimpl
def dovetail_components():
    """Return what this module offers."""
    return [$model]
'''


def add_to_package(kind: Kind, name: str, folder: Path) -> NewPackage:
    """Add a new model to a package that exists: a module with the hook, its entry point, tests and an example.

    Parameters
    ----------
    kind, name
        As in `write_plugin_package`.
    folder : Path
        That of the package's pyproject.toml.

    Raises
    ------
    PluginError
        The name is not usable, or taken.
    DovetailError
        The folder is not that of a package, or a file is there already; then nothing is written.
    """
    words = _words(kind, name)
    project = folder / "pyproject.toml"
    if not project.is_file():
        raise DovetailError(
            Fault(str(folder), "there is no pyproject.toml, so this is not a package.", "the folder of a package")
        )
    content, package = _parsed(project), _import_package(folder)
    words["package"] = package.name
    module = f"{package.name}.{words['name']}"
    model = _filled(f"{kind}.py", words).replace("import numpy", "import dovetail\nimport numpy", 1)
    texts = {
        package / f"{words['name']}.py": model.rstrip("\n") + "\n" + Template(_HOOK).substitute(words),
        folder / f"{words['name']}.yaml": _filled(f"{kind}.yaml", words),
        folder / f"tests/test_{words['name']}.py": _filled(f"{kind}.test.py", words),
        folder / f"tests/test_{words['name']}_conformance.py": _filled("test_conformance.py", words),
    }
    for file in texts:
        if file.exists():
            raise DovetailError(Fault(str(file), "this file already exists.", remedy="Choose another name."))
    for file, text in texts.items():
        for before, after in (
            (f"{package.name}.{kind} import", f"{module} import"),
            (f"from {package.name} import", f"from {module} import"),
            ("example.yaml", f"{words['name']}.yaml"),
        ):
            text = text.replace(before, after)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, text.encode(), overwrite=False)
    write_whole(project, _with_entry_point(content, words["name"], module).encode(), overwrite=True)
    return NewPackage(folder, words["name"], sorted(str(file.relative_to(folder)) for file in (*texts, project)))


def _parsed(project: Path) -> str:
    """Return the text of a pyproject.toml that declares a project."""
    text = project.read_text(encoding="utf-8")
    try:
        declared = tomllib.loads(text).get("project")
    except tomllib.TOMLDecodeError as error:
        raise DovetailError(Fault(str(project), f"this is not TOML: {error}.")) from None
    if declared is None:
        raise DovetailError(Fault(str(project), "it declares no [project], to which an entry point could be added."))
    return text


def _import_package(folder: Path) -> Path:
    """Return the folder of the only package that is imported from a project."""
    places = [place.parent for base in (folder / "src", folder) for place in sorted(base.glob("*/__init__.py"))]
    packages = [place for place in places if place.name not in ("tests", "test", "docs")]
    if len(packages) != 1:
        known = listing(str(place.relative_to(folder)) for place in packages) or "none"
        problem = f"it has {len(packages)} import packages: {known}." if packages else "it has no import package."
        raise DovetailError(Fault(str(folder), problem, "one folder with an __init__.py, in src/ or here"))
    return packages[0]


def _with_entry_point(text: str, name: str, module: str) -> str:
    """Return the text of a pyproject.toml with an entry point of the group dovetail."""
    line, table = (
        f'{name} = "{module}"',
        re.compile(r"^\[project\.entry-points\.(?:dovetail|\"dovetail\")\][^\n]*$", re.M),
    )
    if table.search(text):
        return table.sub(lambda match: f"{match[0]}\n{line}", text, count=1)
    return f"{text.rstrip()}\n\n[project.entry-points.dovetail]\n{line}\n"


def _filled(template: str, words: Mapping[str, str]) -> str:
    """Return the text of a template with its placeholders filled."""
    text = (files("dovetail.registry") / "plugin_template" / f"{template}.template").read_text(encoding="utf-8")
    return Template(text).substitute(words)


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
    registry = installed_components()
    if kind in registry.kinds_of(name):
        source = registry.find(kind, name).source
        raise PluginError(Fault("", f"{source} offers a {kind} '{name}' already.", remedy="Choose another."))
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
    own_files = {f"{words['kind']}.{suffix}": path for suffix, path in _OWN.items()}
    paths = {source: Template(path).substitute(words) for source, path in {**_COMMON, **own_files}.items()}
    with new_folder(folder) as fresh:
        for source, path in paths.items():
            target = fresh / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(_filled(source, words), encoding="utf-8")
    return sorted(paths.values())
