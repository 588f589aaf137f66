"""A case that fails does not end the others, and its cause is kept: in validations, comparisons and studies."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

import dovetail
import dovetail_bench
from dovetail.cli.app import app
from dovetail.errors import MeasurementError
from dovetail_bench.evaluation import comparison, validation
from dovetail_bench.evaluation.cases import read_cases
from dovetail_bench.evaluation.study import _Work

CASE = """\
  {name}:
    assembly: sdof.yaml
    measured: {name}.csv
    joint: {{assembly: sdof.yaml, measured: {name}.csv}}
"""
NAMES = ("fine", "short", "hungry")


@pytest.fixture
def cases(tmp_path, sdof, monkeypatch):
    """Three cases: one in order, one whose measurement is too short, and one for which memory is lacking."""
    (tmp_path / "sdof.yaml").write_text(sdof.description.text)
    for seed, name in enumerate(NAMES):
        frf = dovetail.noisy_frf(dovetail.Frf(sdof.frequency, sdof.frf([3e6, 40.0]), "accelerance"), 0.01, seed)
        lines = 300 if name == "short" else 600
        dovetail.write_frf(
            dovetail.Frf(frf.frequency[:lines], frf.values[:lines], frf.quantity), tmp_path / f"{name}.csv"
        )
    file = tmp_path / "cases.yaml"
    file.write_text("dovetail_series: 1\ntests:\n" + "".join(CASE.format(name=name) for name in NAMES))
    for module in (validation, comparison):
        identify = module.identify

        def faulty(assembly, measured, *arguments, _identify=identify, **options):
            if measured.label == "hungry.csv":
                raise MemoryError
            return _identify(assembly, measured, *arguments, **options)

        monkeypatch.setattr(module, "identify", faulty)
    return file


@pytest.mark.parametrize("evaluate", [dovetail_bench.validate, lambda read: dovetail_bench.compare(read, ("refined",))])
def test_the_other_cases_are_evaluated(cases, evaluate):
    done = evaluate(read_cases(cases))
    found = [one.case.name if isinstance(done, dovetail_bench.Validation) else one.name for one in done.cases]
    assert found == ["fine"]
    assert sorted(done.failures) == ["hungry", "short"]
    assert "the measurement covers" in done.failures["short"]
    assert "short.csv" in done.failures["short"]
    assert done.failures["hungry"] == "case hungry\n  there is not enough memory for it.\n  Free some memory."


@pytest.mark.parametrize("evaluate", [dovetail_bench.validate, lambda read: dovetail_bench.compare(read, ("refined",))])
def test_if_every_case_fails_the_first_cause_is_raised(cases, evaluate):
    cases.write_text("dovetail_series: 1\ntests:\n" + "".join(CASE.format(name=name) for name in NAMES[1:]))
    with pytest.raises(MeasurementError, match="the measurement covers"):
        evaluate(read_cases(cases))


@pytest.mark.parametrize("command", [["validate"], ["compare", "--methods", "refined"]])
def test_the_command_writes_finished_cases_and_exits_with_one(cases, command):
    output = cases.parent / "results"
    done = CliRunner().invoke(app, [command[0], str(cases), *command[1:], "-o", str(output), "--json"])
    assert done.exit_code == 1
    assert sorted(json.loads(done.stdout)["failures"]) == ["hungry", "short"]
    assert "case hungry\n  there is not enough memory" in done.stderr
    assert (output / "SHA256SUMS").exists()


def test_a_trial_that_lacks_memory_fails_and_the_study_goes_on(sdof, tmp_path, monkeypatch):
    pytest.importorskip("optuna")
    ridge = {"model": "sklearn", "estimator": "KernelRidge", "options": {"alpha": 0.1}}
    small = {"samples": 60, "seed": 3, "reducer": {"model": "pca", "n_components": 4}, "regressor": ridge}
    study = {"sweeps": {"reducer.n_components": [4, 8]}}
    described = {**json.loads(sdof.description.text), "identification": small, "study": study}
    answer = _Work._answer

    def faulty(self, attempt, progress):
        if attempt.trial.changes and attempt.trial.kind != "test":
            raise MemoryError
        return answer(self, attempt, progress)

    monkeypatch.setattr(_Work, "_answer", faulty)
    done = dovetail_bench.study(dovetail.load(described), tmp_path / "study")
    assert [trial.state for trial in done.trials if trial.changes and trial.kind != "test"] == ["failed"]
    assert [trial.reason for trial in done.trials if trial.state == "failed"] == ["there is not enough memory for it."]
