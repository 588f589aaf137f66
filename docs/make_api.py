"""Writes docs/api.md, the list of everything public, from the packages' ``__all__``: ``python docs/make_api.py``."""

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

PAGE = Path(__file__).with_name("api.md")

SECTIONS = {
    "assembly": "Assemblies",
    "examples": "Examples",
    "description": "Assemblies",
    "measurement": "Measurements",
    "frf": "Frequency response functions",
    "coupling": "Measured parts",
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
    dovetail_bench: "Evaluation: `dovetail_bench`",
    dovetail_machining: "Spindles: `dovetail_machining`",
}
"""Headings of the modules and packages whose names `import dovetail` does not offer."""

REST = """
## Within results

```{eval-rst}
.. currentmodule:: dovetail.identification

.. autoclass:: Fit
   :members:
```

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


def page() -> str:
    """Return the text of the page."""
    sections: dict[str, list[str]] = {heading: [] for heading in SECTIONS.values()}
    for name in dovetail.__all__:
        package = _home(name)
        sections[SECTIONS[package]].append(_directive(dovetail, name))
    text = (
        "# API\n\nHere you find everything that `import dovetail` offers, and below it `dovetail_bench` and\n"
        "`dovetail_machining`, which ship with it. Names that are not on this page may change at any time.\n"
    )
    text += "".join(_section(dovetail, heading, directives) for heading, directives in sections.items())
    text += REST
    for package, heading in PACKAGES.items():
        text += _section(package, heading, [_directive(package, name) for name in package.__all__])
    return text


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
    PAGE.write_text(page(), encoding="utf-8")
