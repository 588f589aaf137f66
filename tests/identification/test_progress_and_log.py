"""Progress while a joint is identified, stage by stage, and log records under the name "dovetail"."""

from __future__ import annotations

import inspect
import logging
import sys
from itertools import groupby
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import rich.console

import dovetail
from dovetail.inference.adequacy import judgement
from dovetail.inference.adequacy.causes import find_causes
from dovetail.interfaces import progress_reporter
from dovetail.testing import check_component

STEPS = {"refine", "multistart", "judge", "sample_posterior", "laplace_posterior"}
"""Steps of a method, which pass on what the method is given."""
FUNCTIONS = [
    *(one for name in dovetail.__all__ if inspect.isfunction(one := getattr(dovetail, name)) and name not in STEPS),
    check_component,
]


def test_every_public_function_accepts_the_same_progress_values():
    taking = {f.__name__: inspect.signature(f).parameters["progress"] for f in FUNCTIONS if _takes_progress(f)}
    assert len(taking) == 10
    assert {str(parameter.annotation) for parameter in taking.values()} == {"Progress | bool | None"}
    assert {parameter.default for parameter in taking.values()} == {None}


def _takes_progress(function):
    return "progress" in inspect.signature(function).parameters


def test_a_function_is_itself_and_nothing_is_silent():
    with progress_reporter(print) as same:
        assert same is print
    for quiet in (False, None):
        with progress_reporter(quiet) as report:
            assert report is dovetail.silent


@pytest.mark.parametrize("theta", [(3e6, 40.0), (9.99e6, 1.5)])
def test_no_stage_has_more_steps_than_it_says(sdof, theta):
    """The second joint lies so close to the ends of its ranges that the posterior is searched from the fit twice."""
    frf = dovetail.noisy_frf(sdof.simulate(np.array(theta)), 0.02, np.random.default_rng(1))
    steps = []
    dovetail.identify(sdof, frf, progress=lambda stage, done, total, note="": steps.append((stage, done, total)))
    assert [step for step in steps if step[1] > step[2]] == []
    assert [done == total for stage, done, total in steps if stage == "modes"][-1]


def test_a_notebook_shows_bars_in_a_widget(monkeypatch):
    """With stand-ins for the two libraries of a notebook."""
    displayed, output = [], SimpleNamespace(cleared=0)

    class Output:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def clear_output(self, wait):
            output.cleared += 1

    for name, content in {"IPython": {}, "IPython.display": {"display": displayed.append}, "ipywidgets": {}}.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    sys.modules["ipywidgets"].Output = Output
    monkeypatch.setattr(rich.console, "_is_jupyter", lambda: True)
    with progress_reporter(True) as report:
        report("fit", 0, 2)
        report("fit", 2, 2)
    assert isinstance(displayed[0], Output)
    assert output.cleared >= 2
    assert any("fit" in str(getattr(one, "html", "")) for one in displayed)


@pytest.fixture(scope="module")
def sdof(assemblies):
    return dovetail.load(assemblies / "sdof.yaml")


@pytest.fixture(scope="module")
def wrong(sdof):
    """A measurement with a wrong gain, on few lines."""
    few = sdof.on(np.linspace(sdof.frequency[0], sdof.frequency[-1], 40))
    frf = dovetail.noisy_frf(few.simulate({"k": "3 MN/m", "c": 40}), 0.01, np.random.default_rng(1))
    return dovetail.Frf(frf.frequency, 1.3 * frf.values, frf.quantity, label="wrong.uff", variance=frf.variance)


def heard(reported):
    """Return the stages in their order, each with what was reported of it."""
    return {stage: [tuple(one[1:3]) for one in group] for stage, group in groupby(reported, lambda one: one[0])}


@pytest.fixture(scope="module")
def run(sdof, wrong):
    """What an identification reported, and how it searched for causes."""
    reported, searched = [], []

    def search(*arguments, **options):
        searched.append((arguments, options))
        return find_causes(*arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judgement, "find_causes", search)
        progress = lambda *what: reported.append(what)  # noqa: E731
        result = dovetail.identify(sdof, wrong, samples=50, cause_seconds=7, progress=progress)
    assert [cause.name for cause in result.adequacy.causes][:1] == ["gain"]
    return SimpleNamespace(reported=reported, searched=searched)


def test_identification_reports_every_stage(run):
    stages = heard(run.reported)
    assert list(stages)[:4] == ["fit", "model error", "modes", "exploration"]
    assert list(stages)[-1] == "causes"
    assert "samples" in stages
    for stage, steps in stages.items():
        done, totals = zip(*steps, strict=True)
        assert list(done) == sorted(done), stage
        assert all(step <= total for step, total in steps), stage
        assert max(totals) > 1, stage


def test_causes_are_tried_as_long_as_is_wanted(run, sdof, wrong):
    ((arguments, options),) = run.searched
    assert options["seconds"] == 7
    reported: list = []
    assert find_causes(*arguments, seconds=1e-9, progress=lambda *what: reported.append(what)) == ()
    assert {done for _, done, *_ in reported} == {0, 14}  # one was tried, which was no cause
    assert find_causes(*arguments, seconds=0, progress=pytest.fail) == ()
    late = "The time for causes ended before all were tried"
    for seconds, said in ((1e-9, True), (0.0, False), (200.0, False)):
        adequacy = dovetail.identify(sdof, wrong, "refined", cause_seconds=seconds).adequacy
        assert any(reason.startswith(late) for reason in adequacy.reasons) == said
    with pytest.raises(dovetail.ParameterError, match="-1 s is not a time"):
        dovetail.identify(sdof, wrong, cause_seconds=-1)


def test_the_log_has_each_step_with_its_duration(sdof, assemblies, caplog, capfd):
    clean = sdof.simulate({"k": "3 MN/m", "c": 40})
    with caplog.at_level(logging.DEBUG, "dovetail"):
        dovetail.load(assemblies / "sdof.yaml")
        dovetail.identify(sdof, clean, form="laplace")
    done = [record.getMessage() for record in caplog.records if record.levelno == logging.INFO]
    assert [text.rpartition(": ")[0].replace(f"{assemblies}/", "") for text in done] == [
        "description sdof.yaml read",
        "fit of 2 parameters",
        "sdof identified from sdof, simulated by posterior",
    ]
    assert all(text.endswith(" s") for text in done)
    begun = [record.getMessage() for record in caplog.records if record.levelno == logging.DEBUG]
    assert "fit of 2 parameters ..." in begun
    assert all(record.name.startswith("dovetail.") for record in caplog.records)
    assert capfd.readouterr() == ("", "")


def test_nothing_is_logged_without_a_handler():
    assert [type(handler) for handler in logging.getLogger("dovetail").handlers] == [logging.NullHandler]
