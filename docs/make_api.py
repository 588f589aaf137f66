"""Writes docs/api.md and docs/api/, which list everything public, by ``__all__``: ``python docs/make_api.py``."""

import ast
import inspect
import itertools
import re
import sys
import textwrap
import typing
from pathlib import Path
from types import ModuleType

import dovetail
import dovetail.commands
import dovetail.evaluation
import dovetail.interfaces
import dovetail.pages
import dovetail_bench
import dovetail_machining
import dovetail_plugins.beams

DOCS = Path(__file__).parent
_INTERFACES = Path(dovetail.interfaces.__file__).read_text(encoding="utf-8")

SECTIONS = {
    "assembly": ("assemblies", "Assemblies"),
    "examples": ("assemblies", "Examples"),
    "description": ("assemblies", "Assemblies"),
    "design": ("assemblies", "Where to measure"),
    "measurement": ("measurements", "Measurements"),
    "frf": ("measurements", "Frequency response functions"),
    "coupling": ("measurements", "Measured parts"),
    "exchange": ("measurements", "Data of other packages"),
    "identification": ("identification", "Identification"),
    "report": ("identification", "Reports and figures"),
    "errors": ("identification", "Errors"),
    "dataset": ("series", "Datasets"),
    "comparison": ("series", "Comparison of models"),
    "series": ("series", "A series of tests"),
    "interfaces.component": ("parts_and_joints", "Components"),
    "interfaces.substructure": ("parts_and_joints", "Parts"),
    "interfaces.joint": ("parts_and_joints", "Joints"),
    "interfaces.matrices": ("parts_and_joints", "Matrices and directions"),
    "interfaces.coordinates": ("parts_and_joints", "Matrices and directions"),
    "interfaces.file_name": ("parts_and_joints", "Options"),
    "units": ("parts_and_joints", "Options"),
    "registry": ("parts_and_joints", "The hooks"),
    "interfaces.reducer": ("learning", "Reducers"),
    "interfaces.regressor": ("learning", "Regressors"),
    "interfaces.context": ("learning", "What both are given and store"),
    "interfaces.state": ("learning", "What both are given and store"),
    "interfaces.progress": ("learning", "Progress"),
    "interfaces.reader": ("readers", "Readers"),
    "interfaces.recorded": ("readers", "Contents of files with FRFs"),
    "interfaces.recorded_model": ("readers", "Imported matrices"),
    "matrix_files": ("readers", "Imported matrices"),
    "half_matrices": ("readers", "Imported matrices"),
    "atomic_files": ("readers", "Files that may be damaged"),
    "guarded_process": ("readers", "Files that may be damaged"),
    "interfaces.method": ("methods", "Methods"),
    "interfaces.fit_options": ("methods", "Options of a fit"),
    "interfaces.law": ("methods", "Laws"),
    "problem": ("methods", "Steps of a method"),
    "inference": ("methods", "Steps of a method"),
}
"""Page and heading by the package that defines a name, or by its module in `interfaces`, in the order of the pages."""

PACKAGES = {
    dovetail.commands: ("packages", "Commands: `dovetail.commands`"),
    dovetail.pages: ("packages", "Pages and figures: `dovetail.pages`"),
    dovetail.evaluation: ("packages", "Evaluations: `dovetail.evaluation`"),
    dovetail_plugins.beams: ("parts_and_joints", "Beam elements: `dovetail_plugins.beams`"),
    dovetail_bench: ("evaluation", "Evaluation: `dovetail_bench`"),
    dovetail_machining: ("evaluation", "Spindles: `dovetail_machining`"),
}
"""Pages and headings of the modules and packages whose names `import dovetail` does not offer."""

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
    "assemblies": ("Assemblies", "assemblies, examples, and where to measure"),
    "measurements": ("Measurements", "measured FRFs, measured parts, and data of other packages"),
    "identification": ("Identification", "identification, results, prediction, figures and errors"),
    "series": ("Datasets, models and series", "datasets, comparison of models, and series of tests"),
    "parts_and_joints": ("For plugin authors: parts and joints", "the contracts of parts and joints, and the kit"),
    "learning": ("For plugin authors: reducers and regressors", "the contracts of reducers and regressors"),
    "readers": ("For plugin authors: readers of files", "the contracts of readers, and what they return"),
    "methods": ("For plugin authors: methods and laws", "the contracts of methods and laws, and the steps of a method"),
    "packages": ("For plugin authors: commands and pages", "what commands, reports and evaluations may use"),
    "evaluation": ("Evaluation and spindles", "the packages `dovetail_bench` and `dovetail_machining`"),
}
"""Title and content of each page, by its name."""
WITHIN = {"identification": WITHIN_RESULTS, "parts_and_joints": TESTING}
"""Sections of names that `import dovetail` does not offer, by their page."""


def pages() -> dict[str, str]:
    """Return the texts of all pages, by their paths below docs."""
    sections: dict[tuple[str, str], list[str]] = {place: [] for place in SECTIONS.values()}
    for name in dovetail.__all__:
        sections[SECTIONS[_home(name)]].append(_directive(dovetail, name))
    texts = dict.fromkeys(PAGES, "")
    for (page, heading), directives in sections.items():
        texts[page] += _section(dovetail, heading, directives)
    for page, text in WITHIN.items():
        texts[page] += text
    for package, (page, heading) in PACKAGES.items():
        texts[page] += _section(package, heading, [_directive(package, name) for name in package.__all__])
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
    """Return the package that the stub takes a name from; for one of `interfaces`, with the module."""
    stub = Path(dovetail.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    line = next(line for line in stub.splitlines() if line.endswith(f"import {name} as {name}"))
    package = line.split()[1].strip(".").split(".")[0] or name
    if package != "interfaces":
        return package
    taken = re.findall(r"^from dovetail\.interfaces\.(\w+) import (\([^)]*\)|.*)$", _INTERFACES, flags=re.M)
    return next(f"interfaces.{module}" for module, names in taken if re.search(rf"\b{name}\b", names))


def _directive(package: ModuleType, name: str) -> str:
    value = getattr(package, name)
    if inspect.ismodule(value):
        return f".. automodule:: {value.__name__}\n   :members: names, load, measurement, path, measurement_path, copy"
    if inspect.isclass(value) and issubclass(value, Exception):
        return f".. autoexception:: {name}"
    if inspect.isclass(value):
        return f".. autoclass:: {name}\n   :members:"
    if inspect.isroutine(inspect.unwrap(value)):
        return f".. autofunction:: {name}"
    text = _value_text(value)
    lines = [f".. data:: {name}", *([f"   :value: {text}"] if text else []), ""]
    return "\n".join(lines) + "\n" + textwrap.indent(_documentation(name, value), "   ") + "\n"


def _documentation(name: str, value: object) -> str:
    """Return the text below the assignment of a constant, or the help of an option; autodoc shows that of its type."""
    if isinstance(value, typing._AnnotatedAlias):
        return value.__metadata__[0].help
    for module in [module for key, module in sys.modules.items() if key.startswith("dovetail")]:
        if vars(module).get(name) is not value:
            continue
        body = ast.parse(inspect.getsource(module)).body
        for assignment, text in itertools.pairwise(body):
            targets = getattr(assignment, "targets", [getattr(assignment, "target", None)])
            if name in [getattr(target, "id", None) for target in targets] and isinstance(text, ast.Expr):
                return inspect.cleandoc(ast.literal_eval(text.value))
    raise LookupError(f"{name} has no text below its assignment")


def _value_text(value: object) -> str:
    """Return a short value as Python writes it; for an option, its type."""
    if isinstance(value, typing._AnnotatedAlias):
        value = value.__origin__
    if isinstance(value, type):
        return value.__name__
    is_plain = isinstance(value, (int, float, str, tuple)) or typing.get_origin(value) is not None
    text = repr(value).replace("typing.", "").replace("pathlib.", "")
    return text if is_plain and "numpy" not in text and len(text) < 100 else ""


if __name__ == "__main__":
    for old in (DOCS / "api").glob("*.md"):
        old.unlink()
    for file, text in pages().items():
        (DOCS / file).write_text(text, encoding="utf-8")
