from __future__ import annotations

import csv
import dataclasses
import html
import json
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest

import dovetail
from dovetail.frf import Frf
from dovetail.report.batch import file_stems

FILES = ["SHA256SUMS", "frf.csv", "frf.png", "parameters.csv", "report.html", "result.json"]


@pytest.fixture
def untrained(monkeypatch):
    """Fail where a network is trained."""
    monkeypatch.setattr(dovetail, "train", lambda *_, **__: pytest.fail("it trained"))


def test_identify_with_a_model_prints_what_the_model_returns(run, bench):
    printed = run("identify", bench.model, bench.measured, "--method", "network").stdout
    result = dovetail.load_model(bench.model).identify(dovetail.read_frf(bench.measured), "network")
    rows = [line.split() for line in printed.splitlines()]
    (k,) = [row for row in rows if row[:1] == ["k"]]
    assert k[1:] == [f"{result.parameters['k'].value / 1e6:#.4g}", "MN/m", "0.1", "to", "10"]
    assert f"Mean coherence of measured and reconstructed FRF: {result.mean_coherence:.3f}" in printed
    assert any(row[:1] == [f"{result.modes[0].natural_frequency:.1f}"] for row in rows)
    assert "truth" not in printed


def test_the_truth_is_listed_next_to_the_estimates(run, bench):
    printed = run("identify", bench.model, bench.measured, "--method", "network", "--truth", bench.truth).stdout
    lines = printed.splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("parameter"))
    header, _, k, c = (line.split() for line in lines[first : first + 4])
    assert lines[1].startswith("Note: ")  # what decides comes first
    assert header[:5] == ["parameter", "estimate", "unit", "truth", "error"]
    assert (k[3], c[3]) == ("3.000", "40.00")
    assert " 275.7" in printed
    assert "synthetic" in printed
    assert max(map(len, printed.splitlines())) <= 80


def test_all_files_are_written(run, bench, tmp_path):
    folder = tmp_path / "deep" / "results"
    done = run("identify", bench.model, bench.measured, "--method", "network", "--truth", bench.truth, "-o", folder)
    assert sorted(path.name for path in folder.iterdir()) == FILES
    assert done.stderr == f"Written to {folder}: {', '.join([*FILES[1:], FILES[0]])}\n"
    result = json.loads((folder / "result.json").read_text())
    with (folder / "parameters.csv").open() as stream:
        parameters = {row["name"]: row for row in csv.DictReader(stream)}
    assert float(parameters["k"]["estimate"]) == result["parameters"]["k"]["value"]
    assert float(parameters["k"]["truth"]) == pytest.approx(3e6)
    header = (folder / "frf.csv").read_text().splitlines()[:2]
    assert header[0] == "# quantity: accelerance"
    assert header[1] == "frequency_Hz,measured_real,measured_imag,reconstructed_real,reconstructed_imag,coherence"
    table = np.loadtxt(folder / "frf.csv", delimiter=",", skiprows=2)
    assert table.shape == (600, 6)
    np.testing.assert_allclose(table[:, 5], result["coherence"])
    np.testing.assert_allclose(table[:, 1] + 1j * table[:, 2], dovetail.read_frf(bench.measured).values, rtol=1e-6)
    assert (folder / "frf.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("untrained")
def test_by_default_the_answer_has_intervals_and_nothing_is_trained(run, bench, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "95")
    done = run("identify", bench.description, bench.measured, "--truth", bench.truth, "-o", tmp_path / "results")
    header, _, k, c = (line.split() for line in done.stdout.splitlines()[3:7])
    assert " ".join(header) == "parameter estimate 90 % interval unit precision verdict truth error [%]"
    result = dovetail.identify(dovetail.load(bench.description), dovetail.read_frf(bench.measured))
    of_k = result.table[0]
    low, estimate, high = (f"{v / 1e6:#.4g}" for v in (of_k.interval_low, of_k.estimate, of_k.interval_high))
    assert k == ["k", estimate, low, "to", high, "MN/m", *of_k.precision.split(), "identified", "3.000", k[-1]]
    assert c[-6:-1] == ["N·s/m", *result.table[1].precision.split(), "identified", "40.00"]
    assert "All 2 true values lie within their 90 % intervals." in done.stdout
    assert "network" not in done.stdout
    with (tmp_path / "results" / "parameters.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    stored = json.loads((tmp_path / "results" / "result.json").read_text())["table"]
    for row, columns, of_python in zip(rows, stored, result.table, strict=True):
        assert columns == dataclasses.asdict(of_python)
        assert list(row) == [*columns, "truth"]
        assert {name: "" if value is None else str(value) for name, value in columns.items()} == {
            name: text for name, text in row.items() if name != "truth"
        }
    assert [float(row["truth"]) for row in rows] == [3e6, 40.0]


def test_a_cached_network_gives_a_start_and_is_listed_in_its_own_column(run, bench, trains_nothing):
    fast = (bench.description, bench.measured, "--method", "refined", "--json")
    assert json.loads(run("identify", *fast).stdout)["network"] is None
    with_one = run("identify", *fast, "--network")
    answer = json.loads(with_one.stdout)["network"]
    expected = dovetail.load_model(bench.model).identify(dovetail.read_frf(bench.measured), "network")
    assert answer == {name: parameter.value for name, parameter in expected.parameters.items()}
    assert trains_nothing == ["small"]
    for arguments in (fast, (bench.model, *fast[1:])):  # the one that was kept, and a model that is named
        assert json.loads(run("identify", *arguments).stdout)["network"] == answer
    assert json.loads(run("identify", *fast, "--no-network").stdout)["network"] is None
    assert trains_nothing == ["small"]
    header, _, k, _ = run("identify", *fast[:-1], "--truth", bench.truth).stdout.splitlines()[3:7]
    assert " ".join(header.split()) == "parameter estimate unit truth error [%] network its error [%]"
    assert f" {answer['k'] / 1e6:#.4g} " in k


def test_a_note_says_why_the_network_is_not_used(run, bench, tmp_path):
    frf = dovetail.read_frf(bench.measured)
    dovetail.write_frf(Frf(frf.frequency[:400], frf.values[:400], frf.quantity), tmp_path / "part.csv")
    printed = run("identify", bench.model, tmp_path / "part.csv", "--method", "refined").stdout
    assert "Note: The network is not used: " in printed


def test_json_on_the_terminal_equals_the_result_file(run, bench, tmp_path):
    found = json.loads(
        run("identify", bench.model, bench.measured, "--method", "network", "--json", "-o", tmp_path / "results").stdout
    )
    assert found == json.loads((tmp_path / "results" / "result.json").read_text())


def test_an_assembly_is_trained_once_and_kept(run, bench, tmp_path, monkeypatch):
    first = run("identify", bench.description, bench.measured, "--method", "network")
    assert first.stderr == "Training a network for 'small' on 200 simulated FRFs; it is kept for the next time.\n"
    (kept,) = (tmp_path / "cache" / "models").iterdir()
    with monkeypatch.context() as patch:
        patch.setattr(dovetail, "train", lambda *_, **__: pytest.fail("it trained"))
        second = run("identify", bench.description, bench.measured, "--method", "network")
    assert second.stderr == (f"Using the model trained before from this description ({kept}); --retrain trains anew.\n")
    assert second.stdout == first.stdout
    assert (
        "Training a network"
        in run("identify", bench.description, bench.measured, "--method", "network", "--retrain").stderr
    )


@pytest.fixture
def trains_nothing(bench, monkeypatch):
    """Put the model of `bench` in the place of one that would be trained, and count."""
    calls = []

    def take(assembly, **_):
        calls.append(assembly.name)
        return dovetail.load_model(bench.model)

    monkeypatch.setattr(dovetail, "train", take)
    return calls


def test_another_description_is_trained_anew(run, bench, tmp_path, trains_nothing):
    run("identify", bench.description, bench.measured, "--method", "network")
    other = tmp_path / "other.yaml"
    other.write_text(f"extends: {bench.description}\nidentification: {{seed: 1}}\n")
    run("identify", other, bench.measured, "--method", "network")
    run("identify", bench.description, bench.measured, "--method", "network")
    assert len(trains_nothing) == 2


def test_a_description_whose_file_has_changed_is_trained_anew(run, bench, tmp_path, trains_nothing):
    other, file = tmp_path / "other.yaml", tmp_path / "like.csv"
    other.write_text(f"extends: {bench.description}\nidentification: {{augmentation: {{like: like.csv}}}}\n")
    for factor in (1.0, 1.0, 2.0):
        frf = dovetail.read_frf(bench.measured)
        dovetail.write_frf(dataclasses.replace(frf, values=factor * frf.values), file, overwrite=True)
        run("identify", other, bench.measured, "--method", "network")
    assert len(trains_nothing) == 2


def test_a_damaged_kept_model_is_replaced(run, bench, tmp_path, trains_nothing):
    run("identify", bench.description, bench.measured, "--method", "network")
    (kept,) = (tmp_path / "cache" / "models").iterdir()
    (kept / "regressor.safetensors").write_bytes(b"")
    assert (
        "cannot be used; training anew"
        in run("identify", bench.description, bench.measured, "--method", "network").stderr
    )
    assert len(trains_nothing) == 2
    run("identify", bench.description, bench.measured, "--method", "network")
    assert len(trains_nothing) == 2


HOLDER = """
import sys, time, dovetail
from dovetail.cli.app import app

def train(*_, **__):
    print("trains", flush=True)
    time.sleep(2)
    return dovetail.load_model(sys.argv[1])

dovetail.train = train
app(sys.argv[2:])
"""


def test_a_second_training_waits_for_the_first(run, bench, tmp_path, trains_nothing):
    arguments = [str(word) for word in (bench.model, "identify", bench.description, bench.measured, "--network")]
    first = subprocess.Popen([sys.executable, "-c", HOLDER, *arguments], stdout=-1, text=True)
    assert first.stdout.readline() == "trains\n"
    done = run("identify", bench.description, bench.measured, "--method", "network")
    assert f"process {first.pid} is training the model of 'small'; waiting for it.\n" in done.stderr
    assert "Using the model trained before" in done.stderr
    assert trains_nothing == []
    first.communicate()
    assert first.returncode == 0
    assert len(list((tmp_path / "cache" / "models").iterdir())) == 1


def test_without_a_place_for_the_model_the_work_goes_on(run, bench, tmp_path, trains_nothing):
    (tmp_path / "cache").write_text("a file where the folder should be")
    done = run("identify", bench.description, bench.measured, "--method", "network")
    assert "The model is not kept: " in done.stderr
    assert "Mean coherence" in done.stdout
    assert trains_nothing == ["small"]


def test_results_of_an_earlier_run_are_replaced_and_nothing_else(run, bench, tmp_path):
    folder = tmp_path / "results"
    run("identify", bench.model, bench.measured, "--method", "network", "-o", folder)
    (folder / "notes.txt").write_text("mine")
    (folder / "parameters.csv").write_text("old")
    run("identify", bench.model, bench.measured, "--method", "network", "-o", folder)
    assert (folder / "notes.txt").read_text() == "mine"
    assert (folder / "parameters.csv").read_text() != "old"


def test_files_of_the_user_are_never_replaced(run, bench, tmp_path):
    mine = tmp_path / "frf.csv"
    mine.write_text("mine")
    message = run("identify", bench.model, bench.measured, "--method", "network", "-o", tmp_path, code=1).stderr
    assert message == (
        f"{tmp_path}\n  frf.csv would be replaced, and is not of an earlier run.\n  Choose another folder.\n"
    )
    assert mine.read_text() == "mine"


@pytest.mark.usefixtures("untrained")
def test_a_measurement_that_does_not_cover_is_refused_before_training(run, bench, tmp_path):
    whole = dovetail.read_frf(bench.measured)
    part = Frf(whole.frequency[:300], whole.values[:300], whole.quantity)
    dovetail.write_frf(part, tmp_path / "part.csv")
    message = run("identify", bench.description, tmp_path / "part.csv", "--method", "network", code=1).stderr
    assert "the measurement covers 1 to 300 Hz" in message


def test_a_part_of_the_band_is_enough_without_a_network(run, bench, tmp_path):
    whole = dovetail.read_frf(bench.measured)
    dovetail.write_frf(Frf(whole.frequency[20:], whole.values[20:], whole.quantity), tmp_path / "part.csv")
    shown = run("identify", bench.description, tmp_path / "part.csv", "--method", "refined").stdout
    assert "has no lines from 1 to 21 Hz" in " ".join(shown.split())
    dovetail.write_frf(Frf(whole.frequency + 600.0, whole.values, whole.quantity), tmp_path / "beyond.csv")
    message = run("identify", bench.description, tmp_path / "beyond.csv", "--method", "refined", code=1).stderr
    assert "no line of the measurement is within 1 to 600 Hz" in message


@pytest.mark.usefixtures("untrained")
@pytest.mark.parametrize(
    ("arguments", "code", "found"),
    [
        (["--method", "nettwork"], 2, "Did you mean 'network'?"),
        (["--accelerometer-mass", "3 m"], 2, "'3 m' is not in kg, or"),
        (["--accelerometer-mass", "1.2"], 2, "'1.2' without a unit is 1.2 kg."),
        (["--quantity", "mobility"], 1, "the file says that it holds accelerance"),
        (["--quantity", "speed"], 1, "'speed' is not a quantity"),
        (["--truth", "gone.json"], 1, "gone.json"),
        (["--index", "0"], 2, "--index"),
    ],
)
def test_wrong_options_are_refused_before_training(run, bench, arguments, code, found):
    message = run("identify", bench.description, bench.measured, "--network", *arguments, code=code).stderr
    assert found in message
    assert "Traceback" not in message


@pytest.mark.usefixtures("untrained")
def test_missing_files_are_reported(run, bench, tmp_path):
    gone = tmp_path / "gone.uff"
    assert (
        run("identify", bench.description, gone, "--method", "network", code=1).stderr
        == f"{gone}\n  there is no such file.\n"
    )
    assert (
        run("identify", gone, bench.measured, "--method", "network", code=1).stderr
        == f"{gone}\n  there is no such file.\n"
    )
    assert (
        "it is not a trained network" in run("identify", tmp_path, bench.measured, "--method", "network", code=1).stderr
    )


def test_the_mass_of_the_accelerometer_is_removed(run, bench, tmp_path):
    from dovetail.measurement import add_accelerometer_mass

    loaded = tmp_path / "loaded.csv"
    dovetail.write_frf(add_accelerometer_mass(dovetail.read_frf(bench.measured), 0.1), loaded)

    def values(*arguments, code=0):
        found = json.loads(run("identify", bench.model, *arguments, "--method", "network", "--json", code=code).stdout)
        return {name: parameter["value"] for name, parameter in found["parameters"].items()}

    assert values(loaded, "--accelerometer-mass", "100 g") == pytest.approx(values(bench.measured), rel=1e-6)
    assert values(loaded, code=3) != pytest.approx(values(bench.measured), rel=1e-3)


def test_the_quantity_may_be_given(run, bench, tmp_path):
    frf = dovetail.read_frf(bench.measured)
    bare = tmp_path / "bare.csv"
    rows = zip(frf.frequency, frf.values.real, frf.values.imag, strict=True)
    bare.write_text(
        "frequency_Hz,real,imag\n" + "".join(f"{f!r},{a!r},{b!r}\n" for f, a, b in (map(float, r) for r in rows))
    )
    assert "does not say which quantity" in run("identify", bench.model, bare, "--method", "network", code=1).stderr
    assert (
        "Mean coherence"
        in run("identify", bench.model, bare, "--method", "network", "--quantity", "accelerance").stdout
    )


@pytest.fixture(scope="module")
def written(run, bench, tmp_path_factory):
    folder = tmp_path_factory.mktemp("written") / "results"
    run("identify", bench.model, bench.measured, "--method", "network", "-o", folder)
    return folder


@pytest.fixture
def results(written, tmp_path):
    """A copy of the results, which a test may damage."""
    return shutil.copytree(written, tmp_path / "results")


@pytest.fixture
def heavier(bench, tmp_path):
    description = tmp_path / "heavier.yaml"
    description.write_text(
        f"extends: {bench.description}\nname: heavier\nsubstructures: {{mass: {{masses: [{{mass: 2 kg}}]}}}}\n"
    )
    return description


@pytest.mark.parametrize("given", ["folder", "file"])
def test_predict_writes_the_frf_of_another_assembly(run, results, heavier, tmp_path, given):
    source = results if given == "folder" else results / "result.json"
    done = run("predict", heavier, source, "-o", tmp_path / "heavier.csv", "-o", tmp_path / "heavier.png")
    k = json.loads((results / "result.json").read_text())["parameters"]["k"]["value"]
    natural, damping = done.stdout.splitlines()[-2:]
    assert natural == f"{np.sqrt(k / 2) / (2 * np.pi):.1f} Hz"
    assert damping.startswith("damping ratio ")
    assembly = dovetail.load(heavier)
    c = json.loads((results / "result.json").read_text())["parameters"]["c"]["value"]
    np.testing.assert_allclose(dovetail.read_frf(tmp_path / "heavier.csv").values, assembly.frf({"k": k, "c": c}))
    assert (tmp_path / "heavier.png").read_bytes().startswith(b"\x89PNG")


def test_predict_prints_json(run, results, heavier):
    found = json.loads(run("predict", heavier, results, "--json").stdout)
    assert found["name"] == "heavier"
    assert set(found["parameters"]) == {"k", "c"}


def test_a_result_read_back_is_the_same(results, bench):
    from dovetail.identification.result_file import load_result

    result = dovetail.load_model(bench.model).identify(dovetail.read_frf(bench.measured), "network")
    assert load_result(results).to_dict() == result.to_dict()


@pytest.mark.parametrize(
    ("damage", "found"),
    [
        (lambda _: "[]", "this is not the result of an identification"),
        (lambda text: text[: len(text) // 2], "this is not the result of an identification"),
        (lambda text: text.replace('"accelerance"', '"speed"'), "result.json  quantity"),
        (lambda text: text.replace('"method"', '"mode"', 1), "result.json  method"),
        (lambda text: json.dumps({**json.loads(text), "frequency_Hz": [1.0]}), "differ in length"),
    ],
    ids=["a list", "half a file", "quantity", "no method", "lengths"],
)
def test_predict_refuses_a_damaged_result(run, results, heavier, damage, found):
    file = results / "result.json"
    file.write_text(damage(file.read_text()))
    message = run("predict", heavier, results, code=1).stderr
    assert found in message
    assert "Traceback" not in message


def test_predict_refuses_a_folder_without_a_result(run, heavier, tmp_path):
    assert "this folder has no result.json" in run("predict", heavier, tmp_path, code=1).stderr


def test_predict_says_which_parameter_is_missing(run, results, assemblies):
    message = run("predict", assemblies / "bt40_er32.yaml", results, code=1).stderr
    assert message.startswith(
        "parameters Dc, dc, mn1, mn2, kt_tc, kr_tc, ct_tc, cr_tc, kt_hc, kr_hc, ct_hc, cr_hc\n"
        "  assembly 'bt40-er32-t0' needs them, and the identification does not hold them.\n"
    )
    assert message.count("Accepted: mount.k, mount.c") == 1


def test_a_model_folder_may_be_moved(run, bench, tmp_path):
    shutil.copytree(bench.model, tmp_path / "moved")
    printed = run("identify", tmp_path / "moved", bench.measured, "--method", "network").stdout
    assert printed == run("identify", bench.model, bench.measured, "--method", "network").stdout


def test_the_shipped_measurement_is_marked_as_synthetic_in_its_file(run, bench, assemblies, tmp_path):
    shipped = dovetail.read_frf(assemblies / "measurements" / "h0_j_t0_60Nm.uff")
    assert shipped.note == "SYNTHETIC H0-J-T0 60 N m, 1 % noise"
    noted = dataclasses.replace(dovetail.read_frf(bench.measured), note="SYNTHETIC mass on a spring")
    dovetail.write_frf(noted, tmp_path / "noted.uff")
    for given, said in ((tmp_path / "noted.uff", True), (bench.measured, False)):
        done = run("identify", bench.model, given, "--method", "network", "-o", tmp_path / f"results-{said}")
        assert ("synthetic" in (done.stdout + done.stderr).lower()) == said
        assert ("measurement is synthetic" in (tmp_path / f"results-{said}" / "report.html").read_text()) == said


def test_refined_from_the_networks_answer(run, bench):
    found = json.loads(run("identify", bench.model, bench.measured, "--method", "refined", "--json").stdout)
    assert found["method"] == "refined"
    assert found["parameters"]["k"]["value"] == pytest.approx(3e6, rel=1e-6)
    assert found["parameters"]["c"]["value"] == pytest.approx(40.0, rel=1e-5)


def test_several_files_are_a_batch(run, bench, tmp_path):
    """A failure does not end the others, and is reported at the end."""
    frf = dovetail.read_frf(bench.measured)
    folder = tmp_path / "measured"
    folder.mkdir()
    for name, gain in (("a", 1.0), ("b=1", 1.0), ("tripled", 3.0)):
        dovetail.write_frf(dataclasses.replace(frf, values=gain * frf.values), folder / f"{name}.csv")
    out = tmp_path / "results"
    done = run("identify", bench.description, folder, "--samples", "60", "-o", out, code=3)
    assert "joint identified from 3 measurements" in done.stdout
    rows = [line.split() for line in done.stdout.splitlines()]
    assert [row[:1] for row in rows[3:6]] == [["a.csv"], ["b=1.csv"], ["tripled.csv"]]
    assert "does not fit" in done.stdout
    assert "Warning: tripled.csv: The model does not fit the measurement" in done.stderr
    names = {"summary.csv", "summary.html", "parameters.csv", "SHA256SUMS"}
    assert {path.name for path in out.iterdir()} == names | {
        f"{stem}.{suffix}" for stem in ("a.csv", "b_1.csv", "tripled.csv") for suffix in ("json", "html")
    }
    page = (out / "summary.html").read_text()
    assert '<a href="b_1.csv.html">b=1.csv</a>' in page
    assert page.count("not trustworthy</span>") == 2  # of tripled.csv, at each of the two parameters
    with (out / "parameters.csv").open() as stream:
        table = list(csv.DictReader(stream))
    assert [(row["measurement"], row["name"], row["is_trustworthy"]) for row in table] == [
        (name, parameter, str(name != "tripled.csv"))
        for name in ("a.csv", "b=1.csv", "tripled.csv")
        for parameter in ("k", "c")
    ]
    alone = dovetail.load_result(out / "a.csv.json")
    assert float(table[0]["estimate"]) == pytest.approx(alone.table[0].estimate, rel=1e-14)
    expected = dovetail.identify(dovetail.load(bench.description), dovetail.read_frf(folder / "a.csv"), samples=60)
    np.testing.assert_allclose(
        [row.interval_high for row in alone.table], [row.interval_high for row in expected.table], rtol=1e-12
    )

    gone = tmp_path / "gone.csv"
    done = run("identify", bench.description, folder / "a.csv", gone, "--method", "refined", "--json", code=1)
    assert done.stderr.endswith(f"'imag' is imag.\n{gone}\n  there is no such file.\n")
    printed = json.loads(done.stdout)
    assert list(printed["failures"]) == ["gone.csv"]
    assert [row["measurement"] for row in printed["results"]] == ["a.csv"]


@pytest.mark.parametrize(
    ("arguments", "code", "found"),
    [
        (["--truth", "truth.json"], 2, "a truth belongs to one measurement"),
        (["--index", "1"], 2, "several files do not"),
        (["-o", "a.csv"], 1, "a file, not a folder"),
    ],
)
def test_options_that_a_batch_does_not_accept_are_refused(run, bench, tmp_path, monkeypatch, arguments, code, found):
    monkeypatch.chdir(tmp_path)
    for name in ("a.csv", "b.csv"):
        dovetail.write_frf(dovetail.read_frf(bench.measured), name)
    assert found in run("identify", bench.description, "a.csv", "b.csv", *arguments, code=code).stderr


def test_a_batch_prints_the_warnings_of_its_results(run, bench, tmp_path):
    frf, files, out = dovetail.read_frf(bench.measured), [tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "results"
    for file, rows in zip(files, (slice(None), slice(len(frf.frequency) // 2)), strict=True):
        dovetail.write_frf(dovetail.Frf(frf.frequency[rows], frf.values[rows], frf.quantity), file)
    done = run("identify", bench.description, *files, "--method", "refined", "-o", out)
    assert "Note: b.csv: The measurement has no lines from" in done.stdout
    with (out / "summary.csv").open() as stream:
        assert ["has no lines" in row["warnings"] for row in csv.DictReader(stream)] == [False, True]


def test_files_of_a_batch_have_names_that_differ_even_where_capitals_do_not_count():
    assert file_stems(["A_3", "a", "A", "summary"]) == ["A_3", "a", "A_4", "summary_4"]


def test_a_folder_without_measurements_is_refused(run, bench, tmp_path):
    (tmp_path / "empty").mkdir()
    assert "this folder holds no measurement" in run("identify", bench.description, tmp_path / "empty", code=1).stderr


def test_files_of_one_name_that_cannot_be_read_are_all_named(run, bench, tmp_path):
    for folder in ("first", "second", "third"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "m.csv").write_text("no table")
    (tmp_path / "second" / "m.csv").write_bytes(bench.measured.read_bytes())
    files = [tmp_path / folder / "m.csv" for folder in ("first", "second", "third")]
    if bench.measured.suffix != ".csv":
        dovetail.write_frf(dovetail.read_frf(bench.measured), files[1], overwrite=True)
    done = run("identify", bench.description, *files, "--method", "refined", code=1)
    for failed in (files[0], files[2]):
        assert done.output.count(str(failed)) >= 1


def test_the_report_shows_the_command_line_that_made_it(run, bench, tmp_path):
    options = ["--method", "refined", "--amplitude-only", "--cause-seconds", "0", "-o", tmp_path / "a folder"]
    run("-q", "identify", bench.description, bench.measured, *options)
    page = html.unescape((tmp_path / "a folder" / "report.html").read_text(encoding="utf-8"))
    words = ["dovetail", "-q", "identify", bench.description, bench.measured, *options]
    assert f"# {shlex.join(map(str, words))}" in page


def test_one_line_is_not_judged_and_that_is_no_misfit(run, assemblies, tmp_path):
    (tmp_path / "one.csv").write_text("# unit: m/s^2/N\nfrequency_Hz,real,imag\n100,-0.649,0.0404\n")
    result = run("identify", assemblies / "sdof.yaml", tmp_path / "one.csv", "-o", tmp_path / "out", code=0)
    said = " ".join(result.output.split())
    assert "no more values than there are unknowns: the fit cannot be judged" in said
    assert "not trustworthy" not in said
