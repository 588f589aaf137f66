"""The other packages of the docs, a reader, a method and a reducer: installed together, checked, used as users do."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
NAMES = {"json_frf": "dovetail-json-frf", "evolution": "dovetail-evolution", "modal_peaks": "dovetail-modal-peaks"}


@pytest.fixture
def installed(environment, tmp_path):
    """An environment with all three, and copies of their folders by the component's name."""
    ignored = shutil.ignore_patterns("__pycache__")
    folders = {name: Path(shutil.copytree(EXAMPLES / d, tmp_path / d, ignore=ignored)) for name, d in NAMES.items()}
    environment.install(*folders.values())
    return environment, folders


def test_each_conforms_and_does_what_its_readme_says(installed):
    environment, folders = installed
    listed = environment.run("dovetail", "plugins")
    for name, folder in folders.items():
        assert re.search(rf"{name} .*{NAMES[name]} 0\.1\.0", listed)
        readme = (folder / "README.md").read_text()
        commands = re.findall(r"^(dovetail .*?)(?: +#.*)?$", readme, flags=re.M)
        assert len(commands) >= 4
        for command in commands:
            environment.run(*command.split(), folder=folder)
        passed = environment.run("python", "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "not conform", folder)
        assert " passed" in passed
