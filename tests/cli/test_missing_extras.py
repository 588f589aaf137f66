"""Without the package of an extra, whatever needs it says so in one error, and everything else works.

For each extra of pyproject.toml a process is started in which its packages cannot be imported.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import dovetail
from support.hidden_packages import CALL, EXTRAS, hide, import_names
from support.labview_files import HEADER, SEGMENT

FREQUENCY = np.arange(1.0, 101.0)
SCHEDULER = ("--scheduler", "tcp://127.0.0.1:1")
"""Where no scheduler answers: the missing package must be noticed first."""
FLOW = {"samples": 60, "reducer": {"model": "none"}, "regressor": {"model": "flow", "max_epochs": 2}}
STUDY = {"samples": 60, "reducer": {"model": "none"}, "regressor": {"model": "mlp", "max_epochs": 2}}
SEARCH = {"search": {"trials": 2, "options": {"regressor.learning_rate": {"range": [1e-4, 1e-2], "scale": "log"}}}}
COMMANDS_THAT_READ = (
    ("identify", "sdof.yaml", "{file}"),
    ("convert", "{file}", "out.csv"),
    ("plot", "{file}", "-o", "out.png"),
    ("frf", "{file}", "-o", "out.csv"),
    ("explore", "sdof.yaml", "{file}", "--no-browser"),
    ("validate", "{file}.cases.yaml"),
    ("compare", "{file}.cases.yaml"),
)


def reading(*files: str) -> list[str | tuple[str, ...]]:
    """Return the doors through which a measured file is read: commands, and functions in Python."""
    commands = [tuple(word.format(file=file) for word in words) for words in COMMANDS_THAT_READ for file in files]
    return [*commands, *(f"dovetail.read_frf('{file}')" for file in files)]


DOORS: dict[str, list[str | tuple[str, ...]]] = {
    "hdf5": reading("measured.h5", "measured.mat"),
    "lvm": reading("measured.lvm"),
    "ansys": ["dovetail.read_matrices('job.full')"],
    "impact": [
        ("frf", "signals.npz", "-o", "out.csv"),
        "dovetail.frf_from_signals(np.eye(2, 64), np.eye(2, 64), 1000.0)",
    ],
    "pandas": [
        "dovetail.load_result('result.json').to_dataframe()",
        "dovetail.identify_many('sdof.yaml', ['measured.csv'], 'refined', processes=1).to_dataframe()",
        "dovetail.modes('sdof.yaml').to_dataframe()",
    ],
    "arviz": ["dovetail.identify('sdof.yaml', 'measured.csv', samples=20, cause_seconds=0.0).to_inferencedata()"],
    "xarray": ["dovetail.to_xarray(dovetail.read_frf('measured.csv'))"],
    "dask": [
        ("generate", "small.yaml", "-o", "data.zarr", *SCHEDULER),
        ("calibrate", "small.yaml", "--cases", "2", *SCHEDULER),
        ("identify", "small.yaml", "batch", "-o", "batch_results", *SCHEDULER),
        ("study", "study.yaml", "-o", "study", *SCHEDULER),
        "dovetail.generate('small.yaml', 'data.zarr', scheduler='tcp://127.0.0.1:1')",
        "dovetail_bench.calibrate('small.yaml', cases=2, scheduler='tcp://127.0.0.1:1')",
        "dovetail.identify_many('small.yaml', ['measured.csv'], scheduler='tcp://127.0.0.1:1')",
        "dovetail_bench.study('study.yaml', 'study', scheduler='tcp://127.0.0.1:1')",
    ],
    "flow": [
        ("train", "flow.yaml", "-o", "model"),
        ("identify", "flow.yaml", "measured.csv", "--method", "network"),
        ("robustness", "flow.yaml", "--models", "none", "--levels", "0"),
        "dovetail.train('flow.yaml')",
    ],
    "study": [
        ("study", "study.yaml", "-o", "study"),
        "dovetail_bench.study('study.yaml', 'study')",
    ],
    "notebook": [],
}
"""What needs each extra: words of a command, or Python. Bars in a notebook are left out, the work goes on."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, assemblies: Path) -> Path:
    """A folder with descriptions, and with a measurement in every format that needs a package."""
    folder = tmp_path_factory.mktemp("extras")
    text = (assemblies / "sdof.yaml").read_text(encoding="utf-8")
    (folder / "sdof.yaml").write_text(text, encoding="utf-8")
    sections: dict[str, dict[str, Any]] = {
        "small": {"identification": {"samples": 60}},
        "flow": {"identification": FLOW},
        "study": {"identification": STUDY, "study": SEARCH},
    }
    for name, changed in sections.items():
        described = {"extends": "sdof.yaml", "name": name, **changed}
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(described), encoding="utf-8")
    assembly = dovetail.load(folder / "sdof.yaml")
    frf = dovetail.noisy_frf(dovetail.Frf(assembly.frequency, assembly.frf([3e6, 40.0]), "accelerance"), 0.01, 0)
    (folder / "batch").mkdir()
    for path in (folder / "measured.csv", folder / "batch" / "one.csv", folder / "batch" / "two.csv"):
        dovetail.write_frf(frf, path)
    found = dovetail.identify(assembly, frf, "refined", cause_seconds=0.0)
    (folder / "result.json").write_text(json.dumps(found.to_dict()), encoding="utf-8")
    (folder / "measured.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(2000))
    (folder / "measured.mat").write_bytes(
        b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(384) + b"\x89HDF\r\n\x1a\n"
    )
    (folder / "measured.lvm").write_text(HEADER + SEGMENT, encoding="utf-8")
    (folder / "job.full").write_bytes(b"d\0\0\0" + bytes(4) + b"\4\0\0\0" + bytes(400))
    pulse = np.zeros((3, 512))
    pulse[:, 5:9] = [1.0, 3.0, 3.0, 1.0]
    np.savez(
        folder / "signals.npz", force=pulse, response=np.cumsum(pulse, axis=1), rate=1000.0, quantity="accelerance"
    )
    for file in ("measured.h5", "measured.mat", "measured.lvm"):
        case = {"assembly": "sdof.yaml", "measured": {"file": file}}
        cases = {"dovetail_series": 1, "tests": {"one": {**case, "joint": case}}}
        (folder / f"{file}.cases.yaml").write_text(yaml.safe_dump(cases), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def without(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., dict[str, tuple[int, str]]]:
    """Use doors in a process without packages; return the exit code and the text of each."""

    def use(names: set[str], doors: list[str | tuple[str, ...]]) -> dict[str, tuple[int, str]]:
        environment = hide(names, tmp_path_factory.mktemp("hidden"))
        environment["DOVETAIL_CACHE_DIR"] = str(tmp_path_factory.mktemp("cache"))
        command = [sys.executable, "-c", CALL, json.dumps(doors)]
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=1200)
        assert done.returncode == 0, done.stderr
        return {door: (code, text) for door, code, text in json.loads(done.stdout.splitlines()[-1])}

    return use


def test_every_extra_has_functions_that_need_it():
    assert set(DOORS) == set(EXTRAS)


def check_reported(extra: str, door: object, code: int, text: str) -> None:
    """Check that a door gives one error, with the package and the command that installs it."""
    said, names = " ".join(text.split()), import_names(extra)
    assert code == 1, (door, text)
    assert "Traceback" not in said, (door, text)
    assert said.count("this needs the package") == 1, (door, text)
    assert re.search(rf"this needs the package ({'|'.join(names)}), which is not installed", said), (door, text)
    assert said.count(f'pip install "dovetail-frf[{extra}]"') == 1, (door, text)


def test_every_missing_package_is_reported_where_none_is_installed(without):
    """But for a study on a cluster, which lacks two of them then."""
    every = set().union(*map(import_names, EXTRAS))
    doors = [(extra, door) for extra in DOORS for door in DOORS[extra] if extra != "dask" or "study" not in str(door)]
    answers = without(every, [door for _, door in doors]).items()
    for (extra, _), (door, (code, text)) in zip(doors, answers, strict=True):
        check_reported(extra, door, code, text)


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("extra", [extra for extra, doors in DOORS.items() if doors])
def test_a_missing_package_is_reported_with_the_install_command(without, extra):
    for door, (code, text) in without(import_names(extra), DOORS[extra]).items():
        check_reported(extra, door, code, text)


def test_all_else_works_without_any_extra(without, folder):
    every = set().union(*map(import_names, EXTRAS))
    doors: list[str | tuple[str, ...]] = [
        ("check", "sdof.yaml"),
        ("check", "flow.yaml"),
        ("plugins",),
        ("identify", "sdof.yaml", "measured.csv", "--method", "refined", "-o", "results"),
        ("simulate", "sdof.yaml", "--set", "k=3 MN/m", "--set", "c=40", "-o", "simulated.uff"),
        ("convert", "measured.csv", "converted.npz"),
        "dovetail.identify('sdof.yaml', 'measured.csv', progress=True, samples=20, cause_seconds=0.0)",
        "dovetail.write_report(dovetail.identify('sdof.yaml', 'measured.csv', 'refined'), 'report.html')",
    ]
    answers = without(every, doors)
    assert {door: text for door, (code, text) in answers.items() if code} == {}
    assert (folder / "results" / "report.html").exists()
    assert (folder / "report.html").exists()


def test_a_notebook_without_ipywidgets_warns_once(without):
    notebook = (
        "import rich.console, warnings; rich.console._is_jupyter = lambda: True; warnings.simplefilter('always'); "
        "dovetail.identify('sdof.yaml', 'measured.csv', 'refined', progress=True)"
    )
    ((code, text),) = without(import_names("notebook"), [notebook]).values()
    said = " ".join(text.split())
    assert code == 0, text
    assert said.count('pip install "dovetail-frf[notebook]"') == 1, text


def test_extras_that_install_several_are_complete():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (everything,) = project["optional-dependencies"]["all"]
    assert set(re.findall(r"\w+", everything.partition("[")[2])) == set(EXTRAS) - {"ansys", "notebook"}
