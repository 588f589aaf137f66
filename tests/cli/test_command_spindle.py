from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail


@pytest.fixture
def arguments(assemblies, tmp_path):
    folder = assemblies / "campaign"
    tests = [folder / "measurements" / f"sf_h1_{name}.uff" for name in ("aa", "ab", "bb")]
    options = ["--at", "20 mm", "--flange", "72 mm", "--accelerometer-mass", "1.2 g", "-o", tmp_path / "flange.npz"]
    return ["spindle", folder / "h1.yaml", *tests, *options]


def test_three_tests_become_a_file(run, arguments, assemblies, tmp_path):
    printed = run(*arguments).stdout
    assert "3451 lines from 100 to 7000 Hz, rotations by model." in printed
    assert "An error of 1 % in each test is one of 2" in printed
    shipped = dovetail.read_receptance(assemblies / "campaign" / "measurements" / "spindle_flange.npz")
    np.testing.assert_allclose(dovetail.read_receptance(tmp_path / "flange.npz").values, shipped.values, rtol=1e-6)


def test_finite_differences_give_another_flange(run, arguments, tmp_path):
    run(*arguments)
    by_model = dovetail.read_receptance(tmp_path / "flange.npz").values
    run(*arguments, "--rotations", "difference", "--overwrite")
    assert np.abs(dovetail.read_receptance(tmp_path / "flange.npz").values / by_model - 1).max() > 0.5


@pytest.mark.parametrize(
    ("more", "code", "found"),
    [
        (["--rotations", "diffrence"], 2, "'diffrence' is not one of model, difference"),
        (["--at", "20 kg"], 2, "20 kg"),
        (["--at", "21 mm"], 1, "has no node at 21 mm"),
        (["-o", "flange.csv"], 2, "Accepted: .npz"),
    ],
)
def test_unusable_input_is_reported_and_nothing_is_written(run, arguments, tmp_path, more, code, found):
    if (option := more[0]) in arguments:  # which is given once
        first = arguments.index(option)
        arguments = [*arguments[:first], *arguments[first + 2 :]]
    assert found in run(*arguments, *more, code=code).stderr
    assert not (tmp_path / "flange.npz").exists()


def test_tables_without_a_header_are_read_by_columns_and_unit(run, arguments, tmp_path):
    bare = []
    for number, file in enumerate(arguments[2:5]):
        frf = dovetail.read_frf(file)
        bare.append(tmp_path / f"bare{number}.txt")
        np.savetxt(bare[-1], np.column_stack([frf.frequency, frf.values.imag / 9.80665, frf.values.real / 9.80665]))
    run(*arguments)
    from_uff = dovetail.read_receptance(tmp_path / "flange.npz").values
    tables = [*arguments[:2], *bare, *arguments[5:], "--columns", "frequency,imag,real", "--overwrite"]
    assert "mobility" in run(*tables, code=1).stderr
    run(*tables, "--unit", "g/N")
    np.testing.assert_allclose(dovetail.read_receptance(tmp_path / "flange.npz").values, from_uff, rtol=1e-6)


@pytest.mark.parametrize(
    ("number", "line"),
    [(0, "# response: holder, 60 mm"), (0, "# point: holder, 20 mm"), (1, "# force: holder, 0 mm"), (2, "# at 0 mm")],
)
def test_words_that_name_another_point_are_refused(run, arguments, tmp_path, number, line):
    frf = replace(dovetail.read_frf(arguments[2 + number]), response="", force="", note="")
    arguments[2 + number] = tmp_path / "test.csv"
    dovetail.write_frf(frf, arguments[2 + number])
    arguments[2 + number].write_text(f"{line}\n{arguments[2 + number].read_text()}")
    if line == "# at 0 mm":  # of what is open
        run(*arguments)
    else:
        assert "where it is used" in run(*arguments, code=1).stderr


def test_an_existing_file_stays(run, arguments, tmp_path):
    (tmp_path / "flange.npz").write_text("mine")
    assert "add --overwrite" in run(*arguments, code=1).stderr
    assert (tmp_path / "flange.npz").read_text() == "mine"
