"""A measurement with a file for each response: which files belong together, and when they are taken."""

import os

import numpy as np
import pytest
import yaml

import dovetail
from dovetail import ParameterError
from dovetail.monitoring import ALARM, DUPLICATE, PREDICTED, REFERENCE, SET_ASIDE, Watch, WatchOptions
from dovetail.monitoring.response_names import ResponseNames
from support.watched_mornings import OLD

OPTIONS = WatchOptions(reference=14)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["2026-03-01 tip.csv", "2026-03-01 flange.csv"], ("tip", "flange")),
        (["point_1.uff", "point_2.uff", "point_3.uff"], ("1", "2", "3")),
        (["Tip-1.csv", "tip-2.csv"], ("1", "2")),
        (["tip.csv", "the flange.csv"], None),
        (["tip 1.csv", "flange 2.csv"], None),
        (["a 1.csv", "a 1.uff"], None),
        (["a 1.csv", "a 2.csv", "a 1.csv"], None),
    ],
)
def test_the_word_by_which_names_differ_is_found(names, words):
    found = ResponseNames.of(names)
    assert (None if found is None else found.words) == words


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("2026-03-02 tip.csv", ("2026-03-02 *.csv", 0)),
        ("FLANGE 2026-03-02.csv", ("* 2026-03-02.csv", 1)),
        ("tip of the flange.csv", ("tip of the *.csv", 1)),
        ("tips 2026-03-02.csv", None),
        ("notes.txt", None),
    ],
)
def test_a_file_belongs_to_the_measurement_of_its_name(name, place):
    assert ResponseNames(("tip", "flange")).place(name) == place


@pytest.fixture(scope="module")
def rod(tmp_path_factory, assemblies):
    """A folder with 20 mornings of a clamped rod, struck at its end and measured at two points."""
    folder = tmp_path_factory.mktemp("rod")
    point = {"at": "rod", "direction": "x", "quantity": "accelerance"}
    force = {"at": "rod", "position": "0 mm", "direction": "x"}
    described = {
        "extends": str(assemblies / "series" / "clamped_rod.yaml"),
        "frequency": {"start": "100 Hz", "stop": "6020 Hz", "step": "40 Hz"},
        "responses": [{**point, "position": "0 mm"}, {**point, "position": "50 mm", "force": force}],
    }
    (folder / "rod.yaml").write_text(yaml.safe_dump(described))
    (folder / "files").mkdir()
    assembly, random = dovetail.load(folder / "rod.yaml"), np.random.default_rng(3)
    for day in range(20):
        truth = {"k": 3e7 * (0.9 if day >= 17 else 1.0), "kr": 3e4, "c": 60.0, "cr": 0.6}
        for name, one in zip(("tip", "middle"), assembly.each_response, strict=True):
            file = folder / "files" / f"{np.datetime64('2026-01-01') + day} {name}.csv"
            dovetail.write_frf(dovetail.noisy_frf(one.simulate(truth), 0.01, random), file)
            os.utime(file, (OLD + day, OLD + day))
    write(folder, ["2026-01-01 tip.csv", "2026-01-01 middle.csv"])
    return folder


def write(folder, files):
    measured = [f"files/{name}" for name in files]
    roles = dict.fromkeys(("k", "kr", "c", "cr"), "varying")
    described = {
        "dovetail_series": 1,
        "assembly": "rod.yaml",
        "tests": {"first": {"measured": measured}},
        "parameters": roles,
    }
    (folder / "watch.yaml").write_text(yaml.safe_dump(described))


def test_the_files_of_a_measurement_are_taken_together_when_the_last_has_arrived(rod, tmp_path):
    late = rod / "files" / "2026-01-20 middle.csv"
    (rod / "files" / "notes.txt").write_text("remember the torque wrench")
    os.utime(rod / "files" / "notes.txt", (OLD, OLD))
    late.rename(rod / late.name)
    watch = Watch(rod / "watch.yaml", rod / "files", tmp_path / "out", OPTIONS, settle=0.0)
    assert watch.look(trust_old=True)
    statuses = [record["status"] for record in watch.records]
    assert sorted(statuses) == sorted([REFERENCE] * 14 + [PREDICTED] * 4 + [ALARM] + [SET_ASIDE])
    aside = next(record for record in watch.records if record["status"] == SET_ASIDE)
    assert "does not say which response" in aside["reason"]
    (rod / late.name).rename(late)
    again = Watch(rod / "watch.yaml", rod / "files", tmp_path / "out", OPTIONS, settle=0.0)
    assert not again.look(trust_old=True)
    last = again.records[-1]
    assert (last["file"], last["status"]) == ("2026-01-20 *.csv", PREDICTED)
    assert [one["file"] for one in last["files"]] == ["2026-01-20 tip.csv", "2026-01-20 middle.csv"]
    assert not Watch(rod / "watch.yaml", rod / "files", tmp_path / "out", OPTIONS).look(trust_old=True)
    for name in ("tip", "middle"):
        copy = rod / "files" / f"2026-02-20 {name}.csv"
        copy.write_bytes((rod / "files" / f"2026-01-20 {name}.csv").read_bytes())
        os.utime(copy, (OLD, OLD))
    again.look(trust_old=True)
    assert again.records[-1]["status"] == DUPLICATE
    assert len(again.records) == 22


def test_names_that_do_not_show_what_belongs_together_are_refused(rod, tmp_path):
    (rod / "other name.csv").write_bytes((rod / "files" / "2026-01-01 middle.csv").read_bytes())
    write(rod, ["2026-01-01 tip.csv", "../other name.csv"])
    with pytest.raises(ParameterError, match="names that differ in one word"):
        Watch(rod / "watch.yaml", rod / "files", tmp_path / "out", OPTIONS)
