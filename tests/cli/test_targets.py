"""Output paths are checked before long work, and if the disk fills all the same the answer is still printed."""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
from collections import namedtuple
from pathlib import Path

import pytest
from safetensors import SafetensorError

import dovetail
import dovetail_bench
from dovetail import atomic_files

STUDIES = ("identify", "train", "generate", "calibrate", "validate", "compare", "robustness", "study")


@pytest.fixture
def untouched(monkeypatch):
    """Fail where long work begins."""
    bench = [(dovetail_bench, name) for name in ("calibrate", "validate", "compare", "robustness", "study")]
    for package, name in [(dovetail, "train"), (dovetail, "identify"), *bench]:
        monkeypatch.setattr(package, name, lambda *_, name=name, **__: pytest.fail(f"{name} began"))


@pytest.fixture
def arguments(bench, tmp_path):
    """Of each command that works for long; the target is yet to come."""
    cases = tmp_path / "cases.yaml"
    cases.write_text(
        f"dovetail_series: 1\nname: one\ntests:\n  one: {{assembly: {bench.description}, measured: {bench.measured}}}\n"
    )
    of_assembly = {
        name: [name, bench.description] for name in ("train", "generate", "calibrate", "robustness", "study")
    }
    of_cases = {name: [name, cases] for name in ("validate", "compare")}
    return {"identify": ["identify", bench.model, bench.measured, "--method", "network"], **of_assembly, **of_cases}


def fill(monkeypatch, free: int) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**9, 10**9 - free, free))


@pytest.mark.usefixtures("untouched")
@pytest.mark.parametrize("command", STUDIES)
def test_a_target_that_cannot_be_written_is_refused_before_any_work(run, arguments, tmp_path, command):
    (tmp_path / "file").write_text("mine")
    message = run(*arguments[command], "-o", tmp_path / "file" / "results", code=1).stderr
    assert (
        message == f"{tmp_path / 'file'}\n  nothing can be written here: Not a directory.\n  Choose another folder.\n"
    )


@pytest.mark.usefixtures("untouched")
@pytest.mark.parametrize("command", STUDIES)
def test_a_full_disk_is_reported_before_any_work(run, arguments, tmp_path, command, monkeypatch):
    fill(monkeypatch, free=10_000)
    message = run(*arguments[command], "-o", tmp_path / "results", code=1).stderr
    assert "its disk has 0.0 MB left, and " in message
    assert not (tmp_path / "results").exists()


@pytest.mark.usefixtures("untouched")
def test_a_dataset_needs_the_room_of_its_frfs(run, bench, tmp_path, monkeypatch):
    fill(monkeypatch, free=10**9)
    message = run("generate", bench.description, "--samples", 10**6, "-o", tmp_path / "data.zarr", code=1).stderr
    assert "its disk has 1000.0 MB left, and 2416.0 MB are needed." in message  # 600 lines of float32, 2 parameters
    assert not (tmp_path / "data.zarr").exists()


@pytest.mark.usefixtures("untouched")
def test_a_model_is_not_written_into_the_working_folder(run, arguments, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    message = run(*arguments["train"], "-o", ".", code=1).stderr
    problem = "the folder in which you work, or a disk of its own, cannot be replaced as a whole."
    assert message == f".\n  {problem}\n  Name a folder within it.\n"


def test_results_in_the_working_folder_are_listed_and_replace_those_before(run, arguments, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    Path("notes.txt").write_text("mine")
    run(*arguments["identify"], "-o", ".")
    first = sorted(path.name for path in Path.cwd().iterdir())
    assert first == ["SHA256SUMS", "frf.csv", "frf.png", "notes.txt", "parameters.csv", "report.html", "result.json"]
    run(*arguments["identify"], "-o", ".")
    assert sorted(path.name for path in Path.cwd().iterdir()) == first
    listed = Path("SHA256SUMS").read_text().splitlines()
    assert [line.split("  ")[1] for line in listed] == sorted({*first} - {"SHA256SUMS", "notes.txt"})


@pytest.mark.usefixtures("untouched")
@pytest.mark.parametrize("command", ["identify", "robustness"])
def test_files_listed_by_a_foreign_manifest_are_not_removed(run, arguments, tmp_path, command):
    """The user's own measurements with their hashes, or the results of another command."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "measured.txt").write_text("mine")
    (folder / "SHA256SUMS").write_text(f"{hashlib.sha256(b'mine').hexdigest()}  measured.txt\n")
    message = run(*arguments[command], "-o", folder, code=1).stderr
    problem = "SHA256SUMS would be replaced, and is not of an earlier run."
    assert message == f"{folder}\n  {problem}\n  Choose another folder.\n"
    assert (folder / "measured.txt").read_text() == "mine"


def test_a_full_disk_is_reported_before_a_file_is_written(run, bench, tmp_path, monkeypatch):
    fill(monkeypatch, free=10)
    message = run("simulate", bench.description, "-o", tmp_path / "a.csv", code=1).stderr
    assert "its disk has 0.0 MB left" in message
    assert not (tmp_path / "a.csv").exists()


@pytest.mark.parametrize("as_json", [False, True])
def test_a_disk_that_fills_at_the_end_loses_no_answer(run, arguments, tmp_path, monkeypatch, as_json):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(atomic_files, "_replace_folder", full)
    done = run(*arguments["identify"], "-o", tmp_path / "results", *["--json"] * as_json, code=1)
    assert ('"parameters"' if as_json else "Mean coherence") in done.stdout
    assert done.stderr == f"{tmp_path / 'results'}\n  the folder cannot be written: No space left on device.\n"
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def no_room_for_arrays(monkeypatch, folder: Path) -> None:
    """Refuse arrays below a folder, as safetensors does on a full disk."""
    import safetensors.numpy

    save = safetensors.numpy.save_file

    def refuse(arrays, file):
        if Path(file).is_relative_to(folder):
            raise SafetensorError("Error while serializing: I/O error: No space left on device (os error 28)")
        save(arrays, file)

    monkeypatch.setattr(safetensors.numpy, "save_file", refuse)


def test_a_full_cache_loses_no_answer(run, bench, tmp_path, monkeypatch):
    no_room_for_arrays(monkeypatch, tmp_path / "cache")
    monkeypatch.setattr(dovetail, "train", lambda *_, **__: dovetail.load_model(bench.model))
    done = run("identify", bench.description, bench.measured, "--method", "network", "-o", tmp_path / "results")
    assert "The model is not kept: " in done.stderr
    assert "No space left on device" in done.stderr
    assert "Mean coherence" in done.stdout
    assert (tmp_path / "results" / "report.html").exists()


def test_a_model_that_cannot_be_written_is_kept_elsewhere(run, bench, tmp_path, monkeypatch):
    no_room_for_arrays(monkeypatch, tmp_path / "disk")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(elsewhere))
    monkeypatch.setattr(dovetail, "train", lambda *_, **__: dovetail.load_model(bench.model))
    done = run("train", bench.description, "-o", tmp_path / "disk" / "model", code=1)
    assert "Mean R2" in done.stdout
    assert "the model cannot be written: " in done.stderr
    (kept,) = elsewhere.glob("*/model")
    assert f"The model is kept in {kept} for now." in done.stderr
    dovetail.load_model(kept)
    assert list((tmp_path / "disk").iterdir()) == []
