"""The effect of a slightly wrong model on an FRF stays within the model error that is allowed for it."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.frf.frequency_response import QUANTITIES
from dovetail.inference.posterior import ModelError, error_shapes, typical_model_error
from dovetail.inference.posterior.likelihood import marginalised_squares
from dovetail.inference.posterior.model_error import Settings, fit_resonances
from support.noisy_measurements import frf_on

FREQUENCY = np.linspace(100.0, 200.0, 2001)
POLES = np.array([130.0 * (1.0 + 0.01j), 170.0 * (1.0 + 0.005j)])
RESIDUES = np.array([2.0 + 0.3j, -1.0 + 0.1j])
STEP = 1e-6
ALONE = Settings().individual


def near(poles, residues):
    """What resonances add to an FRF next to them; the rest of it changes by a hundredth of that."""
    return residues[:, np.newaxis] / (FREQUENCY - poles[:, np.newaxis])


def frf_of(poles, residues):
    mirrored = np.conj(residues)[:, np.newaxis] / (FREQUENCY + np.conj(poles)[:, np.newaxis])
    return np.sum(near(poles, residues) - mirrored, axis=0)


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("kind", ["natural_frequency", "damping", "magnitude", "phase"])
def test_each_error_is_the_derivative_of_a_pole_residue_frf(kind, index):
    """Of each resonance alone; the first six errors of a kind are those that neighbours share."""
    one = np.eye(2)[index] * STEP
    changed = {
        "natural_frequency": (POLES * (1.0 + 0.6 * one), RESIDUES),
        "damping": (POLES.real + 1j * POLES.imag * (1.0 + one), RESIDUES),
        "magnitude": (POLES, RESIDUES * (1.0 + 0.3 * one)),
        "phase": (POLES, RESIDUES * np.exp(0.3j * one)),
    }[kind]
    difference = np.sum(near(*changed) - near(POLES, RESIDUES), axis=0) / STEP
    size = ModelError(1e-3, damping=0.01, magnitude=0.02, phase=0.003)
    shape = error_shapes([frf_on(FREQUENCY)], [frf_of(POLES, RESIDUES)], size)[kind][-2 + index]
    error = np.abs(shape - getattr(size, kind) * difference)
    assert error.max() < 0.02 * np.abs(shape).max()


@pytest.mark.parametrize("change", [-1.5, 0.5, 1.5])
def test_damping_that_is_far_off_is_a_linear_term_and_one_beyond(change):
    resonances = fit_resonances([frf_on(FREQUENCY)], [frf_of(POLES, RESIDUES)])
    changed = near(POLES.real + 1j * POLES.imag * np.exp(change), RESIDUES) - near(POLES, RESIDUES)
    reported = change * resonances.damping_slope + resonances.damping_remainder(change)
    assert np.abs(reported - changed).max() < 0.02 * np.abs(changed).max()
    assert np.abs(resonances.damping_remainder(change)).max() > 0.1 * np.abs(changed).max()


@pytest.mark.parametrize("lines", [2, 5, 40])
def test_frfs_without_a_resonance_err_smoothly(lines):
    frequency = np.linspace(100.0, 200.0, lines)
    flat, none = np.ones(lines, dtype=np.complex128), np.zeros(lines, dtype=np.complex128)
    for values in ([flat], [flat, none], [none]):
        assert not len(fit_resonances([frf_on(frequency)] * len(values), values).poles)
        shapes = error_shapes([frf_on(frequency)] * len(values), values, typical_model_error(1e-3))
        assert len(shapes["magnitude"]) == len(shapes["phase"]) == 6 * len(values)
        for errors in shapes.values():
            assert errors.shape[1] == len(values) * lines
            assert np.isfinite(errors).all()


def test_a_model_without_errors_has_none():
    shapes = error_shapes([frf_on(FREQUENCY)], [np.ones(len(FREQUENCY), complex)], ModelError(0.0))
    assert {errors.shape for errors in shapes.values()} == {(0, len(FREQUENCY))}


def test_a_single_line_errs_in_magnitude_and_phase():
    shapes = error_shapes([frf_on(FREQUENCY[:1])], [np.array([3.0 + 4.0j])], typical_model_error(1e-3))
    assert np.sum(np.abs(shapes["magnitude"]) ** 2) == pytest.approx((20e-3 * 5.0) ** 2)
    assert np.sum(np.abs(shapes["phase"]) ** 2) == pytest.approx((2e-3 * 5.0) ** 2)


def test_the_error_of_a_narrow_peak_is_of_its_height_at_most():
    pole = 150.0 * (1.0 + 0.5j * 3e-4)
    values = 1.0 / (FREQUENCY - pole) - 1.0 / (FREQUENCY + np.conj(pole))
    for errors in error_shapes([frf_on(FREQUENCY)], [values], typical_model_error(5e-4)).values():
        assert np.abs(errors).max(initial=0.0) < 3.0 * np.abs(values).max()


def test_a_natural_frequency_that_is_off_is_within_the_errors(sdof):
    """A mass lighter by 0.2 % and stiffness as it was: the natural frequency is 0.1 % higher, nothing else is off."""
    values = sdof.frf()
    description = json.loads(sdof.description.text)
    changed = json.loads(json.dumps(description).replace("1 kg", "0.998 kg"))
    assert changed != description
    difference = dovetail.load(changed).frf() - values
    noise = 1e-2 * values.std()
    shapes = error_shapes([frf_on(sdof.frequency, "accelerance")], [values], typical_model_error(1e-3))
    errors = np.concatenate(list(shapes.values())) / noise
    rows = np.concatenate([errors.real, errors.imag], axis=1)
    off = np.concatenate([difference.real, difference.imag])[np.newaxis] / noise
    assert np.sum(off**2) > 100
    assert marginalised_squares(off, rows)[0] < 10.0


def in_quantity(assembly, quantity):
    description = json.loads(assembly.description.text)
    description["response"]["quantity"] = quantity
    return dovetail.load(description)


def test_intervals_are_the_same_in_every_quantity(sdof):
    """An accelerance vanishes with the frequency, and so must its errors: with others, lines far below the resonance,
    determined as well as the rest, seemed to determine the stiffness 14 times better than in the receptance."""
    noise, exact = np.random.default_rng(0).standard_normal((2, len(sdof.frequency))), sdof.frf()
    values = exact * (1.0 + 3e-3 * (noise[0] + 1j * noise[1]) / np.sqrt(2.0))
    frf = dovetail.Frf(sdof.frequency, values, "accelerance", variance=(3e-3 * np.abs(values)) ** 2)
    widths = []
    for quantity in QUANTITIES:
        assembly = in_quantity(sdof, quantity)
        result = dovetail.identify(assembly, frf.to(quantity), form="laplace", cause_seconds=0.0)
        widths.append([row.interval_high - row.interval_low for row in result.table])
    np.testing.assert_allclose(widths[1:], widths[:1] * 2, rtol=0.05)


def test_sizes_of_errors_are_compared_and_described_in_words():
    size, limit = ModelError(0.012, 0.2, 1.5, 0.1, 0.03), ModelError(0.02, 0.3, 0.3, 0.3, 0.3)
    assert not size.within(limit)
    assert ModelError(0.012, 0.2, 0.2, 0.1, 0.03).within(limit)
    assert size.at_least(limit) == ModelError(0.02, 0.3, 1.5, 0.3, 0.3)
    assert size.describe() == (
        "natural frequencies are off by 1.2 %, damping by 20 %, amplitudes by a factor of 4.5, phases by 5.7 degrees, "
        "and what none of these explains is 3 % of the FRF"
    )


def test_a_table_of_modes_without_damping_does_not_confirm_the_damping():
    assert ModelError(0.01).describe() == "natural frequencies are off by 1 %"


def test_phases_are_not_said_to_be_off_by_more_than_half_a_turn():
    assert "phases by 180 degrees" in ModelError(0.01, phase=10.0).describe()
