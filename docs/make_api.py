"""Writes docs/api.md and docs/api/, which list everything public, by ``__all__``: ``python docs/make_api.py``."""

import inspect
from pathlib import Path
from types import ModuleType

import numpy as np

import dovetail
import dovetail.commands
import dovetail.evaluation
import dovetail.pages
import dovetail_bench
import dovetail_machining
import dovetail_plugins.beams

DOCS = Path(__file__).parent

SECTIONS = {
    "assembly": "Assemblies",
    "examples": "Examples",
    "description": "Assemblies",
    "measurement": "Measurements",
    "frf": "Frequency response functions",
    "coupling": "Measured parts",
    "matrix_files": "For plugin authors: imported matrices",
    "half_matrices": "For plugin authors: imported matrices",
    "dataset": "Datasets",
    "identification": "Identification",
    "exchange": "Data of other packages",
    "comparison": "Comparison of models",
    "series": "A series of tests",
    "problem": "For plugin authors: steps of a method",
    "inference": "For plugin authors: steps of a method",
    "report": "Reports and figures",
    "design": "Where to measure",
    "interfaces": "For plugin authors: contracts",
    "registry": "For plugin authors: the hooks",
    "atomic_files": "For plugin authors: files that may be damaged",
    "guarded_process": "For plugin authors: files that may be damaged",
    "units": "For plugin authors: units",
    "errors": "Errors",
}
"""Headings by the package that defines a name, in the order of the page."""

PACKAGES = {
    dovetail.commands: "For plugin authors: commands",
    dovetail.pages: "For plugin authors: pages and figures",
    dovetail.evaluation: "For plugin authors: evaluations",
    dovetail_plugins.beams: "For plugin authors: beam elements",
    dovetail_bench: "Evaluation: `dovetail_bench`",
    dovetail_machining: "Spindles: `dovetail_machining`",
}
"""Headings of the modules and packages whose names `import dovetail` does not offer."""

WITHIN_RESULTS = """
## Within results

```{eval-rst}
.. currentmodule:: dovetail.identification

.. autoclass:: Fit
   :members:
```
"""
TESTING = """
## Testing a plugin

```{eval-rst}
.. currentmodule:: dovetail.testing

.. autofunction:: check_component
.. autofunction:: conformance
.. autofunction:: check_names
.. autoclass:: CheckResult
   :members:
```
"""

PAGES = {
    "assemblies": (
        "Assemblies and measurements",
        "assemblies, examples, measured FRFs, and where to measure",
    ),
    "identification": ("Identification", "identification, results, prediction, series, datasets, figures and errors"),
    "plugins": ("For plugin authors", "what a plugin implements, and what its code may use"),
    "evaluation": ("Evaluation and spindles", "the packages `dovetail_bench` and `dovetail_machining`"),
}
"""Title and content of each page, by its name."""
_FIRST = ("assembly", "examples", "description", "measurement", "frf", "coupling", "design")


def pages() -> dict[str, str]:
    """Return the texts of all pages, by their paths below docs."""
    sections: dict[str, list[str]] = {heading: [] for heading in SECTIONS.values()}
    for name in dovetail.__all__:
        sections[SECTIONS[_home(name)]].append(_directive(dovetail, name))
    texts = dict.fromkeys(PAGES, "")
    first = {SECTIONS[package] for package in _FIRST}
    for heading, directives in sections.items():
        of_plugins = heading.startswith("For plugin authors")
        page = "plugins" if of_plugins else "assemblies" if heading in first else "identification"
        texts[page] += _section(dovetail, heading.removeprefix("For plugin authors: ").capitalize(), directives)
    texts["identification"] += WITHIN_RESULTS
    texts["plugins"] += TESTING
    for package, heading in PACKAGES.items():
        page = "evaluation" if package in (dovetail_bench, dovetail_machining) else "plugins"
        body = [_directive(package, name) for name in package.__all__]
        texts[page] += _section(package, heading.removeprefix("For plugin authors: "), body)
    heads = {name: f"# {title}\n\nHere you find {content}.\n" for name, (title, content) in PAGES.items()}
    return {"api.md": _index(), **{f"api/{name}.md": heads[name] + text for name, text in texts.items()}}


def _index() -> str:
    rows = "\n".join(f"| [{title}](api/{name}.md) | {content} |" for name, (title, content) in PAGES.items())
    tree = "\n".join(f"api/{name}" for name in PAGES)
    return (
        "# API\n\nHere you find everything that `import dovetail` offers, and the packages `dovetail_bench` and\n"
        "`dovetail_machining`, which ship with it. Names that are not on these pages may change at any time.\n\n"
        f"| page | contents |\n|---|---|\n{rows}\n\n```{{toctree}}\n:hidden:\n\n{tree}\n```\n"
    )


def _section(package: ModuleType, heading: str, directives: list[str]) -> str:
    body = "\n".join(directives)
    return f"\n## {heading}\n\n```{{eval-rst}}\n.. currentmodule:: {package.__name__}\n\n{body}\n```\n"


def _home(name: str) -> str:
    """Return the package that the stub takes a name from."""
    stub = Path(dovetail.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    line = next(line for line in stub.splitlines() if line.endswith(f"import {name} as {name}"))
    return line.split()[1].strip(".").split(".")[0] or name


def _directive(package: ModuleType, name: str) -> str:
    value = getattr(package, name)
    if getattr(value, "__origin__", None) is np.ndarray:  # autodoc would show the docstring of numpy
        return f".. data:: {name}"
    if inspect.ismodule(value):
        return f".. automodule:: {value.__name__}\n   :members: names, load, measurement, path, measurement_path, copy"
    if inspect.isclass(value) and issubclass(value, Exception):
        return f".. autoexception:: {name}"
    if inspect.isclass(value):
        return f".. autoclass:: {name}\n   :members:"
    return f".. autofunction:: {name}" if inspect.isfunction(value) else f".. autodata:: {name}"


if __name__ == "__main__":
    (DOCS / "api").mkdir(exist_ok=True)
    for file, text in pages().items():
        (DOCS / file).write_text(text, encoding="utf-8")
