"""A network that is given noise unlike that of its training says so next to its intervals, and names the remedy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.network.known_noise import KnownNoise
from support.mass_on_mount import GAUSSIAN_NETWORK, mass_on_mount

UNKNOWN, FAR = (
    "noise differs from that of the network's training",
    "is smoothed, or has errors that the training FRFs do not have",
)
IDENTIFICATION = {
    **GAUSSIAN_NETWORK,
    "samples": 2000,
    "augmentation": {"additive": 0.01, "multiplicative": 0.01, "circular": 1.0},
}


def trained(**changes):
    parameters = {"k": {"range": [1e6, 1e7]}, "c": {"range": [20, 200]}}
    identification = {**IDENTIFICATION, **changes}
    band = {"start": 150, "stop": 600, "step": 2}
    return dovetail.train(dovetail.load(mass_on_mount(band, parameters, identification=identification)))


@pytest.fixture(scope="module")
def model():
    return trained()


@pytest.fixture(scope="module")
def truths(model):
    return latin_hypercube(model.assembly, 60, seed=41)


def simulated(model, theta):
    return dovetail.Frf(model.assembly.frequency, model.assembly.frf(theta), "accelerance")


def amplitudes(*frfs):
    return np.concatenate([frf.to("accelerance").amplitude for frf in frfs])[np.newaxis]


def proportional(level):
    return lambda frf, rng: replace(dovetail.noisy_frf(frf, level, rng, kind="proportional"), variance=None)


def of_another_quantity(frf, rng):
    return replace(dovetail.noisy_frf(frf.to("receptance"), 0.1, rng), variance=None).to("accelerance")


def hum(frf, rng):
    lines = np.flatnonzero(np.isclose(frf.frequency % 50.0, 0.0))
    values = frf.values.copy()
    values[lines] += 0.5 * values.std() * np.exp(2j * np.pi * rng.random(len(lines)))
    return replace(frf, values=values)


def ripple(frf, rng):
    return replace(frf, values=frf.values * (1.0 + 0.15 * np.sin(frf.frequency / 15.0 + 6.0 * rng.random())))


def share_told(model, truths, spoil):
    """Return the share of measurements that are warned of, or not trustworthy."""
    rng = np.random.default_rng(5)
    reported = []
    for theta in truths:
        result = model.identify(spoil(simulated(model, theta), rng), "network")
        warned = any(UNKNOWN in text or FAR in text for text in result.warnings)
        reported.append(warned or not result.is_trustworthy)
    return np.mean(reported)


@pytest.mark.parametrize("spoil", [proportional(0.05), proportional(0.2), of_another_quantity, hum])
def test_noise_unlike_the_training_is_reported(model, truths, spoil):
    assert share_told(model, truths, spoil) >= 0.95


def test_smooth_errors_unlike_the_training_are_reported(model, truths):
    assert share_told(model, truths, ripple) >= 0.9


@pytest.mark.parametrize("level", [0.0, 0.002, 0.005])
def test_noise_like_the_training_is_not_reported(model, truths, level):
    assert share_told(model, truths, proportional(level)) <= 0.02


def test_the_warning_has_the_band_the_ratio_and_a_remedy(model):
    frf = proportional(0.05)(simulated(model, model.assembly.vector({"k": 4e6, "c": 80.0})), 1)
    (text,) = (text for text in model.identify(frf, "network").warnings if UNKNOWN in text)
    assert " Hz: " in text
    assert " times the largest in the training" in text
    assert "'augmentation: {like: FILE}'" in text
    assert "the method 'posterior'" in text


def test_the_measured_noise_in_the_training_is_the_remedy(model, truths, tmp_path):
    spoil = proportional(0.05)
    dovetail.write_frf(spoil(simulated(model, truths[0]), np.random.default_rng(9)), tmp_path / "noisy.csv")
    remedied = trained(augmentation={"like": str(tmp_path / "noisy.csv")})
    assert share_told(remedied, truths, spoil) <= 0.05
    (tmp_path / "noisy.csv").unlink()
    assert remedied.identify(simulated(model, truths[0]), "network").posterior is not None
    again = dovetail.Identifier.of(remedied)
    assert again.identify(simulated(model, truths[0]), "network").posterior is not None


def test_training_without_noise_is_mentioned_in_the_warning(truths):
    model = trained(augmentation=None)
    assert share_told(model, truths[:20], lambda frf, _: frf) <= 0.05
    frf = proportional(0.02)(simulated(model, truths[0]), 1)
    assert any("the training had none" in text for text in model.identify(frf, "network").warnings)


@pytest.mark.parametrize("augmentation", [{}, {"mass": 1e-4}], ids=["amplitudes", "with phases"])
def test_the_noise_of_each_response_counts(augmentation):
    settings = {"augmentation": {**IDENTIFICATION["augmentation"], **augmentation}}
    block = mass_on_mount({"start": 150, "stop": 600, "step": 2}, {}, identification=settings)
    del block["response"]
    block["substructures"]["base"] = {"model": "lumped", "masses": [{"mass": 2.0}]}
    block["responses"] = [{"at": at, "position": 0, "quantity": "receptance"} for at in ("mass", "base")]
    assembly = dovetail.load(block)
    answer = assembly.vector({"k": 4e6, "c": 80.0})
    draws = answer * np.random.default_rng(1).normal(1.0, 0.01, (50, 2))
    clean = [dovetail.Frf(assembly.frequency, alone.frf(answer), "receptance") for alone in assembly.each_response]
    generator, known = np.random.default_rng(2), KnownNoise.from_description(assembly)
    good = [proportional(0.004)(frf, generator) for frf in clean]
    assert known.warnings(amplitudes(*good), answer, draws) == ()
    (text,) = known.warnings(amplitudes(good[0], proportional(0.1)(clean[1], generator)), answer, draws)
    assert UNKNOWN in text


def test_few_lines_are_not_judged():
    parameters = {"k": {"range": [1e6, 1e7]}}
    assembly = dovetail.load(mass_on_mount({"start": 150, "stop": 230, "step": 10}, parameters))
    answer = assembly.from_unit(np.full((1, len(assembly.parameters)), 0.5))
    frf = dovetail.Frf(assembly.frequency, assembly.frf(answer)[0], "accelerance")
    assert KnownNoise.from_description(assembly).warnings(amplitudes(frf), answer[0], answer) == ()
