"""The files after one that was read in a wrong unit: the watch finds the parameters again, and not another minimum."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.monitoring import ALARM, PREDICTED, Watch, WatchOptions

TRUTH = {"k": 4.13e7, "c": 60.0, "kr": 3e4, "cr": 0.6}
SERIES = {
    "dovetail_series": 1,
    "assembly": "clamped_rod.yaml",
    "tests": {"first": {"measured": "first.csv"}},
    "parameters": {"k": "varying", "kr": "varying", "c": "shared", "cr": "shared"},
}


def test_the_parameters_are_found_again_after_a_file_in_another_unit(assemblies: Path, tmp_path: Path) -> None:
    shutil.copy(assemblies / "series" / "clamped_rod.yaml", tmp_path)
    (tmp_path / "series.yaml").write_text(json.dumps(SERIES))
    (tmp_path / "files").mkdir()
    assembly, random = dovetail.load(tmp_path / "clamped_rod.yaml"), np.random.default_rng(7)

    def write(name: str, factor: float = 1.0) -> None:
        frf = dovetail.noisy_frf(dovetail.Frf(assembly.frequency, assembly.frf(TRUTH), "accelerance"), 0.01, random)
        scaled = replace(frf, values=factor * frf.values, variance=factor**2 * frf.variance)
        dovetail.write_frf(scaled, tmp_path / name)
        os.utime(tmp_path / name, (1.7e9, 1.7e9))

    write("first.csv")
    for day in range(1, 15):
        write(f"files/2026-01-{day:02d}.csv")
    write("files/2026-01-15 in g.csv", 1.0 / 9.80665)
    for day in range(16, 19):
        write(f"files/2026-01-{day:02d}.csv")
    watch = Watch(
        tmp_path / "series.yaml", tmp_path / "files", tmp_path / "out", WatchOptions(reference=14), settle=0.0
    )
    watch.look(trust_old=True)
    assert [record["status"] for record in watch.records[14:]] == [ALARM, ALARM, PREDICTED, PREDICTED]
    for record in watch.records[15:]:
        for name, value in TRUTH.items():
            assert record["parameters"][name]["value"] == pytest.approx(value, rel=0.02), (record["file"], name)
