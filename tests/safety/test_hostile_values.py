"""Whatever values a stranger's file holds: it is used, or refused in one error with its name. It is never "a bug"."""

from __future__ import annotations

import csv
import io
import json
import shutil
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import dovetail
import dovetail_bench
from dovetail.cli.app import app
from dovetail.errors import DovetailError
from support.hostile_values import PLAIN, arrays_like, outcome, places, refusal, replaced, texts, written

AXIS = np.arange(5.0, 305.0, 5.0)
TRUTH = [3e6, 40.0]


@pytest.fixture(scope="module")
def small(sdof) -> dovetail.Assembly:
    """An assembly that is trained in a second."""
    described = json.loads(sdof.description.text)
    regressor = {"model": "mlp", "hidden": [4, 4], "max_epochs": 2}
    settings = {"samples": 40, "seed": 0, "reducer": {"model": "none"}, "regressor": regressor}
    return dovetail.load({**described, "frequency": AXIS.tolist(), "identification": settings})


@pytest.fixture(scope="module")
def frf(small) -> dovetail.Frf:
    return dovetail.noisy_frf(dovetail.Frf(AXIS, small.frf(TRUTH), "accelerance", label="m.npz"), 0.01, 0)


@pytest.fixture(scope="module")
def result(small, frf) -> dict:
    return dovetail.identify(small, frf, cause_seconds=0.0, samples=20).to_dict()


SHARE = pytest.mark.parametrize("share", [3, pytest.param(1, marks=pytest.mark.slow)])
"""One of so many combinations of values and places is tried."""


def tried(sound, values, share: int) -> Iterator[tuple[tuple, object]]:
    """Yield places with values for them: each place and each value in its turn."""
    for row, at in enumerate(places(sound)):
        for column, value in enumerate(values):
            if (row + column) % share == 0:
                yield at, value


def sweep(text: str, use, path: Path, values=PLAIN, load=json.loads, dump=json.dumps, share=1) -> Counter[str]:
    """Put each value in each place of a file."""
    sound, outcomes = load(text), Counter()
    for at, value in tried(sound, values, share):
        written(path, dump(replaced(sound, at, value)))
        outcomes[outcome(use, path.name)] += 1
    return outcomes


FIELDS = ("frequency", "values", "coherence", "variance", "averages", "quantity", "unit", "note", "response")


@pytest.mark.parametrize("field", FIELDS)
def test_hostile_arrays_of_an_archive_are_read_or_refused(field, frf, tmp_path):
    sound = {
        "frequency": frf.frequency,
        "values": frf.values,
        "coherence": np.full(AXIS.size, 0.9),
        "variance": frf.variance,
        "averages": np.array(3),
        "quantity": np.array("accelerance"),
        "unit": np.array("m/s^2/N"),
        "note": np.array("a note"),
        "response": np.array("1+x"),
        "force": np.array("1+x"),
    }
    outcomes = Counter()
    for hostile in (arrays_like(sound[field]) if sound[field].ndim else texts()).values():
        np.savez(tmp_path / "m.npz", **{**sound, field: hostile})

        def use():
            with warnings.catch_warnings():
                warnings.simplefilter("error", RuntimeWarning)
                read = dovetail.read_frf(tmp_path / "m.npz")
            for suffix in (".csv", ".uff", ".npz"):
                dovetail.write_frf(read, tmp_path / f"copy{suffix}", overwrite=True)
                assert np.isfinite(dovetail.read_frf(tmp_path / f"copy{suffix}").values).all()

        outcomes[outcome(use, "m.npz") if field != "variance" else "used or refused"] += 1
    assert sum(outcomes.values()) >= 14
    assert outcomes["refused"] or field in ("variance", "note")


CELLS = ("1e300", "-1e300", "1e155", "5e-324", "-1", "1" * 400, "nan", "inf", "1e999", "x", "", "\x00", "\uff11", "1_0")


@pytest.mark.parametrize("column", [0, 1, 2])
def test_hostile_cells_of_a_table_are_read_or_refused(column, small, tmp_path):
    for cell in CELLS:
        rows = [[f"{line:g}", "1e-3", "2e-3"] for line in AXIS]
        rows[4][column] = cell
        stream = io.StringIO()
        csv.writer(stream).writerows([["frequency_Hz", "real", "imag"], *rows])
        file = written(tmp_path / "m.csv", f"# quantity: accelerance\n{stream.getvalue()}")
        outcome(lambda file=file: dovetail.read_frf(file), "m.csv")


@pytest.mark.parametrize("averages", ["0" * 40 + "5", "9" * 400, "000001000" + "9" * 900, "-3", "1e300", "nan", "1.5"])
def test_a_number_of_averages_that_is_not_a_whole_number_is_refused(averages, tmp_path):
    text = f"# quantity: accelerance\n# averages: {averages}\nfrequency_Hz,real,imag\n1,2,3\n2,3,4\n"
    file = written(tmp_path / "m.csv", text)
    if averages.endswith("5") and averages.startswith("0"):
        assert dovetail.read_frf(file).averages == 5
    else:
        with pytest.raises(DovetailError, match=r"m.csv:2\n.* is not a number of averages") as caught:
            dovetail.read_frf(file)
        assert len(str(caught.value)) < 300


def test_an_frf_has_limits_however_it_is_made():
    for changed, said in (
        ({"values": [1e300, 1.0]}, "line 1\n  the value is 1e.300, which no structure has"),
        ({"values": [0.0, 1e-300]}, "line 2\n  the largest value is 1e-300, which no structure has"),
        ({"frequency": [1.0, 1e300]}, "line 2\n  the frequency is 1e.300, which no structure has"),
        ({"variance": [1.0, 1e300]}, "line 2\n  the variance is 1e.300, which no structure has"),
        ({"averages": 10**400 // 3}, "line 1\n  3333333333333333333333333333333333333333 is not a number of averages"),
    ):
        sound = {"frequency": [1.0, 2.0], "values": [1.0, 2.0], "quantity": "accelerance", "label": "m.csv"}
        with pytest.raises(DovetailError, match=rf"m.csv  {said}"):
            dovetail.Frf(**{**sound, **changed})


@pytest.mark.parametrize("exponent", [-320, -155, -110, -90, 90, 110, 300])
def test_measurements_of_any_size_are_identified_or_refused(small, exponent):
    def use():
        measured = dovetail.Frf(AXIS, 10.0**exponent * small.frf(TRUTH), "accelerance", label="m.csv")
        found = dovetail.identify(small, measured, "refined", cause_seconds=0.0)
        assert np.isfinite([parameter.value for parameter in found.parameters.values()]).all()

    assert outcome(use, "m.csv") == ("used" if abs(exponent) < 100 else "refused")


@SHARE
def test_hostile_values_of_a_description_are_read_or_refused(sdof, tmp_path, share):
    def use():
        assembly = dovetail.load(tmp_path / "a.yaml")
        frf = assembly.frf()
        assert np.isfinite(frf).all()
        assembly.natural_frequencies()

    described = {**json.loads(sdof.description.text), "frequency": {"start": "1 Hz", "stop": "9 Hz", "step": "4 Hz"}}
    outcomes = Counter()
    for at, value in tried(described, PLAIN, share):
        written(tmp_path / "a.yaml", json.dumps(replaced(described, at, value)))
        outcomes["used" if refusal(use) is None else "refused"] += 1
    assert outcomes["refused"] > outcomes["used"] > 20 / share


@SHARE
def test_hostile_values_of_a_result_are_read_or_refused(small, result, tmp_path, share):
    def use():
        found = dovetail.load_result(tmp_path / "r.json")
        json.dumps(found.to_dict())
        assert repr(found)
        assert found._repr_html_()
        assert found.table
        for at in found.responses:
            assert np.isfinite(at.frf.values).all()

    values = (1e300, 0, 10**30, True, None, [], {"a": 1}, "x")
    outcomes = sweep(json.dumps(result), use, tmp_path / "r.json", values, share=share)
    assert min(outcomes.values()) > 100
    ragged = replaced(result, ("posterior", "samples", "theta", 0), result["posterior"]["samples"]["theta"][0][:1])
    written(tmp_path / "r.json", json.dumps(ragged))
    with pytest.raises(DovetailError, match=r"r.json\n.*a sample of its posterior has not as many values"):
        dovetail.load_result(tmp_path / "r.json")


@SHARE
def test_hostile_values_of_a_dataset_are_read_or_refused(small, tmp_path, share):
    data = dovetail.generate(small, tmp_path / "d.zarr").path

    def use():
        read = dovetail.Dataset(data)
        assert repr(read)
        assert read._repr_html_()
        read.require(small)
        assert np.isfinite(read.amplitude[:]).all()

    outcomes = Counter()
    for file in sorted(data.rglob("zarr.json")):
        sound = file.read_text()
        values = (1e300, -1, 10**30, None, [], {"a": 1}, "x", [2**62, 60], "(missing)")
        for at, value in tried(json.loads(sound), values, share):
            file.write_text(json.dumps(replaced(json.loads(sound), at, value)))
            outcomes[outcome(use, "d.zarr")] += 1
        file.write_text(sound)
    assert min(outcomes.values()) > 50 / share
    use()


@SHARE
def test_hostile_values_of_a_model_are_read_or_refused(small, frf, tmp_path, share):
    dovetail.train(small).save(tmp_path / "model")
    manifest = tmp_path / "model" / "manifest.json"
    sound = {name: value for name, value in json.loads(manifest.read_text()).items() if name != "sha256"}

    def use():
        model = dovetail.load_model(tmp_path / "model")
        assert repr(model)
        assert model._repr_html_()

    outcomes = Counter()
    for at, value in tried(sound, (1e300, None, [], {"a": 1}, "x"), share):
        manifest.write_text(json.dumps(replaced(sound, at, value)))
        outcomes[outcome(use, "model")] += 1
    assert outcomes["refused"] > 300 / share


def test_hostile_values_of_a_truth_are_read_or_refused(small, tmp_path):
    truth = {"synthetic": True, "note": "n", "parameters": {"k": "3 MN/m", "c": 40}, "natural_frequencies_Hz": [275.0]}
    sweep(json.dumps(truth), lambda: dovetail.read_truth(tmp_path / "t.json", small.parameters), tmp_path / "t.json")
    truths = {"tests": {"a": {"parameters": {"k": 1e6}}}}
    sweep(json.dumps(truths), lambda: dovetail_bench.read_truths(tmp_path / "t.json"), tmp_path / "t.json")


def test_hostile_values_of_a_file_of_cases_are_read_or_refused(small, frf, tmp_path):
    (tmp_path / "a.yaml").write_text(small.description.text)
    dovetail.write_frf(frf, tmp_path / "m.csv")
    joint = {"assembly": "a.yaml", "measured": "m.csv"}
    cases = {
        "dovetail_series": 1,
        "name": "t",
        "covariates": {"s": "N m"},
        "tests": {"one": {**joint, "at": {"s": 1.0}, "joint": joint}},
    }
    sweep(json.dumps(cases), lambda: dovetail_bench.read_cases(tmp_path / "c.yaml"), tmp_path / "c.yaml")


@pytest.mark.parametrize("column", [0, 1, 2, 3])
def test_hostile_cells_of_a_table_of_modes_are_read_or_refused(column, small, tmp_path):
    for cell in (*CELLS, "1e-320", "1e-200"):
        row = ["275", "0.01", "0.1", "0.001"]
        row[column] = cell
        header = "frequency_Hz,damping_ratio,frequency_sd_Hz,damping_ratio_sd"
        file = written(tmp_path / "modes.csv", f"{header}\n{','.join(row)}\n")

        def use(file=file):
            dovetail.identify(small, dovetail.read_modal_parameters(file), samples=20)

        outcome(use, "modes.csv")


@pytest.mark.parametrize("field", ["M", "K", "nodes", "directions", "positions"])
def test_hostile_arrays_of_an_imported_part_are_read_or_refused(field, sdof, tmp_path):
    springs = 1e5 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    sound = {"M": np.eye(2), "K": springs, "nodes": np.array(["1", "2"]), "directions": np.array(["x", "x"])}
    sound["positions"] = np.array([0.0, 0.1])
    (tmp_path / "a.yaml").write_text(IMPORTED)
    outcomes = Counter()
    square = {f"{value} everywhere": np.full((2, 2), value) for value in (1e300, 1e308, 5e-324, np.nan, np.inf, -1.0)}
    lines = {f"{value} on the axis": value * np.eye(2) for value in (1e300, 1e-300, 1e308, 1j)}
    for hostile in {**square, **lines, **arrays_like(np.ones(10)), **texts()}.values():
        np.savez(tmp_path / "part.npz", **{**sound, field: hostile})

        def use():
            assembly = dovetail.load(tmp_path / "a.yaml")
            assert np.isfinite(assembly.frf()).all()
            assembly.natural_frequencies()

        outcomes["used" if refusal(use) is None else "refused"] += 1
    assert outcomes["refused"] > 5


IMPORTED = """\
dovetail: 1
name: imported
frequency: {start: 10 Hz, stop: 40 Hz, step: 10 Hz}
substructures: {part: {model: matrices, file: part.npz}, base: {model: ground}}
joints:
  spring:
    model: spring_damper
    connect: {a: {to: part, at: 0 mm}, b: {to: base, at: 0 mm}}
    parameters: {k: {value: 1 kN/m}, c: {value: 1 N s/m}}
response: {at: part, position: 0 mm}
"""


def run(*words: object) -> str:
    """Run a command that must fail with one error, and return that."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    assert done.exit_code == 1, done.output
    return done.stderr


def test_the_commands_name_the_file_and_the_cause(small, frf, result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text(small.description.text)
    np.savez(
        "codes.npz", frequency=AXIS, values=frf.values, quantity="accelerance", note=texts()["codes of no character"]
    )
    values = "".join(f"{line},1e300,-1e300\n" for line in range(1, 60))
    written(tmp_path / "huge.csv", f"# quantity: accelerance\nfrequency_Hz,real,imag\n{values}")
    written(
        tmp_path / "averages.csv", f"# averages: 1{'9' * 900}\n# quantity: accelerance\nfrequency_Hz,real,imag\n1,2,3\n"
    )
    described = {**json.loads(small.description.text), "frequency": {"start": "1 Hz", "stop": "1e300 Hz", "lines": 10}}
    written(tmp_path / "far.yaml", yaml.safe_dump(described))
    ragged = replaced(result, ("posterior", "samples", "theta", 0), [1.0])
    written(tmp_path / "ragged.json", json.dumps(ragged))
    data = dovetail.generate(small, tmp_path / "d.zarr").path / "zarr.json"
    data.write_text(data.read_text().replace('"fingerprint"', '"fingerprint_"'))
    for command in (["plot"], ["identify", "a.yaml"]):
        assert "codes.npz  note\n  the text holds a number that is not the code of any character" in run(
            *command, "codes.npz"
        )
        assert "huge.csv:3\n  the value is 1.41e+300, which no structure has" in run(*command, "huge.csv")
        assert "is not a number of averages" in run(*command, "averages.csv")
    for command in ("check", "simulate"):
        assert "far.yaml" in run(command, "far.yaml")
        assert "1e+300 Hz is far above the frequencies of any structure" in run(command, "far.yaml")
    assert run("predict", "a.yaml", "ragged.json").startswith("ragged.json\n  a sample of its posterior")
    assert "d.zarr/zarr.json\n  it has no 'fingerprint'." in run("train", "a.yaml", "--data", "d.zarr", "-o", "m")
    shutil.rmtree("d.zarr")


@pytest.mark.parametrize("error", [MemoryError(), OverflowError("math range error"), np.linalg.LinAlgError("Singular")])
def test_what_exceeds_memory_or_numbers_is_one_error_with_the_file(error, small, tmp_path, monkeypatch):
    def fails(*_):
        raise error

    file = written(tmp_path / "a.yaml", small.description.text)
    monkeypatch.setattr("sys.argv", ["dovetail", "simulate", str(file)])
    monkeypatch.setattr(dovetail.Assembly, "simulate", fails)
    reported = run("simulate", file)
    assert reported.startswith(f"{file}\n  ")
    assert "bug" not in reported
