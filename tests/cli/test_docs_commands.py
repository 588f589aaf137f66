"""Pages of commands and scripts, run from top to bottom as a reader would."""

from __future__ import annotations

import csv
import re
import runpy
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

import dovetail

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^(<!-- output -->\n)?```(bash|yaml|python|)\n(.*?)^```", flags=re.S | re.M)


def run_page(page: str, folder: Path, type_line: Callable[[str], str], smaller: Mapping[str, str]) -> int:
    """Run the commands and scripts of a page from top to bottom, and return how many there were.

    A block below ``<!-- output -->`` must be in what the command before it prints.
    """
    if not (folder / "assemblies").exists():  # a page before this one has copied them
        shutil.copytree(ROOT / "assemblies", folder / "assemblies")
    described = folder / "assemblies" / "sdof.yaml"
    described.write_text(_replaced(described.read_text(encoding="utf-8"), smaller), encoding="utf-8")
    printed: list[str] = []
    for output, language, text in BLOCK.findall((ROOT / "docs" / page).read_text(encoding="utf-8")):
        if output:
            assert_printed(text, printed[-1])
        elif language == "bash":
            commands = text.strip().replace("\\\n", "").splitlines()
            printed += [type_line(_replaced(command, smaller)) for command in commands]
        elif language:
            name = re.match(r"# (\S+)\n", text)[1]
            (folder / name).write_text(_replaced(text, smaller), encoding="utf-8")
            if language == "python":
                printed.append(type_line(f"python {name}"))
    return len(printed)


def assert_printed(shown: str, printed: str) -> None:
    """Each line that is shown begins a line that was printed; numbers may differ in their last digits."""
    lines = [_words(line) for line in printed.splitlines()]
    for line in shown.splitlines():
        words = _words(line)
        assert any(_begins(candidate, words) for candidate in lines), f"not printed: {line}\n{printed}"


def _words(line: str) -> list[str]:
    return line.replace("\N{MINUS SIGN}", "-").split()


def _begins(printed: list[str], shown: list[str]) -> bool:
    return len(printed) >= len(shown) and all(map(_alike, printed, shown))


def _alike(printed: str, shown: str) -> bool:
    try:
        return float(printed.rstrip(",")) == pytest.approx(float(shown.rstrip(",")), rel=0.02, abs=0.1)
    except ValueError:
        return printed == shown


def test_a_line_that_was_not_printed_is_seen():
    assert_printed("k 2.50 to 2.6", "k   2.51   to  2.6 MN/m\n")
    for line in ("k 2.9", "c 2.51", "k 2.51 to 2.6 MN/m more"):
        with pytest.raises(AssertionError, match="not printed"):
            assert_printed(line, "k   2.51   to  2.6 MN/m\n")


def _replaced(text: str, smaller: Mapping[str, str]) -> str:
    for size, small in smaller.items():
        text = text.replace(size, small)
    return text


@pytest.fixture(autouse=True)
def _wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "160")


@pytest.fixture(scope="module")
def one_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the tutorials are read one after the other, as a reader would."""
    return tmp_path_factory.mktemp("learn")


@pytest.fixture
def learn(one_folder: Path, type_line: Callable[[str], str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same folder, as the current one."""
    monkeypatch.chdir(one_folder)
    return one_folder


def test_the_tutorials_are_tested_here_in_their_order():
    tree = (ROOT / "docs" / "learn.md").read_text(encoding="utf-8").partition("```{toctree}")[2]
    tested = re.findall(r'run_page\("(\w+)\.md", learn', Path(__file__).read_text(encoding="utf-8"))
    assert ["install", *tested] == [name for name in tree.split() if name.isidentifier()]


def test_the_first_look_runs_from_top_to_bottom(learn, type_line):
    assert run_page("first_look.md", learn, type_line, {}) >= 10
    made = {"frf.csv", "frf.png", "measured.uff", "small.zarr", "small_model", "predicted.csv", "sdof.svg"}
    assert made <= {path.name for path in learn.iterdir()}
    assert {"report.html", "result.json", "parameters.csv"} <= {p.name for p in (learn / "results").iterdir()}
    assert {"robustness.csv", "robustness.png"} <= {p.name for p in (learn / "robustness").iterdir()}


def test_your_own_measurement_is_described_mended_and_identified(learn, type_line):
    """In a smaller band, by a Gaussian, and without the search for what explains the misfit of the draft."""
    smaller = {
        "to 10 kHz": "to 4 kHz",
        "-o wrong": "--cause-seconds 0 -o wrong",
        "-o hub_results": "--form laplace -o hub_results",
    }
    assert run_page("own_measurement.md", learn, type_line, smaller) == 6
    draft, mine = (dovetail.load_result(learn / name) for name in ("wrong", "hub_results"))
    assert (draft.is_trustworthy, mine.is_trustworthy) == (False, True)
    truth = dovetail.read_truth(learn / "assemblies/measurements/shaft_hub.truth.json", mine.parameters.values())
    assert mine.parameters["k"].value == pytest.approx(truth.parameters["k"], rel=0.05)


def test_a_new_joint_is_checked_and_identified(learn, type_line):
    assert run_page("new_joint.md", learn, type_line, {}) == 5
    assert (learn / "pad_results" / "report.html").exists()


def test_the_study_of_the_page_finds_the_settings_that_it_shows(tmp_path, type_line):
    pytest.importorskip("optuna")
    assert run_page("study.md", tmp_path, type_line, {}) == 1
    assert dovetail.load(tmp_path / "study" / "best.yaml").description.identification.reducer.config.n_components == 12


@pytest.mark.slow
def test_the_page_from_hammer_to_tool_tip_runs(learn, type_line):
    """Without the search for what explains the error of the mesh."""
    pytest.importorskip("pyFRF")
    smaller = {"-o joint": "--cause-seconds 0 -o joint"}
    assert run_page("hammer_to_tool_tip.md", learn, type_line, smaller) == 8
    with (learn / "compared" / "validation.csv").open() as stream:
        errors = [abs(float(row["error_percent"])) for row in csv.DictReader(stream) if row["error_percent"]]
    assert len(errors) >= 7
    assert max(errors) < 1.0


def test_a_bracket_in_space_is_described_measured_and_identified(learn, type_line):
    assert run_page("bracket.md", learn, type_line, {}) == 5
    result = dovetail.load_result(learn / "bracket_results")
    assert len(result.parameters) == 12
    assert {row.verdict for row in result.table} == {"identified"}
    assert result.parameters["k_ry"].value == pytest.approx(2e4, rel=0.01)


SMALLER = {
    "(20, 2)": "(2, 2)",
    "samples=2000": "samples=200",
    "--samples 2000": "--samples 200",
    "model: umap, n_components: 20, metric: euclidean": "model: pca, n_components: 20",
    "hidden: [512, 256]": "hidden: [64, 32], max_epochs: 50",
}


@pytest.mark.parametrize(("measurements", "smaller"), [(2, SMALLER), pytest.param(20, {}, marks=pytest.mark.slow)])
def test_the_script_and_the_commands_of_the_page_on_python_run(tmp_path, type_line, measurements, smaller):
    """By default with fewer measurements and samples, and a network that learns sooner; the script in this process."""

    def typed(line: str) -> str:
        if line.startswith("python "):
            return str(runpy.run_path(line.removeprefix("python "))["result"])
        return type_line(line)

    assert run_page("python.md", tmp_path, typed, smaller) == 10
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    script, *short = re.findall(r"^```python\n(.*?)^```", text, flags=re.S | re.M)
    assert len(script.splitlines()) <= 45
    assert all(len(example.splitlines()) <= 25 for example in short)
    assert len(list((tmp_path / "measured").iterdir())) == measurements
    with (tmp_path / "results_by_command" / "parameters.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        truth = float(row["measurement"][len("joint_")]) * 1e6 if row["name"] == "k" else 40.0
        assert float(row["estimate"]) == pytest.approx(truth, rel=0.05)
        assert row["network"]
    assert len(rows) == 6
