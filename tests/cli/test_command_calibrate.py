from __future__ import annotations

import csv
import json
import signal
import time

import pytest

from support.waiting import PATIENCE

pytestmark = pytest.mark.usefixtures("few_mode_searches")
FILES = {f"calibration.{suffix}" for suffix in ("html", "json", "md")}
FILES |= {"parameters.csv", "cases.csv", "ranks.png", "coverage.png", "SHA256SUMS"}


def test_calibrate_writes_all_files_and_prints_the_table(run, bench, tmp_path):
    folder = tmp_path / "study"
    arguments = ["calibrate", bench.description, "--cases", 2, "--samples", 50, "--noise", 0.1, "-o", folder]
    printed = run(*arguments).stdout
    assert {file.name for file in folder.iterdir()} == FILES
    reported = json.loads((folder / "calibration.json").read_text())
    rows = [line.split() for line in printed.splitlines() if line.startswith(("k ", "c ", "all "))]
    assert [row[1] for row in rows] == [
        *(f"{one['coverage']:.1%}" for one in reported["parameters"]),
        f"{reported['coverage']:.1%}",
    ]
    with (folder / "cases.csv").open() as stream:
        next(stream)
        cases = list(csv.DictReader(stream))
    held = sum(0.05 < float(case["rank k"]) < 0.95 for case in cases) / len(cases)
    assert held == pytest.approx(reported["parameters"][0]["coverage"])
    assert "| k | " in (folder / "calibration.md").read_text()
    for name in ("ranks.png", "coverage.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    page = (folder / "calibration.html").read_text()
    assert f"The 90 % intervals hold the truth in {reported['coverage']:.1%}" in page
    assert page.count("<svg") == 2
    again = json.loads(run(*arguments, "--json").stdout)
    assert again["parameters"] == reported["parameters"]


def test_ctrl_c_writes_the_finished_results(interruptible, bench, tmp_path):
    folder = tmp_path / "study"
    for seconds in (4, 8, 20, 60):  # however slow the machine is: before any case is done there is nothing to write
        process = interruptible("calibrate", bench.description, "--cases", 5000, "--samples", 50, "-o", folder)
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 130, errors
        if "of 5000 cases" in errors:
            break
        assert not (folder / "calibration.json").exists()
    assert {file.name for file in folder.iterdir()} == FILES


@pytest.mark.parametrize(
    ("arguments", "code", "found"),
    [
        (["--cases", "0"], 2, "--cases"),
        (["--noise", "0"], 1, "is not positive"),
        (["--finer-mesh", "4"], 1, "none of its parts has a mesh"),
        (["--model-error", "2"], 2, "'2' may mean 2 % or 200 %"),
        (["--model-error", "200%"], 1, "not a relative error"),
    ],
)
def test_wrong_options_are_refused(run, bench, arguments, code, found):
    assert found in run("calibrate", bench.description, *arguments, code=code).stderr


def test_a_folder_with_other_files_is_not_written_to(run, bench, tmp_path):
    (tmp_path / "ranks.png").write_text("mine")
    assert "would be replaced" in run("calibrate", bench.description, "-o", tmp_path, code=1).stderr
    assert (tmp_path / "ranks.png").read_text() == "mine"
