from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail


def test_parameters_that_are_not_set_are_in_the_middle_of_their_ranges(run, assemblies, collet):
    arguments = ["simulate", assemblies / "bt40_er32.yaml", "--set", "Dc=30mm", "--set", "collet.kt_tc=500 MN/m"]
    found = json.loads(run(*arguments, "--json").stdout)
    middle = dict(zip((p.name for p in collet.parameters), collet.from_unit(np.full(12, 0.5)).tolist(), strict=True))
    expected = {**middle, "Dc": 0.03, "kt_tc": 5e8}
    assert found["parameters"] == pytest.approx(expected)
    assert found["natural_frequencies"] == pytest.approx(collet.natural_frequencies(expected).tolist())


def test_it_prints_parameters_and_natural_frequencies(run, assemblies):
    printed = run("simulate", assemblies / "sdof.yaml", "--set", "k=3 MN/m", "--set", "c=500").stdout.splitlines()
    rows = [line.split() for line in printed]
    assert ["k", "3.000", "MN/m", "0.1", "to", "10", "MN/m"] in rows
    assert ["c", "500.0", "N·s/m", "1", "to", "100", "N·s/m", "outside", "the", "range"] in rows
    assert printed[-2] == f"{np.sqrt(3e6) / (2 * np.pi):.1f} Hz"
    assert printed[-1] == f"damping ratio {100 * 250 / np.sqrt(3e6):.3g} %"


def test_the_ends_of_a_range_belong_to_it_in_every_unit(run, assemblies):
    """26 mm, times a thousandth, is larger than 0.026 m by rounding."""
    assert "outside" not in run("simulate", assemblies / "bt40_er32.yaml", "--set", "Dc=0.026").stdout


@pytest.mark.parametrize("suffix", ["csv", "uff", "npz"])
def test_written_files_hold_the_frf(run, sdof, assemblies, tmp_path, suffix):
    file = tmp_path / "new" / f"frf.{suffix}"
    run("simulate", assemblies / "sdof.yaml", "--set", "k=3e6", "--set", "c=40", "-o", file)
    read = dovetail.read_frf(file)
    assert read.quantity == "accelerance"
    np.testing.assert_allclose(read.values, sdof.frf({"k": 3e6, "c": 40.0}), rtol=1e-9)


def test_several_files_and_a_figure_are_written_at_once(run, assemblies, tmp_path):
    table, figure = tmp_path / "frf.csv", tmp_path / "frf.png"
    done = run("simulate", assemblies / "sdof.yaml", "-o", table, "-o", figure)
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert table.exists()
    assert done.stderr == f"Written: {table}\nWritten: {figure}\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frf.csv", "frf.png"]


@pytest.mark.parametrize("name", ["frf.csv", "frf.png"])
def test_a_file_that_is_there_stays(run, assemblies, tmp_path, name):
    file = tmp_path / name
    file.write_text("mine")
    message = run("simulate", assemblies / "sdof.yaml", "-o", file, code=1).stderr
    assert message == f"{file}\n  a file of this name already exists.\n  Choose another name, or add --overwrite.\n"
    assert file.read_text() == "mine"
    run("simulate", assemblies / "sdof.yaml", "-o", file, "--overwrite")
    assert file.read_bytes() != b"mine"


def test_an_unknown_parameter_is_refused(run, assemblies):
    message = run("simulate", assemblies / "sdof.yaml", "--set", "kk=1", code=1).stderr
    assert message == ("parameter kk\n  the assembly has no such parameter.\n  Did you mean 'k'?  Accepted: k, c\n")


def test_a_wrong_unit_is_refused(run, assemblies):
    message = run("simulate", assemblies / "sdof.yaml", "--set", "k=3 mm", code=1).stderr
    assert message.startswith("parameter k\n  '3 mm' is not in N/m, or")
    assert "Traceback" not in message


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["--set", "k"], "'k' is not NAME=VALUE"),
        (["--set", "=3"], "'=3' is not NAME=VALUE"),
        (["--set", "k=1", "--set", "k=2"], "'k' is set twice"),
        (["-o", "frf.pdf"], "Accepted: .uff, .unv, .csv, .npz, .png"),
        (["--sett", "k=1"], "No such option"),
    ],
)
def test_wrong_command_lines_print_the_usage(run, assemblies, arguments, found):
    message = run("simulate", assemblies / "sdof.yaml", *arguments, code=2).stderr
    assert message.startswith("Usage: ")
    assert found in message


def test_a_missing_file_is_reported(run, tmp_path):
    file = tmp_path / "gone.yaml"
    done = run("simulate", file, code=1)
    assert done.stdout == ""
    assert done.stderr == f"{file}\n  there is no such file.\n"


def test_an_output_that_cannot_be_written_is_reported(run, assemblies, tmp_path):
    blocker = tmp_path / "file"
    blocker.write_text("")
    message = run("simulate", assemblies / "sdof.yaml", "-o", blocker / "frf.csv", code=1).stderr
    assert message.startswith(f"{blocker}\n  nothing can be written here: ")


def test_noise_and_truth_make_a_measurement(run, sdof, assemblies, tmp_path):
    file, truth = tmp_path / "measured.npz", tmp_path / "truth.json"
    arguments = ["simulate", assemblies / "sdof.yaml", "--set", "k=3e6", "--set", "c=40", "--noise", "1%"]
    run(*arguments, "--seed", 3, "--truth-output", truth, "-o", file)
    clean, noisy = sdof.frf([3e6, 40.0]), dovetail.read_frf(file)
    error = np.std(noisy.values - clean) / np.std(clean)
    assert error == pytest.approx(0.01, rel=0.1)
    np.testing.assert_allclose(np.sqrt(noisy.variance), 0.01 * np.std(clean))
    known = dovetail.read_truth(truth, sdof.parameters)
    assert known.synthetic
    assert dict(known.parameters) == pytest.approx({"k": 3e6, "c": 40.0})
    assert known.natural_frequencies == pytest.approx([np.sqrt(3e6) / (2 * np.pi)])
    printed = run("identify", assemblies / "sdof.yaml", file, "--truth", truth, "--no-network").stdout
    assert "All 2 true values lie within their 90 % intervals." in printed
    run(*arguments, "--seed", 4, "-o", tmp_path / "other.npz")
    assert not np.array_equal(dovetail.read_frf(tmp_path / "other.npz").values, noisy.values)


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["--noise", "much"], "'much' is not a number such as 0.01 or 1%"),
        (["--noise", "-1%"], "'-1%' is not 0 or more"),
        (["--truth-output", "truth.txt"], "truth.txt"),
    ],
)
def test_a_wrong_noise_or_truth_is_refused(run, assemblies, arguments, found):
    assert found in run("simulate", assemblies / "sdof.yaml", *arguments, code=2).stderr


def test_a_number_without_a_unit_is_explained_where_it_is_outside_the_range(run, assemblies):
    words = ("--set", "Dc=30", "--set", "mn1=3kg", "--set", "dc=0.012")
    said = run("simulate", assemblies / "bt40_er32_quick.yaml", *words).stderr
    assert said == "'Dc=30' has no unit, so that it is 30 m: outside the range 26 to 40 mm.\n"
