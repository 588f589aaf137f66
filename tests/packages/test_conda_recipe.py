"""The conda recipe has the requirements and commands of the package, and rattler-build reads it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
RECIPE = ROOT / "conda" / "recipe.yaml"
CONDA_NAMES = {"torch": "pytorch", "matplotlib": "matplotlib-base"}
"""Packages that conda-forge names otherwise."""


@pytest.fixture(scope="module")
def recipe():
    return yaml.safe_load(RECIPE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_recipe_requires_what_the_package_requires(recipe, project):
    required = set()
    for requirement in project["dependencies"]:
        name, _, least = requirement.partition(">=")
        required.add(f"{CONDA_NAMES.get(name, name)} >={least}")
    run = set(recipe["requirements"]["run"]) - {"python >=${{ python_min }}"}
    assert run == required


def test_the_recipe_has_the_oldest_python_and_the_commands_of_the_package(recipe, project):
    variants = yaml.safe_load((ROOT / "conda" / "variants.yaml").read_text(encoding="utf-8"))
    assert project["requires-python"] == f">={variants['python_min'][0]}"
    commands = [f"{name} = {target}" for name, target in project["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == commands


def test_rattler_build_renders_the_recipe():
    """Its own parser refuses keys, expressions and requirements that it does not know."""
    rattler_build = pytest.importorskip("rattler_build", reason="pip install py-rattler-build")
    variants = rattler_build.VariantConfig.from_file(str(RECIPE.with_name("variants.yaml")))
    (rendered,) = rattler_build.Stage0Recipe.from_file(str(RECIPE)).render(variants)
    assert rendered.recipe.package.name == "dovetail-frf"
    broken = RECIPE.read_text(encoding="utf-8").replace("noarch: python", "noarchy: python")
    with pytest.raises(rattler_build.RecipeParseError, match="noarchy"):
        rattler_build.Stage0Recipe.from_yaml(broken)
