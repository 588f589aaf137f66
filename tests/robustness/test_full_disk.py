"""A generation on a disk that refuses to be written, at random moments, ends with a dataset bit for bit the same."""

from __future__ import annotations

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
assert attempt(lambda *told: None) is None  # refused from the start: nothing may be left
for _ in range(int(sys.argv[4])):
    steps = [moments.randrange(0, 3)]

    def refuse(*told):
        steps[0] -= 1
        if steps[0] < 0:
            limit(moments.choice([0, 1, 10_000, 1_000_000, 7_000_000]))  # a chunk has 8 MB

    assert attempt(refuse) is None
assert all("File too large" in refusal and "--resume" in refusal for refusal in refusals), refusals
assert attempt(lambda *told: None).complete
print(len(refusals))
"""

FULL = """
import json, random, subprocess, sys, dovetail
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


def test_a_disk_that_refuses_at_random_moments(whole, tmp_path):
    description = whole.path.parent / "description.json"
    arguments = [str(description), str(tmp_path / "data.zarr"), str(len(whole)), "6"]
    done = subprocess.run([sys.executable, "-c", REFUSED, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "7"
    same(tmp_path / "data.zarr", whole)
    assert [path.name for path in tmp_path.iterdir()] == ["data.zarr"]


def may_mount() -> bool:
    if not (shutil.which("unshare") and shutil.which("mount")):
        return False
    probe = ["unshare", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return subprocess.run(probe, capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not may_mount(), reason="mounting a small disk is not permitted here")
def test_a_disk_that_is_full(whole, tmp_path):
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
