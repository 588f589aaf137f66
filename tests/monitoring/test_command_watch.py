"""``dovetail watch``: its output, its exit codes, its table and its page."""

import csv
import json
import re
import signal
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from dovetail.cli.app import app
from support.waiting import PATIENCE, wait_until
from support.watched_mornings import write_morning


@pytest.fixture(scope="module")
def watched(mornings, tmp_path_factory):
    """The output of a single look, and the folder of its results."""
    folder, series = mornings
    output = tmp_path_factory.mktemp("watched") / "out"
    command = ["watch", str(series), str(folder / "files"), "-o", str(output), "--once", "--reference", "12"]
    return CliRunner().invoke(app, command), output


def test_an_alarm_makes_the_exit_code_3_and_is_printed(watched):
    done, _ = watched
    assert done.exit_code == 3, done.output
    assert "ALARM at 2026-01-21.csv (2026-01-21T00:00:00): k fell by 10 %." in done.stderr
    assert re.search(r"^21  2026-01-21\.csv  alarm  k 1\.[78]\d*e\+06 N/m, c 2", done.stdout, re.MULTILINE)


def test_a_second_look_finds_nothing_new(watched, mornings):
    folder, series = mornings
    _, output = watched
    command = ["watch", str(series), str(folder / "files"), "-o", str(output), "--once", "--reference", "12"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert "0 new files" in done.stderr


def test_table_and_journal_have_a_line_for_each_file(watched):
    _, output = watched
    rows = list(csv.DictReader((output / "files.csv").open(encoding="utf-8")))
    records = [json.loads(line) for line in (output / "files.jsonl").read_text().splitlines()]
    assert len(rows) == len(records) == 28
    for row, record in zip(rows, records, strict=True):
        assert float(row["k [N/m]"]) == record["parameters"]["k"]["value"]
        assert row["alarm"] == str(record["status"] == "alarm")


def test_the_page_loads_nothing_and_names_the_alarm(watched):
    _, output = watched
    page = (output / "watch.html").read_text(encoding="utf-8")
    assert "<title>Alarm: mass on a mount, every morning: 28 files</title>" in page
    assert "k fell by 10 %." in page
    assert not re.search(r"(src|href)\s*=|url\(|@import|<script", page)
    assert page.count("<svg") == 3  # k, c and the evidence


def test_it_stops_cleanly_when_it_is_asked_to_end(mornings, tmp_path):
    folder, series = mornings
    command = [sys.executable, "-m", "dovetail", "watch", str(series), str(folder / "files"), "--settle", "0"]
    command += ["-o", str(tmp_path / "out"), "--interval", "0.1", "--reference", "12"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    wait_until((tmp_path / "out" / "watch.html").exists, process)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=PATIENCE)
    errors = errors.decode()
    assert process.returncode == 0, errors
    assert "28 new files" in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["missing.yaml", "files"], 1, "missing.yaml"),
        (["watch.yaml", "missing"], 1, "there is no such folder"),
        (["watch.yaml", "files", "--false-alarms", "2"], 2, "percent sign"),
        (["watch.yaml", "files", "--false-alarms", "60%"], 1, "not a rate of false alarms"),
        (["watch.yaml", "files", "--reference", "3"], 1, "too few to learn"),
    ],
)
def test_bad_input_is_one_error_without_a_traceback(mornings, tmp_path, monkeypatch, arguments, code, message):
    monkeypatch.chdir(mornings[0])
    done = CliRunner().invoke(app, ["watch", *arguments, "--once", "-o", str(tmp_path / "out")])
    assert done.exit_code == code, done.output
    assert message in done.output
    assert not (tmp_path / "out").exists()


def test_a_folder_without_files_has_a_page_that_says_so(mornings, tmp_path):
    (tmp_path / "empty").mkdir()
    done = CliRunner().invoke(
        app, ["watch", str(mornings[1]), str(tmp_path / "empty"), "-o", str(tmp_path / "out"), "--once"]
    )
    assert done.exit_code == 0, done.output
    assert "No measurement yet." in (tmp_path / "out" / "watch.html").read_text()
    assert write_morning(tmp_path / "empty", 0, 2e6).exists()
