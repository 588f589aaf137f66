"""The outside package of the docs: built, installed next to dovetail's wheel, used, and broken."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from dovetail.testing import check_names

PACKAGE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "dovetail-rubber-mount"


@pytest.fixture
def package(tmp_path) -> Path:
    """A copy of the package, away from the source tree."""
    return Path(shutil.copytree(PACKAGE, tmp_path / PACKAGE.name, ignore=shutil.ignore_patterns("__pycache__")))


@pytest.mark.slow
def test_it_is_listed_checked_and_identified_and_red_when_broken(environment, package, tmp_path):
    environment.install(package)
    where = environment.run("python", "-c", "import dovetail, dovetail_plugins; print(dovetail.__file__)")
    assert where.startswith(str(tmp_path / "environment"))
    assert re.search(r"joint +rubber_mount .*dovetail-rubber-mount 0\.1\.0", environment.run("dovetail", "plugins"))
    checked = environment.run("dovetail", "check-plugin", "rubber_mount")
    assert f"{len(check_names('joint')) - 2} passed, 2 not applicable." in checked

    def run(*words: str) -> str:
        return environment.run("dovetail", *words, folder=package)

    run("simulate", "example.yaml", "--set", "k=1.5e6", "--set", "g=0.2", "--set", "alpha=0.4", "-o", "measured.csv")
    run("identify", "example.yaml", "measured.csv", "--method", "refined", "-o", "results")
    found = json.loads((package / "results" / "result.json").read_text())
    values = {name: entry["value"] for name, entry in found["parameters"].items()}
    assert values == pytest.approx({"k": 1.5e6, "g": 0.2, "alpha": 0.4}, rel=1e-4)
    tested = environment.run("python", "-m", "pytest", "-q", "-p", "no:cacheprovider", package)
    assert f"{len(check_names('joint')) + 2} passed" in tested

    joint = package / "src" / "dovetail_rubber_mount" / "joint.py"
    joint.write_text(joint.read_text().replace("(1j * frequency", "(-1j * frequency"))
    environment.install(package)
    broken = environment.run("dovetail", "check-plugin", "rubber_mount", code=1)
    assert re.search(r"failed +dynamic stiffness is symmetric and passive", broken)
    assert "1 failed" in broken
    environment.run("python", "-m", "pytest", "-qx", "-p", "no:cacheprovider", "-k", "conformance", package, code=1)
