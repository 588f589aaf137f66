"""Calibration of the posterior: a correct one passes; one that is too narrow, too wide or biased does not."""

from __future__ import annotations

import json
import os
import signal
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail.errors import DovetailError, ParameterError
from dovetail.parallel import side_by_side
from dovetail_bench import calibrate
from dovetail_bench.evaluation import calibration as study
from dovetail_bench.evaluation.mesh_refinement import finer

pytestmark = pytest.mark.usefixtures("few_mode_searches")
FEW, MANY = 60, 120
"""Cases of the study by default, and of that which sees smaller faults."""
WRONG = {
    FEW: {"too sure": (0.35, 0.0), "too unsure": (3.0, 0.0), "to one side": (1.0, 1.0)},
    MANY: {"too sure": (0.5, 0.0), "too unsure": (2.5, 0.0), "to one side": (1.0, 1.0)},
}
"""By how much the samples are stretched, and moved by how many standard deviations."""


@pytest.fixture(scope="module", params=[FEW, pytest.param(MANY, marks=pytest.mark.slow)])
def cases(request):
    return request.param


@pytest.fixture(scope="module")
def posteriors(cases):
    """The posterior of each case by its number, filled by the calibration that is right."""
    return {}


@pytest.fixture(scope="module")
def right(sdof, cases, posteriors):
    """A calibration in this process, so that its posteriors can be kept."""
    identify = study.identify

    def keeping(*arguments, seed, **options):
        result = identify(*arguments, seed=seed, **options)
        posteriors[seed] = result.posterior
        return result

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "identify", keeping)
        return calibrate(sdof, cases=cases, samples=200, noise=0.1, workers=1)


@pytest.fixture
def spoilt(monkeypatch, right, posteriors):
    """The same posteriors, but with samples stretched about their mean, and moved by so many standard deviations."""
    assert len(posteriors) == len(right.case)

    def install(stretch, moved=0.0):
        def spoiling(*_, seed, **__):
            posterior = posteriors[seed]
            mean = posterior.weight @ posterior.fraction
            deviation = np.sqrt(posterior.weight @ (posterior.fraction - mean) ** 2)
            fraction = mean + moved * deviation + stretch * (posterior.fraction - mean)
            return SimpleNamespace(posterior=replace(posterior, fraction=fraction), is_trustworthy=True)

        monkeypatch.setattr(study, "identify", spoiling)

    return install


def test_a_right_posterior_holds_the_truth_as_often_as_it_says(right, cases):
    assert right.names == ("k", "c")
    assert right.rank.shape == (cases, 2)
    for one in right.parameters:
        low, high = one.by_chance
        assert low <= one.coverage <= high
        assert one.p_uniform > 0.01
        assert one.r2 > 0.95
    covered, error = right.coverage
    assert abs(covered - 0.9) < 3 * error
    assert 0 < error < 0.03


@pytest.mark.parametrize("wrong", ["too sure", "too unsure", "to one side"])
def test_one_that_is_too_sure_or_too_unsure_or_to_one_side_is_seen(sdof, spoilt, cases, wrong):
    spoilt(*WRONG[cases][wrong])
    spoilt_study = calibrate(sdof, cases=cases, samples=200, noise=0.1, workers=1)
    assert [one.name for one in spoilt_study.parameters] == ["k", "c"]
    for one in spoilt_study.parameters:
        low, high = one.by_chance
        assert one.p_uniform < 1e-3
        assert not low <= one.coverage <= high


def test_a_case_gives_the_same_result_with_any_number_of_workers(sdof, right):
    parallel = calibrate(sdof, cases=3, samples=200, noise=0.1, workers=2)
    np.testing.assert_array_equal(parallel.rank, right.rank[:3])
    assert (parallel.workers, right.workers) == (2, 1)
    other = calibrate(sdof, cases=3, samples=200, noise=0.1, workers=1, seed=1)
    assert not np.any(other.truth == right.truth[:3])


def test_the_band_is_where_chance_alone_leads(right, cases):
    low, high = right.by_chance(0.9, 0.95)
    drawn = np.random.default_rng(0).binomial(cases, 0.9, 20000) / cases
    assert np.mean((low <= drawn) & (drawn <= high)) >= 0.95
    assert np.mean((low < drawn) & (drawn < high)) <= 0.95


@pytest.fixture
def heard():
    """Ctrl-C is heard, also where the tests were started in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
def test_ctrl_c_returns_the_finished_cases(sdof):
    def stop(stage, done, total, note=""):
        if done == 5:
            threading.Timer(0.0, os.kill, (os.getpid(), signal.SIGINT)).start()

    found = calibrate(sdof, cases=5000, samples=50, noise=0.1, progress=stop)
    assert 5 <= len(found.case) < 2500
    assert found.to_dict()["cases"] == len(found.case)
    assert found.setting.cases == 5000
    json.dumps(found.to_dict(), allow_nan=False)


def test_ctrl_c_before_any_case_is_done_ends_it(sdof):
    def stop(*_, **__):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        calibrate(sdof, cases=3, progress=stop, workers=1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cases": 0}, "0 cases are none"),
        ({"noise": 0.0}, "is not positive"),
        ({"noise": float("nan")}, "is not positive"),
        ({"workers": 0}, "0 are none"),
        ({"finer_mesh": 0}, "not a number of elements"),
        ({"finer_mesh": 2}, "none of its parts has a mesh"),
        ({"samples": 0}, "0 must be at least 20"),
        ({"model_error": -1.0}, "not a relative error"),
        ({"method": "network", "samples": 10}, "'network' has no option samples in a calibration"),
    ],
)
def test_options_that_calibrate_cannot_use_are_refused(sdof, options, message):
    with pytest.raises(ParameterError, match=message):
        calibrate(sdof, **{"cases": 1, **options})


def test_a_calibration_without_parameters_to_identify_is_refused(sdof):
    description = json.loads(sdof.description.text)
    description["joints"]["mount"]["parameters"] = {"k": {"value": 1e6}, "c": {"value": 10.0}}
    with pytest.raises(ParameterError, match="nothing to identify"):
        calibrate(dovetail.load(description))


def test_a_finer_mesh_is_the_description_with_more_elements(collet, torque_100):
    description = json.loads(collet.description.text)
    for part in description["substructures"].values():
        for section in part["sections"]:
            section["elements"] = int(section.get("elements", 1)) * 2
    description["joints"]["collet"]["elements_per_segment"] = 2
    expected = dovetail.load(description).frf(torque_100)
    found = finer(collet, 2).frf(torque_100)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert np.max(np.abs(found / collet.frf(torque_100) - 1.0)) > 1e-3
    assert finer(collet, 1) is collet


@pytest.mark.slow
def test_several_responses_are_measured_and_identified_together(assemblies):
    two = dovetail.load(assemblies / "bt40_er32_two_points.yaml")
    options = {"cases": 1, "samples": 60, "finer_mesh": 2, "model_error": 5e-4}
    found, alone = calibrate(two, **options), calibrate(two.at(0), **options)
    np.testing.assert_array_equal(found.truth, alone.truth)
    assert not np.array_equal(found.rank, alone.rank)
    assert np.all((found.rank >= 0) & (found.rank <= 1))


def test_a_worker_that_is_killed_is_one_clear_error():
    def work(index):
        os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(DovetailError, match="ended by the system"):
        list(side_by_side(work, 4, 2))


def test_a_fault_of_a_case_reaches_the_caller():
    def work(index):
        raise ParameterError("this one cannot be")

    with pytest.raises(ParameterError, match="this one cannot be"):
        list(side_by_side(work, 4, 2))


def test_a_finer_mesh_leaves_sensors_where_they_are(collet, torque_100):
    sensor = {"mass": "20 g", "at": [{"at": "tool", "position": "30 mm"}]}
    loaded = dovetail.load({**json.loads(collet.description.text), "calibration": sensor})
    fine = finer(loaded, 2)
    (place,) = fine.description.sensors
    assert fine.description.substructures["tool"].nodes[place.node].position == pytest.approx(0.03)
    assert fine.natural_frequencies(torque_100) == pytest.approx(loaded.natural_frequencies(torque_100), rel=5e-3)


def test_a_finer_mesh_leaves_the_force_where_it_is(collet, torque_100):
    description = json.loads(collet.description.text)
    description["response"] = {**description["response"], "force": {"at": "holder", "position": "62 mm"}}
    transfer = dovetail.load(description)
    finer_force = finer(transfer, 2).description.response.force
    nodes = finer(transfer, 2).description.substructures["holder"].nodes
    assert nodes[finer_force.node].position == pytest.approx(0.062)
    coarse, fine = transfer.frf(torque_100), finer(transfer, 2).frf(torque_100)
    assert np.linalg.norm(fine - coarse) < 0.1 * np.linalg.norm(coarse)
