"""The transcript of docs/plugins.md, run as printed: from `new-plugin` to an identified parameter."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "plugins.md"
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def section() -> str:
    text = PAGE.read_text(encoding="utf-8")
    return text.partition("## From nothing to an identified parameter")[2].partition("\n## ")[0]


def blocks() -> list[tuple[str, str]]:
    return re.findall(r"^```(console|python)\n(.*?)^```", section(), flags=re.S | re.M)


def commands(block: str) -> list[tuple[str, list[str]]]:
    """Return each command and the lines that the page says it prints."""
    found: list[tuple[str, list[str]]] = []
    for line in block.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        else:
            found[-1][1].append(line)
    return found


def equal(expected: str, printed: str) -> bool:
    """Compare two lines: words to the letter but for the space between them, numbers within a hundredth."""
    words, numbers = NUMBER.sub("#", expected).split(), [float(number) for number in NUMBER.findall(expected)]
    theirs = [float(number) for number in NUMBER.findall(printed)]
    return words == NUMBER.sub("#", printed).split() and theirs == pytest.approx(numbers, rel=0.01)


def assert_printed(expected: list[str], printed: str, command: str) -> None:
    lines = iter(printed.splitlines())
    anywhere = False
    for wanted in expected:
        if wanted == "...":
            anywhere = True
            continue
        met = any(
            equal(wanted, line) or (anywhere and wanted in line) for line in (lines if anywhere else [next(lines)])
        )
        assert met, f"$ {command}\n{printed}\nlacks the line\n{wanted}"
        anywhere = False


def test_the_page_s_joint_is_at_most_forty_lines():
    (code,) = [text for language, text in blocks() if language == "python"]
    assert len(code.splitlines()) <= 40


def test_from_nothing_to_an_identified_parameter(environment, tmp_path, monkeypatch):
    for name in ("PIP_NO_BUILD_ISOLATION", "PIP_NO_INDEX", "PIP_NO_DEPS"):  # nothing from outside is needed
        monkeypatch.setenv(name, "0" if name == "PIP_NO_BUILD_ISOLATION" else "1")
    workplace = tmp_path / "workplace"
    workplace.mkdir()
    before: dict[Path, bytes] = {}
    ran = []
    for language, text in blocks():
        if language == "python":
            before = {
                file: file.read_bytes() for file in (workplace / "dovetail-felt-pad").rglob("*") if file.is_file()
            }
            (workplace / "dovetail-felt-pad/src/dovetail_felt_pad/joint.py").write_text(text, encoding="utf-8")
            continue
        for command, expected in commands(text):
            printed = environment.run(*shlex.split(command), folder=workplace)
            assert_printed(expected, printed, command)
            ran.append(command.split()[1])
    assert ran == ["new-plugin", "-m", "check-plugin", "simulate", "identify", "-m"]
    touched = [file.name for file, content in before.items() if file.read_bytes() != content]
    assert touched == ["joint.py"]
