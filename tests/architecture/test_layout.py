"""The layout of the tests: folders named after packages, names that occur once, shared code in one package."""

from __future__ import annotations

import ast
import re
from collections import Counter

import pytest
from house import PACKAGES, ROOT

from support.waiting import PATIENCE

TESTS = ROOT / "tests"
FILES = sorted(TESTS.rglob("test_*.py"))
SCRIPTS = {file.stem for folder in ("architecture", "benchmarks", "browser") for file in (TESTS / folder).glob("*.py")}
"""Modules that run as scripts too; the tests in their folders import them by name."""
SHARED = {file.stem for file in TESTS.rglob("*.py")} - SCRIPTS
"""Modules that are imported from where they are, and not by their bare names."""


def test_a_folder_has_the_name_of_a_package_or_is_described():
    folders = {file.parent.name for file in FILES}
    packages = {folder.name for package in PACKAGES for folder in package.iterdir() if folder.is_dir()}
    described = (TESTS / "README.md").read_text(encoding="utf-8")
    assert {folder for folder in folders - packages if f"`{folder}`" not in described} == set()


def test_no_two_test_modules_have_the_same_name():
    assert [name for name, count in Counter(file.name for file in FILES).items() if count > 1] == []


@pytest.fixture(scope="module")
def texts() -> dict[str, str]:
    """Every test module by its name."""
    return {file.name: file.read_text(encoding="utf-8") for file in FILES}


def test_shared_code_of_tests_is_imported_from_support(texts):
    def imported(text: str) -> set[str | None]:
        return {node.module for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)}

    assert {name: shared for name, text in texts.items() if (shared := imported(text) & SHARED)} == {}
    assert [name for name, text in texts.items() if re.search(r"sys\.path\.(?:insert|append)\(", text)] == []


def test_no_test_limits_a_time_that_goes_on_while_the_machine_stands_still(texts):
    """A wait is given up after minutes only; no clock that goes on meanwhile is compared with a number of seconds."""
    limits = [(name, limit) for name, text in texts.items() for limit in re.findall(r"\btimeout=([\d.]+)", text)]
    assert [(name, limit) for name, limit in limits if float(limit) < PATIENCE] == []
    clock = re.compile(r"assert .*(?:monotonic|perf_counter|time\.time)\(\).*<=? *[\d.]+")
    assert {name: found for name, text in texts.items() if (found := clock.findall(text))} == {}
