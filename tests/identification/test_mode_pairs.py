"""Which modes belong to which peaks, and what is in the table of natural frequencies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.assembly import VibrationMode
from dovetail.frf.resonance_peaks import resonance_peaks
from dovetail.identification.reconstruction import paired_modes, reconstruct, unpaired_peaks
from dovetail.inference.adequacy.verdict import AtPoint
from dovetail.problem import Problem
from dovetail.report.content import ABSENT, mode_rows

FREQUENCY = np.arange(100.0, 2000.0, 0.5)
POINT = ("part", 0)
HERE = ((1.0, POINT),)


def mode(natural: float, damping: float = 0.005, shape: float = 1.0) -> VibrationMode:
    """Of a mass of 1 kg, with a displacement relative to the first point."""
    scale = np.sqrt(1.0 / (4j * np.pi * natural * np.sqrt(1.0 - damping**2)))
    return VibrationMode(natural, damping, {"part": np.array([[shape * scale, 0.0]])})


def frf_of(*modes: VibrationMode) -> dovetail.Frf:
    """Sum over the poles and their conjugates."""
    s = 2j * np.pi * FREQUENCY
    poles = [(m.pole, m.shapes["part"][0, 0] ** 2) for m in modes]
    values = sum(r / (s - p) + np.conj(r) / (s - np.conj(p)) for p, r in poles)
    return dovetail.Frf(FREQUENCY, values, "receptance")


def test_a_mode_without_motion_at_the_point_is_not_paired_with_the_peak_of_its_neighbour():
    still, moving = mode(819.0, shape=1e-3), mode(825.0)
    frf = frf_of(moving)
    pairs = paired_modes([still, moving], (HERE, HERE), AtPoint("part", frf, frf))
    assert pairs[0].reconstructed_peak is None
    assert pairs[1].reconstructed_peak == pytest.approx(825.0, rel=1e-3)
    assert pairs[1].measured_peak == pytest.approx(825.0, rel=1e-3)


def test_a_peak_belongs_to_the_mode_that_makes_it_even_if_another_one_is_nearer():
    """Of two modes next to each other, the nearer one is nearly a node of vibration."""
    maker = mode(800.0, damping=0.05)
    (peak,) = resonance_peaks(frf_of(maker))
    nearer = mode(peak, shape=0.01)
    pairs = paired_modes([maker, nearer], (HERE, HERE), AtPoint("part", frf_of(maker), frf_of(maker)))
    assert pairs[0].measured_peak == peak
    assert pairs[1].measured_peak is None


def test_a_mode_that_makes_little_of_a_peak_is_not_paired_with_it():
    """The mode that does is no mode of the model, or lies outside the band."""
    little = mode(990.0, damping=0.05, shape=0.1)
    frf = frf_of(little, mode(1000.0))
    (pair,) = paired_modes([little], (HERE, HERE), AtPoint("part", frf, frf))
    assert pair.reconstructed_peak is None


def test_a_measured_peak_without_mode_is_listed_with_the_reconstructed_one_near_by():
    known, further = mode(500.0), mode(1500.0)
    frf = frf_of(known, further)
    pairs = paired_modes([known], (HERE, HERE), AtPoint("part", frf_of(known), frf))
    (peak,) = unpaired_peaks(AtPoint("part", frf_of(known), frf), pairs)
    assert np.isnan(peak.natural_frequency)
    assert (peak.reconstructed_peak, peak.measured_peak) == (None, pytest.approx(1500.0, rel=1e-3))
    (peak,) = unpaired_peaks(AtPoint("part", frf, frf), pairs)
    assert peak.reconstructed_peak == pytest.approx(1500.0, rel=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_every_mode_and_every_measured_peak_is_in_the_table_once(seed):
    """Some modes are nodes, some are strongly damped, and the measured ones are displaced or others."""
    random = np.random.default_rng(seed)
    natural = np.sort(random.uniform(200.0, 1900.0, 6))
    damping, shape = random.uniform(1e-3, 0.1, 6), random.choice([0.01, 1.0], 6)
    modes = [mode(*values) for values in zip(natural, damping, shape, strict=True)]
    measured = frf_of(*(mode(n * random.uniform(0.9, 1.1), z) for n, z in zip(natural, damping, strict=True)))
    pairs = paired_modes(modes, (HERE, HERE), AtPoint("part", frf_of(*modes), measured))
    rest = unpaired_peaks(AtPoint("part", frf_of(*modes), measured), pairs)
    peaks = [pair.measured_peak for pair in (*pairs, *rest) if pair.measured_peak is not None]
    assert len(pairs) == len(modes)
    assert sorted(peaks) == pytest.approx(resonance_peaks(measured))


LOCKED = {
    "dovetail": 1,
    "name": "a block on a block",
    "frequency": {"start": 20.0, "stop": 600.0, "step": 0.5},
    "substructures": {
        "base": {"model": "ground"},
        "low": {"model": "lumped", "masses": [{"mass": 2.0}]},
        "top": {"model": "lumped", "masses": [{"mass": 1.0}]},
    },
    "joints": {
        "foot": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "low", "at": 0.0}, "b": {"to": "base", "at": 0.0}},
            "parameters": {"k": {"value": 4e6}, "c": {"value": 20.0}},
        },
        "joint": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "top", "at": 0.0}, "b": {"to": "low", "at": 0.0}},
            "parameters": {"k": {"range": [1e4, 1e8], "scale": "log"}, "c": {"range": [1.0, 1e5], "scale": "log"}},
        },
    },
    "response": {"at": "top", "position": 0.0, "quantity": "receptance"},
}


def test_a_joint_that_its_damper_locks_has_the_one_resonance_of_the_locked_structure():
    """sqrt(4e6 / 3) / 2 pi = 183.8 Hz; without the damper 50 and 226 Hz."""
    assembly = dovetail.load(LOCKED)
    theta = np.array([1e5, 2e4])
    natural = assembly.natural_frequencies(theta)
    assert natural[0] == pytest.approx(np.sqrt(4e6 / 3.0) / (2.0 * np.pi), rel=2e-3)
    assert np.isnan(natural[1:]).all()
    result = reconstruct(Problem.of(assembly, assembly.simulate(theta)), theta, method="by hand", provenance={})
    (row,) = mode_rows(result, None)
    assert float(row.natural) == pytest.approx(natural[0], abs=0.1)
    assert row.measured_peak == row.reconstructed_peak != ABSENT
    stored = result.to_dict()
    assert stored["modes"][0]["damping_ratio"] == pytest.approx(assembly.modes(theta)[0].damping_ratio)
    assert stored["peaks_without_mode"] == []


def test_the_table_names_measured_peaks_that_the_model_lacks():
    assembly = dovetail.load(LOCKED)
    theta = np.array([1e5, 2e4])
    frf = assembly.simulate(theta)
    other = replace(frf, values=frf.values + 1e-6 / (1.0 - (frf.frequency / 400.0) ** 2 + 0.01j))
    result = reconstruct(Problem.of(assembly, other), theta, method="by hand", provenance={})
    first, second = mode_rows(result, None)
    assert (first.natural != ABSENT, second.natural) == (True, ABSENT)
    assert float(second.measured_peak) == pytest.approx(400.0, rel=1e-2)
    (peak,) = result.to_dict()["peaks_without_mode"]
    assert peak["measured_peak"] == pytest.approx(400.0, rel=1e-2)
