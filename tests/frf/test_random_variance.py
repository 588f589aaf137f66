"""The variance of an FRF: from coherence and averages, equal to the scatter of repeated estimates."""

import numpy as np
import pytest

from dovetail import Frf
from dovetail.errors import MeasurementError

TRUE = 3 - 4j
AVERAGES = 20


def _h1_and_coherence(rng, noise):
    """H1 and coherence of one line, from `AVERAGES` random forces and a response with sensor noise."""

    def gaussian(size):
        return rng.normal(size=size) + 1j * rng.normal(size=size)

    force = gaussian((4000, AVERAGES))
    response = TRUE * force + noise * gaussian((4000, AVERAGES))
    cross = np.mean(force.conj() * response, axis=1)
    force_power = np.mean(abs(force) ** 2, axis=1)
    response_power = np.mean(abs(response) ** 2, axis=1)
    return cross / force_power, abs(cross) ** 2 / (force_power * response_power)


@pytest.mark.parametrize("noise", [0.3, 1.0])
def test_the_variance_from_the_coherence_is_the_scatter_of_repeated_estimates(noise):
    values, coherence = _h1_and_coherence(np.random.default_rng(0), noise)
    scatter = np.mean(abs(values - TRUE) ** 2)
    axis = np.arange(1.0, len(values) + 1)
    predicted = Frf(axis, values, "accelerance", coherence=coherence, averages=AVERAGES).random_variance
    assert np.mean(predicted) == pytest.approx(scatter, rel=0.04)


def test_a_variance_follows_its_values_to_another_quantity():
    axis = np.array([10.0, 20.0])
    frf = Frf(axis, [1 + 1j, 2j], "receptance", variance=[1.0, 4.0])
    omega = 2 * np.pi * axis
    np.testing.assert_allclose(frf.to("accelerance").random_variance, [1.0 * omega[0] ** 4, 4.0 * omega[1] ** 4])


def test_a_given_variance_comes_first_and_without_one_there_must_be_averages():
    axis, values = np.array([1.0, 2.0, 3.0]), [1.0, 2.0, 2.0]
    coherence = [1.0, 0.5, 0.0]
    assert Frf(axis, values, "mobility", coherence=coherence).random_variance is None
    assert Frf(axis, values, "mobility", coherence=np.ones(3), averages=1).random_variance is None
    np.testing.assert_allclose(
        Frf(axis, values, "mobility", coherence=coherence, averages=5).random_variance, [0.0, 1.0, np.inf]
    )
    both = Frf(axis, values, "mobility", coherence=coherence, averages=5, variance=[7.0, 8.0, 9.0])
    np.testing.assert_allclose(both.random_variance, [7.0, 8.0, 9.0])


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"variance": [1.0]}, "variances do not fit"),
        ({"variance": [-1.0, 1.0]}, "a variance is negative or not finite"),
        ({"averages": 0}, "0 averages"),
    ],
)
def test_impossible_values_are_refused(given, fault):
    with pytest.raises(MeasurementError, match=fault):
        Frf(np.array([1.0, 2.0]), [1.0, 1.0], "mobility", **given)
