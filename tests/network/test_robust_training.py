"""Robust training: the noise that training FRFs get, and epochs that change."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.description import AugmentationSection
from dovetail.errors import DatasetError
from dovetail.network.augmentation import Augmentation, NoisyFeatures
from dovetail.network.epochs import FreshEpochs, ReducedEpochs
from dovetail.network.pipeline import Reduction
from dovetail.network.preprocessing import TargetScaling, ZScore

AXIS = np.arange(1.0, 2001.0)
SILENT = {"additive": 0.0, "multiplicative": 0.0}


def augmented(amplitude, seed=0, deviation=1.0, **settings):
    chosen = AugmentationSection(**{**SILENT, **settings})
    return Augmentation(chosen, AXIS, deviation)(amplitude, np.random.default_rng(seed))


def flat(rows, level=100.0):
    return np.full((rows, len(AXIS)), level, dtype=np.float32)


def test_without_any_noise_nothing_changes():
    np.testing.assert_array_equal(augmented(flat(3)), flat(3))


def test_additive_noise_has_levels_over_three_decades_in_units_of_the_deviation():
    levels = augmented(flat(400), additive=0.5, clean=0.0, deviation=20.0).std(axis=1)
    assert levels.max() == pytest.approx(10.0, rel=0.1)
    assert levels.min() == pytest.approx(0.01, rel=0.2)
    assert np.median(levels) == pytest.approx(10.0 * 10**-1.5, rel=0.3)


def test_a_share_of_the_frfs_stays_without_additive_noise():
    untouched = np.all(augmented(flat(1000), clean=0.3, additive="100%") == 100.0, axis=1)
    assert np.mean(untouched) == pytest.approx(0.3, abs=0.05)


def test_multiplicative_noise_is_relative_and_a_gain_scales_all_lines():
    relative = augmented(flat(400, level=7.0), multiplicative=0.1).std(axis=1) / 7.0
    assert relative.max() == pytest.approx(0.1, rel=0.1)
    assert relative.min() < 0.005
    gains = augmented(flat(1000), gain=0.05)
    np.testing.assert_allclose(gains, gains[:, :1].repeat(len(AXIS), axis=1))
    assert gains[:, 0].std() == pytest.approx(5.0, rel=0.1)


def test_circular_noise_is_that_of_a_complex_measurement():
    """The amplitude of what is only noise follows Rayleigh; an error in quadrature adds to a small amplitude too."""
    only_noise = augmented(flat(300, level=0.0), circular=1.0, additive=0.5, clean=0.0, deviation=20.0)
    of_rayleigh = np.sqrt(np.pi / (4.0 - np.pi))
    np.testing.assert_allclose(only_noise.mean(axis=1) / only_noise.std(axis=1), of_rayleigh, rtol=0.1)
    assert np.sqrt(np.mean(only_noise**2, axis=1)).max() == pytest.approx(10.0, rel=0.05)
    of_both = augmented(flat(300, level=7.0), circular=1.0, multiplicative=0.3)
    excess = np.mean(of_both**2, axis=1) / 49.0 - 1.0
    assert np.sqrt(excess.max()) == pytest.approx(0.3, rel=0.1)
    np.testing.assert_array_equal(augmented(flat(3), circular=1.0), flat(3))
    some = augmented(flat(600, level=0.0), circular=0.3, additive="100%", clean=0.0)
    is_circular = some.mean(axis=1) / some.std(axis=1) > 1.6  # 1.91 for Rayleigh, 1.32 for the magnitude of a normal
    assert np.mean(is_circular) == pytest.approx(0.3, abs=0.06)


def test_bad_lines_are_wrong_by_up_to_a_decade():
    spoiled = augmented(flat(200), bad_lines=0.2)
    share = np.mean(spoiled != 100.0, axis=1)
    assert share.max() == pytest.approx(0.2, rel=0.15)
    assert 10.0 <= spoiled.min() < 11.0
    assert 900.0 < spoiled.max() <= 1000.0


def test_a_stretched_axis_moves_a_peak():
    peak = np.exp(-(((AXIS - 1000.0) / 50.0) ** 2))[np.newaxis].astype(np.float32).repeat(500, axis=0)
    moved = AXIS[np.argmax(augmented(peak, stretch=0.01), axis=1)]
    assert moved.std() == pytest.approx(10.0, rel=0.1)
    assert moved.mean() == pytest.approx(1000.0, abs=2.0)


def test_a_remaining_mass_lowers_or_raises_the_natural_frequency(sdof):
    """A mass dm on 1 kg moves the natural frequency by -dm/2 of itself."""
    theta = np.array([1e6, 5.0])
    clean = sdof.frf(theta)[np.newaxis].repeat(300, axis=0)
    chosen = AugmentationSection(**SILENT, mass=0.05)
    loaded = Augmentation(chosen, sdof.frequency, 1.0)(clean, np.random.default_rng(0))
    natural = sdof.natural_frequencies(theta, count=1)[0]
    shift = sdof.frequency[np.argmax(loaded, axis=1)] / natural - 1
    assert shift.std() == pytest.approx(0.025, rel=0.1)


@pytest.fixture(scope="module")
def robust(with_settings):
    return with_settings(
        samples=600,
        reducer={"model": "pca", "n_components": 12},
        regressor={"model": "mlp", "hidden": [32, 16], "max_epochs": 5},
        augmentation={"copies": 3},
    )


@pytest.fixture(scope="module")
def frfs(robust, tmp_path_factory):
    return dovetail.generate(robust, tmp_path_factory.mktemp("robust") / "data.zarr")


def noisy_features(assembly, dataset):
    return NoisyFeatures.from_samples(assembly, np.asarray(dataset.amplitude[:]), dataset.parameters)


def test_epochs_differ_and_each_can_be_had_again(robust, frfs):
    first, again = noisy_features(robust, frfs), noisy_features(robust, frfs)
    np.testing.assert_array_equal(first(1)[0], again(1)[0])
    assert np.mean(first(0)[0] != first(1)[0]) > 0.9
    np.testing.assert_array_equal(first(2)[1], frfs.parameters)


def test_fresh_epochs_have_new_samples_and_their_own_frfs(with_settings, robust, frfs):
    settings = {"fresh": True, "additive": 0.0, "multiplicative": 0.0}
    assembly = with_settings(samples=600, reducer={"model": "none"}, augmentation=settings)
    features, theta = noisy_features(assembly, frfs)(4)
    assert not np.isin(theta[:, 0], frfs.parameters[:, 0]).any()
    expected = np.log10(assembly.accelerance_amplitude(theta) + 1)
    np.testing.assert_allclose(features, expected, rtol=1e-5, atol=1e-6)


def test_a_remaining_mass_needs_phases(with_settings, frfs):
    assembly = with_settings(samples=600, augmentation={"mass": "2 g"})
    with pytest.raises(DatasetError, match="needs phases"):
        noisy_features(assembly, frfs)
    fresh = with_settings(samples=600, augmentation={"mass": "2 g", "fresh": True, "additive": 0.0})
    assert np.isfinite(noisy_features(fresh, frfs)(0)[0]).all()


def test_training_goes_through_as_many_augmentations_as_copies(robust, frfs):
    asked = []
    settings = robust.description.identification

    class Spy(type(settings.regressor)):
        def fit_epochs(self, epoch, **others):
            made = [epoch(number)[0] for number in range(5)]
            asked.extend(made)
            return super().fit_epochs(epoch, **others)

    spied = dovetail.Assembly(
        robust.description.with_identification({}, regressor=Spy(settings.regressor.config)),
    )
    dovetail.train(spied, frfs)
    assert asked[3] is asked[0]
    assert asked[4] is asked[1]
    assert not np.array_equal(asked[0], asked[1])


@pytest.mark.parametrize("reducer", [{"model": "pca", "n_components": 12}, {"model": "none"}])
def test_an_epoch_is_the_same_whether_it_is_computed_ahead_or_alone(with_settings, frfs, reducer):
    assembly = with_settings(samples=600, reducer=reducer, augmentation={"copies": 3})
    noisy = noisy_features(assembly, frfs)
    reduction = reduction_of(assembly, noisy)
    with ReducedEpochs(noisy, reduction, reduction(*noisy(0))) as epochs:
        made = {number: epochs(number) for number in (0, 2, 1)}
    for number, (features, targets) in made.items():
        expected = reduction(*noisy(number))
        np.testing.assert_array_equal(features, expected[0])
        np.testing.assert_array_equal(targets, expected[1])


def test_no_epoch_is_begun_once_training_has_failed(robust, frfs, monkeypatch):
    noisy, computed = noisy_features(robust, frfs), []
    reduction = reduction_of(robust, noisy)
    first = reduction(*noisy(0))
    monkeypatch.setattr(ReducedEpochs, "_computed", lambda _, number: computed.append(number) or first)

    def train():
        with ReducedEpochs(noisy, reduction, first) as epochs:
            epochs(0)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        train()
    assert computed in ([], [1])


def reduction_of(assembly, noisy):
    """The reduction that is fitted to the first epoch."""
    features, theta = noisy(0)
    reducer = assembly.description.identification.reducer.fit(features, seed=0)
    return Reduction(
        "reducer", reducer, ZScore.fit(reducer.transform(features)), TargetScaling.fit(theta, assembly.parameters)
    )


@pytest.fixture
def fresh_epochs(with_settings, frfs):
    """Makes epochs of fresh samples, each drawn so often on average."""

    def make(reuse):
        augmentation = {"fresh": True, "reuse": reuse}
        assembly = with_settings(samples=600, reducer={"model": "pca"}, augmentation=augmentation)
        samples = noisy_features(assembly, frfs)
        reduction = reduction_of(assembly, samples)
        return FreshEpochs(samples, reduction, reduction(*samples(0)))

    return make


def drawn(epochs, numbers):
    """Return the targets of each epoch, as sets of rows."""
    return [[tuple(row) for row in epochs(number)[1].tolist()] for number in numbers]


def test_fresh_samples_are_never_used_twice(fresh_epochs):
    rows = [row for epoch in drawn(fresh_epochs(1), range(4)) for row in epoch]
    assert len(set(rows)) == len(rows) == 4 * 600


def test_fresh_samples_are_used_as_often_as_is_wanted_each_at_its_place(fresh_epochs):
    epochs = drawn(fresh_epochs(3), range(10))
    assert len({row for epoch in epochs for row in epoch}) <= 600 + 9 * 200
    assert len(set(epochs[9]) - set(epochs[8])) > 200  # of the new segment and of what was drawn again
    places = {}
    for epoch in epochs:
        for place, row in enumerate(epoch):
            assert places.setdefault(row, place) == place
    assert epochs == drawn(fresh_epochs(3), range(10))


def test_fresh_features_belong_to_their_targets(fresh_epochs):
    """The features that a regressor gets are those of the FRF of the parameters next to them, but for the noise."""
    epochs = fresh_epochs(3)
    reduction = epochs._reduction
    features, targets = epochs(5)
    clean = np.log10(epochs._noisy.assembly.accelerance_amplitude(reduction.targets.inverse(targets)) + 1)
    expected, _ = reduction(clean.astype(np.float32), reduction.targets.inverse(targets))
    assert np.corrcoef(features[:, 0], expected[:, 0])[0, 1] > 0.99


def test_a_regressor_that_knows_no_epochs_gets_several_at_once(frfs):
    class Recorder(dovetail.Regressor):
        name = "recorder"
        summary = "keeps what it is fitted to"

        def fit(self, features, targets, *, seed, progress=dovetail.silent):
            self.__dict__["given"] = features, targets
            return self

        def restore(self, state):
            raise NotImplementedError

    recorder = Recorder(Recorder.Config())
    recorder.fit_epochs(lambda number: (np.full((2, 3), float(number)), np.full((2, 1), 9.0)), seed=0)
    features, targets = recorder.given
    np.testing.assert_array_equal(features[:, 0], [0, 0, 1, 1, 2, 2, 3, 3])
    assert targets.shape == (8, 1)


def test_robust_training_is_an_option_and_is_in_the_description(with_settings, frfs):
    plain = with_settings(
        samples=600, reducer={"model": "pca", "n_components": 12}, regressor={"model": "mlp", "max_epochs": 3}
    )
    model = dovetail.train(plain, frfs, robust=True)
    again = dovetail.load(json.loads(model.assembly.description.text))
    assert again.description.identification.augmentation == AugmentationSection()
