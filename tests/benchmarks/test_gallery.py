"""The gallery's own arithmetic, and its page of the oscillator on the FRF that is part of this repository."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gallery
import numpy as np
import pytest

import dovetail

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def measured() -> dovetail.Frf:
    return dovetail.read_frf(ROOT / "assemblies/measurements/oscillator_case1.uff")


def test_a_circle_gives_stiffness_and_damping_through_any_gain_and_phase(measured):
    omega = 2 * np.pi * measured.frequency
    values = -30 * np.exp(0.4j) * omega**2 / (1.7e6 - omega**2 + 1j * 2.5 * omega)
    circle = gallery.circle_fit(replace(measured, values=values), (204.0, 212.0))
    assert circle.stiffness == pytest.approx(1.7e6, rel=1e-6)
    assert circle.damping == pytest.approx(2.5, rel=1e-4)
    assert circle.natural_frequency == pytest.approx(np.sqrt(1.7e6) / (2 * np.pi), rel=1e-6)


def test_frac_sees_shapes_and_the_magnitude_error_sees_sizes():
    curve = np.array([1.0 + 1j, 5.0, 2.0j])
    assert gallery.frac(curve, 3j * curve) == pytest.approx(1.0)
    assert gallery.frac(curve, np.array([0.0, 0.0, 1.0])) == pytest.approx(4 / 31)
    assert gallery.magnitude_error(curve, 2 * curve) == pytest.approx(0.5)
    assert gallery.magnitude_error(2 * curve, curve) == pytest.approx(0.5)


def test_the_oscillator_agrees_with_its_circle_and_predicts_lines_that_were_not_fitted(measured):
    assembly = dovetail.load(ROOT / "assemblies/oscillator.yaml")
    band = float(assembly.frequency[0]), float(assembly.frequency[-1])
    circle = gallery.circle_fit(measured, band)
    result = dovetail.identify(assembly, measured, "posterior")
    assert result.theta[:2] == pytest.approx([circle.stiffness, circle.damping], rel=0.02)
    for name, value in (("k", circle.stiffness), ("c", circle.damping)):
        low, high = result.interval[name]
        assert low < value < high
    assert gallery.word(result) == "good"
    assert result.known["response.sign"] == -1
    ((likeness, _),) = gallery.predictions(
        gallery.with_band(assembly, 216.5625, 300.0), gallery.named(result, assembly), [measured]
    )
    assert likeness > 0.99


def test_the_frame_predicts_floors_that_were_not_fitted_where_its_model_is_right():
    assembly = dovetail.load(gallery.DESCRIPTIONS / "frame_free.yaml")
    theta = assembly.from_unit(np.full(len(assembly.parameters), 0.5))
    frfs = [dovetail.Frf(assembly.frequency, values, "accelerance") for values in assembly.frfs(theta)]
    values = dict(zip((parameter.name for parameter in assembly.parameters), map(float, theta), strict=True))
    np.testing.assert_allclose(gallery.predictions(assembly, values, frfs), [(1.0, 0.0)] * 3, atol=1e-12)
    values["floor3.masses.0.mass"] *= 1.2
    assert max(likeness for likeness, _ in gallery.predictions(assembly, values, frfs)) < 0.99


def test_the_columns_of_the_beam_are_reciprocal_and_move_with_the_first_sensor():
    first, third = gallery.beam_column(1, 45), gallery.beam_column(3, 45)
    values = {p.name: float(v) for p, v in zip(first.parameters, first.from_unit(np.full(14, 0.5)), strict=True)}
    there, back = (assembly.frfs(assembly.vector(values)) for assembly in (first, third))
    np.testing.assert_allclose(there[4], back[0], rtol=1e-8)
    assert np.abs(there[4] - there[0]).max() > 0.1 * np.abs(there[0]).max()
    elsewhere = gallery.beam_column(1, 55)
    moved = elsewhere.frfs(elsewhere.vector(values))
    assert np.abs(moved[0] / there[0] - 1).max() > 0.1


def test_the_hammers_only_resonance_determines_its_stiffness():
    """Errors of a model that has one resonance are reported small enough that its interval means something."""
    table = gallery.PAGES["hammer"](Path())["hammer_parts"]
    row = next(line for line in table.splitlines() if line.startswith("| k |"))
    value, interval = (cell.strip() for cell in row.split("|")[2:4])
    low, high = map(float, interval.split(" to "))
    assert low < float(value) < high < 1.5 * low
