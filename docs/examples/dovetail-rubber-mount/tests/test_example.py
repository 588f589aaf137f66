"""The example: its FRF against a hand calculation, and its three parameters identified."""

from pathlib import Path

import numpy as np
import pytest

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


def test_all_three_parameters_are_identified(assembly, measured):
    found = dovetail.identify(assembly, measured).parameters
    assert {name: found[name].value for name in TRUTH} == pytest.approx(TRUTH, rel=0.01)
