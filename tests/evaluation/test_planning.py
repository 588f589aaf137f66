"""Where to measure: predicted gains against what measuring there achieves."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import dovetail
from dovetail.cli import app
from dovetail.errors import ParameterError
from dovetail.evaluation import plan
from dovetail.identification.fitting import refine
from dovetail.identification.posterior import sample_posterior


def test_the_best_point_of_the_collet_tells_more_than_the_described_one(collet):
    found = plan(collet, ["tool"], samples=10)
    assert len(found.points) == 8  # the last three of eleven nodes are inside the collet
    means = [point.mean_gain for point in found.points]
    assert means == sorted(means, reverse=True)
    assert found.points[found.current].position == pytest.approx(0.01)
    assert 0.75 < found.points[found.current].mean_gain < 0.85
    assert found.seconds[0].mean_gain > means[0]
    gains = found.points[0].gain
    assert min(gains, key=gains.get) in {"dc", "ct_hc"}


def test_a_node_of_vibration_is_named(collet):
    points = {round(1e3 * point.position): point for point in plan(collet, ["tool"], samples=2).points}
    first = collet.natural_frequencies()[0]
    assert points[60].hidden == pytest.approx((first,))
    assert points[0].hidden == ()


def test_gains_are_those_that_a_measurement_achieves(sdof):
    """One point is all that a single mass has: the prediction against samples of the posterior."""
    found = plan(sdof, samples=12, noise=0.3)
    achieved = []
    for seed, fraction in enumerate(np.random.default_rng(3).random((12, 2))):
        values = sdof.frf(sdof.from_unit(fraction))
        deviation = 0.3 * values.std()
        normal = np.random.default_rng(seed).standard_normal((2, len(values)))
        noisy = values + deviation * (normal[0] + 1j * normal[1]) / np.sqrt(2)
        frf = dovetail.Frf(sdof.frequency, noisy, "accelerance", variance=np.full(len(values), deviation**2))
        samples = sample_posterior(sdof, frf, refine(sdof, frf), model_error=0.0, seed=seed)
        mean = samples.weight @ samples.fraction
        achieved.append(12 * samples.weight @ (samples.fraction - mean) ** 2)
    left = [1 - gain for gain in found.points[0].gain.values()]
    np.testing.assert_allclose(np.sqrt(np.mean(achieved, axis=0) / left), 1.0, atol=0.6)


def test_the_command_prints_the_ranking(assemblies):
    path = str(assemblies / "sdof.yaml")
    printed = CliRunner().invoke(app, ["plan", path])
    assert printed.exit_code == 0, printed.output
    assert "as described" in printed.output
    plain = json.loads(CliRunner().invoke(app, ["plan", path, "--json"]).output)
    assert set(plain["points"][0]["gain"]) == {"k", "c"}


def test_what_cannot_be_planned(collet, assemblies):
    with pytest.raises(ParameterError, match="no substructure 'tol'"):
        plan(collet, ["tol"])
    with pytest.raises(ParameterError, match="is no noise"):
        plan(collet, noise=0.0)
    with pytest.raises(ParameterError, match="nothing to measure for"):
        plan(dovetail.load(assemblies / "campaign" / "t0.yaml"))
