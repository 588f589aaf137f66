"""Calls that say one thing twice: options given twice, edited results, copies of a measurement, values out of range."""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path

import pytest

import dovetail

SDOF = Path(__file__).resolve().parents[2] / "assemblies" / "sdof.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a measurement, a copy of it, and its result."""
    from typer.testing import CliRunner

    from dovetail.cli.app import app

    folder = tmp_path_factory.mktemp("calls")
    shutil.copy(SDOF, folder / "sdof.yaml")
    narrow = SDOF.read_text().replace("1e5 N/m, 1e7 N/m", "1e5 N/m, 2e6 N/m")
    (folder / "narrow.yaml").write_text(narrow)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for words in (
            "simulate sdof.yaml --set k=2.5e6 --set c=40 --noise 1% -o m.uff",
            "identify sdof.yaml m.uff --method refined -o result",
        ):
            done = CliRunner().invoke(app, words.split())
            assert done.exit_code == 0, done.output
    shutil.copy(folder / "m.uff", folder / "copy.uff")
    return folder


@pytest.fixture
def called(folder, monkeypatch, run):
    monkeypatch.chdir(folder)
    return lambda words, code=0: run(*words.split(), code=code)


REFUSED = {
    "identify sdof.yaml m.uff --method refined --method posterior": (2, "--method is given twice; give it once."),
    "identify sdof.yaml m.uff --network --no-network": (2, "--network/--no-network is given twice"),
    "simulate sdof.yaml --seed 1 --seed 2": (2, "--seed is given twice"),
    "simulate sdof.yaml --seed 1": (2, "no noise is drawn without '--noise'"),
    "simulate sdof.yaml --set k=2e6 --set mount.k=3e6": (1, "with and without the name of its joint"),
    "plot m.uff --index 1 --response 5+x": (1, "set 1 is not from any force to 5+x"),
    "compare-models sdof.yaml m.uff --against sdof.yaml": (1, "are the same model"),
}


@pytest.mark.parametrize(("words", "said"), REFUSED.items())
def test_a_contradicting_call_is_refused(called, words, said):
    done = called(words, code=said[0])
    assert said[1] in " ".join(done.output.split())


def test_options_that_may_be_repeated_still_may(called):
    called("simulate sdof.yaml --set k=2e6 --set c=10 -q -q")


def test_an_edited_result_is_reported_and_an_untouched_one_is_not(folder, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dovetail.load_result(folder / "result")
    shutil.copytree(folder / "result", tmp_path / "edited")
    file = tmp_path / "edited" / "result.json"
    content = json.loads(file.read_text())
    content["parameters"]["k"]["value"] = 9e6
    file.write_text(json.dumps(content))
    with pytest.warns(UserWarning, match="the file was changed after it was written"):
        dovetail.load_result(tmp_path / "edited")


def test_a_value_outside_the_range_of_the_other_description_is_reported(folder):
    result = dovetail.load_result(folder / "result")
    with pytest.warns(UserWarning, match=r"k: 2.5\d*e\+06 N/m is outside of its range in 'sdof', "):
        dovetail.predict(folder / "narrow.yaml", result)


def test_a_copy_in_a_batch_is_reported(folder):
    files = [folder / "m.uff", folder / "copy.uff"]
    with pytest.warns(UserWarning, match="copy.uff: it holds the same values as m.uff"):
        dovetail.identify_many(folder / "sdof.yaml", files, "refined", processes=1)


@pytest.mark.parametrize("seed", [-1, 1.5, "a"])
def test_a_seed_that_is_not_one_is_refused(folder, tmp_path, seed):
    with pytest.raises(dovetail.DovetailError, match="is not a seed"):
        dovetail.identify(folder / "sdof.yaml", folder / "m.uff", "refined", seed=seed)
    with pytest.raises(dovetail.DovetailError, match="is not a seed"):
        dovetail.generate(folder / "sdof.yaml", tmp_path / "data.zarr", samples=10, seed=seed)


def test_a_start_outside_its_range_is_reported(folder):
    with pytest.warns(UserWarning, match="start: k = 1e\\+09 N/m is outside of its range"):
        dovetail.identify(folder / "sdof.yaml", folder / "m.uff", "refined", start={"k": 1e9, "c": 10})


def test_a_given_value_outside_its_range_is_reported(folder):
    with pytest.warns(UserWarning, match="is outside of its range in 'sdof'"):
        dovetail.predict(folder / "sdof.yaml", {"k": 2e12, "c": 10.0})


def test_an_accelerometer_of_many_kilograms_is_reported(folder):
    with pytest.warns(UserWarning, match="the accelerometer has 5 kg; were 5 g meant"):
        dovetail.read_frf(folder / "m.uff", accelerometer_mass=5)
