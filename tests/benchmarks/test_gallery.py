"""The gallery's own arithmetic, and its page of the oscillator on the FRF that is part of this repository."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gallery
import gallery_brake_reuss
import gallery_collet
import gallery_tables
import numpy as np
import pytest
import scipy.io

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
    assert gallery_tables.frac(curve, 3j * curve) == pytest.approx(1.0)
    assert gallery_tables.frac(curve, np.array([0.0, 0.0, 1.0])) == pytest.approx(4 / 31)
    assert gallery_tables.magnitude_error(curve, 2 * curve) == pytest.approx(0.5)
    assert gallery_tables.magnitude_error(2 * curve, curve) == pytest.approx(0.5)


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


def test_shared_poles_are_found_again_with_their_damping():
    frequency = np.arange(600.0, 3200.0, 2.0)
    s = 2j * np.pi * frequency
    poles = ((1070.0, 0.03), (1250.0, 0.04), (1970.0, 0.05), (2610.0, 0.03))
    residues = np.array([[2.0, 0.4, 3.0, 5.0], [0.5, 0.2j, -1.0, -1.0 + 0.3j]])
    terms = []
    for natural, damping in poles:
        pole = 2 * np.pi * natural * (-damping + 1j * np.sqrt(1 - damping**2))
        terms.append((1 / (s - pole), 1 / (s - np.conj(pole))))
    frfs = np.array(
        [sum(r * one + np.conj(r) * other for r, (one, other) in zip(row, terms, strict=True)) for row in residues]
    )
    found = gallery_collet.fit_poles(frequency, frfs, gallery_collet.POLES)
    np.testing.assert_allclose(found.natural_frequency, [natural for natural, _ in poles], rtol=1e-6)
    np.testing.assert_allclose(found.damping_ratio, [damping for _, damping in poles], rtol=1e-5)
    assert found.misfit.max() < 1e-6


def test_the_predicted_points_of_the_collet_are_those_of_the_hammer():
    """The FRF of every impact is that of the same structure: exchanged, the fitted ones stay the same."""
    five, two = gallery_collet.column(range(5)), gallery_collet.column(gallery_collet.FITTED)
    assert [parameter.name for parameter in five.parameters] == [parameter.name for parameter in two.parameters]
    theta = two.from_unit(np.full(len(two.parameters), 0.5))
    np.testing.assert_allclose(five.frfs(theta)[[0, 2]], two.frfs(theta), rtol=1e-9)
    assert len(gallery_collet.column((0,), gallery_collet.without_masses).parameters) == len(two.parameters) - 6


def test_the_page_of_the_collet_is_made_from_five_files(tmp_path, monkeypatch):
    five = gallery_collet.column(range(5))
    lines = five.on(np.arange(600.0, 3201.0, 20.0))
    values = lines.frfs(lines.from_unit(np.full(len(five.parameters), 0.6)))
    for name, frf in zip(gallery_collet.FILES, values, strict=True):
        np.savetxt(tmp_path / name, np.column_stack([lines.frequency, frf.real, frf.imag]), delimiter="\t", fmt="%.6e")
    monkeypatch.setattr(gallery_collet, "STARTS", 1)
    monkeypatch.setattr(gallery_collet, "SEEDS", 1)
    monkeypatch.setattr(gallery_collet, "MODELS", {"all": lambda _: None})
    tables = gallery.PAGES["collet"](tmp_path)
    lengths = {"collet": 7, "collet_modes": 6, "collet_all": 5}
    assert {name: tables[name].count("\n") for name in lengths} == lengths
    assert "| H14 | predicted | " in tables["collet"]


def test_the_level_under_a_force_has_the_damping_of_this_level():
    def law(level):
        return gallery_brake_reuss.Mode(1.9 * (2.0 * np.pi * 80.0) ** 2, 3.0 + 0.1 * level, 1.9)

    level = gallery_brake_reuss.level_under(0.5, 80.0, law)
    assert level == pytest.approx(0.5 * 2.0 * np.pi * 80.0 / (3.0 + 0.1 * level), rel=1e-9)


def test_the_shift_of_a_natural_frequency_is_found():
    mode, frequency = gallery_brake_reuss.Mode(4.8e5, 5.0, 1.9), np.arange(79.0, 81.0, 0.05)
    moved = mode._replace(k=4.8e5 * 1.004)
    shift, left = gallery_brake_reuss.best_shift(
        mode, dovetail.Frf(frequency, moved.accelerance(frequency), "accelerance")
    )
    assert shift == pytest.approx(moved.natural_frequency - mode.natural_frequency, rel=1e-3)
    assert left < 1e-3


@pytest.mark.slow
def test_the_page_of_the_brake_reuss_beam_is_made_from_one_file(tmp_path, monkeypatch):
    """A mode whose damping rises with the level, which the four levels that are not fitted show too."""
    mass, frequency = 1.9, np.arange(79.0, 81.0, 0.1)

    def sweep(level, force=None):
        s, c = 2j * np.pi * frequency, 3.0 * np.exp(0.018 * level)
        accelerance = s**2 / (mass * s**2 + c * s + mass * (2.0 * np.pi * 80.0) ** 2)
        noise = np.random.default_rng(int(level)).normal(1.0, 0.01, len(frequency))
        force = level / np.abs(accelerance) * noise if force is None else np.full(len(frequency), force)
        return frequency, force, force * np.abs(accelerance), np.angle(-accelerance)

    types = [(name, object) for name in ("frequency", "force", "amplitude", "phase")]
    held = np.array([sweep(level) for level in (5.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0)], dtype=types)
    pushed = np.array([sweep(20.0, force=0.3)], dtype=types)
    data = {"FRdata": {"ResponseControl": held, "ForceControl": pushed}}
    scipy.io.savemat(tmp_path / "ForcedFrequencyResponses.mat", data)
    monkeypatch.setattr(gallery_brake_reuss, "STIFFNESS", ("shared",))
    monkeypatch.setattr(gallery_brake_reuss, "DAMPING", ("shared", "linear"))
    monkeypatch.setattr(gallery_brake_reuss, "SAMPLES", 100)
    tables = gallery.PAGES["brake_reuss"](tmp_path)
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in tables["brake_reuss"].splitlines()[2:]]
    assert [line[1] for line in cells] == ["fitted", "predicted"] * 4
    for line in cells:
        assert float(line[2]) > 0.99
        low, high = (float(end) for end in line[7].split("(")[1].rstrip(")").split(" to "))
        assert 0.9 * low < 3.0 * np.exp(0.018 * float(line[0])) < 1.1 * high
