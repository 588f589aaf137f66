"""What a model that is a little wrong does to an FRF is within the errors that it is allowed."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.identification.posterior.likelihood import marginalised_squares
from dovetail.identification.posterior.model_error import fit_resonances, model_errors


@pytest.mark.parametrize("lines", [2, 5, 40])
def test_frfs_without_a_resonance_err_smoothly(lines):
    frequency = np.linspace(100.0, 200.0, lines)
    flat, none = np.ones(lines, dtype=np.complex128), np.zeros(lines, dtype=np.complex128)
    for values in ([flat], [flat, none], [none]):
        assert not len(fit_resonances([frequency] * len(values), values).poles)
        errors = model_errors([frequency] * len(values), values, 1e-3)
        assert errors.shape == (2 * 6 + len(values) * 2 * 6, len(values) * lines)
        assert np.isfinite(errors).all()


def test_no_error_is_larger_than_a_peak_however_narrow_it_is():
    frequency = np.linspace(100.0, 200.0, 2001)
    pole = 150.0 * (1.0 + 0.5j * 3e-4)
    values = 1.0 / (frequency - pole) - 1.0 / (frequency + np.conj(pole))
    errors = model_errors([frequency], [values], 5e-4)
    assert np.abs(errors).max() < 3.0 * np.abs(values).max()


def test_a_natural_frequency_that_is_off_is_within_the_errors(sdof):
    """A mass lighter by 0.2 % and stiffness as it was: the natural frequency is 0.1 % higher, nothing else is off."""
    values = sdof.frf()
    description = json.loads(sdof.description.text)
    changed = json.loads(json.dumps(description).replace("1 kg", "0.998 kg"))
    assert changed != description
    difference = dovetail.load(changed).frf() - values
    noise = 1e-2 * values.std()
    errors = model_errors([sdof.frequency], [values], 1e-3) / noise
    rows = np.concatenate([errors.real, errors.imag], axis=1)
    off = np.concatenate([difference.real, difference.imag])[np.newaxis] / noise
    assert np.sum(off**2) > 100
    assert marginalised_squares(off, rows)[0] < 10.0  # 4.0; without what is not linear in it 21
