"""The sequential test: its statistic, its evidence, and how often it raises an alarm though nothing has changed."""

import numpy as np
import pytest
import scipy

from dovetail.monitoring.alarm import SCALES, Detector, Moments, file_probability, log_evidence


def statistics(deviations, first):
    """Return the F statistics of the files after the first ones."""
    moments, found = Moments.none(deviations.shape[1]), []
    for deviation in deviations:
        if moments.count >= first:
            found.append(moments.studentise(deviation))
        moments = moments.with_file(deviation)
    return found


def test_moments_are_those_of_all_files_at_once():
    deviations = np.random.default_rng(0).standard_normal((30, 3))
    moments = Moments.none(3)
    for deviation in deviations:
        moments = moments.with_file(deviation)
    np.testing.assert_allclose(moments.mean, deviations.mean(axis=0))
    np.testing.assert_allclose(moments.scatter / 29, np.cov(deviations.T))


@pytest.mark.parametrize("size", [1, 3, 6])
def test_probabilities_are_uniform_whatever_the_mean_and_covariance(size):
    random = np.random.default_rng(1)
    mixture, mean = random.standard_normal((size, size)) * 5.0, 100.0 * random.standard_normal(size)
    probabilities = []
    for _ in range(60):
        deviations = random.standard_normal((size + 30, size)) @ mixture + mean
        probabilities += [file_probability(*one) for one in statistics(deviations, size + 4)]
    assert scipy.stats.kstest(probabilities, "uniform").pvalue > 0.01


def test_successive_statistics_are_independent():
    random = np.random.default_rng(2)
    pairs = [[file_probability(*one) for one in statistics(random.standard_normal((12, 2)), 10)] for _ in range(1500)]
    assert abs(scipy.stats.spearmanr(*np.transpose(pairs)).statistic) < 0.07


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


def test_a_gross_change_raises_an_alarm_at_once_and_a_slight_one_soon():
    random = np.random.default_rng(4)
    deviations = random.standard_normal((130, 3))
    gross, slight = deviations.copy(), deviations.copy()
    gross[100:] += 20.0
    slight[100:] *= 2.5
    assert alarms(gross, 30, 1e-3)[0] == 70
    assert 70 <= alarms(slight, 30, 1e-3)[0] < 85
