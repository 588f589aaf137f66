"""Where to measure: predicted gains against those that a measurement there achieves."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app
from dovetail.dataset import latin_hypercube
from dovetail.design import plan_measurements
from dovetail.design.truncated_gaussian import remaining_uncertainty
from dovetail.errors import ParameterError
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import ModelError, sample_posterior
from dovetail.problem import Problem
from support.mass_on_mount import mass_on_mount


def test_the_best_point_of_the_collet_reveals_more_than_the_described_one(collet):
    found = plan_measurements(collet, ["tool"], samples=10)
    assert len(found.points) == 8  # the last three of eleven nodes are inside the collet
    means = [point.mean_gain for point in found.points]
    assert means == sorted(means, reverse=True)
    assert found.points[found.current].position == pytest.approx(0.01)
    assert 0.75 < found.points[found.current].mean_gain < 0.85
    assert found.seconds[0].mean_gain > means[0]
    gains = found.points[0].gain
    assert min(gains, key=gains.get) in {"dc", "ct_hc"}


def test_a_node_of_vibration_is_named(collet):
    points = {round(1e3 * point.position): point for point in plan_measurements(collet, ["tool"], samples=2).points}
    first = collet.natural_frequencies()[0]
    assert points[60].hidden == pytest.approx((first,))
    assert points[0].hidden == ()


@pytest.mark.usefixtures("few_mode_searches")
def test_gains_are_those_that_a_measurement_achieves(sdof):
    """One point is all that a single mass has: the prediction against samples of the posterior."""
    joints = latin_hypercube(sdof, 12, seed=0)  # those of the prediction
    found = plan_measurements(sdof, samples=12, noise=0.3, seed=0)
    achieved = []
    for seed, theta in enumerate(joints):
        values = sdof.frf(theta)
        deviation = 0.3 * values.std()
        normal = np.random.default_rng(seed).standard_normal((2, len(values)))
        noisy = values + deviation * (normal[0] + 1j * normal[1]) / np.sqrt(2)
        frf = dovetail.Frf(sdof.frequency, noisy, "accelerance", variance=np.full(len(values), deviation**2))
        problem = Problem.of(sdof, frf)
        samples = sample_posterior(problem, refine(problem), model_error=ModelError(0.0), seed=seed)
        mean = samples.weight @ samples.fraction
        achieved.append(12 * samples.weight @ (samples.fraction - mean) ** 2)
    left = [1 - gain for gain in found.points[0].gain.values()]
    ratio = np.sqrt(np.mean(achieved, axis=0) / left)
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)


def cut_off_variance(centre, deviation):
    """Return the variance of normal distributions that are cut off at 0 and 1, by sums over a fine axis."""
    axis = (np.arange(500) + 0.5) / 500
    weight = np.exp(-(((axis - centre[..., np.newaxis]) / deviation) ** 2) / 2)
    weight /= weight.sum(axis=-1, keepdims=True)
    mean = weight @ axis
    return weight @ axis**2 - mean**2


def test_the_remaining_variance_of_one_parameter_is_that_of_a_truncated_normal_distribution():
    random, deviation = np.random.default_rng(1), np.array([0.02, 0.2, 1.0])
    truth = random.random((300, 1))
    found = remaining_uncertainty(np.broadcast_to(deviation[:, None, None, None] ** -2, (3, 300, 1, 1)), truth, seed=0)
    for one, variance, mean in zip(deviation, found.variance, found.deviation, strict=True):
        centre = truth[:, 0] + one * random.standard_normal((100, 300))
        expected = cut_off_variance(centre, one)
        assert variance == pytest.approx(expected.mean(), rel=0.03)
        assert mean == pytest.approx(np.sqrt(expected).mean(), rel=0.03)


def test_the_remaining_variance_of_two_correlated_parameters_is_that_of_a_grid():
    """Only the difference is measured well: the ends of the ranges are what limits either."""
    information = np.array([[400.0, -390.0], [-390.0, 400.0]])
    random, truth = np.random.default_rng(2), np.random.default_rng(3).random((200, 2))
    axis = (np.arange(120) + 0.5) / 120
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    root = np.linalg.cholesky(np.linalg.inv(information))
    expected = []
    for one in truth:
        off = grid - one - root @ random.standard_normal(2)
        weight = np.exp(-np.einsum("gi,ij,gj->g", off, information, off) / 2)
        mean = weight @ grid / weight.sum()
        expected.append(weight @ (grid - mean) ** 2 / weight.sum())
    found = remaining_uncertainty(np.broadcast_to(information, (200, 2, 2)), truth, seed=0)
    np.testing.assert_allclose(found.variance, np.mean(expected, axis=0), rtol=0.08)
    normal_prior = np.diag(np.linalg.inv(information + 12 * np.eye(2)))
    assert np.all(found.variance < 0.95 * normal_prior)


def test_a_second_point_narrows_every_interval(collet):
    found = plan_measurements(collet, ["tool"], samples=6)
    pair = found.seconds[0]
    assert all(share < 1.02 for share in found.narrowing.values())
    assert found.narrowing["mn1"] < 0.5
    assert pair.deviation["mn1"] == pytest.approx(found.narrowing["mn1"] * found.points[0].deviation["mn1"])
    assert found.responses.count("- {at: tool, position: ") == 2


def test_second_points_are_ranked_given_the_described_response(collet):
    found = plan_measurements(collet, ["tool"], samples=6, with_described=True)
    assert found.first == found.current != 0
    described, best = found.points[found.first], found.seconds[0]
    assert all(best.deviation[name] / described.deviation[name] == share for name, share in found.narrowing.items())
    assert "- {at: tool, position: 10 mm, direction: x, quantity: accelerance}" in found.responses
    assert (described.substructure, described.position) not in {(p.substructure, p.position) for p in found.seconds}
    assert found.to_dict()["first"]["position"] == pytest.approx(0.01)


def test_the_command_prints_the_ranking(assemblies):
    path = str(assemblies / "sdof.yaml")
    printed = CliRunner().invoke(app, ["plan", path])
    assert printed.exit_code == 0, printed.output
    assert "as described" in printed.output
    plain = json.loads(CliRunner().invoke(app, ["plan", path, "--json"]).output)
    assert set(plain["points"][0]["gain"]) == {"k", "c"}


def test_a_plan_that_cannot_be_made_is_refused(collet, assemblies):
    with pytest.raises(ParameterError, match="no substructure 'tol'"):
        plan_measurements(collet, ["tol"])
    with pytest.raises(ParameterError, match="is not positive"):
        plan_measurements(collet, noise=0.0)
    with pytest.raises(ParameterError, match="nothing to measure for"):
        plan_measurements(dovetail.load(assemblies / "campaign" / "t0.yaml"))


def test_a_planned_response_keeps_the_force_that_the_description_has(collet):
    description = json.loads(collet.description.text)
    description["response"] = {**description["response"], "force": {"at": "tool", "position": "10 mm"}}
    section = plan_measurements(dovetail.load(description), ["tool"], samples=3).responses
    assert section.count("force: {at: tool, position: 10 mm, direction: x}}") == 2
    del description["response"]
    dovetail.load({**description, **yaml.safe_load(section)})


def test_a_planned_response_keeps_the_chain_that_the_description_has(collet):
    description = json.loads(collet.description.text)
    description["response"] = {**description["response"], "calibration": {"sign": -1, "mass": {"value": "2 g"}}}
    section = plan_measurements(dovetail.load(description), ["tool"], samples=3).responses
    del description["response"]
    chains = dovetail.load({**description, **yaml.safe_load(section)}).description.calibrations
    assert [chain.fixed for chain in chains.values()] == [{"sign": -1.0, "mass": 0.002}] * 2


def test_nodes_of_a_part_with_unknown_options_are_ranked_too(collet):
    description = json.loads(collet.description.text)
    description["substructures"]["tool"]["material"]["young"] = {"range": ["500 GPa", "600 GPa"]}
    assert len(plan_measurements(dovetail.load(description), ["tool"], samples=3).points) == len(
        plan_measurements(collet, ["tool"], samples=3).points
    )


def test_a_plan_over_no_samples_is_refused(sdof):
    with pytest.raises(dovetail.ParameterError, match="samples"):
        dovetail.plan_measurements(sdof, samples=0)


def test_nodes_at_one_position_are_distinguished_by_their_labels(tmp_path):
    springs = 1e6 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    table = {"nodes": ["end", "front", "back"], "directions": ["x"] * 3, "positions": [0.0, 0.1, 0.1]}
    np.savez(tmp_path / "chain.npz", M=np.diag([0.2, 0.4, 0.2]), K=springs, **table)
    description = mass_on_mount({"start": 20, "stop": 600, "step": 5}, {})
    description["substructures"]["mass"] = {"model": "matrices", "file": str(tmp_path / "chain.npz")}
    description["response"] = {"at": "mass", "position": "node back"}
    (tmp_path / "chain.yaml").write_text(yaml.safe_dump(description))
    found = plan_measurements(tmp_path / "chain.yaml", samples=2)
    assert {point.place for point in found.points} == {"100 mm (front)", "100 mm (back)"}
    pair = dovetail.load(
        {**{k: v for k, v in description.items() if k != "response"}, **yaml.safe_load(found.responses)}
    )
    assert len({response.node for response in pair.description.responses}) == 2
    printed = CliRunner().invoke(app, ["plan", str(tmp_path / "chain.yaml")]).output
    assert printed.count("(as described)") == 1
    assert "100 (front)" in printed
