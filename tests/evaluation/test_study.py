"""A study of settings: its plan, and what it tries."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import dovetail
import dovetail_bench
from dovetail.errors import DovetailError
from dovetail.registry import components
from dovetail_bench.evaluation.study import _Worker
from dovetail_bench.evaluation.study_plan import StudyPlan
from dovetail_bench.pages.study import chosen

pytest.importorskip("optuna")
from dovetail_bench.evaluation.study_trials import TrialStore

SWEEPS: dict[str, Any] = {"reducer.n_components": [2, 4, 8], "regressor.options.alpha": [1e-4, 10.0]}
RIDGE = {"model": "sklearn", "estimator": "KernelRidge", "options": {"alpha": 0.1, "kernel": "rbf"}}


def described(sdof, **study: Any) -> dict[str, Any]:
    description = json.loads(sdof.description.text)
    identification = {"samples": 100, "seed": 3, "test_fraction": 0.2}
    description["identification"] = {
        **identification,
        "reducer": {"model": "pca", "n_components": 4},
        "regressor": RIDGE,
    }
    return {**description, "study": study}


@pytest.fixture(scope="module")
def swept(sdof, tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    return folder, dovetail_bench.study(dovetail.load(described(sdof, sweeps=SWEEPS)), folder)


def test_each_setting_is_tried_once_and_then_the_best_values_of_all_sweeps(swept):
    _, done = swept
    assert [trial.kind for trial in done.trials] == ["described", *["sweep"] * 4, "together", "test"]
    assert [sweep.trials for sweep in done.sweeps] == [(1, 0, 2), (3, 4)]  # 4 components are those of the description
    assert all(trial.state == "done" and trial.attempts == 1 for trial in done.trials)
    errors = {trial.number: trial.answer["mae"] for trial in done.trials[:-1]}
    assert errors[4] > 1.5 * errors[0]
    assert done.best.answer["mae"] == min(errors.values())
    together = done.trials[5].changes
    assert together["regressor.options.alpha"] == 1e-4
    assert done.described == {"reducer.n_components": 4, "regressor.options.alpha": 0.1}


def test_the_test_part_is_used_once_by_the_best_settings(swept):
    folder, done = swept
    assert done.test.changes == done.best.changes
    assert sorted(path.name for path in folder.glob("*.zarr")) == ["samples-20-seed-4.zarr", "samples-80-seed-3.zarr"]
    assert (done.test.answer["training_samples"], done.test.answer["samples"]) == (64, 20)
    test = dovetail.Dataset(folder / "samples-20-seed-4.zarr")
    tuned = dovetail.Dataset(folder / "samples-80-seed-3.zarr")
    assert not np.isin(test.parameters[:, 0], tuned.parameters[:, 0]).any()
    made = [path.stat().st_mtime for path in (folder / "samples-20-seed-4.zarr" / "zarr.json", folder / "trials.db")]
    assert made[0] <= made[1]


@pytest.mark.parametrize(
    ("identification", "changes"),
    [
        ({}, {"reducer.n_components": 3}),  # the reducer by default, with robust training
        ({"augmentation": {"gain": 0.5}}, {"augmentation": {"additive": 0.01}}),
        ({"augmentation": {"gain": 0.5}}, {"augmentation": None}),
    ],
)
def test_a_description_with_the_best_settings_is_read_as_what_was_tried(sdof, tmp_path, identification, changes):
    description = {**json.loads(sdof.description.text), "identification": identification}
    (tmp_path / "old.yaml").write_text(json.dumps({**description, "study": {"sweeps": {"augmentation": [None]}}}))
    plan = StudyPlan(dovetail.load(tmp_path / "old.yaml"), components(()))
    best = {"extends": "old.yaml", "identification": plan.complete_sections(changes)}
    (tmp_path / "best.yaml").write_text(json.dumps(best))
    tried, read = plan.variant(changes), dovetail.load(tmp_path / "best.yaml")
    for name in ("reducer", "regressor", "augmentation"):
        known, found = (repr(getattr(one.description.identification, name)) for one in (tried, read))
        assert found == known


def test_a_finished_study_trains_nothing_again(swept, sdof):
    folder, done = swept
    stages: list[str] = []
    again = dovetail_bench.study(
        dovetail.load(described(sdof, sweeps=SWEEPS)), folder, progress=lambda stage, *_: stages.append(stage)
    )
    assert again.to_dict() == done.to_dict()
    assert set(stages) == {"settings", "trials"}


def test_the_test_part_is_used_if_another_process_ends_the_last_trial_while_this_one_asks(sdof, tmp_path, monkeypatch):
    begin, waited = TrialStore.begin, []

    def begin_too_early(store, propose):
        trials = store.trials()
        if len(trials) == 2 and trials[1].ended and not waited:
            waited.append(len(trials))
            return None
        return begin(store, propose)

    monkeypatch.setattr(TrialStore, "begin", begin_too_early)
    done = dovetail_bench.study(dovetail.load(described(sdof, sweeps={"reducer.n_components": [2]})), tmp_path)
    assert waited == [2]
    assert done.test.state == "done"


def test_a_worker_without_the_shared_folder_reports_it_and_starts_no_study_of_its_own(sdof, tmp_path):
    assembly = dovetail.load(described(sdof, sweeps={"reducer.n_components": [2]}))
    with pytest.raises(DovetailError, match="does not find the study there"):
        _Worker(assembly, tmp_path / "elsewhere", components(()))(0)
    assert list(tmp_path.iterdir()) == []


def test_another_study_is_refused_in_the_same_folder(swept, sdof):
    folder, _ = swept
    other = dovetail.load(described(sdof, sweeps={**SWEEPS, "reducer.n_components": [3]}))
    with pytest.raises(dovetail.DovetailError, match="holds a study of another description"):
        dovetail_bench.study(other, folder)


@pytest.mark.parametrize(
    ("study", "fault"),
    [
        ({}, "a study needs 'sweeps', a 'search', or both"),
        ({"sweeps": {"reducer.n_components": []}}, "sweeps"),
        ({"sweeps": {"joints.k": [1]}}, "is not an option of the training, such as 'reducer.n_neighbors'"),
        ({"sweeps": {"reducer.n_components": [2, -3]}}, r"study\.sweeps\.reducer\.n_components\[1\]"),
        ({"sweeps": {"reducer.components": [2]}}, "'components' is not a key of reducer model 'pca'"),
        ({"search": {"trials": 0, "options": {"reducer.n_components": [2]}}}, "trials"),
        ({"search": {"trials": 3, "options": {"reducer.n_components": {"range": [5, 2]}}}}, "the range is empty"),
        ({"search": {"trials": 3, "options": {"reducer.n_components": {"range": [0, 2]}}}}, r"search\.options"),
        ({"sweeps": {"reducer.n_components": [2]}, "lease": "3 m"}, "lease"),
    ],
)
def test_values_that_cannot_be_tried_are_refused_before_any_work(sdof, tmp_path, study, fault):
    with pytest.raises(dovetail.DescriptionError, match=fault):
        dovetail_bench.study(dovetail.load(described(sdof, **study)), tmp_path / "study")
    assert not (tmp_path / "study").exists()


def test_a_description_without_a_study_is_refused(sdof, tmp_path):
    with pytest.raises(dovetail.DescriptionError, match="the description has no study"):
        dovetail_bench.study(sdof, tmp_path)


def test_settings_that_fail_are_reported_and_the_others_are_tried(sdof, tmp_path):
    done = dovetail_bench.study(dovetail.load(described(sdof, sweeps={"reducer.n_components": [500, 8]})), tmp_path)
    failed = done.trials[1]
    assert failed.state == "failed"
    assert failed.reason
    assert done.best.number in (0, 2)


def test_a_search_prunes_bad_settings_and_is_repeatable(sdof, tmp_path):
    options = {
        "reducer.n_components": {"range": [1, 12]},
        "regressor.options.alpha": {"range": [1e-6, 1e3], "scale": "log"},
    }
    study = {"sweeps": {"reducer.n_components": [2, 8]}, "search": {"trials": 14, "options": options}}
    done = dovetail_bench.study(dovetail.load(described(sdof, **study)), tmp_path)
    searched = [trial for trial in done.trials if trial.kind == "search"]
    assert len(searched) == 14
    pruned = [trial for trial in searched if trial.state == "pruned"]
    kept = [trial for trial in searched if trial.state == "done"]
    assert pruned
    assert all(trial.state == "done" for trial in searched[:4])  # whose median is the first that means something
    assert np.median([trial.first for trial in pruned]) > np.median([trial.first for trial in kept])
    assert done.best.answer["mae"] <= min(trial.answer["mae"] for trial in done.trials[:3])
    assert all(isinstance(trial.changes["reducer.n_components"], int) for trial in searched)
    first = dovetail_bench.study(dovetail.load(described(sdof, **study)), tmp_path / "again")
    assert [trial.changes for trial in first.trials] == [trial.changes for trial in done.trials]


@pytest.mark.parametrize("kind", ["sweeps", "search"])
def test_without_optuna_a_study_says_what_to_install(sdof, tmp_path, monkeypatch, kind):
    monkeypatch.setitem(__import__("sys").modules, "optuna", None)
    options = {"reducer.n_components": [2, 3]}
    study = {"sweeps": options} if kind == "sweeps" else {"search": {"trials": 2, "options": options}}
    with pytest.raises(dovetail.DovetailError, match=r"pip install \"dovetail-frf\[study\]\""):
        dovetail_bench.study(dovetail.load(described(sdof, **study)), tmp_path / "study")
    assert not (tmp_path / "study").exists()


@pytest.mark.parametrize(("changes", "described_value"), [({"reducer.n_epochs": None}, False), ({}, True)])
def test_the_described_value_is_shown_only_for_options_that_the_best_settings_do_not_change(changes, described_value):
    study = SimpleNamespace(best=SimpleNamespace(changes=changes), described={"reducer.n_epochs": 100})
    assert ("100" in chosen(study, "reducer.n_epochs")) is described_value
