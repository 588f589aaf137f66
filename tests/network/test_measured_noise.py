"""Training noise like that of a measurement: its level line by line, faults of its file, a model trained on it."""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.description import AugmentationSection
from dovetail.errors import DescriptionError, MeasurementError
from dovetail.network.augmentation import Augmentation, NoisyFeatures, measured_noises
from dovetail.problem.random_error import MeasuredNoise, most_likely_parts

AXIS = np.linspace(20.0, 590.0, 50)
"""Between the lines of the measurement."""
DRAWS, AVERAGES = 4000, 20
LEVEL = 100.0


def coherence(frequency):
    return 0.99 - 0.5 * frequency / 600.0


def deviation(frequency):
    return 0.01 + 0.1 * frequency / 600.0


def measurement(**reported) -> dovetail.Frf:
    frequency = np.linspace(1.0, 600.0, 400)
    values = (2.0 + np.sin(frequency / 70.0)) * np.exp(1j * frequency / 170.0)
    given = {name: reported[name](frequency) if callable(reported[name]) else reported[name] for name in reported}
    return dovetail.Frf(frequency, values, "accelerance", **given)


def of_coherence() -> dovetail.Frf:
    return measurement(coherence=coherence, averages=AVERAGES)


def of_variance() -> dovetail.Frf:
    return measurement(variance=lambda frequency: deviation(frequency) ** 2)


def drawn(frf: dovetail.Frf, amplitude: float) -> np.ndarray:
    amplitudes = np.full((DRAWS, len(AXIS)), amplitude, dtype=np.float32)
    MeasuredNoise.of(frf, AXIS).add(amplitudes, np.float32(1.0), np.random.default_rng(2))
    return amplitudes.astype(np.float64)


def test_noise_from_coherence_is_relative_to_each_amplitude():
    """Of small complex noise, half of the variance is in the amplitude; 4000 draws estimate it within 2.2 %."""
    share = (1.0 - coherence(AXIS)) / (coherence(AXIS) * (AVERAGES - 1))
    np.testing.assert_allclose(drawn(of_coherence(), LEVEL).var(axis=0), 0.5 * share * LEVEL**2, rtol=0.1)
    assert np.all(drawn(of_coherence(), 0.0) == 0.0)


@pytest.mark.parametrize("quantity", ["accelerance", "receptance"])
def test_noise_from_a_given_variance_is_absolute(quantity):
    """Of nothing but noise the mean square is the variance, reported to 1.6 %; the file may be of another quantity."""
    frf, expected = of_variance().to(quantity), deviation(AXIS) ** 2
    np.testing.assert_allclose(np.mean(drawn(frf, 0.0) ** 2, axis=0), expected, rtol=0.1)
    np.testing.assert_allclose(drawn(frf, LEVEL).var(axis=0), 0.5 * expected, rtol=0.12)


def test_an_estimated_floor_is_even_in_the_quantity_of_the_file():
    frequency, generator = np.linspace(5.0, 120.0, 400), np.random.default_rng(1)
    noise = generator.standard_normal((2, len(frequency))) / np.sqrt(2.0)
    clean = 1.0 / (1.0 - (frequency / 20.0) ** 2 + 0.5j * frequency / 20.0)
    frf = dovetail.Frf(frequency, clean + 0.01 * (noise[0] + 1j * noise[1]), "receptance")
    estimate = MeasuredNoise.of(frf, frequency)
    squares = (2.0 * np.pi * frequency) ** 4
    level = np.sqrt(estimate.floor / squares + estimate.share * np.abs(clean) ** 2)
    np.testing.assert_allclose(level[frequency > 40.0], 0.01, rtol=0.35)


def test_of_any_other_it_is_estimated_from_the_scatter():
    frf = measurement()
    noise = np.random.default_rng(1).standard_normal((2, len(frf.values))) / np.sqrt(2.0)
    for floor, share in ((0.05, 0.0), (0.0, 0.03)):
        values = frf.values + np.hypot(floor, share * frf.amplitude) * (noise[0] + 1j * noise[1])
        estimate = MeasuredNoise.of(dovetail.Frf(frf.frequency, values, "accelerance"), AXIS)
        for amplitude in (1.0, 3.0):
            level = np.sqrt(estimate.floor + estimate.share * amplitude**2)
            np.testing.assert_allclose(level, np.hypot(floor, share * amplitude), rtol=0.35)


def test_a_line_without_coherence_gets_the_largest_known_ratio():
    known = measurement(coherence=coherence, averages=AVERAGES).coherence.copy()
    known[100:140] = 0.0
    share = MeasuredNoise.of(measurement(coherence=known, averages=AVERAGES), AXIS).share
    assert np.isfinite(share).all()
    last = (1.0 - coherence(600.0)) / (coherence(600.0) * (AVERAGES - 1))
    assert share[(AXIS > 155.0) & (AXIS < 205.0)] == pytest.approx(last, rel=1e-5)


def test_its_level_varies_around_the_measured_one():
    settings = AugmentationSection(like="measured.npz", like_decades=2.0)
    assert (settings.additive, settings.multiplicative) == (0.0, 0.0)
    augmentation = Augmentation(settings, AXIS, 1.0, MeasuredNoise.of(of_variance(), AXIS))
    noisy = augmentation(np.full((2000, len(AXIS)), LEVEL, dtype=np.float32), np.random.default_rng(3))
    decades = np.log10(np.sqrt(2.0 * np.mean(((noisy - LEVEL) / deviation(AXIS)) ** 2, axis=1)))
    assert np.quantile(decades, [0.005, 0.5, 0.995]) == pytest.approx([-1.0, 0.0, 1.0], abs=0.15)
    assert np.histogram(decades, bins=4, range=(-1.0, 1.0))[0] == pytest.approx(500, rel=0.2)


@pytest.fixture
def folder(tmp_path, sdof) -> Path:
    dovetail.write_frf(of_coherence(), tmp_path / "measured.uff")
    dovetail.write_frf(of_variance(), tmp_path / "variance.npz")
    return tmp_path


def described(folder: Path, sdof, augmentation, **changes) -> Path:
    regressor = {"model": "mlp", "hidden": [8], "max_epochs": 2}
    identification = {"samples": 60, "reducer": {"model": "pca", "n_components": 5}, "regressor": regressor}
    whole = {**json.loads(sdof.description.text), **changes}
    whole["identification"] = {**identification, "augmentation": augmentation}
    (folder / "assembly.yaml").write_text(json.dumps(whole))
    return folder / "assembly.yaml"


def test_a_file_that_is_missing_is_named_with_its_place(folder, sdof):
    with pytest.raises(DescriptionError) as error:
        dovetail.load(described(folder, sdof, {"like": ["measured.uff", "none.uff"]}))
    (fault,) = error.value.faults
    assert fault.where.endswith("identification.augmentation.like[1]")
    assert fault.problem == f"there is no file '{folder / 'none.uff'}'."


def test_a_file_outside_of_the_band_is_refused_before_any_work(folder, sdof):
    above = described(folder, sdof, {"like": "measured.uff"}, frequency={"start": 700, "stop": 900, "step": 1})
    with pytest.raises(MeasurementError) as error:
        dovetail.train(above, progress=lambda *_: pytest.fail("work was begun"))
    assert error.value.faults[0].problem == "it was measured from 1 to 600 Hz."
    assert "700 to 900 Hz" in error.value.faults[0].accepted


def test_of_several_frfs_one_is_chosen_by_its_number(folder, sdof):
    several = folder / "several.uff"
    several.write_bytes((folder / "measured.uff").read_bytes() * 2)
    with pytest.raises(MeasurementError, match="holds 2 FRFs") as error:
        dovetail.train(described(folder, sdof, {"like": "several.uff"}))
    assert error.value.faults[0].where.startswith("identification.augmentation.like  ")
    assert error.value.faults[0].remedy == "Choose one with 'like_index', from 1."
    (noise,) = measured_noises(dovetail.load(described(folder, sdof, {"like": "several.uff", "like_index": 3})))
    assert noise is not None


def test_a_wrong_number_of_files_is_refused(folder, sdof):
    points = {"responses": [{"at": "mass", "position": 0, "name": name} for name in ("soft", "hard")]}
    whole = {key: value for key, value in json.loads(sdof.description.text).items() if key != "response"}
    both = described(folder, dovetail.load({**whole, **points}), {"like": ["measured.uff", "variance.npz"]})
    one, other = measured_noises(dovetail.load(both))
    assert (one.share.max() > 0.0, other.share.max() > 0.0) == (True, False)
    same, again = measured_noises(dovetail.load(described(folder, dovetail.load(both), {"like": "measured.uff"})))
    assert same is again
    with pytest.raises(MeasurementError, match="3 files and 3 indices were given for 2 responses"):
        measured_noises(dovetail.load(described(folder, dovetail.load(both), {"like": ["measured.uff"] * 3})))


@pytest.mark.parametrize("wrong", [{"like": 3}, {"like_index": 0, "like": "measured.uff"}, {"like_decades": -1}])
def test_wrong_values_of_the_keys_are_refused(folder, sdof, wrong):
    with pytest.raises(DescriptionError, match=r"identification\.augmentation"):
        dovetail.load(described(folder, sdof, wrong))


def test_a_model_needs_the_file_no_more(folder, sdof, tmp_path_factory):
    """The noise is in the features; what is saved has a copy of its own, also of fresh samples."""
    assembly = dovetail.load(described(folder, sdof, {"like": "measured.uff"}))
    clean = assembly.accelerance_amplitude(assembly.from_unit(np.full((30, 2), 0.5)))
    features = NoisyFeatures.from_samples(assembly, clean, assembly.from_unit(np.full((30, 2), 0.5)))(1)[0]
    assert features.std(axis=0).min() > 0.0
    model = dovetail.train(assembly, fresh=True)
    model.save(folder / "model")
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    shutil.move(folder / "model", elsewhere / "model")
    for file in ("measured.uff", "assembly.yaml"):
        (folder / file).unlink()
    loaded = dovetail.load_model(elsewhere / "model")
    assert (loaded.assembly.description.identification.augmentation.like) != str(folder / "measured.uff")
    np.testing.assert_array_equal(loaded.network.predict(clean), model.network.predict(clean))


def test_parts_of_a_variance_of_any_size_are_estimated_without_overflow():
    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for case in range(170):
            count = int(rng.integers(5, 2000))
            magnitude = 10.0 ** rng.uniform(-12.0, 3.0, count) * 10.0 ** rng.uniform(-8.0, 8.0)
            level = np.full(count, 10.0 ** rng.uniform(-8.0, 4.0))
            squares = rng.exponential(size=count) * 10.0 ** rng.uniform(-20.0, 5.0)
            squares *= magnitude * rng.random() + level * rng.random()
            if case % 3 == 0:
                squares[rng.integers(count)] *= 1e12
            parts = most_likely_parts(squares, level, magnitude, 1e-30 * magnitude.max())
            assert np.isfinite(parts).all()
