"""The filter against least squares of all files at once, and steps that are learned from a known random walk."""

import numpy as np
import pytest

from dovetail.monitoring.kalman import RANGE_VARIANCE, Belief, LinearMeasurement, RandomWalk, learn_walk


def measured(position, random, deviation=0.01, free=0):
    root = np.triu(random.uniform(0.5, 1.0, (len(position), len(position))))
    noise = np.eye(len(position)) * deviation**2
    target = root @ position + deviation * random.standard_normal(len(position))
    return LinearMeasurement(root, target, noise, free, 0.0)


def test_constant_parameters_are_those_of_least_squares():
    random, truth = np.random.default_rng(0), np.array([0.3, 0.6, 0.5])
    files = [measured(truth, random) for _ in range(8)]
    start = Belief.about(np.full(3, 0.5))
    *_, (_, _, last) = RandomWalk(np.zeros(3), np.zeros(3, dtype=bool)).follow(start, files)
    information = np.linalg.inv(start.covariance) + sum(f.root.T @ np.linalg.inv(f.noise) @ f.root for f in files)
    pulled = np.linalg.solve(start.covariance, start.mean)
    pulled = pulled + sum(f.root.T @ np.linalg.inv(f.noise) @ f.target for f in files)
    np.testing.assert_allclose(last.mean, np.linalg.solve(information, pulled), rtol=1e-9)
    np.testing.assert_allclose(last.covariance, np.linalg.inv(information), rtol=1e-6)


def test_earlier_files_say_nothing_of_a_free_parameter():
    walk = RandomWalk(np.array([0.0, 1e-3]), np.array([True, False]))
    predicted = walk.predict(Belief(np.array([0.4, 0.6]), np.array([[1e-6, 5e-7], [5e-7, 1e-6]])))
    np.testing.assert_allclose(predicted.covariance, [[RANGE_VARIANCE, 0.0], [0.0, 2e-6]])


def test_no_innovation_depends_on_a_free_parameter():
    random = np.random.default_rng(1)
    here = measured(np.array([0.2, 0.5]), random, free=1)
    priors = (Belief(np.array([first, 0.5]), np.eye(2) * 0.01) for first in (0.1, 0.9))
    (one, _), (other, _) = (here.innovation(prior) for prior in priors)
    np.testing.assert_allclose(one, other)


def test_a_prediction_is_never_wider_than_the_range():
    predicted = RandomWalk(np.array([0.2, 0.0]), np.zeros(2, dtype=bool)).predict(Belief.about(np.full(2, 0.5)))
    for _ in range(30):
        predicted = RandomWalk(np.array([0.2, 0.0]), np.zeros(2, dtype=bool)).predict(predicted)
    np.testing.assert_allclose(np.diag(predicted.covariance), [RANGE_VARIANCE, 0.01])


@pytest.mark.parametrize("noise", [0.5, 2.0])
def test_the_steps_and_the_scale_of_the_noise_are_learned(noise):
    random = np.random.default_rng(2)
    truth = np.array([0.5, 0.5]) + np.cumsum(random.standard_normal((150, 2)) * [3e-3, 0.0], axis=0)
    files = [measured(position, random, 1e-3 * noise) for position in truth]
    claimed = [LinearMeasurement(f.root, f.target, np.eye(2) * 1e-6, 0, 0.0) for f in files]
    first = RandomWalk(np.array([1e-3, 1e-3]), np.zeros(2, dtype=bool))
    walk = learn_walk(Belief.about(np.full(2, 0.5)), claimed, first)
    assert walk.step[0] == pytest.approx(3e-3, rel=0.25)
    assert walk.step[1] < 4e-4
    assert walk.noise_scale == pytest.approx(noise, rel=0.2)
