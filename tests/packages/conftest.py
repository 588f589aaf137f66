"""Fresh environments: dovetail's wheel and a package under test, next to the libraries of this interpreter."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest

from support.waiting import PATIENCE

ROOT = Path(__file__).resolve().parents[2]


class Environment:
    """A virtual environment of its own; it sees the libraries that are installed here, but no source tree."""

    def __init__(self, folder: Path) -> None:
        venv.create(folder, with_pip=False, symlinks=True)
        self.scripts = folder / "bin"
        (site,) = (folder / "lib").glob("python*/site-packages")
        libraries = [entry for entry in sys.path if entry.endswith(("site-packages", "dist-packages"))]
        (site / "libraries.pth").write_text("\n".join(libraries), encoding="utf-8")

    def install(self, *packages: Path) -> None:
        command = [sys.executable, "-m", "pip", "--python", str(self.scripts / "python"), "install", "-q", "--no-index"]
        options = ["--no-deps", "--no-build-isolation", "--force-reinstall", "--disable-pip-version-check"]
        done = subprocess.run(
            [*command, *options, *map(str, packages)], capture_output=True, text=True, timeout=PATIENCE
        )
        assert done.returncode == 0, done.stderr

    def run(self, *words: object, code: int = 0, folder: Path | None = None) -> str:
        """Run a program of the environment: ``run("dovetail", "plugins")``."""
        program = str(self.scripts / str(words[0]))
        variables = {
            **os.environ,
            "OMP_NUM_THREADS": "1",
            "COLUMNS": "120",
            "DOVETAIL_CACHE_DIR": str(self.scripts / "c"),
        }
        for name in ("PYTHONPATH", "COLUMNS"):
            variables.pop(name, None)
        done = subprocess.run(
            [program, *map(str, words[1:])], capture_output=True, text=True, timeout=PATIENCE, cwd=folder, env=variables
        )
        assert done.returncode == code, f"{words}\n{done.stdout}\n{done.stderr}"
        return done.stdout + done.stderr


@pytest.fixture(scope="session")
def wheel(tmp_path_factory) -> Path:
    """Dovetail's own wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, "-w", str(folder), str(ROOT)], check=True, timeout=PATIENCE)
    (made,) = folder.glob("*.whl")
    return made


@pytest.fixture
def environment(tmp_path, wheel) -> Environment:
    """A fresh environment with dovetail's wheel."""
    fresh = Environment(tmp_path / "environment")
    fresh.install(wheel)
    return fresh
