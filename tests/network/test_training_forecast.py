"""A long training says beforehand how long it will take."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail.interfaces import FeatureContext
from dovetail.network import training

ROWS, EPOCHS = 2000, 40
SECONDS_PER_ROW, SECONDS_PER_EPOCH_AND_ROW = 2e-3, 1e-3
CONTEXT = FeatureContext(np.arange(1.0, 5.0), ("one",), ("k",))


class Clock:
    def __init__(self):
        self.now = 0.0

    def perf_counter(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(training, "time", clock)
    return clock


class Reducer:
    """Takes a time that grows with the rows, and the first time one for what it loads."""

    def __init__(self, clock):
        self.clock, self.fitted = clock, []

    def fit(self, features, *, seed):
        self.clock.now += 100.0 * (not self.fitted) + SECONDS_PER_ROW * len(features)
        self.fitted.append(len(features))
        return self

    def transform(self, features):
        return features


class Regressor:
    def __init__(self, clock):
        self.clock = clock

    def fit(self, features, targets, *, seed, progress):
        for epoch in range(1, EPOCHS + 1):
            self.clock.now += SECONDS_PER_EPOCH_AND_ROW * len(features)
            progress("regressor", epoch, EPOCHS)


class Failing:
    def fit(self, features, *, seed):
        raise dovetail.DovetailError("too few")


def forecast(clock, reducer, context=CONTEXT):
    settings = SimpleNamespace(seed=0, reducer=reducer, regressor=Regressor(clock))
    parameters = [SimpleNamespace(scale="linear")]
    assembly = SimpleNamespace(description=SimpleNamespace(identification=settings), parameters=parameters)
    generator = np.random.default_rng(0)
    features = generator.standard_normal((ROWS, 4), dtype=np.float32)
    return training._forecast(assembly, features, generator.random((ROWS, 1)), context)


def test_the_duration_is_forecast_from_a_few_samples(clock):
    reducer = Reducer(clock)
    reducing, regressing = ROWS * SECONDS_PER_ROW, ROWS * SECONDS_PER_EPOCH_AND_ROW * EPOCHS
    assert forecast(clock, reducer) == f"; about {reducing:.0f} s, then the regressor at most {regressing:.0f} s"
    assert sum(reducer.fitted) < 0.1 * ROWS


def test_a_time_limit_replaces_the_forecast(clock):
    assert forecast(clock, Reducer(clock), replace(CONTEXT, seconds=600.0)).endswith("at most 10 min")


@pytest.mark.parametrize(("limit", "said"), [(0.0, True), (1e9, False)])
def test_the_forecast_is_shown_if_the_frfs_took_long(small, monkeypatch, limit, said):
    reported = []
    monkeypatch.setattr(training, "_WORTH_FORECASTING", limit)
    trained = dovetail.train(small, progress=lambda *what: reported.append(what))
    notes = [what[3] for what in reported if what[0] == "reducer" and len(what) > 3]
    assert any("then the regressor at most" in note for note in notes) is said
    assert ("forecast" in trained.evaluation.seconds) is said


@pytest.fixture(scope="module")
def small(assemblies, tmp_path_factory):
    path = tmp_path_factory.mktemp("forecast") / "small.yaml"
    network = (
        "{samples: 200, reducer: {model: pca, n_components: 3}, regressor: {model: mlp, hidden: [8], max_epochs: 4}}"
    )
    path.write_text(f"extends: {assemblies / 'sdof.yaml'}\nidentification: {network}\n")
    return dovetail.load(path)


def test_a_failing_pilot_shows_no_forecast(clock):
    assert forecast(clock, Failing()) == ""
