"""Shards of a dataset: disjoint, resumable, and merged to the same bytes as the dataset generated in one run."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app
from dovetail.dataset import generation
from dovetail.errors import DatasetError
from support.mass_on_mount import mass_on_mount
from support.waiting import PATIENCE

SAMPLES = 300


@pytest.fixture(scope="module", autouse=True)
def small_chunks():
    """Chunks of a few samples, so that there are enough of them for seven shards."""
    patch = pytest.MonkeyPatch()
    patch.setattr(generation, "_CHUNK_BYTES", 4e4)
    yield
    patch.undo()


@pytest.fixture(scope="module")
def assembly():
    return dovetail.load(mass_on_mount({"start": 10, "stop": 400, "step": 1}, {}))


@pytest.fixture(scope="module")
def whole(assembly, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "data.zarr"
    assert dovetail.generate(assembly, path, samples=SAMPLES).complete
    return path


def digests(folder):
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return {str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def shards(assembly, folder, count, **options):
    paths = [folder / f"shard{number}.zarr" for number in range(1, count + 1)]
    for number, path in enumerate(paths, start=1):
        dovetail.generate(assembly, path, samples=SAMPLES, shard=(number, count), **options)
    return paths


@pytest.mark.parametrize("count", [1, 3, 7])
def test_any_number_of_shards_gives_the_same_bytes(assembly, whole, tmp_path, count):
    paths = shards(assembly, tmp_path, count)
    written = np.array([dovetail.Dataset(path).amplitude.complete_chunks() for path in paths])
    assert (written.sum(axis=0) == 1).all()
    merged = dovetail.merge_datasets(paths[::-1], tmp_path / "data.zarr")
    assert merged.complete
    assert digests(tmp_path / "data.zarr") == digests(whole)
    merged.require(assembly)


def test_chunks_are_links_and_shards_may_go(assembly, whole, tmp_path):
    paths = shards(assembly, tmp_path, 2)
    dovetail.merge_datasets(paths, tmp_path / "data.zarr")
    chunk = "amplitude/c/0/0"
    assert os.stat(tmp_path / "data.zarr" / chunk).st_ino == os.stat(paths[0] / chunk).st_ino
    for path in paths:
        for file in sorted(path.rglob("*"), reverse=True):
            file.rmdir() if file.is_dir() else file.unlink()
    assert digests(tmp_path / "data.zarr") == digests(whole)


def test_chunks_are_copied_if_links_are_impossible(assembly, whole, tmp_path, monkeypatch):
    paths = shards(assembly, tmp_path, 2)

    def refuse(*_, **__):
        raise OSError("another file system")

    monkeypatch.setattr(os, "link", refuse)
    dovetail.merge_datasets(paths, tmp_path / "data.zarr")
    assert digests(tmp_path / "data.zarr") == digests(whole)


def test_an_interrupted_shard_is_reported_and_can_be_resumed(assembly, whole, tmp_path):
    paths = shards(assembly, tmp_path, 3)
    (paths[1] / "written" / "c" / "4").unlink()
    with pytest.raises(DatasetError) as error:
        dovetail.merge_datasets(paths, tmp_path / "data.zarr")
    assert error.value.faults[0].problem == "samples 100 to 124 are in none of the 3 shards."
    assert not (tmp_path / "data.zarr").exists()
    dovetail.generate(assembly, paths[1], samples=SAMPLES, shard=(2, 3), resume=True)
    dovetail.merge_datasets(paths, tmp_path / "data.zarr")
    assert digests(tmp_path / "data.zarr") == digests(whole)


@pytest.mark.parametrize("damage", ["truncated", "missing"])
def test_a_damaged_chunk_is_named_with_its_shard(assembly, tmp_path, damage):
    paths = shards(assembly, tmp_path, 3)
    file = paths[1] / "amplitude" / "c" / "4" / "0"
    if damage == "truncated":
        file.write_bytes(file.read_bytes()[:-100])
    else:
        file.unlink()
    with pytest.raises(DatasetError) as error:
        dovetail.merge_datasets(paths, tmp_path / "data.zarr")
    assert error.value.faults[0].where == str(file)
    assert "this chunk holds samples 100 to 124" in error.value.faults[0].problem
    assert not (tmp_path / "data.zarr").exists()


def test_training_on_a_shard_is_refused_with_a_remedy(assembly, tmp_path):
    (shard, _) = shards(assembly, tmp_path, 2)
    with pytest.raises(DatasetError) as error:
        dovetail.Dataset(shard).require(assembly)
    assert "joined by 'dovetail merge'" in error.value.faults[0].remedy


def test_all_missing_samples_are_listed(assembly, tmp_path):
    dovetail.generate(assembly, tmp_path / "shard.zarr", samples=290, shard=(1, 2))
    with pytest.raises(DatasetError, match="275 to 289 are in none"):
        dovetail.merge_datasets([tmp_path / "shard.zarr"], tmp_path / "data.zarr")


@pytest.mark.parametrize("count", [1, 3, 7])
def test_a_shard_that_was_killed_goes_on(assembly, whole, tmp_path, count):
    """SIGKILL ends it while it writes the first of two chunks."""
    description, path = tmp_path / "block.yaml", tmp_path / "shard1.zarr"
    description.write_text(assembly.description.text)
    script = f"""
import os, signal, dovetail
from dovetail.dataset import generation
generation._CHUNK_BYTES = 4e4
end = lambda stage, done, total, *_: done and os.kill(os.getpid(), signal.SIGKILL)
dovetail.generate({str(description)!r}, {str(path)!r}, samples={SAMPLES}, shard=(1, {count}), progress=end)
"""
    assert subprocess.run([sys.executable, "-c", script], timeout=PATIENCE).returncode == -signal.SIGKILL
    assert dovetail.Dataset(path).amplitude.complete_chunks().sum() <= 1
    with pytest.raises(DatasetError, match="are in none of the"):
        dovetail.merge_datasets([path], tmp_path / "data.zarr")
    dovetail.generate(assembly, path, samples=SAMPLES, shard=(1, count), resume=True)
    others = [tmp_path / f"shard{number}.zarr" for number in range(2, count + 1)]
    for number, other in enumerate(others, start=2):
        dovetail.generate(assembly, other, samples=SAMPLES, shard=(number, count))
    dovetail.merge_datasets([path, *others], tmp_path / "data.zarr")
    assert digests(tmp_path / "data.zarr") == digests(whole)


def test_shards_of_another_plan_are_refused(assembly, tmp_path):
    first = dovetail.generate(assembly, tmp_path / "a.zarr", samples=SAMPLES, shard=(1, 2))
    dovetail.generate(assembly, tmp_path / "b.zarr", samples=SAMPLES, shard=(2, 2), seed=9)
    with pytest.raises(DatasetError, match="its seed, parameters differ"):
        dovetail.merge_datasets([first.path, tmp_path / "b.zarr"], tmp_path / "data.zarr")
    description = json.loads(assembly.description.text)
    description["frequency"]["stop"] = 900.0
    dovetail.generate(dovetail.load(description), tmp_path / "c.zarr", samples=SAMPLES, shard=(2, 2))
    with pytest.raises(DatasetError, match="its description differ"):
        dovetail.merge_datasets([first.path, tmp_path / "c.zarr"], tmp_path / "data.zarr")
    with pytest.raises(DatasetError, match="a file or folder of this name already exists"):
        dovetail.merge_datasets([first.path], tmp_path / "b.zarr")
    with pytest.raises(DatasetError, match="there are none"):
        dovetail.merge_datasets([], tmp_path / "data.zarr")


def test_the_description_may_be_in_other_folders_on_other_machines(assembly, tmp_path):
    frequency, description = np.linspace(5.0, 500.0, 200), json.loads(assembly.description.text)
    receptance = np.array([[1e-7 + 0j, 0.0], [0.0, 1e-4]]) * np.ones((200, 1, 1))
    description["substructures"]["base"] = {"model": "measured", "file": "base.npz"}
    for number, machine in enumerate(("one", "other"), start=1):
        folder = tmp_path / machine
        folder.mkdir()
        dovetail.write_receptance(dovetail.ReceptanceMatrix(frequency, receptance), folder / "base.npz")
        (folder / "block.yaml").write_text(json.dumps(description))
        dovetail.generate(folder / "block.yaml", tmp_path / f"{number}.zarr", samples=SAMPLES, shard=(number, 2))
    merged = dovetail.merge_datasets([tmp_path / "1.zarr", tmp_path / "2.zarr"], tmp_path / "data.zarr")
    merged.require(dovetail.load(folder / "block.yaml"))


@pytest.mark.parametrize("shard", [(0, 3), (4, 3), (1, 0)])
def test_an_impossible_shard_number_is_refused(assembly, tmp_path, shard):
    with pytest.raises(DatasetError, match="there is no shard"):
        dovetail.generate(assembly, tmp_path / "data.zarr", samples=SAMPLES, shard=shard)


def test_a_wrong_shard_option_is_explained(tmp_path):
    result = CliRunner().invoke(app, ["generate", "a.yaml", "-o", str(tmp_path / "x.zarr"), "--shard", "2-7"])
    assert result.exit_code == 2
    assert "'2-7' is not I/N, such as 2/7." in result.stderr


def test_the_commands_of_the_page_run_as_they_stand(tmp_path, monkeypatch):
    root = Path(__file__).resolve().parents[2]
    page = (root / "docs" / "cluster.md").read_text(encoding="utf-8")
    first = re.findall(r"```bash\n(.*?)```", page, flags=re.S)[0].replace("--samples 3000", "--samples 60")
    identification = {"samples": 60, "reducer": {"model": "pca", "n_components": 5}, "regressor": {"model": "mlp"}}
    identification["regressor"] |= {"hidden": [4], "max_epochs": 1}
    description = {"extends": str(root / "assemblies" / "sdof.yaml"), "identification": identification}
    (tmp_path / "sdof.yaml").write_text(yaml.safe_dump(description))
    program = tmp_path / "bin" / "dovetail"
    program.parent.mkdir()
    program.write_text('#!/bin/bash\nprintf "%s\\n" "$(printf "%q " "$@")" >> words\n')
    program.chmod(0o755)
    environment = {**os.environ, "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}
    subprocess.run(
        ["bash", "-euo", "pipefail", "-c", first], cwd=tmp_path, env=environment, check=True, timeout=PATIENCE
    )
    monkeypatch.chdir(tmp_path)
    for words in (tmp_path / "words").read_text().splitlines():  # in this process, which spares their starts
        done = CliRunner().invoke(app, shlex.split(words))
        assert done.exit_code == 0, done.output
    assert dovetail.Dataset(tmp_path / "data.zarr").complete
    assert (tmp_path / "model" / "manifest.json").is_file()
