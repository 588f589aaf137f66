"""The sequential test: its statistic, its evidence, and how often it raises an alarm though nothing has changed."""

import numpy as np
import pytest
import scipy

from dovetail.monitoring.alarm import SCALES, Detector, UsualDeviations, file_probability, log_evidence


def statistics(deviations, first):
    """Return the F statistics of the files after the first ones."""
    usual, found = UsualDeviations.of(deviations[:first]), []
    for deviation in deviations[first:]:
        found.append(usual.studentise(deviation))
        usual = usual.with_file(deviation)
    return found


def probabilities(deviations, first):
    """Return the probabilities of the files after the first ones."""
    return [file_probability(*one) for one in statistics(deviations, first)]


def correlated(random, count, coefficient, size=3):
    """Return deviations (count, size), each correlated with the one before."""
    deviations = random.standard_normal((count, size))
    for number in range(1, count):
        deviations[number] = coefficient * deviations[number - 1] + np.sqrt(1 - coefficient**2) * deviations[number]
    return deviations


@pytest.mark.parametrize("size", [1, 3, 6])
def test_probabilities_do_not_depend_on_the_mean_and_covariance(size):
    random = np.random.default_rng(1)
    mixture, mean = random.standard_normal((size, size)) * 5.0, 100.0 * random.standard_normal(size)
    deviations = random.standard_normal((size + 30, size))
    plain, mixed = (probabilities(each, size + 4) for each in (deviations, deviations @ mixture + mean))
    np.testing.assert_allclose(mixed, plain, rtol=1e-6)


@pytest.mark.parametrize("coefficient", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("size", [1, 3, 6])
def test_small_probabilities_are_no_more_frequent_than_they_say(size, coefficient):
    random, found = np.random.default_rng(1), []
    for _ in range(60):
        found += probabilities(correlated(random, size + 90, coefficient, size), size + 60)
    for level in (0.1, 0.01):
        assert np.mean(np.array(found) < level) < level + 3.0 * np.sqrt(level / len(found)) * (1.0 + coefficient)


def test_the_probabilities_of_independent_deviations_are_nearly_uniform_after_many_files():
    random, found = np.random.default_rng(5), []
    for _ in range(40):
        found += probabilities(random.standard_normal((230, 3)), 180)
    assert scipy.stats.kstest(found, "uniform").statistic < 0.03


def test_successive_statistics_are_independent():
    random = np.random.default_rng(2)
    pairs = [probabilities(random.standard_normal((12, 2)), 10) for _ in range(1500)]
    assert abs(scipy.stats.spearmanr(*np.transpose(pairs)).statistic) < 0.07


def test_a_file_after_a_change_does_not_depend_on_the_one_before():
    random = np.random.default_rng(6)
    deviations = correlated(random, 100, 0.9, 1)
    usual = UsualDeviations.of(deviations)
    high = usual.with_file(deviations.mean(axis=0) + 3.0)
    correlated_file, after = (abs(one.deviation_of_last(usual.centre + 2.0)) for one in (high, high.after_change()))
    assert correlated_file < after


@pytest.mark.parametrize(("above", "below"), [(1, 5), (4, 20), (13, 19), (5, 900)])
def test_the_evidence_has_an_expectation_of_one(above, below):
    places = (np.arange(200_000) + 0.5) / 200_000
    values = scipy.stats.f.ppf(places, above, below)
    for number, scale in enumerate(SCALES):
        density = scipy.stats.f.pdf(values / scale, above, below) / scale / scipy.stats.f.pdf(values, above, below)
        logs = np.array([log_evidence(value, above, below)[number] for value in values[::500]])
        np.testing.assert_allclose(logs, np.log(density[::500]), atol=1e-8)
        if scale < 2.0:  # the tail of gross alternatives lies beyond the grid
            assert density.mean() == pytest.approx(1.0, abs=2e-3)


def alarms(deviations, first, rate):
    """Return the numbers of the files that raise an alarm; the sums start again after each."""
    detector, raised = Detector.new(), []
    for number, one in enumerate(statistics(deviations, first)):
        detector = detector.with_file(log_evidence(*one))
        if detector.evidence >= 1.0 / rate:
            raised.append(number)
            detector = Detector.new()
    return raised


def test_false_alarms_are_no_more_frequent_than_specified():
    random = np.random.default_rng(3)
    count = sum(len(alarms(random.standard_normal((530, 3)), 30, 0.01)) for _ in range(20))
    assert 0 < count < 0.01 * 20 * 500


@pytest.mark.parametrize("coefficient", [0.4, 0.8])
def test_correlated_deviations_raise_no_more_false_alarms_than_specified(coefficient):
    random = np.random.default_rng(7)
    count = sum(len(alarms(correlated(random, 530, coefficient), 30, 0.01)) for _ in range(20))
    assert count < 0.01 * 20 * 500


def test_a_gross_change_raises_an_alarm_at_once_and_a_slight_one_soon():
    random = np.random.default_rng(4)
    deviations = random.standard_normal((130, 3))
    gross, slight = deviations.copy(), deviations.copy()
    gross[100:] += 20.0
    slight[100:] *= 2.5
    assert alarms(gross, 30, 1e-3)[0] == 70
    assert 70 <= alarms(slight, 30, 1e-3)[0] < 85
