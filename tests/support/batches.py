"""Twelve measurements for a batch, of which some cannot be identified, and a command that loses workers on purpose."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np

import dovetail

COMMAND = """
import os, signal, sys, time
from pathlib import Path
from dovetail.identification import batch

identify, marks = batch.identify, Path(sys.argv[1])


def faulty(assembly, measured, *arguments, **options):
    name = measured.label
    (marks / f"{os.getpid()}.worker").touch()
    if name == "memory.npz":
        raise MemoryError
    if name == "bug.npz":
        raise ValueError("nobody thought of this")
    if name.startswith("killed_once") and not (marks / name).exists():
        (marks / name).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("killed_always"):
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("endless"):
        time.sleep(600)
    return identify(assembly, measured, *arguments, **options)


if __name__ == "__main__":
    batch.identify = faulty
    batch.cores = lambda: 2
    del sys.argv[1]
    from dovetail.cli import main
    main()
"""
"""The ``dovetail`` command whose work on measurements of certain names fails; the first argument is a folder."""
BAD = ("codepoint.npz", "huge.csv", "cut.npz", "memory.npz", "bug.npz")


def write_measurements(folder: Path, sdof: dovetail.Assembly, *names: str) -> None:
    """Write a description and a noisy measurement of each name, or a bad one if the name says so."""
    folder.mkdir(parents=True)
    (folder.parent / "sdof.yaml").write_text(sdof.description.text)
    random = np.random.default_rng(0)
    for number, name in enumerate(names):
        theta = sdof.from_unit(0.2 + 0.6 * random.random(2))
        frf = dovetail.noisy_frf(dovetail.Frf(sdof.frequency, sdof.frf(theta), "accelerance"), 0.01, number)
        dovetail.write_frf(frf, folder / name)
    if "huge.csv" in names:
        lines = "".join(f"{number},{number}e300,1e300\n" for number in range(1, 300))
        (folder / "huge.csv").write_text(f"# quantity: accelerance\nfrequency_Hz,real,imag\n{lines}")
    if "cut.npz" in names:
        (folder / "cut.npz").write_bytes((folder / "cut.npz").read_bytes()[:3000])
    if "codepoint.npz" in names:
        note = np.array(["a note"])
        note.view(np.uint32)[:2] = 0x110000, 0xFFFFFFFF
        arrays = {"frequency": np.arange(1.0, 99.0), "values": np.ones(98) + 1j, "quantity": np.array("accelerance")}
        np.savez(folder / "codepoint.npz", note=note, **arrays)


def start(place: Path, *words: str) -> subprocess.Popen[str]:
    """Start an identification of the measurements in `place`, with its results in the folder `results`.

    Ctrl-C reaches it, also where this process was started in the background, to ignore it.
    """
    (place / "marks").mkdir(exist_ok=True)
    (place / "faulty.py").write_text(COMMAND)
    options = ["identify", "sdof.yaml", *words, "-o", "results", "--cause-seconds", "0", "--samples", "50"]
    command = [sys.executable, "faulty.py", "marks", *options]
    return subprocess.Popen(
        command,
        cwd=place,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def summary(place: Path) -> list[str]:
    """Return the measurements that have a result, all of whose files are as the manifest says."""
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=place / "results", check=True)
    rows = (place / "results" / "summary.csv").read_text().splitlines()
    names = [row.partition(",")[0] for row in rows[1:]]
    for name in names:
        assert json.loads((place / "results" / f"{name}.json").read_text())["method"] == "posterior"
        assert (place / "results" / f"{name}.html").exists()
    return names
