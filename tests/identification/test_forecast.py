"""The forecast of the time that an identification takes."""

from __future__ import annotations

import logging
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail.identification.forecast import FIXED, ForecastProgress, evaluation_seconds, in_words
from dovetail.interfaces import NO_LIMIT, TimeLimit, silent


class Clock:
    """Stands still unless time is spent."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def problem_that_takes(seconds, clock, limit=NO_LIMIT):
    """A problem whose derivatives take some time once they are compiled, and three seconds before."""
    took = iter([3.0, *[seconds] * 100])

    def frf_jacobian(_):
        clock.now += next(took)

    parameters = [None, None]
    return SimpleNamespace(parameters=parameters, from_unit=np.asarray, frf_jacobian=frf_jacobian, limit=limit)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.0, "a few seconds left"),
        (4.9, "a few seconds left"),
        (5.1, "about 10 s left"),
        (34.0, "about 30 s left"),
        (94.0, "about 90 s left"),
        (96.0, "about 2 min left"),
        (1000.0, "about 17 min left"),
    ],
)
def test_time_is_given_to_one_digit(seconds, words):
    assert in_words(seconds) == words


def test_the_time_of_compiling_does_not_count():
    clock = Clock()
    assert evaluation_seconds(problem_that_takes(0.02, clock), clock) == pytest.approx(0.02)


def test_the_time_that_is_left_shrinks_and_is_forecast_again_after_the_fit():
    clock, shown = Clock(), []
    problem = problem_that_takes(0.1, clock)
    progress = ForecastProgress(lambda *report: shown.append(report), (800.0, 1000.0), clock)
    progress("reading", 1, 1)
    progress.begin(problem)
    assert progress.seconds_left == pytest.approx(FIXED + 180.0)
    progress("fit", 0, 5)
    clock.now += 60.0
    progress("fit", 4, 5, "a note of its own")
    progress("fit", 5, 5)
    clock.now += 200.0  # the fit took longer than usual
    progress("modes", 0, 12)
    clock.now += 97.0
    progress("samples", 100, 400)
    assert shown == [
        ("reading", 1, 1, ""),
        ("fit", 0, 5, "about 3 min left"),
        ("fit", 4, 5, "a note of its own"),
        ("fit", 5, 5, "about 2 min left"),
        ("modes", 0, 12, "about 2 min left"),
        ("samples", 100, 400, "a few seconds left"),
    ]


def test_no_more_time_is_left_than_the_limit_allows():
    clock = Clock()
    progress = ForecastProgress(silent, (800.0, 0.0), clock)
    progress.begin(problem_that_takes(0.1, clock, TimeLimit(20.0, clock=clock)))
    assert progress.seconds_left < 20.0


def test_nothing_is_measured_where_nobody_sees_it_or_the_method_does_not_know(sdof, monkeypatch):
    monkeypatch.setattr("dovetail.identification.forecast.evaluation_seconds", lambda *_: pytest.fail("measured"))
    measured = dovetail.noisy_frf(sdof.simulate([2e6, 30.0]), 0.01, 1)
    dovetail.identify(sdof, measured, "refined")
    dovetail.identify(sdof, measured, "multistart", starts=4, progress=lambda *_: None)


def test_the_log_and_the_bars_of_an_identification_have_a_forecast(sdof, caplog):
    reports = []
    with caplog.at_level(logging.INFO, "dovetail"):
        dovetail.identify(
            sdof,
            dovetail.noisy_frf(sdof.simulate([2e6, 30.0]), 0.01, 1),
            "refined",
            progress=lambda *r: reports.append(r),
        )
    assert "forecast: about" in caplog.text
    assert {note for stage, _, _, note in reports if stage == "fit"} == {"a few seconds left"}
