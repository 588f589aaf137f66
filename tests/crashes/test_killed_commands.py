"""Commands killed at random moments leave no partial or mixed file under a final name."""

from __future__ import annotations

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import dovetail

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are of POSIX")


@pytest.fixture(scope="module")
def place(sdof, tmp_path_factory) -> Path:
    """A description that trains in a second, two measurements, and a model."""
    folder = tmp_path_factory.mktemp("killed")
    description = json.loads(sdof.description.text)
    regressor = {"model": "mlp", "hidden": [8, 4], "max_epochs": 3}
    description["identification"].update(samples=60, reducer={"model": "none"}, regressor=regressor)
    (folder / "small.yaml").write_text(json.dumps(description))
    for name, theta in (("first", [4e6, 60.0]), ("second", [3e6, 40.0])):
        dovetail.write_frf(dovetail.Frf(sdof.frequency, sdof.frf(theta), "accelerance"), folder / f"{name}.csv")
    joint = "joint: {assembly: small.yaml, measured: first.csv}"
    cases = "".join(
        f"  {name}: {{assembly: small.yaml, measured: {name}.csv, {joint}}}\n" for name in ("first", "second")
    )
    (folder / "cases.yaml").write_text(f"dovetail_series: 1\ntests:\n{cases}")
    dovetail.train(dovetail.load(folder / "small.yaml")).save(folder / "model")
    return folder


def command(place: Path, kind: str, which: str) -> list[str]:
    words = {
        "generate": ["generate", "small.yaml", "-o", "data.zarr", "--samples", "4000"],
        "train": ["train", "small.yaml", "-o", "trained"],
        "identify": ["identify", "model", f"{which}.csv", "--method", "network", "-o", "results"],
        "convert": ["convert", f"{which}.csv", "converted.uff", "--overwrite"],
        "validate": ["validate", "cases.yaml", "--method", "network", "-o", "validated"],
        "calibrate": ["calibrate", "small.yaml", "--cases", "1", "--samples", "20", "-o", "calibrated"],
    }[kind]
    resume = ["--resume"] if kind == "generate" and (place / "data.zarr").exists() else []
    return [sys.executable, "-m", "dovetail", *words, *resume]


def check(place: Path) -> None:
    """Each target is not there, or whole."""
    for name in ("results", "validated", "calibrated"):
        if (place / name).exists():
            listed = [line.split("  ") for line in (place / name / "SHA256SUMS").read_text().splitlines()]
            files = {file.name: file for file in (place / name).iterdir() if file.name != "SHA256SUMS"}
            assert {file for _, file in listed} == files.keys()
            for digest, file in listed:
                assert hashlib.sha256(files[file].read_bytes()).hexdigest() == digest
    if (place / "trained").exists():
        dovetail.load_model(place / "trained")
    if (place / "converted.uff").exists():
        assert len(dovetail.read_frf(place / "converted.uff").frequency) == 600
    if (place / "data.zarr").exists():
        assert len(dovetail.Dataset(place / "data.zarr")) == 4000


EVERY = ("generate", "train", "identify", "convert", "validate", "calibrate")


@pytest.mark.parametrize(
    ("piece", "kinds", "kills"),
    [(0, ("identify",), 1), *(pytest.param(piece, EVERY, 25, marks=pytest.mark.slow) for piece in range(1, 9))],
)
def test_commands_killed_at_random_moments_leave_whole_files(place, piece, kinds, kills):
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "DOVETAIL_CACHE_DIR": str(place / "cache")}
    usual: dict[str, float] = {}
    moments, killed = random.Random(piece), 0
    for turn in range(10 * kills):
        kind = kinds[(turn + piece) % len(kinds)]
        start = time.monotonic()
        words = command(place, kind, ("first", "second")[turn // len(kinds) % 2])
        process = subprocess.Popen(words, cwd=place, stdout=-3, stderr=-1, env=environment)
        if kind in usual:
            try:
                process.wait(usual[kind] * moments.uniform(0.5, 1.0))
            except subprocess.TimeoutExpired:
                process.kill()
        said = process.communicate()[1].decode()
        assert process.returncode in (0, -signal.SIGKILL), (words, said)
        killed += process.returncode == -signal.SIGKILL
        if process.returncode == 0:
            usual[kind] = time.monotonic() - start
        check(place)
        if killed == kills:
            break
    assert killed == kills
    for kind in kinds:
        subprocess.run(command(place, kind, "first"), cwd=place, stdout=-3, check=True, env=environment)
    check(place)
    assert [path.name for path in place.iterdir() if path.name.startswith(".")] == []
