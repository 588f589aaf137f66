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


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_shared_code_of_tests_is_imported_from_support(file):
    text = file.read_text(encoding="utf-8")
    imported = {node.module for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)}
    assert imported & SHARED == set()
    assert re.findall(r"sys\.path\.(?:insert|append)\(", text) == []


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_no_test_fails_because_the_machine_stood_still(file):
    """A wait is given up after minutes only; no clock that goes on meanwhile is compared with a number of seconds."""
    text = file.read_text(encoding="utf-8")
    assert [limit for limit in re.findall(r"\btimeout=([\d.]+)", text) if float(limit) < PATIENCE] == []
    assert re.findall(r"assert .*(?:monotonic|perf_counter|time\.time)\(\).*<=? *[\d.]+", text) == []
