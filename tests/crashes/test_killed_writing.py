"""Results and models are complete or absent, whenever their writing is killed."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail import atomic_files
from dovetail.cli.output_files import writing
from dovetail.network import bundle
from dovetail.report import figures, plots
from dovetail.report.frf_files import write_frf_files
from dovetail.report.result_files import prepare_folder, write_results
from support.kills import kill_at_each_step

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
EVERY = pytest.mark.parametrize("stride", [13, pytest.param(1, marks=pytest.mark.slow)])


FILES = ["frf.csv", "frf.png", "parameters.csv", "report.html", "result.json"]


def hashes(folder: Path) -> dict[str, str]:
    """Of each file but the manifest and what is hidden."""
    files = (file for file in folder.iterdir() if file.name != "SHA256SUMS" and not file.name.startswith("."))
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def is_of_one_measurement(folder: Path) -> bool:
    listed = [line.split("  ") for line in (folder / "SHA256SUMS").read_text().splitlines()]
    if {name: digest for digest, name in listed} != hashes(folder) or sorted(hashes(folder)) != FILES:
        return False
    result = json.loads((folder / "result.json").read_text())
    value = result["parameters"]["k"]["value"]
    label = result["measured"]["label"]
    (first,) = (line for line in (folder / "frf.csv").read_text().splitlines() if line.startswith("1.0,"))
    return (
        label in (folder / "report.html").read_text(encoding="utf-8")
        and f",{value}," in (folder / "parameters.csv").read_text()
        and first.split(",")[1] == str(result["measured"]["real"][0])
    )


@pytest.fixture(scope="module")
def model(sdof) -> dovetail.Identifier:
    description = json.loads(sdof.description.text)
    regressor = {"model": "mlp", "hidden": [8, 4], "max_epochs": 3}
    description["identification"].update(samples=60, reducer={"model": "none"}, regressor=regressor)
    return dovetail.train(dovetail.load(description))


@pytest.fixture(scope="module")
def results(model):
    """The result of a measurement, and that of another one with other parameters.

    Their figures are drawn here, once: that takes longer than all else that each child does.
    """
    assembly = model.assembly
    frfs = [
        dovetail.Frf(assembly.frequency, assembly.frf(theta), "accelerance", label=label)
        for label, theta in (("first.csv", [4e6, 60.0]), ("second.csv", [3e6, 40.0]))
    ]
    results = [model.identify(frf, "network") for frf in frfs]
    drawn = {result.measured.label: plots.plot_frf(result) for result in results}
    images = {figure: figures.png_bytes(figure, label) for label, figure in drawn.items()}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plots, "plot_frf", lambda result, index: drawn[result.measured.label])
        patch.setattr(figures, "png_bytes", lambda figure, title: images[figure])
        yield results


def write(result: dovetail.Identification, folder: Path) -> None:
    prepare_folder(folder)
    with writing(folder, lambda place: write_results(result, place, None)):
        pass


@EVERY
def test_a_killed_identification_leaves_the_files_of_one_measurement(results, tmp_path, stride):
    folder = tmp_path / "results"

    def check():
        assert not folder.exists() or is_of_one_measurement(folder)

    kills = kill_at_each_step(lambda number: write(results[number % 2], folder), tmp_path, check, stride)
    assert kills >= 4
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


@EVERY
def test_a_killed_identification_in_the_working_folder_is_whole_if_it_has_a_manifest(
    results, tmp_path, stride, monkeypatch
):
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)

    def check():
        assert not (folder / "SHA256SUMS").exists() or is_of_one_measurement(folder)

    kills = kill_at_each_step(lambda number: write(results[number % 2], folder), tmp_path, check, stride)
    assert kills >= 4
    assert is_of_one_measurement(folder)
    assert sorted(path.name for path in folder.iterdir()) == ["SHA256SUMS", *FILES]


@pytest.mark.parametrize("exchange", [True, False])
@pytest.mark.parametrize("stride", [7, pytest.param(1, marks=pytest.mark.slow)])
def test_a_model_that_is_replaced_is_never_absent(model, tmp_path, stride, monkeypatch, exchange):
    """Where folders cannot be exchanged, as on Windows, the next run brings back what was moved away."""
    if not exchange:
        monkeypatch.setattr(atomic_files, "_exchange", lambda *_: False)
    states = [bundle._states(model)]  # a forked process computes nothing
    states.append({**states[0], "novelty": {**states[0]["novelty"], "number": 1}})
    whole = []
    for number, state in enumerate(states):
        monkeypatch.setattr(bundle, "_states", lambda _, state=state: state)
        whole.append(hashes(model.save(tmp_path / f"{number}")))
    assert whole[0] != whole[1]
    target = tmp_path / "model"
    model.save(target)

    def save(number: int) -> None:
        bundle._states = lambda _: states[number % 2]
        model.save(target)

    def check() -> None:
        if not exchange:
            with atomic_files.locked(target):
                pass
        assert hashes(target) in whole

    assert kill_at_each_step(save, tmp_path, check, stride) >= 4
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0", "1", "model"]


@pytest.mark.parametrize("stride", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_files_that_are_named_one_by_one_appear_together(tmp_path, stride):
    """Each takes its place by a step of its own; nothing is computed or written between those."""
    frequency = np.arange(1.0, 50.0)
    frfs = [dovetail.Frf(frequency, scale * frequency + 0j, "accelerance") for scale in (1.0, 2.0)]
    files = [tmp_path / name for name in ("frf.csv", "frf.uff", "frf.npz", "band.csv")]
    for frf in frfs:
        write_frf_files(frf, files, [], {files[3]: f"{frf.values[0].real}\n"}, overwrite=True)
    mixed = 0

    def check() -> None:
        nonlocal mixed
        seen = {dovetail.read_frf(file).values[0].real for file in files[::2]} | {float(files[3].read_text())}
        mixed += len(seen) > 1

    def write(number: int) -> None:
        write_frf_files(frfs[number % 2], files, [], {files[3]: f"{1.0 + number % 2}\n"}, overwrite=True)

    kills = kill_at_each_step(write, tmp_path, check, stride)
    assert kills > 8
    assert mixed <= 3  # between the four renames
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(file.name for file in files)
