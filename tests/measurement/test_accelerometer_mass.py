"""The accelerometer's mass, compared with systems that model it as a part."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dovetail.errors import DovetailError, MeasurementError
from dovetail.frf import QUANTITIES, Frf
from dovetail.measurement import add_accelerometer_mass, read_frf, remove_accelerometer_mass, write_frf

FREQUENCY = np.arange(1.0, 2000.0)
MASS = 1.2e-3


def one_mass(added: float) -> np.ndarray:
    omega = 2 * np.pi * FREQUENCY
    stiffness = 0.05 * (2 * np.pi * 700) ** 2
    return 1 / (stiffness * (1 + 0.003j) - omega**2 * (0.05 + added))


def two_masses(added: float) -> np.ndarray:
    """Drive point of a free chain of two masses, the accelerometer on the first."""
    omega = 2 * np.pi * FREQUENCY
    spring = 0.02 * (2 * np.pi * 900) ** 2 * (1 + 0.005j)
    first, second = (spring - omega**2 * mass for mass in (0.03 + added, 0.06))
    return second / (first * second - spring**2)


@pytest.mark.parametrize("system", [one_mass, two_masses])
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_removed_and_added_equal_the_mass_modelled_in(system, quantity: str) -> None:
    bare, loaded = (Frf(FREQUENCY, system(added), "receptance").to(quantity) for added in (0.0, MASS))
    assert np.max(np.abs(loaded.values / bare.values - 1)) > 0.1
    removed, added = remove_accelerometer_mass(loaded, MASS), add_accelerometer_mass(bare, MASS)
    np.testing.assert_allclose(removed.values, bare.values, rtol=1e-9)
    np.testing.assert_allclose(added.values, loaded.values, rtol=1e-9)
    assert removed.quantity == added.quantity == quantity


def test_reading_removes_the_mass(tmp_path: Path) -> None:
    write_frf(Frf(FREQUENCY, one_mass(MASS), "receptance").to("accelerance"), tmp_path / "a.csv")
    bare = read_frf(tmp_path / "a.csv", accelerometer_mass=MASS).to("receptance")
    np.testing.assert_allclose(bare.values, one_mass(0.0), rtol=1e-9)


@pytest.mark.parametrize("mass", [-1e-3, np.nan, np.inf])
def test_an_impossible_accelerometer_mass_is_refused(measured: Frf, mass: float) -> None:
    for change in (remove_accelerometer_mass, add_accelerometer_mass):
        with pytest.raises(MeasurementError, match=f"the accelerometer's mass is {mass!r} kg"):
            change(measured, mass)


def test_an_amplitude_alone_cannot_be_corrected(measured: Frf) -> None:
    amplitude = replace(measured, values=measured.amplitude, has_phase=False)
    assert remove_accelerometer_mass(amplitude, 0.0) is amplitude
    with pytest.raises(MeasurementError, match="acts on amplitude and phase, and this is an amplitude alone"):
        remove_accelerometer_mass(amplitude, MASS)


def test_a_mass_may_have_its_unit(measured: Frf, tmp_path: Path) -> None:
    write_frf(measured, file := tmp_path / "a.csv")
    expected = read_frf(file, accelerometer_mass=MASS).values
    np.testing.assert_allclose(read_frf(file, accelerometer_mass="1.2 g").values, expected, rtol=1e-12)
    np.testing.assert_array_equal(read_frf(file, accelerometer_mass="0 g").values, read_frf(file).values)
    for wrong in ("1.2 N", "heavy", "-1 g"):
        with pytest.raises(DovetailError, match=r"kg"):
            read_frf(file, accelerometer_mass=wrong)
