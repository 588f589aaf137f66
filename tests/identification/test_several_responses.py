"""Two masses in a row, each measured: every method takes both FRFs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.dataset import complex_accelerance
from dovetail.description import AugmentationSection
from dovetail.errors import MeasurementError, ParameterError
from dovetail.identification.result_file import load_result
from dovetail.inference.fitting import multistart, refine
from dovetail.inference.posterior import ModelError, error_shapes, sample_posterior, typical_model_error
from dovetail.inference.posterior.model_error import fit_resonances
from dovetail.network.augmentation import Augmentation, NoisyFeatures
from dovetail.network.preprocessing import log10p1
from dovetail.problem import Problem
from dovetail.problem.observations import Observations
from dovetail.problem.residuals import FrfResiduals, ModelFrfs, _end_to_end
from support.noisy_measurements import frf_on, noisy

LINES = 300
CHAIN = {
    "dovetail": 1,
    "name": "chain",
    "frequency": {"start": "2 Hz", "stop": "600 Hz", "lines": LINES},
    "substructures": {
        "lower": {"model": "lumped", "masses": [{"mass": "2 kg"}]},
        "upper": {"model": "lumped", "masses": [{"mass": "1 kg"}]},
        "base": {"model": "ground"},
    },
    "joints": {
        "foot": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "lower", "at": 0}, "b": {"to": "base", "at": 0}},
            "parameters": {"k": {"range": [1e5, 1e7], "scale": "linear"}, "c": {"range": [1, 100]}},
        },
        "link": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "upper", "at": 0}, "b": {"to": "lower", "at": 0}},
            "parameters": {"k": {"range": [1e5, 1e7], "scale": "linear"}, "c": {"range": [1, 100]}},
        },
    },
    "responses": [{"at": "lower", "position": 0, "quantity": "receptance"}, {"at": "upper", "position": 0}],
    "identification": {
        "samples": 1200,
        "reducer": {"model": "pca", "n_components": 20},
        "regressor": {"model": "mlp", "hidden": [64, 32], "dropout": 0.0, "max_epochs": 150},
    },
}
TRUTH = np.array([4e6, 60.0, 2e6, 20.0])


@pytest.fixture(scope="module")
def chain() -> dovetail.Assembly:
    return dovetail.load(CHAIN)


@pytest.fixture(scope="module")
def clean(chain) -> list[dovetail.Frf]:
    pairs = zip(chain.frfs(TRUTH), ("receptance", "accelerance"), ("lower.uff", "upper.uff"), strict=True)
    return [dovetail.Frf(chain.frequency, values, quantity, label=label) for values, quantity, label in pairs]


@pytest.fixture(scope="module")
def frfs(chain, clean) -> list[dovetail.Frf]:
    return [noisy(chain.at(index), frf.values, 0.02, index, label=frf.label) for index, frf in enumerate(clean)]


@pytest.fixture(scope="module")
def dataset(chain, tmp_path_factory) -> dovetail.Dataset:
    return dovetail.generate(chain, tmp_path_factory.mktemp("chain") / "chain.zarr")


@pytest.fixture(scope="module")
def model(chain, dataset) -> dovetail.Identifier:
    return dovetail.train(chain, dataset)


def stacked_shapes(frfs, values):
    return np.concatenate(list(error_shapes(frfs, values, typical_model_error(1e-3)).values()))


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("method", ["refined", "multistart", "posterior"])
def test_fits_find_the_joint_from_two_responses(chain, frfs, method):
    options = {"multistart": {"starts": 8, "objective": "weighted"}, "posterior": {"samples": 100, "model_error": 0.0}}
    result = dovetail.identify(chain, frfs, method, **options.get(method, {}))
    assert result.fit.chi_squared == pytest.approx(1.0, abs=0.1)
    assert result.fit.degrees_of_freedom == 2 * 2 * LINES - 4
    deviation = np.sqrt(np.diag(np.linalg.inv(result.fit.information)))
    assert np.all(np.abs(chain.to_unit(result.theta) - chain.to_unit(TRUTH)) < 4 * deviation)
    if result.posterior is not None:
        assert result.posterior.fraction.std(axis=0) == pytest.approx(deviation, rel=0.3)


def test_the_information_of_two_measurements_is_the_sum_of_both(chain, frfs):
    both = refine(Problem.of(chain, frfs)).information
    alone = [refine(Problem.of(chain.at(index), frf)).information for index, frf in enumerate(frfs)]
    np.testing.assert_allclose(both, sum(alone), rtol=0.1, atol=1e-6 * np.max(both))


def test_one_response_in_a_list_is_the_same_as_one(chain, frfs):
    alone, listed = refine(Problem.of(chain.at(0), frfs[0]), seed=3), refine(Problem.of(chain.at(0), frfs[:1]), seed=3)
    np.testing.assert_array_equal(alone.theta, listed.theta)
    np.testing.assert_array_equal(alone.information, listed.information)


def test_the_jacobian_is_that_of_the_residuals(chain, clean):
    measured = Observations.of(
        chain.description, [clean[0], noisy(chain.at(1), clean[1].values, 0.02, 5, has_phase=False)]
    )
    variance = measured.variance()
    weighted = measured.weighted(variance, np.ones(2 * LINES, dtype=bool))
    fraction, step = np.array([[0.3, 0.4, 0.6, 0.5]]), 1e-6
    for residual in (weighted, measured.logarithms(variance)):
        misfit = FrfResiduals(chain, residual)
        jacobian = misfit.linearise(fraction).jacobian[0]
        for index, direction in enumerate(np.eye(4)):
            ends = misfit.residuals(np.concatenate([fraction + step * direction, fraction - step * direction]))
            expected = (ends[0] - ends[1]) / (2 * step)
            np.testing.assert_allclose(jacobian[index], expected, atol=1e-5 * np.abs(expected).max())


def test_residuals_on_some_lines_are_those_of_all_lines(chain, frfs):
    measured = Observations.of(
        chain.description, [frfs[0], noisy(chain.at(1), frfs[1].values, 0.02, 5, has_phase=False)]
    )
    residual = measured.weighted(measured.variance(), np.ones(2 * LINES, dtype=bool))
    fraction = np.array([[0.3, 0.4, 0.6, 0.5]])
    whole = FrfResiduals(chain, residual).residuals(fraction)[0]
    for lines in ([3, 250, LINES + 7, LINES + 8], [LINES + 30]):
        few = np.array(lines)
        rows = residual.residuals_of(few)
        np.testing.assert_array_equal(residual.lines_of(rows), few)
        some = FrfResiduals(ModelFrfs.of(chain).at(few), residual.at(few)).residuals(fraction)[0]
        np.testing.assert_allclose(some, whole[rows], rtol=1e-9)


def test_each_has_its_own_noise_phase_and_bad_lines(chain, clean):
    loud = noisy(chain.at(1), clean[1].values, 0.2, 2, has_phase=False)
    values = noisy(chain.at(0), clean[0].values, 0.001, 1).values.copy()
    values[120] *= 3.0
    spiked = dovetail.Frf(chain.frequency, values, "receptance")
    fit = refine(Problem.of(chain, [spiked, loud]))
    assert fit.ignored.tolist() == [chain.frequency[120]]
    assert not fit.used[120]
    assert fit.used[LINES:].all()
    assert not fit.variance_known
    np.testing.assert_allclose(fit.variance[LINES:], loud.variance)
    assert np.abs(chain.to_unit(fit.theta) - chain.to_unit(TRUTH)).max() < 0.01
    lower, upper = (fit.at(index, (LINES, LINES)) for index in (0, 1))
    assert (lower.ignored.tolist(), upper.ignored.tolist()) == ([chain.frequency[120]], [])
    np.testing.assert_array_equal(np.concatenate([lower.variance, upper.variance]), fit.variance)
    warnings = dovetail.identify(chain, [spiked, loud], "refined").warnings
    assert any(warning.startswith("1 isolated line was left out at lower, 0 mm") for warning in warnings)
    assert not any("left out at upper, 0 mm" in warning for warning in warnings)


def test_the_network_sees_all_responses(chain, dataset, model, clean):
    assert dataset.amplitude.shape == (1200, 2 * LINES)
    assert dataset.attributes["responses"] == ["lower, 0 mm", "upper, 0 mm"]
    accelerances = [np.abs(alone.frf(dataset.parameters[7])) for alone in chain.each_response]
    accelerances[0] *= (2 * np.pi * chain.frequency) ** 2
    np.testing.assert_allclose(dataset.amplitude[7], np.concatenate(accelerances), rtol=1e-5)
    reported = {name: metrics.r2 for name, metrics in model.evaluation.parameters.items()}
    assert min(reported["foot.k"], reported["link.k"]) > 0.9
    result = model.identify(clean, "network")
    np.testing.assert_array_equal(result.theta, model.predict_parameters(dataset_row(chain))[0])
    refined = model.identify(clean, "refined")
    np.testing.assert_allclose(refined.theta, TRUTH, rtol=1e-3)


def dataset_row(chain) -> np.ndarray:
    return np.abs(chain.accelerance_amplitude(TRUTH))[np.newaxis]


def test_the_bundle_and_the_dataset_keep_their_responses(chain, dataset, model, clean, tmp_path):
    loaded = dovetail.load_model(model.save(tmp_path / "model"))
    assert loaded.assembly.description.response_labels == chain.description.response_labels
    np.testing.assert_array_equal(loaded.identify(clean, "network").theta, model.identify(clean, "network").theta)
    phased = dovetail.generate(chain, tmp_path / "phased.zarr", samples=50, storage="complex")
    np.testing.assert_allclose(phased.accelerance[:], complex_accelerance(chain, phased.parameters))
    np.testing.assert_allclose(np.abs(phased.accelerance[:]), phased.amplitude[:])
    with pytest.raises(dovetail.DovetailError, match="another description"):
        dataset.require(chain.at(0))


@pytest.mark.parametrize("of_the_second", [{}, {"gain": {"same_as": "response_1.gain"}}])
def test_a_response_alone_is_not_trained_with_the_chain_of_another(chain, of_the_second):
    """A saved model is read by its description, which has that response only."""
    description = json.loads(chain.description.text)
    first, second = description["responses"]
    first["calibration"], second["calibration"] = {"gain": {"range": [0.8, 1.2]}}, of_the_second
    with pytest.raises(ParameterError, match="it has parameters of the chain of response_1, whose FRF is not among"):
        dovetail.train(dovetail.load(description).at(1))


def test_each_response_is_converted_on_its_own_lines(chain):
    axes = [np.arange(20.0, 60.0, 0.5), np.arange(15.0, 70.0, 0.8)]
    separate = complex_accelerance(chain.on(*axes), TRUTH[np.newaxis])[0]
    alone = [complex_accelerance(chain.at(number).on(axis), TRUTH[np.newaxis])[0] for number, axis in enumerate(axes)]
    np.testing.assert_allclose(separate, np.concatenate(alone), rtol=1e-6)


def test_noise_for_training_is_drawn_for_each_response(chain, dataset):
    description = json.loads(chain.description.text)
    description["identification"]["augmentation"] = {"additive": 0.0, "multiplicative": 0.0, "gain": 0.1}
    samples = NoisyFeatures.from_samples(
        dovetail.load(description), np.asarray(dataset.amplitude[:50]), dataset.parameters[:50]
    )
    features, _ = samples(0)
    gains = (10.0**features - 1) / dataset.amplitude[:50]
    each = [part[:, part.shape[1] // 2] for part in np.split(gains, 2, axis=1)]
    for part, gain in zip(np.split(gains, 2, axis=1), each, strict=True):
        np.testing.assert_allclose(part, np.broadcast_to(gain[:, None], part.shape), rtol=2e-2)
    assert abs(np.corrcoef(each)[0, 1]) < 0.5
    assert np.std(each, axis=1) == pytest.approx([0.1, 0.1], rel=0.3)


def test_the_unit_of_the_noise_is_that_of_each_response(chain, dataset):
    description = json.loads(chain.description.text)
    description["identification"]["augmentation"] = {"additive": 0.1, "multiplicative": 0.0, "clean": 0.0}
    clean = np.asarray(dataset.amplitude[:20]) * np.repeat([1.0, 1000.0], LINES).astype(np.float32)
    features, _ = NoisyFeatures.from_samples(dovetail.load(description), clean, dataset.parameters[:20])(0)
    settings = AugmentationSection(additive=0.1, multiplicative=0.0, clean=0.0)
    generator = np.random.default_rng([0, 2, 0, 0])
    blocks = [
        Augmentation(settings, chain.frequency, float(np.std(part, dtype=np.float64)))(part, generator)
        for part in np.split(clean, 2, axis=1)
    ]
    np.testing.assert_array_equal(features, log10p1(np.concatenate(blocks, axis=1)))


def test_the_result_has_every_response(chain, frfs, tmp_path):
    result = dovetail.identify(chain, frfs, "refined")
    assert [response.point for response in result.responses] == ["lower, 0 mm", "upper, 0 mm"]
    assert result.provenance["further_measurements"] == ["upper.uff"]
    assert [response.frf.quantity for response in result.responses] == ["receptance", "accelerance"]
    np.testing.assert_array_equal(result.frf.values, result.responses[0].frf.values)
    for response, values in zip(result.responses, chain.frfs(result.theta), strict=True):
        np.testing.assert_allclose(response.frf.values, values, rtol=1e-9)
        assert response.mean_coherence > 0.95
    file = tmp_path / "result.json"
    file.write_text(json.dumps(result.to_dict(), allow_nan=False))
    stored = load_result(file)
    assert [response.point for response in stored.responses] == ["lower, 0 mm", "upper, 0 mm"]
    np.testing.assert_array_equal(stored.responses[1].measured.values, result.responses[1].measured.values)
    assert stored.responses[1].mean_coherence == pytest.approx(result.responses[1].mean_coherence)
    page = dovetail.write_report(result, tmp_path / "report.html").read_text()
    assert page.count("<figure>") == 2
    assert "<h3>upper, 0 mm</h3>" in page
    assert "2 measured FRFs" in page


def test_a_sign_that_is_wrong_in_one_response_does_not_fit(chain, clean):
    wrong = dovetail.Frf(chain.frequency, -clean[1].values, "accelerance")
    result = dovetail.identify(chain, [clean[0], wrong], "multistart", starts=4, cause_seconds=0.0)
    assert not result.is_trustworthy
    assert result.adequacy.size.magnitude > 0.8
    assert dovetail.identify(chain, list(clean), "multistart", starts=4).adequacy.word == "to the noise"


@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_wrong_number_of_measurements_is_one_clear_error(chain, clean, count):
    with pytest.raises(MeasurementError) as raised:
        dovetail.identify(chain, (clean * 2)[:count], "refined")
    (fault,) = raised.value.faults
    assert "'chain' has 2 responses" in fault.problem
    assert fault.accepted == "1. lower, 0 mm; 2. upper, 0 mm"
    with pytest.raises(MeasurementError):
        multistart(Problem.of(chain, (clean * 2)[:count]))


def test_resonances_make_up_the_frfs_of_all_responses(chain, clean):
    values = [frf.values for frf in clean]
    resonances = fit_resonances(clean, values)
    expected = chain.natural_frequencies(TRUTH)[:2]
    np.testing.assert_allclose(resonances.poles.real, expected, rtol=1e-3)
    assert [terms.shape for terms in resonances.terms] == [(2, LINES)] * 2
    for frf, terms in zip(values, resonances.terms, strict=True):
        np.testing.assert_allclose(terms.sum(axis=0), frf, rtol=1e-9)


def test_resonances_are_common_to_responses_with_different_frequencies(chain, clean):
    expected = chain.natural_frequencies(TRUTH)[:2]
    axes = [chain.frequency, chain.frequency[:-1:2] + 0.37]
    values = [alone.frf(TRUTH) for alone in chain.on(*axes).each_response]
    frfs = [frf_on(axes[0]), frf_on(axes[1], "accelerance")]
    resonances = fit_resonances(frfs, values)
    np.testing.assert_allclose(resonances.poles.real, expected, rtol=1e-3)
    assert [terms.shape for terms in resonances.terms] == [(2, len(axis)) for axis in axes]
    np.testing.assert_allclose(resonances.terms[1].sum(axis=0), values[1], rtol=1e-9)
    errors = stacked_shapes(frfs, values)
    common = stacked_shapes(clean, [alone.frf(TRUTH) for alone in chain.each_response])
    assert errors.shape == (len(common), sum(map(len, axes)))
    np.testing.assert_allclose(errors[:, :LINES], common[:, :LINES], atol=1e-3 * np.abs(common).max())


def test_responses_share_pole_errors_and_have_their_own_magnitude_errors(chain, clean):
    values = [frf.values for frf in clean]
    each = [error_shapes([frf], [frf.values], typical_model_error(1e-3)) for frf in clean]
    joint = error_shapes(clean, values, typical_model_error(1e-3))
    poles = len(fit_resonances(clean, values).poles)
    counts = {kind: len(rows) for kind, rows in joint.items()}
    own = 2 * (6 + poles)
    assert counts.pop("higher") % poles == 0
    assert counts == {"natural_frequency": 6 + poles, "damping": poles, "magnitude": own, "phase": own}
    for kind, rows in joint.items():
        common = kind not in ("magnitude", "phase")
        for row in rows[rows.any(axis=1)]:
            assert (row[:LINES].any() and row[LINES:].any()) == common
        blocks = [alone[kind] for alone in each]
        if common:
            expected = np.concatenate(blocks, axis=1)
        else:
            expected = np.concatenate(
                [np.pad(blocks[0], ((0, 0), (0, LINES))), np.pad(blocks[1], ((0, 0), (LINES, 0)))]
            )
        np.testing.assert_allclose(rows, expected, atol=1e-6 * np.abs(rows).max())


@pytest.mark.usefixtures("few_mode_searches")
def test_model_error_widens_the_posterior_of_both(chain, frfs):
    fit = refine(Problem.of(chain, frfs))
    exact, allowed = (
        sample_posterior(Problem.of(chain, frfs), fit, samples=100, model_error=size).fraction.std(axis=0)
        for size in (ModelError(0.0), typical_model_error(0.02))
    )
    assert np.all(allowed[[0, 2]] > 1.2 * exact[[0, 2]])


def test_predictions_are_at_the_first_response_or_at_the_chosen_one(chain, clean):
    result = dovetail.identify(chain, clean, "refined")
    np.testing.assert_allclose(dovetail.predict(chain, result).values, result.frf.values, rtol=1e-9)
    second = dovetail.predict(chain.at(1), result)
    np.testing.assert_allclose(second.values, result.responses[1].frf.values, rtol=1e-9)
    assert second.quantity == "accelerance"


def test_a_misspelt_weight_of_one_response_is_refused(chain, clean):
    with pytest.raises(dovetail.ParameterError, match="'coherense' is not a way to weight lines"):
        dovetail.identify(chain, clean, "refined", weights=["amplitude", "coherense"])


def test_poor_bands_of_the_second_response_are_reported_too(chain, clean):
    measured = [noisy(chain.at(index), frf.values, 0.01, index) for index, frf in enumerate(clean)]
    wrong = (chain.frequency > 450.0) & (chain.frequency < 550.0)
    measured[1] = replace(measured[1], values=measured[1].values * np.where(wrong, 5.0, 1.0))
    bands = dovetail.identify(chain, measured, "refined", cause_seconds=0.0).adequacy.bands
    assert 530.0 < max(high for _, high in bands) < 570.0


def test_a_mode_that_the_first_response_does_not_show_is_paired_where_another_one_does():
    """A mass on springs along two axes: each response shows one of two natural frequencies."""
    description = {
        "dovetail": 1,
        "name": "mass",
        "frequency": {"start": 20.0, "stop": 200.0, "lines": 361},
        "substructures": {
            "mass": {"model": "rigid_body", "mass": 1.0, "inertia": [1e-3, 1e-3, 1e-3]},
            "ground": {"model": "ground"},
        },
        "joints": {
            "mount": {
                "model": "bushing",
                "directions": ["x", "y"],
                "connect": {"a": {"to": "mass", "at": "center"}, "b": {"to": "ground", "at": 0.0}},
                "parameters": {"c_x": {"value": 20.0}, "c_y": {"value": 20.0}},
            }
        },
        "responses": [{"at": "mass", "position": "center", "direction": each} for each in ("x", "y")],
    }
    assembly = dovetail.load(description)
    true = {"k_x": 1e5, "k_y": 4e5}
    measured = [
        dovetail.noisy_frf(alone.simulate(true), 0.01, seed) for seed, alone in enumerate(assembly.each_response)
    ]
    result = dovetail.identify(assembly, measured, method="refined")
    frequencies = [np.sqrt(k) / (2 * np.pi) for k in true.values()]
    assert [mode.natural_frequency for mode in result.modes] == pytest.approx(frequencies, rel=1e-3)
    assert [mode.measured_peak for mode in result.modes] == pytest.approx(frequencies, rel=0.03)


def test_the_lines_of_several_responses_are_joined_without_unknowns_too():
    """As for a rigid joint, of which all is known: there is nothing by which to differentiate."""
    values = np.arange(2 * 3 * 4).reshape(1, 2, 3, 4).astype(complex)
    np.testing.assert_array_equal(_end_to_end(values), values.reshape(1, 6, 4))
    assert _end_to_end(values[..., :0]).shape == (1, 6, 0)
