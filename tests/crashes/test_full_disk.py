"""A generation whose writes fail at random moments, as on a full disk, still ends with a bit-identical dataset."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest

import dovetail

REFUSED = """
import json, random, resource, sys, dovetail
assembly = dovetail.load(json.loads(open(sys.argv[1]).read()))
moments, refusals = random.Random(1), []
unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)


def limit(size):
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, unlimited[1]))


def attempt(progress):
    try:
        return dovetail.generate(assembly, sys.argv[2], samples=int(sys.argv[3]), resume=True, progress=progress)
    except dovetail.DovetailError as error:
        refusals.append(str(error))
    finally:
        limit(unlimited[0])


limit(100)
assert attempt(lambda *reported: None) is None  # refused from the start: nothing may be left
for _ in range(int(sys.argv[4])):
    steps = [moments.randrange(0, 3)]

    def refuse(*reported):
        steps[0] -= 1
        if steps[0] < 0:
            limit(moments.choice([0, 1, 10_000, 1_000_000, 7_000_000]))  # a chunk has 8 MB

    assert attempt(refuse) is None
assert all("File too large" in refusal and "`resume=True`" in refusal for refusal in refusals), refusals
assert attempt(lambda *reported: None).complete
print(len(refusals))
"""

FULL = """
import json, random, subprocess, sys, dovetail
from dovetail.dataset import generation
generation.check_room = lambda *_: None  # which would refuse from the start
assembly = dovetail.load(json.loads(open(sys.argv[1]).read()))
moments, megabytes, refusals = random.Random(2), 0.2, []
while True:
    size = f"remount,size={int(megabytes * 1e6)}"
    subprocess.run(["mount", "-o", size, sys.argv[2]], check=True)
    try:
        dovetail.generate(assembly, sys.argv[2] + "/data.zarr", samples=int(sys.argv[3]), resume=True)
        break
    except dovetail.DovetailError as error:
        refusals.append(str(error))
    megabytes += moments.uniform(2, 14)
assert all("No space left on device" in refusal for refusal in refusals), refusals
print(len(refusals))
subprocess.run(["cp", "-r", sys.argv[2] + "/data.zarr", sys.argv[4]], check=True)
"""


@pytest.fixture(scope="module")
def whole(collet, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    (folder / "description.json").write_text(collet.description.text)
    return dovetail.generate(collet, folder / "data.zarr", samples=3000)


def same(folder, whole) -> None:
    """Equal in every file, and in nothing more than those."""
    files = {file.relative_to(whole.path): file for file in whole.path.rglob("*") if file.is_file()}
    assert {file.relative_to(folder) for file in folder.rglob("*") if file.is_file()} == {*files}
    for name, file in files.items():
        assert (folder / name).read_bytes() == file.read_bytes(), name
    assert np.isfinite(dovetail.Dataset(folder).amplitude[:]).all()


def test_a_dataset_is_resumed_after_a_disk_refused_at_random_moments(whole, tmp_path):
    description = whole.path.parent / "description.json"
    arguments = [str(description), str(tmp_path / "data.zarr"), str(len(whole)), "3"]
    without_caches = [sys.executable, "-B", "-c", REFUSED]  # the limit would cut off the bytecode of modules, too
    done = subprocess.run([*without_caches, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "4"
    same(tmp_path / "data.zarr", whole)
    assert [path.name for path in tmp_path.iterdir()] == ["data.zarr"]


def may_mount() -> bool:
    if not (shutil.which("unshare") and shutil.which("mount")):
        return False
    probe = ["unshare", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return subprocess.run(probe, capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not may_mount(), reason="mounting a small disk is not permitted here")
def test_a_dataset_is_resumed_after_the_disk_was_full(whole, tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    arguments = [str(whole.path.parent / "description.json"), str(disk), str(len(whole)), str(tmp_path / "copy.zarr")]
    mounted = 'mount -t tmpfs tmpfs "$1"; shift; exec "$@"'
    command = [
        "unshare",
        "--map-root-user",
        "--mount",
        "sh",
        "-ec",
        mounted,
        "sh",
        str(disk),
        sys.executable,
        "-c",
        FULL,
    ]
    done = subprocess.run([*command, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 4
    same(tmp_path / "copy.zarr", whole)


FILLED = """
import hashlib, json, os, pathlib, random, shutil, sys, dovetail
from dovetail.cli.output_files import writing
from dovetail.report.result_files import write_results
from dovetail.report.frf_files import write_frf_files

assembly = dovetail.load(json.loads(open(sys.argv[1]).read()))
disk, moments, times = pathlib.Path(sys.argv[2]), random.Random(3), int(sys.argv[3])
model = dovetail.train(assembly)
frfs = [dovetail.Frf(assembly.frequency, assembly.frf(theta), "accelerance") for theta in ([4e6, 60.0], [3e6, 40.0])]
results = [model.identify(frf, "network") for frf in frfs]
printed, refused = 0, {"results": 0, "model": 0, "files": 0}


def attempt(kind, write):
    try:
        write()
    except dovetail.DovetailError as error:
        assert "No space left on device" in str(error), error
        refused[kind] += 1


def write(folder, result):
    global printed
    with writing(folder, lambda place: write_results(result, place, None)):
        printed += 1


def size(path):
    return sum(file.stat().st_blocks * 512 for file in path.rglob("*"))


def digest(file):
    return hashlib.sha256(file.read_bytes()).hexdigest()


write(disk / "results", results[0])
model.save(disk / "model")
write_frf_files(frfs[0], [disk / "a.csv", disk / "a.npz"], (), {}, overwrite=True)
whole = [shutil.disk_usage(disk).free, size(disk)]
for turn in range(times):
    free = int(whole[1] * moments.uniform(0.0, 0.7))
    with open(disk / "ballast", "wb") as ballast:
        ballast.truncate(0)
        os.posix_fallocate(ballast.fileno(), 0, shutil.disk_usage(disk).free - free)
    attempt("results", lambda: write(disk / "results", results[turn % 2]))
    attempt("model", lambda: model.save(disk / "model"))
    attempt("files", lambda: write_frf_files(
        frfs[turn % 2], [disk / "a.csv", disk / "a.npz"], (), {}, overwrite=True))
    os.remove(disk / "ballast")
    lines = (disk / "results" / "SHA256SUMS").read_text().splitlines()
    assert sorted(line.split("  ")[1] for line in lines) == sorted(
        file.name for file in (disk / "results").iterdir() if file.name != "SHA256SUMS")
    assert all(digest(disk / "results" / line.split("  ")[1]) == line.split("  ")[0] for line in lines)
    dovetail.load_model(disk / "model")
    assert (dovetail.read_frf(disk / "a.csv").values == dovetail.read_frf(disk / "a.npz").values).all()
    assert sorted(path.name for path in disk.iterdir()) == ["a.csv", "a.npz", "model", "results"], list(disk.iterdir())
assert printed == times + 1
print(json.dumps(refused))
"""


@pytest.mark.skipif(not may_mount(), reason="mounting a small disk is not permitted here")
@pytest.mark.parametrize("times", [6, pytest.param(50, marks=pytest.mark.slow)])
def test_a_disk_that_fills_while_results_are_written_leaves_no_half_file(sdof, tmp_path, times):
    description = json.loads(sdof.description.text)
    regressor = {"model": "mlp", "hidden": [8, 4], "max_epochs": 3}
    description["identification"].update(samples=60, reducer={"model": "none"}, regressor=regressor)
    (tmp_path / "description.json").write_text(json.dumps(description))
    (tmp_path / "disk").mkdir()
    mounted = 'mount -t tmpfs -o size=20m tmpfs "$1"; shift; exec "$@"'
    command = ["unshare", "--map-root-user", "--mount", "sh", "-ec", mounted, "sh", str(tmp_path / "disk")]
    command += [sys.executable, "-c", FILLED, str(tmp_path / "description.json"), str(tmp_path / "disk"), str(times)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    refused = json.loads(done.stdout)
    assert 0 < refused["results"] <= times
    assert 0 < refused["files"] <= times
