"""Hostile names in every command: a terminal, browser, spreadsheet or page shows them as text and executes nothing."""

from __future__ import annotations

import base64
import csv
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from dovetail.cli.app import app

OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]")
NAME = "=cmd|'/C calc'!A0\"><img src=x onerror=alert(1)><form action=//x><meta http-equiv=refresh>$\\frac{1$\u202eX"
FILE = "=cmd\x1b[31m<b>\x9b2J\udcff.uff"
NOTE = "=1+1\x1b]0;owned\x07,=cmd|' /C calc'!A0\x9b2J<script>x</script>\u202e"
CASES = """\
dovetail_series: 1
name: {name}
covariates: {{torque: N m}}
tests:
  {name}: {{assembly: small.yaml, measured: plain.uff, joint: {joint}, at: {{torque: 1}}}}
  plain: {{assembly: small.yaml, measured: plain.uff, joint: {joint}, at: {{torque: 2}}}}
"""


class Elements(HTMLParser):
    """What a browser would make of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}
        assert tag != "meta" or dict(attrs).get("http-equiv") in (None, "Content-Security-Policy")


@pytest.fixture
def folder(tmp_path: Path, assemblies: Path, run) -> Path:
    parent = json.dumps(str(assemblies / "sdof.yaml"))
    text = f"extends: {parent}\nname: small\nfrequency: {{stop: 601 Hz, step: 4 Hz}}\n"
    (tmp_path / "small.yaml").write_text(text, encoding="utf-8")
    run("simulate", tmp_path / "small.yaml", "--set", "k=3 MN/m", "--set", "c=40", "-o", tmp_path / "plain.csv")
    table = (tmp_path / "plain.csv").read_text(encoding="utf-8")
    (tmp_path / "noted.csv").write_text(f"# note: {NOTE}\n{table}", encoding="utf-8")
    run("convert", tmp_path / "noted.csv", tmp_path / "plain.uff")
    (tmp_path / FILE).write_bytes((tmp_path / "plain.uff").read_bytes())
    return tmp_path


def check_scripts(text: str) -> None:
    """Nothing runs but what the page's policy names by its hash; other scripts are data that hold no element."""
    allowed = re.findall(r"'sha256-([^']*)'", text)
    for attributes, script in re.findall(r"<script([^>]*)>(.*?)</script>", text, flags=re.S):
        if attributes:
            assert attributes.startswith(' type="application/json"')
            assert "<" not in script
            json.loads(script)
        else:
            assert base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() in allowed
    assert len(allowed) in (0, 3)
    assert "default-src 'none'" in text


def check_files(folder: Path) -> None:
    """Look at everything that a command wrote."""
    files = [file for file in folder.iterdir() if file.suffix in (".html", ".csv", ".md", ".json")]
    assert files
    for file in files:
        text = file.read_bytes().decode("utf-8")
        assert not OBEYED.search(text) or file.suffix == ".json", file
        if file.suffix == ".html":
            elements = Elements(text)
            assert not elements.tags & {"img", "form", "b", "iframe", "link"}
            check_scripts(text)
            assert not {name for name in elements.attributes if name.startswith("on") or name == "src"}
        elif file.suffix == ".csv":
            for row in csv.reader(text.splitlines()):
                for cell in row:
                    assert not re.match(r"\s*[=@]|\s*[-+](?![\d.]+(e[-+]\d+)?$|$|inf)", cell), (file, cell)
        elif file.suffix == ".md":
            assert not re.search(r"<|!\[", text)
        else:
            json.loads(text)


def test_hostile_names_are_shown_harmlessly_by_identify_and_predict(folder, run):
    out = folder / "out"
    done = run("identify", folder / "small.yaml", folder / FILE, "--method", "refined", "-o", out)
    assert not OBEYED.search(done.output)
    check_files(out)
    done = run("predict", folder / "small.yaml", out, "-o", out / "p.csv")
    assert not OBEYED.search(done.output)
    check_files(out)


@pytest.mark.parametrize("command", ["validate", "compare"])
def test_hostile_names_of_cases_are_shown_harmlessly(folder, run, command):
    cases = CASES.format(name=json.dumps(NAME, ensure_ascii=False), joint="{assembly: small.yaml, measured: plain.uff}")
    (folder / "cases.yaml").write_text(cases, encoding="utf-8")
    options = ["--methods", "refined"] if command == "compare" else []
    done = run(command, folder / "cases.yaml", "-o", folder / "out", *options)
    assert not OBEYED.search(done.output)
    check_files(folder / "out")


ESCAPE = "\x1b[2J\x9b\u202eH"


def archive(folder: Path) -> Path:
    np.savez(folder / "a.npz", **{f"f{ESCAPE}": np.arange(3.0), f"g{ESCAPE}": np.arange(3.0)})
    return folder / "a.npz"


def units(folder: Path) -> Path:
    np.savez(folder / "u.npz", frequency=np.arange(1.0, 4), values=np.arange(3.0) + 1j, unit=f"m{ESCAPE}/N")
    return folder / "u.npz"


def table(folder: Path) -> Path:
    (folder / "t.csv").write_text(f"frequency_Hz,re{ESCAPE}al\n1,2\n", encoding="utf-8")
    return folder / "t.csv"


def noted(folder: Path) -> Path:
    values = {"frequency": np.arange(1.0, 4), "values": np.arange(3.0) + 1j, "quantity": "mobility"}
    np.savez(folder / "n.npz", **values, note=NOTE)
    return folder / "n.npz"


@pytest.mark.parametrize("make", [archive, units, table])
def test_faults_of_files_show_what_they_name(make, run, tmp_path):
    assert not OBEYED.search(run("convert", make(tmp_path), tmp_path / "b.csv", code=1).output)
    assert not OBEYED.search(run("frf", make(tmp_path), "-o", tmp_path / "b.csv", code=1).output)


def test_control_characters_in_notes_and_file_names_are_not_printed(run, folder, tmp_path):
    for output in ("b.csv", "b.uff", "b.npz"):
        assert not OBEYED.search(run("convert", noted(tmp_path), folder / output).output)
    (tmp_path / "only").mkdir()
    (folder / "b.csv").rename(tmp_path / "only/b.csv")
    check_files(tmp_path / "only")
    for words in (("convert", tmp_path / f"{FILE}.csv", "b.csv"), ("check", tmp_path / FILE)):
        assert not OBEYED.search(run(*words, code=1).output)


ESCAPE = "\x1b]0;owned\x07\x1b[31mx\x9b2J\u202e"


@pytest.mark.parametrize(
    "words",
    [
        [ESCAPE],
        [f"--{ESCAPE}", "plugins"],
        ["--plugin", ESCAPE, "plugins"],
        ["convert", ESCAPE, "b.npz"],
        ["convert", "a.csv", ESCAPE],
        ["convert", "a.csv", "b.npz", ESCAPE],
        ["convert", "a.csv", f"-{ESCAPE}"],
        ["convert", "a.csv", f"--overwrite{ESCAPE}"],
        ["convert", "a.csv", f"--overwrite={ESCAPE}"],
        *(
            ["convert", "a.csv", "b.npz", option, ESCAPE]
            for option in ("--dofs", "--name", "--columns", "--index", "--to", "--unit", "--accelerometer-mass")
        ),
        ["identify", "a.yaml", "a.csv", "--method", ESCAPE],
        ["new-plugin", ESCAPE, "a"],
        ["new-plugin", "joint", ESCAPE],
        ["describe", ESCAPE],
        ["simulate", "a.yaml", "--set", ESCAPE, "-o", "b.npz"],
        ["robustness", "a.yaml", "--levels", ESCAPE],
    ],
    ids=lambda words: ascii(" ".join(words)),
)
def test_a_command_line_that_is_wrong_is_shown_and_not_obeyed(words, tmp_path, monkeypatch):
    """Words may come from file names by a wildcard."""
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text("# quantity: receptance\nfrequency,real,imag\n1,2,3\n2,3,4\n")
    done = CliRunner().invoke(app, words, color=True)
    assert done.exit_code in (1, 2)
    assert isinstance(done.exception, SystemExit)
    assert done.stderr
    assert not OBEYED.search(done.output)
