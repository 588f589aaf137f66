"""A study of settings: its plan, its record of trials, and that no trial is lost or run twice."""

from __future__ import annotations

import json
import threading
import time
from contextlib import suppress
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import dovetail
import dovetail_bench
from dovetail.atomic_files import is_locked, locked
from dovetail.errors import DovetailError
from dovetail.registry import components
from dovetail_bench.evaluation.study import _Worker
from dovetail_bench.evaluation.study_ledger import Ledger, Proposal
from dovetail_bench.evaluation.study_plan import StudyPlan
from dovetail_bench.pages.study import chosen

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


def test_each_setting_is_tried_once_and_the_best_of_all_sweeps_together(swept):
    _, done = swept
    assert [trial.kind for trial in done.trials] == ["described", *["sweep"] * 4, "together", "test"]
    assert [sweep.trials for sweep in done.sweeps] == [(1, 0, 2), (3, 4)]  # 4 components are those of the description
    assert all(trial.state == "done" and trial.claims == 1 for trial in done.trials)
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
    made = [path.stat().st_mtime for path in (folder / "samples-20-seed-4.zarr" / "zarr.json", folder / "ledger.json")]
    assert made[0] <= made[1]


@pytest.mark.parametrize(
    ("stated", "changes"),
    [
        ({}, {"reducer.n_components": 3}),  # the reducer by default, with robust training
        ({"augmentation": {"gain": 0.5}}, {"augmentation": {"additive": 0.01}}),
        ({"augmentation": {"gain": 0.5}}, {"augmentation": None}),
    ],
)
def test_the_best_settings_are_those_that_were_tried(sdof, tmp_path, stated, changes):
    description = {**json.loads(sdof.description.text), "identification": stated}
    (tmp_path / "old.yaml").write_text(json.dumps({**description, "study": {"sweeps": {"augmentation": [None]}}}))
    plan = StudyPlan(dovetail.load(tmp_path / "old.yaml"), components(()))
    best = {"extends": "old.yaml", "identification": plan.complete_sections(changes)}
    (tmp_path / "best.yaml").write_text(json.dumps(best))
    tried, read = plan.variant(changes), dovetail.load(tmp_path / "best.yaml")
    for name in ("reducer", "regressor", "augmentation"):
        known, found = (repr(getattr(one.description.identification, name)) for one in (tried, read))
        assert found == known


def test_a_finished_study_is_read_back_and_tries_nothing(swept, sdof):
    folder, done = swept
    stages: list[str] = []
    again = dovetail_bench.study(
        dovetail.load(described(sdof, sweeps=SWEEPS)), folder, progress=lambda stage, *_: stages.append(stage)
    )
    assert again.to_dict() == done.to_dict()
    assert set(stages) == {"settings", "trials"}


def test_the_test_is_not_forgotten_where_another_process_ended_the_last_trial_before_it(sdof, tmp_path, monkeypatch):
    """It was still running when this process asked for a trial, and has ended when it looks who else is at work."""
    claim, waited = Ledger.claim, []

    def claim_too_early(ledger, propose):
        trials = ledger.trials()
        if len(trials) == 2 and trials[1].ended and not waited:
            waited.append(len(trials))
            return None
        return claim(ledger, propose)

    monkeypatch.setattr(Ledger, "claim", claim_too_early)
    done = dovetail_bench.study(dovetail.load(described(sdof, sweeps={"reducer.n_components": [2]})), tmp_path)
    assert waited == [2]
    assert done.test.state == "done"


def test_a_worker_that_does_not_see_the_folder_says_so_and_begins_no_study_of_its_own(sdof, tmp_path):
    assembly = dovetail.load(described(sdof, sweeps={"reducer.n_components": [2]}))
    with pytest.raises(DovetailError, match="does not find the study there"):
        _Worker(assembly, tmp_path / "elsewhere", components(()))(0)
    assert list(tmp_path.iterdir()) == []


def test_another_study_is_refused_in_the_same_folder(swept, sdof):
    folder, _ = swept
    other = dovetail.load(described(sdof, sweeps={**SWEEPS, "reducer.n_components": [3]}))
    with pytest.raises(dovetail.DovetailError, match="holds a study of another description"):
        dovetail_bench.study(other, folder)
    (folder / "ledger.json").write_text("[]")
    with pytest.raises(dovetail.DovetailError, match="no ledger of a study"):
        dovetail_bench.study(other, folder)


@pytest.mark.parametrize(
    ("study", "fault"),
    [
        ({}, "a study has 'sweeps', a 'search', or both"),
        ({"sweeps": {"reducer.n_components": []}}, "sweeps"),
        ({"sweeps": {"joints.k": [1]}}, "is no option such as 'reducer.n_neighbors'"),
        ({"sweeps": {"reducer.n_components": [2, -3]}}, r"study\.sweeps\.reducer\.n_components\[1\]"),
        ({"sweeps": {"reducer.components": [2]}}, "'components' is not a key of reducer model 'pca'"),
        ({"search": {"trials": 0, "options": {"reducer.n_components": [2]}}}, "trials"),
        ({"search": {"trials": 3, "options": {"reducer.n_components": {"range": [5, 2]}}}}, "the range is empty"),
        ({"search": {"trials": 3, "options": {"reducer.n_components": {"range": [0, 2]}}}}, r"search\.options"),
        ({"sweeps": {"reducer.n_components": [2]}, "lease": "3 m"}, "lease"),
    ],
)
def test_what_cannot_be_tried_is_said_before_any_work(sdof, tmp_path, study, fault):
    if any("search" in key for key in study):
        pytest.importorskip("optuna")
    with pytest.raises(dovetail.DescriptionError, match=fault):
        dovetail_bench.study(dovetail.load(described(sdof, **study)), tmp_path / "study")
    assert not (tmp_path / "study").exists()


def test_a_description_without_a_study(sdof, tmp_path):
    with pytest.raises(dovetail.DescriptionError, match="the description has no study"):
        dovetail_bench.study(sdof, tmp_path)


def test_settings_that_fail_are_told_and_the_others_go_on(sdof, tmp_path):
    done = dovetail_bench.study(dovetail.load(described(sdof, sweeps={"reducer.n_components": [500, 8]})), tmp_path)
    failed = done.trials[1]
    assert failed.state == "failed"
    assert failed.reason
    assert done.best.number in (0, 2)


def test_a_search_gives_up_what_is_hopeless_and_takes_the_sweeps_into_account(sdof, tmp_path):
    pytest.importorskip("optuna")
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


def test_without_optuna_a_search_says_what_to_install(sdof, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "optuna", None)
    search = {"trials": 2, "options": {"reducer.n_components": [2, 3]}}
    with pytest.raises(dovetail.DovetailError, match=r"pip install \"dovetail-frf\[study\]\""):
        dovetail_bench.study(dovetail.load(described(sdof, search=search)), tmp_path)


def one(trials: Any) -> Proposal | None:
    return None if trials else Proposal("described")


def test_a_claim_ends_with_its_process_and_with_its_lease(tmp_path):
    first, second = (Ledger(tmp_path, {}, 1.0) for _ in range(2))
    with first.at_work():
        trial = first.claim(one)
        assert trial.claims == 1
        assert second.claim(one) is None
    taken = second.claim(one)  # the first has ended
    assert (taken.number, taken.claims) == (0, 2)
    assert not first.note(trial, state="done", answer={"mae": 1.0})
    assert second.trials()[0].state == "running"
    with second.at_work():
        assert first.claim(one) is None
        time.sleep(1.1)
        assert first.claim(one).claims == 3  # the lease of the second has run out
        assert not second.note(taken, state="done")


def test_a_lease_is_renewed_while_a_trial_runs_and_a_trial_that_fails_is_given_back(tmp_path):
    first, second = (Ledger(tmp_path, {}, 1.0) for _ in range(2))
    with first.at_work():
        trial = first.claim(one)
        with suppress(KeyboardInterrupt), first.signs_of_life(trial):
            time.sleep(1.4)
            assert second.claim(one) is None
            raise KeyboardInterrupt
        assert second.claim(one).claims == 2


def test_the_lock_of_a_process_that_was_killed_before_it_claimed_anything_does_not_stay(tmp_path):
    first, second = (Ledger(tmp_path, {}, 1.0) for _ in range(2))
    with second.at_work():
        (tmp_path / ".process-killed.lock").write_text("")
        with first.at_work():
            pass
        assert len(list(tmp_path.glob(".process-*.lock"))) == 1  # of the second, which is at work


def test_many_at_once_get_each_trial_once(tmp_path):
    def propose(trials: Any) -> Proposal | None:
        return Proposal("sweep", {"reducer.a": len(trials)}) if len(trials) < 24 else None

    got: list[int] = []

    def work() -> None:
        ledger = Ledger(tmp_path, {}, 60.0)
        with ledger.at_work():
            while (trial := ledger.claim(propose)) is not None:
                got.append(trial.number)
                assert ledger.note(trial, state="done", answer={"mae": 1.0})

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(got) == list(range(24))
    trials = Ledger(tmp_path, {}, 60.0).trials()
    assert [asdict(trial)["claims"] for trial in trials] == [1] * 24


def test_a_lock_is_held_as_long_as_its_process(tmp_path):
    assert not is_locked(tmp_path / "a")
    with locked(tmp_path / "a"):
        assert is_locked(tmp_path / "a")
    assert not is_locked(tmp_path / "a")
    (tmp_path / ".a.lock").write_text("")
    assert not is_locked(tmp_path / "a")
    assert not (tmp_path / ".a.lock").exists()


@pytest.mark.parametrize(("changes", "told"), [({"reducer.n_epochs": None}, False), ({}, True)])
def test_a_best_value_of_null_is_told_as_it_is(changes, told):
    study = SimpleNamespace(best=SimpleNamespace(changes=changes), described={"reducer.n_epochs": 100})
    assert ("100" in chosen(study, "reducer.n_epochs")) is told
