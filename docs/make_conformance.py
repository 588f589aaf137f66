"""Writes docs/conformance.md, the checks of the kit with their broken plugins: ``python docs/make_conformance.py``."""

import importlib
import inspect
import sys
from pathlib import Path

from dovetail.testing.kit import check_descriptions

sys.path.insert(0, str(Path(__file__).parent))
from line_length import wrapped

PAGE = Path(__file__).with_name("conformance.md")
TESTS = Path(__file__).parents[1] / "tests"
HEADINGS = {"joint": "Joints", "substructure": "Substructures", "reducer": "Reducers", "regressor": "Regressors"}
HEADINGS |= {
    "reader": "File readers",
    "matrix_reader": "Readers of matrices",
    "method": "Methods of identification",
    "law": "Laws",
}

INTRODUCTION = """# What the conformance kit checks

Here you find what each check of the kit demands of a plugin, and a mistake that it catches.
[Write a plugin](plugins.md#the-conformance-kit) explains how to run the kit and what its outcomes mean.

The page is made by `python docs/make_conformance.py` from the docstrings of the checks and from the broken plugins in
`tests/support/broken_plugins`: {plugins} components with a single fault each, all of which the kit catches. Each check
is listed with a mistake that only this check catches, and with the number of other plugins that it catches too.
"""
ENTRY = "- **{check}**: {text} *Mistake:* {alone}{others}\n"


def page() -> str:
    """Return the text of the page."""
    broken = _broken_plugins()
    text = INTRODUCTION.format(plugins=sum(map(len, broken.BROKEN.values())) + len(broken.FURTHER))
    kinds = {kind: check_descriptions(kind) for kind in HEADINGS}
    shared = {check for check, _ in set.intersection(*(set(checks.items()) for checks in kinds.values()))}
    alone = {check: model for kind in reversed(HEADINGS) for check, model in broken.BROKEN[kind].items()}
    any_kind = {check: said for check, said in kinds["joint"].items() if check in shared}
    text += _section("Any component", any_kind, alone, [checks for _, checks in broken.FURTHER])
    for kind, heading in HEADINGS.items():
        checks = {check: said for check, said in kinds[kind].items() if check not in shared}
        others = [checks for model, checks in broken.FURTHER if model.kind == kind]
        text += _section(heading, checks, alone | broken.BROKEN[kind], others)
    return wrapped(text)


def _section(heading: str, checks: dict[str, str], alone: dict, further: list) -> str:
    entries = []
    for check, said in checks.items():
        others = sum(check in names for names in further)
        entry = ENTRY.format(
            check=check.replace("_", " "),
            text=said,
            alone=inspect.getdoc(alone[check]).splitlines()[0],
            others=f" *({others} more)*" if others else "",
        )
        entries.append(entry)
    return f"\n## {heading}\n\n{''.join(entries)}"


def _broken_plugins():
    """Import every module of broken plugins, and return the one in which they are listed."""
    sys.path.insert(0, str(TESTS))
    try:
        importlib.import_module("support.broken_plugins").load_broken_plugins()
        return importlib.import_module("support.broken_plugins.lists")
    finally:
        sys.path.remove(str(TESTS))


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
