"""The conda recipe has what pyproject.toml declares."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml

import dovetail

ROOT = Path(__file__).parents[2]
RECIPE = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA_NAMES = {"matplotlib": "matplotlib-base", "torch": "pytorch"}
"""Names of packages on conda-forge that differ from those on PyPI."""


def test_it_builds_this_version_of_this_project():
    assert RECIPE["context"]["version"] == dovetail.__version__
    assert RECIPE["package"]["name"] == PROJECT["name"]
    assert RECIPE["about"]["summary"] == PROJECT["description"]
    assert RECIPE["about"]["license"] == PROJECT["license"]
    assert (ROOT / RECIPE["about"]["license_file"]).is_file()
    assert [f"{name} = {target}" for name, target in PROJECT["scripts"].items()] == RECIPE["build"]["python"][
        "entry_points"
    ]


def test_it_needs_what_the_project_needs():
    pairs = [re.fullmatch(r"([\w-]+)(>=[\d.]+)", text).groups() for text in PROJECT["dependencies"]]
    expected = {f"{CONDA_NAMES.get(name, name)} {version}" for name, version in pairs}
    python, *packages = RECIPE["requirements"]["run"]
    assert python.startswith("python >=")
    assert set(packages) == expected
    assert packages == sorted(packages)


def test_it_has_the_sections_and_tests_that_conda_forge_asks_for():
    sections = ["schema_version", "context", "package", "source", "build", "requirements", "tests", "about", "extra"]
    assert list(RECIPE) == sections
    assert {"homepage", "summary", "license", "license_file", "documentation", "repository"} <= set(RECIPE["about"])
    assert RECIPE["build"]["noarch"] == "python"
    assert RECIPE["extra"]["recipe-maintainers"] == [urlsplit(PROJECT["urls"]["Source"]).path.split("/")[1]]
    test = RECIPE["tests"][0]["python"]
    assert test["imports"] == ["dovetail", "dovetail_bench", "dovetail_machining", "dovetail_plugins"]
    assert test["python_version"] == ["${{ python_min }}.*", "*"], "the oldest Python and the newest"


def test_rattler_build_renders_it():
    """Its parser refuses keys, expressions and requirements that it does not know."""
    rattler_build = pytest.importorskip("rattler_build", reason="pip install py-rattler-build")
    file = ROOT / "conda" / "recipe.yaml"
    variants = rattler_build.VariantConfig.from_file(str(file.with_name("variants.yaml")))
    (rendered,) = rattler_build.Stage0Recipe.from_file(str(file)).render(variants)
    assert rendered.recipe.package.name == PROJECT["name"]
    broken = file.read_text(encoding="utf-8").replace("noarch: python", "noarchy: python")
    with pytest.raises(rattler_build.RecipeParseError, match="noarchy"):
        rattler_build.Stage0Recipe.from_yaml(broken)


def test_the_page_on_installation_lists_every_extra():
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `(\w+)` \|", page, flags=re.M)
    for_users = set(PROJECT["optional-dependencies"]) - {"test", "docs", "mutation"}
    assert set(listed) == for_users
