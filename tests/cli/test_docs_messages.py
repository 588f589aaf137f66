"""The page of messages, word for word; and the format of a truth file that it shows."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "messages.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, flags=re.M | re.S))
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", flags=re.M | re.S)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What stands next to the commands: the assemblies, and the measurement that the page begins with."""
    there = tmp_path_factory.mktemp("messages")
    shutil.copytree(ROOT / "assemblies", there / "assemblies")
    ((_, command),) = BLOCK.findall(PAGE.partition("\n## ")[0])
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(there)
        done = CliRunner().invoke(app, shlex.split(command)[1:])
        assert done.exit_code == 0, done.output
    return there


def printed(command):
    done = CliRunner().invoke(app, shlex.split(command)[1:])
    assert done.exit_code in (1, 2), done.output
    assert isinstance(done.exception, SystemExit), repr(done.exception)
    text = done.output.replace(str(Path.cwd()), "/home/me")
    return text[text.index("Error:") :] if done.exit_code == 2 else text  # without how the command is used


def raised(script):
    with pytest.raises(dovetail.DovetailError) as caught:
        exec(script, {})
    return f"{type(caught.value).__name__}: {caught.value}\n"


def test_the_page_has_at_least_twenty_messages():
    assert len(SECTIONS) >= 20


@pytest.mark.parametrize("title", SECTIONS)
def test_each_mistake_of_the_page_gets_the_message_shown_there(folder, monkeypatch, title):
    monkeypatch.chdir(folder)
    *files, (kind, last) = BLOCK.findall(SECTIONS[title])
    script = files.pop()[1] if kind == "text" else ""
    for language, text in files:
        name, _, content = text.removeprefix("# ").partition("\n")
        Path(name).write_text(text if language in ("yaml", "none") else content)
    if kind == "text":
        assert raised(script) == last
    else:
        command, _, output = last.removeprefix("$ ").partition("\n")
        assert printed(command) == output


def test_the_truth_on_the_page_is_read(run, assemblies, tmp_path):
    page = (ROOT / "docs" / "measurements.md").read_text(encoding="utf-8")
    section = page.partition("## The truth of a synthetic measurement\n")[2].partition("\n## ")[0]
    ((_, text),) = BLOCK.findall(section)
    file = tmp_path / "truth.json"
    file.write_text(text)
    assembly = dovetail.load(assemblies / "sdof.yaml")
    truth = dovetail.read_truth(file, assembly.parameters)
    assert (dict(truth.parameters), truth.natural_frequencies) == ({"k": 2.5e6, "c": 40.0}, (251.6,))
    assert truth.synthetic
    assert truth.note.startswith("Simulated")
    run(
        "simulate",
        assemblies / "sdof.yaml",
        "--set",
        "k=2.5e6",
        "--set",
        "c=40",
        "--truth-output",
        tmp_path / "own.json",
    )
    written = dovetail.read_truth(tmp_path / "own.json", assembly.parameters)
    assert written.parameters == truth.parameters
    assert written.natural_frequencies == pytest.approx(truth.natural_frequencies, rel=1e-3)
    keys = re.findall(r"^\| `(\w+)`", section, flags=re.M)
    file.write_text('{"natural": 1}')
    with pytest.raises(dovetail.MeasurementError) as caught:
        dovetail.read_truth(file, assembly.parameters)
    assert all(key in str(caught.value) for key in keys)
