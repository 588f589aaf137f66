"""Damping that depends on the amplitude is reported, between measurements at several levels and within one."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import dovetail
from support.noisy_measurements import noisy

STIFFNESS, DAMPING = 4e6, 20.0
AXIS = np.arange(250.0, 400.0, 0.5)


@pytest.fixture(scope="module")
def mount(sdof):
    return sdof.on(AXIS)


def at_levels(mount, count):
    """Return the assembly measured at one point at several levels of the force."""
    description = json.loads(mount.description.text)
    response = description.pop("response")
    description["responses"] = [{**response, "name": f"level{number}"} for number in range(count)]
    return dovetail.load(description)


def growing(ratio):
    """Return the accelerance under a constant force, with damping in proportion to the displacement, at 1 kg."""
    omega = 2.0 * np.pi * AXIS
    amplitude = np.ones(len(AXIS))
    for _ in range(400):
        damping = DAMPING * (1.0 + (ratio - 1.0) * amplitude / amplitude.max())
        receptance = 1.0 / (STIFFNESS - omega**2 + 1j * omega * damping)
        amplitude = 0.5 * (amplitude + np.abs(receptance))
    return -(omega**2) * receptance


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize("growth", [4.5, 1.0])
@pytest.mark.parametrize("levels", [2, 3])
def test_damping_that_grows_from_level_to_level_is_reported(mount, levels, growth):
    ratios = np.geomspace(1.0, growth, levels)
    measured = [noisy(mount, mount.frf([STIFFNESS, DAMPING * ratio]), 0.01, n) for n, ratio in enumerate(ratios)]
    adequacy = dovetail.identify(at_levels(mount, levels), measured, "refined").adequacy
    if growth == 1.0:
        assert adequacy.word == "to the noise"
        return
    (words,) = [cause.words for cause in adequacy.causes if cause.name == "level"]
    assert re.search(r"damping ratio from 0\.5 to 2\.[23] %, 4\.[3-7] times as much", words)


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("ratio", [4.5, 2.0])
def test_damping_that_grows_within_a_measurement_is_reported(mount, ratio):
    causes = dovetail.identify(mount, noisy(mount, growing(ratio), 0.01, 5), "refined").adequacy.causes
    assert causes[0].name == "level"
    (times,) = re.findall(r"^damping ([\d.]+) times as large at the peak", causes[0].words)
    assert float(times) == pytest.approx(ratio, rel=0.1)


def test_damping_that_does_not_grow_is_not_reported(mount):
    assert np.allclose(growing(1.0), mount.frf([STIFFNESS, DAMPING]), rtol=1e-6)
    adequacy = dovetail.identify(mount, noisy(mount, growing(1.0), 0.01, 5), "refined").adequacy
    assert (adequacy.word, adequacy.causes) == ("to the noise", ())
