"""Files named by untrusted descriptions and models: none is printed, and a model may name only files inside itself."""

from __future__ import annotations

import json
import os
import shutil
import stat
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.errors import BundleError, DescriptionError
from dovetail.identification import load_model
from dovetail.network.manifest import manifest_hash

SECRETS = {
    "passwd": "root:x:0:0:root:/root:/bin/bash\ndaemon:x:1:1::/:/bin/sh\n",
    "key": "-----BEGIN PRIVATE KEY-----\nMIIEvQIBADANBg\n-----END PRIVATE KEY-----\n",
    "settings": "name: 12\npassword: hunter2\npassword: hunter2\nroot: !secret x\n",
    "env": "TOKEN=hunter2\n",
    "list": "[root, hunter2]\n",
}
PART = {
    "dovetail": 1,
    "name": "imported",
    "frequency": {"start": "10 Hz", "stop": "400 Hz", "step": "10 Hz"},
    "substructures": {"part": {"model": "matrices", "file": "part.npz"}, "base": {"model": "ground"}},
    "joints": {
        "spring": {
            "model": "spring_damper",
            "connect": {"a": {"to": "part", "at": 0}, "b": {"to": "base", "at": 0}},
            "parameters": {"k": {"range": ["1 kN/m", "1 MN/m"]}, "c": {"value": "1 N s/m"}},
        }
    },
    "response": {"at": "part", "position": 0},
    "identification": {
        "samples": 40,
        "reducer": {"model": "none"},
        "regressor": {"model": "mlp", "hidden": [4, 4], "max_epochs": 2},
    },
}


@pytest.mark.parametrize("secret", SECRETS)
def test_the_content_of_a_file_other_than_a_description_is_not_printed(secret: str, tmp_path: Path) -> None:
    (tmp_path / "secret").write_text(SECRETS[secret])
    (tmp_path / "a.yaml").write_text("extends: secret\nname: a\n")
    with pytest.raises(DescriptionError) as caught:
        dovetail.load(tmp_path / "a.yaml")
    assert len(caught.value.faults) == 1
    for word in ("root", "hunter2", "BEGIN", "MII", "password"):
        assert word not in str(caught.value).replace(str(tmp_path), "")


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of an imported part, and a model of its assembly."""
    folder = tmp_path_factory.mktemp("trained")
    springs = 1e5 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    table = {"nodes": ["1", "2"], "directions": ["x", "x"], "positions": [0.0, 0.1]}
    np.savez(folder / "part.npz", M=np.eye(2), K=springs, **table)
    (folder / "a.yaml").write_text(json.dumps(PART))
    dovetail.train(dovetail.load(folder / "a.yaml")).save(folder / "model")
    return folder


def test_a_model_holds_the_files_of_its_description(trained: Path, tmp_path: Path) -> None:
    moved = shutil.copytree(trained / "model", tmp_path / "elsewhere")
    (trained / "part.npz").rename(trained / "gone.npz")
    try:
        model = load_model(moved)
    finally:
        (trained / "gone.npz").rename(trained / "part.npz")
    [file] = model.assembly.description.files.values()
    assert Path(file).parent == moved / "files"
    model.save(tmp_path / "again")
    assert {path.name for path in (tmp_path / "again/files").iterdir()} == {Path(file).name}


@pytest.mark.parametrize("name", ["/etc/passwd", "../part.npz", "files/../../part.npz", "link.npz"])
def test_a_model_names_no_file_outside_itself(trained: Path, tmp_path: Path, name: str) -> None:
    moved = shutil.copytree(trained / "model", tmp_path / "model")
    shutil.copy(trained / "part.npz", tmp_path / "part.npz")
    os.symlink(tmp_path / "part.npz", moved / "link.npz")
    manifest = json.loads((moved / "manifest.json").read_text())
    description = json.loads(manifest["description"])
    description["substructures"]["part"]["file"] = name
    manifest["description"] = json.dumps(description)
    manifest["sha256"] = manifest_hash(manifest)  # as a stranger can compute it
    (moved / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(BundleError, match=r"the file '.*' is not in '") as caught:
        load_model(moved)
    assert len(caught.value.faults) == 1


def test_a_model_with_a_changed_file_is_refused(trained: Path, tmp_path: Path) -> None:
    moved = shutil.copytree(trained / "model", tmp_path / "model")
    [file] = (moved / "files").iterdir()
    file.write_bytes(file.read_bytes() + b"\0")
    with pytest.raises(BundleError, match="the content of the file does not match its name"):
        load_model(moved)


def test_a_description_may_be_kept_in_a_folder(trained: Path, tmp_path: Path) -> None:
    assert dovetail.load(trained / "a.yaml", files_in=trained).name == "imported"
    with pytest.raises(DescriptionError, match="there is no such file"):
        dovetail.load(trained / "a.yaml", files_in=tmp_path)


def test_a_dataset_begins_under_an_unpredictable_name(sdof, tmp_path: Path) -> None:
    (tmp_path / "victim").mkdir()
    (tmp_path / "victim/kept").write_text("kept")
    os.symlink(tmp_path / "victim", tmp_path / f".d.zarr.{os.getpid()}.new")
    dovetail.generate(sdof, tmp_path / "d.zarr", samples=3)
    assert (tmp_path / "victim/kept").read_text() == "kept"
    assert stat.S_ISLNK(os.lstat(tmp_path / f".d.zarr.{os.getpid()}.new").st_mode)
