"""A network whose answer is corrected with the model linearised there: features, gain, file, requirements."""

from __future__ import annotations

import json
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

import dovetail
import dovetail_bench
from dovetail.errors import BundleError, ParameterError, PluginError
from dovetail.network import training
from dovetail.network.correction import (
    GaussNewtonFeatures,
    _over_bands,
    correction_states,
    restore_corrections,
)
from dovetail.network.manifest import manifest_hash
from dovetail.network.preprocessing import TargetScaling
from dovetail.network.training import fit_in_context
from dovetail.registry import components
from dovetail_bench.evaluation.robustness import variant
from support.mass_on_mount import mass_on_mount
from support.waiting import PATIENCE

DESCRIPTION = mass_on_mount(
    {"start": 150, "stop": 600, "step": 1},
    {"k": {"range": [1e6, 1e7]}, "c": {"range": [20, 200], "scale": "log"}},
)
DESCRIPTION["response"]["quantity"] = "mobility"
NEAR = np.array([5e-4, 0.05])
"""Deviations of a first answer that knows the stiffness well and the damping little."""
PER_CAUTION = 3 * 2 + 1
"""Features: two parameters, their corrections and deviations, and the residuals' mean square."""
REGRESSOR = {
    "model": "mlp",
    "uncertainty": "gaussian",
    "activation": "silu",
    "hidden": [32],
    "dropout": 0.0,
    "max_epochs": 20,
    "learning_rate": 3e-3,
}


def block(**identification):
    settings = {"samples": 1000, "reducer": {"model": "pca", "n_components": 8}, "regressor": REGRESSOR}
    noise = {"additive": 0.0, "multiplicative": 0.1, "circular": 1.0, "fresh": True}
    return dovetail.load({**DESCRIPTION, "identification": {**settings, "augmentation": noise, **identification}})


@pytest.fixture(scope="module")
def model():
    return dovetail.train(block(correction={"samples": 2000, "rounds": 2}))


def linearised(assembly):
    ends = assembly.from_unit(np.array([[0.0, 0.0], [1.0, 1.0]]))
    return GaussNewtonFeatures.for_assembly(assembly, TargetScaling.fit(ends, assembly.parameters))


@pytest.fixture(scope="module")
def gauss_newton():
    return linearised(block())


def answers(quantiles, deviation, draws=400):
    """Return what a regressor shows that knows the normal quantiles to these deviations."""
    spread = deviation * dovetail.spread_normal(draws, quantiles.shape[1])
    return dovetail.TargetDistribution(ndtr(quantiles[:, np.newaxis] + spread))


def corrected(gauss_newton, truth, first, deviation, noise=0.0, rng=None):
    """Return the corrected normal quantiles for the smallest and the largest caution, line by line."""
    amplitude = gauss_newton.assembly.accelerance_amplitude(gauss_newton.targets.inverse(ndtr(truth)))
    if rng is not None:
        amplitude = amplitude * (1.0 + noise * rng.standard_normal(amplitude.shape))
    features = gauss_newton(amplitude, answers(first, deviation))
    return features[:, :2], features[:, 3 * PER_CAUTION : 3 * PER_CAUTION + 2]


def test_near_the_truth_one_step_reaches_it_and_caution_holds_it_back(gauss_newton):
    truth = np.array([[0.3, -0.4], [-1.0, 0.8]])
    first = truth + np.array([[0.0005, -0.05], [-0.0005, 0.05]])
    bold, cautious = corrected(gauss_newton, truth, first, NEAR)
    away = np.abs(first - truth)
    assert np.all(np.abs(bold - truth) < 0.2 * away)
    assert np.all(np.abs(cautious - truth) < away)
    assert np.all(np.abs(cautious - truth) > np.abs(bold - truth))


def test_band_averages_correct_estimates_that_single_lines_mislead(gauss_newton):
    """From answers whose resonance lies several of its widths next to the true one."""
    assert gauss_newton.bands == (64, 16)
    rng = np.random.default_rng(6)
    truth = rng.uniform(-1.0, 1.0, (300, 2))
    first = truth + rng.standard_normal(truth.shape)
    amplitude = gauss_newton.assembly.accelerance_amplitude(gauss_newton.targets.inverse(ndtr(truth)))
    features = gauss_newton(amplitude, answers(first, 1.0))
    stiffness = features[:, [(4 * kind + 1) * PER_CAUTION for kind in range(3)]]
    lines, many, few = np.sqrt(np.mean((stiffness - truth[:, :1]) ** 2, axis=0))
    assert lines > many > 1.0 > few


def test_bands_are_averages_of_as_many_lines_or_one_more():
    values = np.random.default_rng(7).random((2, 3, 25, 4))
    expected = [part.mean(axis=2) for part in np.split(values, [8, 16], axis=2)]
    np.testing.assert_allclose(_over_bands(values, 3), np.stack(expected, axis=2))


def test_with_noise_the_step_errs_as_the_fisher_information_has_it(gauss_newton):
    """From differences of the model's own FRFs, without its Jacobian."""
    rng, noise, count = np.random.default_rng(1), 0.2, 200
    truth = np.tile([[0.2, 0.1]], (count, 1))
    bold, _ = corrected(gauss_newton, truth, truth + 0.01 * rng.standard_normal(truth.shape), 0.3, noise, rng)

    def logarithm(quantiles):
        return np.log(gauss_newton.assembly.frf(gauss_newton.targets.inverse(ndtr(quantiles)))).real

    step = 1e-4 * np.eye(2)
    slopes = (logarithm(truth[0] + step) - logarithm(truth[0] - step)) / 2e-4
    expected = np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T / noise**2)))
    ratio = (bold - truth).std(axis=0) / expected
    assert np.all((ratio > 0.8) & (ratio < 3.0))


def on_lines(step, damping=None):
    described = {**deepcopy(DESCRIPTION), "frequency": {"start": 150, "stop": 600, "step": step}}
    if damping is not None:
        described["joints"]["mount"]["parameters"]["c"]["range"] = damping
    return linearised(dovetail.load(described))


def test_lines_are_thinned_if_resonances_are_wide():
    assert [on_lines(step).step for step in (1, 0.25)] == [1, 4]
    assert [on_lines(0.25, damping).step for damping in ([10, 15], [3, 10])] == [2, 1]


@pytest.mark.parametrize("step", [0.25, 0.1])
def test_thinning_keeps_the_information_of_all_lines(step):
    """A step from a few of the lines is as good as one from all; without their neighbours' noise it would be worse."""
    fewer, truth = on_lines(step), np.tile([[0.2, 0.1]], (200, 1))
    errors = []
    for gauss_newton in (replace(fewer, step=1), fewer):
        rng = np.random.default_rng(1)
        first = truth + 0.01 * rng.standard_normal(truth.shape)
        errors.append((corrected(gauss_newton, truth, first, 0.3, 0.2, rng)[0] - truth).std(axis=0))
    assert np.all(errors[1] < 1.15 * errors[0])


@pytest.mark.parametrize(("spacing", "step"), [(1, 1), (0.25, 4)])
def test_whitened_residuals_of_pure_noise_have_unit_size(spacing, step):
    """Their mean square over the variance is 1, or up to a third more where smoothed neighbours share lines."""
    gauss_newton, truth, rng = on_lines(spacing), np.tile([[0.2, 0.1]], (100, 1)), np.random.default_rng(8)
    assert (gauss_newton.step, gauss_newton.bands) == (step, (64, 16))
    amplitude = gauss_newton.assembly.accelerance_amplitude(gauss_newton.targets.inverse(ndtr(truth)))
    amplitude = amplitude * (1.0 + 0.05 * rng.standard_normal(amplitude.shape))
    features = gauss_newton(amplitude, answers(truth, 1e-5))
    squares = np.exp(features[:, [(4 * kind + 1) * PER_CAUTION - 1 for kind in range(3)]])
    assert np.all((squares.mean(axis=0) > 0.85) & (squares.mean(axis=0) < 1.4))


def test_features_of_an_frf_do_not_depend_on_the_batch(gauss_newton):
    rng = np.random.default_rng(2)
    first = rng.standard_normal((150, 2))
    amplitude = gauss_newton.assembly.accelerance_amplitude(gauss_newton.targets.inverse(ndtr(first + 0.1)))
    together, chosen = gauss_newton(amplitude, answers(first, 0.2)), (0, 77, 149)
    alone = [gauss_newton(amplitude[[number]], answers(first[[number]], 0.2))[0] for number in chosen]
    np.testing.assert_allclose(together[list(chosen)], alone, rtol=1e-4, atol=1e-5)


def test_lines_without_any_amplitude_give_finite_features(gauss_newton):
    features = gauss_newton(np.zeros((1, len(gauss_newton.assembly.frequency))), answers(np.zeros((1, 2)), 0.2))
    assert np.isfinite(features).all()


def test_the_correction_reduces_the_error(model):
    """On FRFs that neither of the two regressors was trained on, at a noise that hides no resonance."""
    rng = np.random.default_rng(3)
    theta = model.assembly.from_unit(rng.random((300, 2)))
    amplitude = model.assembly.accelerance_amplitude(theta)
    amplitude = amplitude * (1.0 + 0.02 * rng.standard_normal(amplitude.shape))
    uncorrected = replace(model.network, corrections=())
    first = uncorrected.predict_distribution(amplitude.astype(np.float32)).samples.mean(axis=1)
    truth = model.network.target_scaling.transform(theta)
    last = model.network.target_scaling.transform(model.predict_parameters(amplitude))
    before, after = (np.sqrt(np.mean((predicted - truth) ** 2, axis=0)) for predicted in (first, last))
    assert np.all(after < 0.7 * before)


def test_its_intervals_hold_the_truth_as_often_as_they_say(model):
    done = dovetail_bench.calibrate(
        model.assembly, cases=300, noise=0.05, seed=5, method="network", model=model, noise_kind="proportional"
    )
    covered, _ = done.coverage
    assert 0.82 < covered < 0.97


def test_a_stored_model_predicts_the_same(model, tmp_path):
    amplitude = model.assembly.accelerance_amplitude({"k": 4e6, "c": 80.0})[np.newaxis]
    again = dovetail.load_model(model.save(tmp_path / "model"))
    np.testing.assert_allclose(again.predict_parameters(amplitude), model.predict_parameters(amplitude), rtol=1e-5)
    np.testing.assert_allclose(again.predict_samples(amplitude[0]), model.predict_samples(amplitude[0]), rtol=1e-4)


def test_a_model_without_stored_steps_uses_all_lines(model):
    states = correction_states(model.network.corrections)
    old = {name: value for name, value in states.items() if ".lines." not in name}
    assert len(old) < len(states)
    targets = model.network.target_scaling
    recipe = model.network.recipes[1]
    restored = [one.gauss_newton for one in restore_corrections(old, model.assembly, targets, recipe)]
    assert [(one.step, one.bands) for one in restored] == [(1, ()), (1, ())]


@pytest.mark.parametrize(("step", "bands"), [(4, (64, 16)), (2, ())])
def test_which_lines_and_bands_a_correction_looks_at_is_stored(model, step, bands):
    targets, recipe = model.network.target_scaling, model.network.recipes[1]
    gauss_newton = GaussNewtonFeatures(model.assembly, targets, step, bands)
    states = correction_states([replace(model.network.corrections[0], gauss_newton=gauss_newton)])
    (restored,) = restore_corrections(states, model.assembly, targets, recipe)
    assert (restored.gauss_newton.step, restored.gauss_newton.bands) == (step, bands)


def test_a_stored_model_without_its_corrections_is_refused(model, tmp_path):
    folder = model.save(tmp_path / "model")
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["version"] == 3
    del manifest["files"]["corrections"]
    manifest["sha256"] = manifest_hash(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(BundleError, match="predictions differ from those after its training"):
        dovetail.load_model(folder)


def test_a_correction_without_fresh_samples_is_refused():
    assembly = block(correction={"samples": 200}, augmentation={"multiplicative": 0.1})
    message = r"(?s)identification\.correction.*no fresh samples are drawn.*`fresh=True`"
    with pytest.raises(ParameterError, match=message):
        dovetail.train(assembly)


def test_a_comparison_without_noise_leaves_the_correction_out():
    assembly = block(correction={"samples": 200})
    plain, robust = (variant(assembly, name, components()) for name in ("pca", "pca+robust"))
    assert plain.description.identification.correction is None
    assert robust.description.identification.correction.samples == 200


def test_a_correction_of_a_regressor_without_distribution_is_refused():
    assembly = block(correction={"samples": 200}, regressor={"model": "mlp", "hidden": [8]})
    with pytest.raises(PluginError, match=r"(?s)identification\.correction.*predicts values without their uncertainty"):
        dovetail.train(assembly)


def test_nearly_half_of_the_time_is_for_the_first_regressor_and_the_remaining_time_for_the_correction(monkeypatch):
    limits = []

    def fit(work, *arguments, context, **options):
        limits.append(context.seconds)
        return fit_in_context(work, *arguments, context=context, **options)

    monkeypatch.setattr(training, "fit_in_context", fit)
    seconds = dovetail.train(block(correction={"samples": 200}), minutes=10).evaluation.seconds
    remaining = 600.0 - seconds["regressor"] - seconds["FRFs of correction 1 of 1"]
    assert limits[-2:] == [pytest.approx(0.45 * 600.0), pytest.approx(remaining)]


def test_a_time_limit_reduces_the_frfs_of_a_correction():
    made = []

    def listen(stage, done, total, note=""):
        if stage == "FRFs of correction 1 of 1":
            made.append(done)

    trained = dovetail.train(
        block(correction={"samples": 10_000_000}, regressor=REGRESSOR), minutes=0.1, progress=listen
    )
    assert 0 < made[-1] < 10_000_000
    assert sum(trained.evaluation.seconds.values()) < PATIENCE


@pytest.mark.parametrize(("spacing", "step"), [(1, 1), (0.25, 4)])
def test_lines_of_several_responses_are_concatenated(spacing, step):
    whole = json.loads(block().description.text)
    whole["frequency"]["step"] = spacing
    whole["substructures"]["rider"] = {"model": "lumped", "masses": [{"mass": 0.1}]}
    connected = {"a": {"to": "rider", "at": 0}, "b": {"to": "mass", "at": 0}}
    known = {"k": {"value": 3e6}, "c": {"value": 50.0}}
    whole["joints"]["strap"] = {**whole["joints"]["mount"], "connect": connected, "parameters": known}
    response = whole.pop("response")
    whole["responses"] = [response, {**response, "at": "rider", "name": "rider", "quantity": "receptance"}]
    gauss_newton = linearised(dovetail.load(whole))
    assert gauss_newton.step == step
    truth = np.array([[0.3, -0.4]])
    first = truth + np.array([[0.0005, -0.05]])
    bold, _ = corrected(gauss_newton, truth, first, NEAR)
    assert np.all(np.abs(bold - truth) < 0.2 * np.abs(first - truth))
