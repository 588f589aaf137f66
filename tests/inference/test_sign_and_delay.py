"""A reversed sign and a delay of half a period: over a narrow band they are the same, and that is said."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail

NATURAL, MASS = 445.4, 0.42
TRUTH = {"k": MASS * (2 * np.pi * NATURAL) ** 2, "c": 0.235}
MOUNT = {
    "model": "spring_damper",
    "direction": "x",
    "connect": {"a": {"to": "mass", "at": 0}, "b": {"to": "base", "at": 0}},
    "parameters": {"k": {"range": [1e4, 1e8], "scale": "log"}, "c": {"range": [1e-3, 1e2], "scale": "log"}},
}
MODEL = dovetail.load(
    {
        "dovetail": 1,
        "name": "one resonance",
        "frequency": {"start": 435, "stop": 456, "step": 0.25},
        "substructures": {"base": {"model": "ground"}, "mass": {"model": "lumped", "masses": [{"mass": MASS}]}},
        "joints": {"mount": MOUNT},
        "response": {"at": "mass", "position": 0},
    }
)
NARROW, WIDER = np.arange(444.0, 447.0, 0.05), np.arange(435.0, 456.01, 0.25)


def causes_of(axis, factor, noise=4e-3):
    """Return what is named for the FRF of the mass times a factor, with noise."""
    values = factor(axis) * MODEL.on(axis).frf(TRUTH)
    parts = np.random.default_rng(0).standard_normal((2, len(axis))) / np.sqrt(2.0)
    measured = dovetail.Frf(axis, values + noise * values.std() * (parts[0] + 1j * parts[1]), "accelerance")
    return dovetail.identify(MODEL, measured, "refined", cause_seconds=60).adequacy.causes


def half_a_period(axis):
    return np.exp(-1j * np.pi * axis / NATURAL)


def reversed_sign(axis):
    return np.full(len(axis), -1.0)


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("factor", [half_a_period, reversed_sign])
def test_over_a_narrow_band_the_sign_is_named_and_the_delay_with_it(factor):
    (cause, *_) = causes_of(NARROW, factor, noise=0.05)
    assert cause.name == "sign"
    assert "(or a delay of" in cause.words
    assert "the two are equal)" in cause.words


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("noise", [4e-3, 0.01])
def test_the_right_one_of_sign_and_delay_is_first_over_a_wide_band(noise):
    assert causes_of(WIDER, half_a_period, noise)[0].name == "delay"
    sign = causes_of(WIDER, reversed_sign, noise)[0]
    assert sign.name == "sign"
    assert "or a delay" not in sign.words
