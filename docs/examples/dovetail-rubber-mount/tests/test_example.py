"""The example: its FRF against a hand calculation, and its three parameters identified."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import dovetail

EXAMPLE = Path(__file__).parents[1] / "example.yaml"
TRUTH = {"k": 1.5e6, "g": 0.2, "alpha": 0.4}


@pytest.fixture(scope="module")
def assembly():
    return dovetail.load(EXAMPLE)


@pytest.fixture(scope="module")
def measured(assembly):
    """The FRF of known parameters with one per cent of noise."""
    random = np.random.default_rng(0).standard_normal((2, len(assembly.frequency)))
    noise = 1.0 + 0.01 * (random[0] + 1j * random[1]) / np.sqrt(2.0)
    return dovetail.Frf(assembly.frequency, assembly.frf(TRUTH) * noise, "accelerance")


def test_the_frf_is_that_of_a_mass_on_the_law(assembly):
    f = assembly.frequency
    law = 1.5e6 * (1 + 0.2 * (f / 100) ** 0.4 * np.exp(0.5j * np.pi * 0.4))
    expected = -((2 * np.pi * f) ** 2) / (law - 2.0 * (2 * np.pi * f) ** 2)
    np.testing.assert_allclose(assembly.frf(TRUTH), expected, rtol=1e-10)


def test_a_network_identifies_the_stiffness(assembly, measured):
    found = dovetail.train(assembly).identify(measured).parameters
    assert found["k"].value == pytest.approx(TRUTH["k"], rel=0.1)


def test_least_squares_identify_all_three(assembly, measured):
    def residual(fraction):
        difference = assembly.frf(assembly.from_unit(fraction)) / measured.values - 1.0
        return np.concatenate([difference.real, difference.imag])

    fits = [least_squares(residual, np.full(3, start), bounds=(0.0, 1.0)) for start in (0.25, 0.5, 0.75)]
    best = min(fits, key=lambda fit: fit.cost)
    assert dict(zip(TRUTH, assembly.from_unit(best.x), strict=True)) == pytest.approx(TRUTH, rel=0.01)
