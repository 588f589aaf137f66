"""Verdicts of one mass on a spring and a damper, against formulas written out here."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail

STIFFNESS, DAMPING = (1e5, 1e7), 50.0
PLACE = np.array([0.4, 0.5])
GRID = (np.arange(100) + 0.5) / 100


@pytest.fixture
def ranged(sdof):
    """The assembly with damping unknown within half of `width` around 50 N s/m."""

    def assembly(width):
        description = json.loads(sdof.description.text)
        ends = [f"{DAMPING + sign * width / 2} N s/m" for sign in (-1, 1)]
        description["joints"]["mount"]["parameters"]["c"]["range"] = ends
        return dovetail.load(description)

    return assembly


def accelerance(frequency, place, width):
    """Of 1 kg, at fractions (..., 2) of the ranges of stiffness and damping; and its derivatives by them."""
    omega = 2 * np.pi * frequency
    k = STIFFNESS[0] + place[..., 0, np.newaxis] * (STIFFNESS[1] - STIFFNESS[0])
    c = DAMPING + (place[..., 1, np.newaxis] - 0.5) * width
    stiffness = k + 1j * omega * c - omega**2
    by_k, by_c = omega**2 / stiffness**2, 1j * omega**3 / stiffness**2
    return -(omega**2) / stiffness, np.stack([by_k * (STIFFNESS[1] - STIFFNESS[0]), by_c * width])


def measurement(frequency, width, noise=1.0):
    """With noise in parts of the FRF's standard deviation; and the Fisher information."""
    clean, derivatives = accelerance(frequency, PLACE, width)
    variance = np.full(len(clean), (noise * clean.std()) ** 2)
    normal = np.random.default_rng(2).standard_normal((2, len(clean)))
    noisy = clean + np.sqrt(variance / 2) * (normal[0] + 1j * normal[1])
    frf = dovetail.Frf(frequency, noisy, "accelerance", variance=variance)
    return frf, 2.0 / variance[0] * np.real(derivatives.conj() @ derivatives.T)


def chi_squared(frf, width, reach):
    """On a grid around the true stiffness and over all damping."""
    stiffness = PLACE[0] + np.linspace(-1, 1, 61) * reach
    places = np.stack(np.meshgrid(stiffness, GRID, indexing="ij"), axis=-1)
    values = np.stack([accelerance(frf.frequency, row, width)[0] for row in places])
    return np.sum(np.abs(values - frf.values) ** 2 / (frf.variance / 2), axis=-1)


def word(gain, half_width):
    """By hand: the interval reaches so far from 50 N s/m."""
    if gain < 0.5:
        return "not identifiable"
    return "identified" if half_width / DAMPING <= 0.2 else "weakly identified"


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize(
    ("width", "noise", "expected"),
    [
        (90.0, 1.0, "identified"),
        (14.0, 1.0, "identified"),
        (3.0, 1.0, "not identifiable"),
        (90.0, 3.5, "weakly identified"),
        (45.0, 3.5, "weakly identified"),
        (14.0, 3.5, "not identifiable"),
    ],
)
def test_four_routes_give_one_verdict(ranged, width, noise, expected):
    assembly = ranged(width)
    frf, information = measurement(assembly.frequency, width, noise)
    posterior = dovetail.identify(assembly, frf, "posterior", samples=1000, model_error=0.0).posterior
    verdict = posterior.verdicts["c"]
    spread = np.linalg.inv(information + 12 * np.eye(2))
    grid = chi_squared(frf, width, reach=6 * np.sqrt(spread[0, 0]))
    density = np.exp(-(grid - grid.min()) / 2).sum(axis=0)
    density /= density.sum()
    gain = 1 - 12 * density @ (GRID - density @ GRID) ** 2
    low, high = np.interp([0.05, 0.95], np.cumsum(density), GRID)
    region = np.count_nonzero(grid.min(axis=0) <= grid.min() + 2.71) / 100
    fisher = 1 - 12 * spread[1, 1]
    assert verdict.gain == pytest.approx(gain, abs=0.05)
    words = [
        word(gain, width * (high - low) / 2),
        word(fisher, width * 1.645 * np.sqrt(spread[1, 1])),
        word(1 - 12 * (region / 3.29) ** 2, width * region / 2),
    ]
    assert [verdict.word, *words] == [expected] * 4
    assert posterior.verdicts["k"].word == "identified"


def test_a_parameter_that_hardly_changes_the_frf_has_that_reason(ranged):
    assembly = ranged(3.0)
    posterior = dovetail.identify(assembly, measurement(assembly.frequency, 3.0)[0], "posterior").posterior
    assert posterior.verdicts["c"].reason == "The measurement hardly depends on it."


def absorbers():
    """A block with two light masses on springs, of which nothing in the block's FRF shows which is which."""

    def spring(part, to, stiffness):
        return {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": part, "at": 0}, "b": {"to": to, "at": 0}},
            "parameters": {"k": stiffness, "c": {"range": [0.1, 300.0], "scale": "log"}},
        }

    unknown = {"range": [2e4, 3e6], "scale": "log"}
    masses = {"block": 3.0, "first": 0.2, "second": 0.2}
    parts = {name: {"model": "lumped", "masses": [{"mass": mass}]} for name, mass in masses.items()}
    return {
        "dovetail": 1,
        "name": "absorbers",
        "frequency": {"start": 20.0, "stop": 250.0, "step": 0.5},
        "substructures": {"base": {"model": "ground"}, **parts},
        "joints": {
            "mount": spring("block", "base", unknown),
            "one": spring("first", "block", unknown),
            "other": spring("second", "block", unknown),
        },
        "response": {"at": "block", "position": 0.0, "quantity": "receptance"},
    }


def test_exchangeable_stiffnesses_are_not_reported_as_their_mean():
    stiffness, damping, masses = (1e6, 8e4, 1.1e5), (30.0, 1.0, 1.5), (3.0, 0.2, 0.2)
    omega = 2j * np.pi * np.arange(20.0, 250.0, 0.5)
    spring = [k + c * omega for k, c in zip(stiffness, damping, strict=True)]
    carried = [m * omega**2 * z / (m * omega**2 + z) for m, z in zip(masses[1:], spring[1:], strict=True)]
    receptance = 1.0 / (masses[0] * omega**2 + spring[0] + sum(carried))
    noise = np.random.default_rng(1).standard_normal((2, len(omega))) / np.sqrt(2.0)
    measured = receptance + 0.01 * receptance.std() * (noise[0] + 1j * noise[1])
    frf = dovetail.Frf(omega.imag / (2 * np.pi), measured, "receptance")
    posterior = dovetail.identify(dovetail.load(absorbers()), frf).posterior
    exchanged = {"one.k", "one.c", "other.k", "other.c"}
    assert {"one.k", "other.k"} <= set(posterior.groups) <= exchanged
    for name in ("one.k", "other.k"):
        low, high = posterior.interval()[name]
        assert low < stiffness[1] * 1.005
        assert high > stiffness[2] * 0.995
        assert posterior.verdicts[name].word == "weakly identified"
        groups = posterior.groups[name]
        assert posterior.verdicts[name].precision == "2 groups"
        assert sum(group.weight for group in groups) == pytest.approx(1.0)
        for group, value in zip(groups, sorted(stiffness[1:]), strict=True):
            assert group.interval_low < value < group.interval_high
            assert group.estimate == pytest.approx(value, rel=0.02)
            assert group.precision.startswith("±")
    one, other = (posterior.estimate[posterior.names.index(name)] for name in ("one.k", "other.k"))
    assert sorted((one, other)) == pytest.approx(stiffness[1:], rel=0.02)  # of one group for both, not their means
    assert posterior.verdicts["mount.k"].word == "identified"
