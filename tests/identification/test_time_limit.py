"""Identifications with a time limit, at every stage, and what they report as left out."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest

import dovetail
from dovetail.interfaces import NO_LIMIT

SAMPLES = 60


class Clock:
    """A clock that advances by a second whenever it is read."""

    def __init__(self):
        self._readings = itertools.count()

    def __call__(self):
        return float(next(self._readings))


@pytest.fixture(scope="module")
def sdof(assemblies):
    return dovetail.load(assemblies / "sdof.yaml")


def measured_of(sdof, gain):
    few = sdof.on(np.linspace(sdof.frequency[0], sdof.frequency[-1], 40))
    frf = dovetail.noisy_frf(few.simulate({"k": "3 MN/m", "c": 40}), 0.01, np.random.default_rng(1))
    return dovetail.Frf(frf.frequency, gain * frf.values, frf.quantity, label="m.uff", variance=frf.variance)


@pytest.fixture(scope="module", params=[1.0, 1.3], ids=["to the noise", "wrong gain"])
def measured(request, sdof):
    return measured_of(sdof, request.param)


@pytest.fixture(scope="module")
def table(sdof):
    return dovetail.ModalParameters(np.array([1000.0]), np.array([0.01]), label="modes.csv")


def readings_of(identify):
    """Return how often an identification without an end reads the clock."""
    limit = dovetail.TimeLimit(1e9, clock=Clock())
    complete = identify(limit)
    assert complete.cut_short is None
    return complete, int(limit.elapsed)


def check(result, complete):
    """Check that a result is valid, and that what it lacks is what it reports."""
    assert np.all(np.isfinite(result.theta))
    again = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    lacking = () if result.cut_short is None else result.cut_short.left_out
    assert (again["cut_short"] is None) == (result.cut_short is None)
    assert (result.cut_short is not None) == any("Cut short" in note for note in result.warnings)
    if result.posterior is None and complete.posterior is not None:
        assert "intervals" in lacking
        assert not result.is_trustworthy
    elif complete.posterior is not None and result.is_trustworthy:
        samples = [one for one in lacking if "samples" in one and "independent" not in one]
        taken_by_laplace = result.posterior.form == "laplace"
        assert taken_by_laplace == any("Gaussian" in one for one in samples)
        if result.posterior.searches < complete.posterior.searches:
            assert samples == [f"{result.posterior.searches} of {SAMPLES} samples"]
    if complete.adequacy.causes and not result.adequacy.causes and result.adequacy.size is not None:
        assert any("causes" in one for one in lacking)
    if result.adequacy.word == "not judged" and complete.adequacy.word != "not judged":
        assert not result.is_trustworthy
        assert "do not trust" in result.warning


def limited(identify, steps=4):
    """Check results with limits from none of the time to all of it; return what they left out."""
    complete, readings = readings_of(identify)
    left_out = []
    for seconds in np.unique(np.linspace(0, readings, steps).astype(int)).tolist():
        result = identify(dovetail.TimeLimit(seconds, clock=Clock()))
        check(result, complete)
        left_out.append(() if result.cut_short is None else result.cut_short.left_out)
    assert left_out[0]
    return left_out


def test_the_default_method_reports_what_it_left_out_at_every_stage(sdof, measured):
    left_out = limited(lambda limit: dovetail.identify(sdof, measured, seconds=limit, samples=SAMPLES), steps=12)
    assert any("samples" in text for texts in left_out for text in texts)


def test_causes_are_left_out_before_samples(sdof):
    measured = measured_of(sdof, 1.3)

    def identify(limit):
        return dovetail.identify(sdof, measured, seconds=limit, samples=SAMPLES, cause_seconds=1e9)

    complete, readings = readings_of(identify)
    assert complete.adequacy.causes
    results = [identify(dovetail.TimeLimit(part * readings, clock=Clock())) for part in (0.7, 0.9)]
    without_causes = [one for one in results if any("causes" in text for text in one.cut_short.left_out)]
    assert without_causes
    assert all(len(one.posterior.weight) == len(complete.posterior.weight) for one in without_causes[-1:])


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize("method", ["refined", "multistart"])
def test_a_fit_alone_reports_what_it_left_out(sdof, measured, method):
    options = {"starts": 4} if method == "multistart" else {}
    limited(lambda limit: dovetail.identify(sdof, measured, method, seconds=limit, **options))


@pytest.mark.parametrize("method", ["posterior", "refined", "multistart"])
def test_a_table_of_modes_reports_what_it_left_out(sdof, table, method):
    options = {"samples": SAMPLES} if method == "posterior" else {}
    limited(lambda limit: dovetail.identify(sdof, table, method, seconds=limit, **options), steps=3)


@pytest.mark.sweep(keep=1)
def test_ample_time_gives_the_answer_without_a_limit(sdof, measured):
    with_limit, without = (dovetail.identify(sdof, measured, seconds=s, samples=SAMPLES) for s in (1e6, None))
    assert with_limit.cut_short is None
    assert np.array_equal(with_limit.posterior.theta, without.posterior.theta)
    assert with_limit.adequacy.to_dict() == without.adequacy.to_dict()


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("calls", [0, 6])
def test_a_stopped_identification_returns_what_there_is(sdof, measured, calls):
    limit, counted = dovetail.TimeLimit(), itertools.count()

    def progress(*_):
        if next(counted) == calls:
            limit.stop()

    complete = dovetail.identify(sdof, measured, samples=SAMPLES)
    result = dovetail.identify(sdof, measured, seconds=limit, samples=SAMPLES, progress=progress)
    check(result, complete)
    assert result.cut_short is None or result.cut_short.by_user


def test_what_was_left_out_is_read_again(sdof, tmp_path):
    result = dovetail.identify(sdof, measured_of(sdof, 1.3), seconds=dovetail.TimeLimit(0))
    file = tmp_path / "result.json"
    file.write_text(json.dumps(result.to_dict()))
    again = dovetail.load_result(file)
    assert again.cut_short == result.cut_short
    assert again.warning == result.warning
    assert again.is_trustworthy == result.is_trustworthy


def test_each_measurement_of_a_batch_has_the_time(sdof):
    measured = [measured_of(sdof, gain) for gain in (1.0, 1.3)]
    batch = dovetail.identify_many(sdof, measured, seconds=1e-3, processes=1)
    assert [one.cut_short is not None for one in batch.results.values()] == [True, True]


@pytest.mark.parametrize("seconds", [0, -1, float("nan"), "5", True])
def test_a_time_limit_that_is_not_positive_is_refused(sdof, seconds):
    with pytest.raises(dovetail.ParameterError, match="greater than 0"):
        dovetail.identify(sdof, measured_of(sdof, 1.0), seconds=seconds)


def test_parts_of_a_limit_end_with_it_and_share_its_record():
    now = 0.0
    limit = dovetail.TimeLimit(10.0, clock=lambda: now)
    part, causes = limit.share(0.5), limit.at_most(20.0)
    now = 6.0
    assert (part.is_over, causes.is_over, limit.remaining) == (True, False, 4.0)
    part.leave_out("samples")
    part.leave_out("samples")
    assert limit.left_out == ("samples",)
    limit.stop()
    assert causes.is_over
    assert not NO_LIMIT.is_over


def test_time_for_causes_is_the_smaller_one(sdof):
    measured, times = measured_of(sdof, 1.3), []
    for cause_seconds in (0.0, 1e-9):
        result = dovetail.identify(sdof, measured, "refined", seconds=1e6, cause_seconds=cause_seconds)
        times.append((result.cut_short, result.adequacy.causes))
    assert times == [(None, ()), (None, ())]
