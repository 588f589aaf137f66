"""The FRF object: what it refuses and with which position, its units, and its conversions worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail import Frf
from dovetail.errors import MeasurementError
from dovetail.frf import unit_of

AXIS = np.array([10.0, 20.0, 40.0])
VALUES = np.array([3.0 + 4.0j, -1.0j, -2.0])


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"quantity": "receptence"}, "'receptence' is not a quantity; accepted: receptance, mobility, accelerance"),
        ({"frequency": AXIS[:, None]}, r"the frequencies have the shape \(3, 1\), not \(n_freq,\)"),
        ({"frequency": [], "values": []}, r"the frequencies have the shape \(0,\)"),
        ({"values": VALUES[:2]}, r"\(2,\) values do not fit \(3,\) frequencies"),
        ({"coherence": [1.0, 1.0]}, r"\(2,\) coherences do not fit \(3,\) frequencies"),
        ({"variance": [1.0, 1.0]}, r"\(2,\) variances do not fit \(3,\) frequencies"),
        ({"variance": [1.0, np.nan, 1.0]}, "a variance is negative or not finite"),
        ({"variance": [1.0, 1.0, -1e-30]}, "a variance is negative or not finite"),
        ({"frequency": [10.0, np.inf, np.nan]}, r"the frequency of line 2 is not finite \(2 such lines\)"),
        ({"values": [1.0, 1.0, np.nan]}, r"the value of line 3 is not finite \(1 such lines\)"),
        ({"frequency": [10.0, 20.0, 20.0]}, r"does not increase after line 2 \(20 Hz, then 20 Hz\)"),
        ({"frequency": [10.0, 9.0, 20.0]}, r"does not increase after line 1 \(10 Hz, then 9 Hz\)"),
        ({"frequency": [0.0, 9.0, 20.0]}, "the first frequency is 0 Hz; it must be positive"),
        ({"averages": 0}, "0 averages; it must be at least 1"),
        ({"coherence": [1.0, 1.2, 1.0]}, "the coherence of line 2 is 1.2; it must be from 0 to 1"),
        ({"coherence": [1.0, 1.0, -0.1]}, "the coherence of line 3 is -0.1"),
        ({"values": np.ma.masked_equal([1.0, 2.0, 3.0], 2.0)}, r"values has a masked value at place 2 \(1 in all\)"),
        ({"variance": np.ma.masked_less([0.0, 0.0, 1.0], 0.5)}, r"variance has a masked value at place 1 \(2 in all\)"),
    ],
)
def test_invalid_frfs_are_refused_with_their_line(changed, fault):
    with pytest.raises(MeasurementError, match=fault):
        Frf(**{"frequency": AXIS, "values": VALUES, "quantity": "mobility", **changed})


def test_the_smallest_valid_frf_is_accepted():
    """One line, above but near 0 Hz, one average, and an error that is known to be nothing."""
    frf = Frf([1e-6], [0.0], "receptance", averages=1, variance=[0.0], coherence=[0.0])
    assert frf.random_variance.tolist() == [0.0]
    assert frf.label == "FRF"
    assert frf.has_phase
    assert not frf.rotation


def test_an_frf_keeps_its_own_numbers():
    """Later changes of the caller's arrays do not reach it, and nobody writes into its own."""
    frequency, values, coherence, variance = AXIS.copy(), VALUES.copy(), np.full(3, 0.5), np.ones(3)
    frf = Frf(frequency, values, "mobility", coherence=coherence, variance=variance)
    for array in (frequency, values, coherence, variance):
        array[:] = 7.0
    np.testing.assert_array_equal(frf.frequency, AXIS)
    np.testing.assert_array_equal(frf.values, VALUES)
    np.testing.assert_array_equal(frf.coherence, [0.5, 0.5, 0.5])
    np.testing.assert_array_equal(frf.variance, [1.0, 1.0, 1.0])
    for array in (frf.frequency, frf.values, frf.coherence, frf.variance):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_numbers_of_any_kind_become_those_of_an_frf():
    frf = Frf([10, 20], [1, 2], "mobility", coherence=[1, 0], variance=np.ones(2, dtype=np.float32))
    assert (frf.frequency.dtype, frf.values.dtype) == (np.float64, np.complex128)
    assert (frf.coherence.dtype, frf.variance.dtype) == (np.float64, np.float64)


def test_amplitude_and_phase_equal_a_manual_calculation():
    frf = Frf(AXIS, VALUES, "accelerance")
    np.testing.assert_allclose(frf.amplitude, [5.0, 1.0, 2.0])
    np.testing.assert_allclose(frf.phase, [np.arctan2(4, 3), -np.pi / 2, np.pi])


def test_units_of_frfs_between_rotations_and_displacements():
    per_force, per_moment = ({"rotation": turns, "moment": not turns} for turns in (True, False))
    assert Frf(AXIS, VALUES, "accelerance", **per_force).unit == "rad/(N s^2)"
    assert (Frf(AXIS, VALUES, "receptance", **per_force).unit, unit_of("receptance", **per_moment)) == (
        "rad/N",
        "m/(N m)",
    )
    assert Frf(AXIS, VALUES, "mobility", **per_moment).kind == "displacement per moment"


@pytest.mark.parametrize(
    ("quantity", "rotation", "unit"),
    [
        ("receptance", False, "m/N"),
        ("mobility", False, "m/(N s)"),
        ("accelerance", False, "m/(N s^2)"),
        ("receptance", True, "rad/(N m)"),
        ("mobility", True, "rad/(N m s)"),
        ("accelerance", True, "rad/(N m s^2)"),
    ],
)
def test_each_quantity_has_its_unit(quantity, rotation, unit):
    assert Frf(AXIS, VALUES, quantity, rotation=rotation).unit == unit
    assert unit_of(quantity, rotation=rotation) == unit
    assert unit_of(quantity) == unit or rotation


@pytest.mark.parametrize(
    ("source", "target", "power"),
    [
        ("receptance", "mobility", 1),
        ("receptance", "accelerance", 2),
        ("mobility", "accelerance", 1),
        ("mobility", "mobility", 0),
        ("accelerance", "receptance", -2),
        ("accelerance", "mobility", -1),
    ],
)
def test_each_derivative_by_time_is_a_factor_of_i_omega(source, target, power):
    omega = np.array([20.0, 40.0, 80.0]) * np.pi
    derivative = {0: 1.0, 1: 1j * omega, 2: -(omega**2), -1: -1j / omega, -2: -1.0 / omega**2}[power]
    converted = Frf(AXIS, VALUES, source, variance=[1.0, 4.0, 9.0]).to(target)
    assert converted.quantity == target
    np.testing.assert_allclose(converted.values, VALUES * derivative, rtol=1e-13)
    np.testing.assert_allclose(converted.variance, np.array([1.0, 4.0, 9.0]) * np.abs(derivative) ** 2, rtol=1e-13)
    amplitude = Frf(AXIS, np.abs(VALUES), source, has_phase=False).to(target)
    np.testing.assert_allclose(amplitude.values, np.abs(VALUES) * np.abs(derivative), rtol=1e-13)
    assert amplitude.variance is None
    assert not amplitude.has_phase


def test_a_conversion_keeps_the_metadata_and_refuses_an_unknown_quantity():
    frf = Frf(AXIS, VALUES, "mobility", np.ones(3), label="tip", note="dry", averages=4, rotation=True, response="5+z")
    other = frf.to("receptance")
    assert (other.label, other.note, other.averages, other.rotation, other.response) == ("tip", "dry", 4, True, "5+z")
    np.testing.assert_array_equal(other.coherence, [1.0, 1.0, 1.0])
    with pytest.raises(MeasurementError, match="'acceleration' is not a quantity; accepted: receptance, mobility"):
        frf.to("acceleration")


def test_the_variance_from_coherence_and_averages_equals_a_manual_calculation():
    """|H|^2 (1 - c) / (c (n - 1)) with two averages, the fewest, and with five."""
    coherence = [0.8, 0.5, 1.0]
    two = Frf(AXIS, VALUES, "mobility", coherence=coherence, averages=2).random_variance
    np.testing.assert_allclose(two, [25 * 0.2 / 0.8, 1.0, 0.0], rtol=1e-12, atol=1e-15)
    five = Frf(AXIS, VALUES, "mobility", coherence=coherence, averages=5).random_variance
    np.testing.assert_allclose(five, two / 4, rtol=1e-12, atol=1e-15)
    assert Frf(AXIS, VALUES, "mobility", averages=5).random_variance is None


def test_zero_coherence_gives_an_infinite_variance():
    """Without a warning, and where the FRF is zero as well."""
    with np.errstate(divide="raise"):
        variance = Frf(AXIS, VALUES, "mobility", coherence=[0.0, 0.5, 0.0], averages=3).random_variance
    np.testing.assert_allclose(variance, [np.inf, 0.5, np.inf])
    with np.errstate(invalid="ignore"):
        assert Frf([1.0], [0.0], "mobility", coherence=[0.0], averages=3).random_variance.tolist() == [np.inf]


def test_the_coherence_spectrum_equals_a_manual_calculation():
    """Equal, opposite, one of them zero, both zero, a right angle, and twice as much."""
    first = np.array([[1 + 1j, 2.0, 3.0], [0.0, 1.0, 1.0]])
    second = np.array([[1 + 1j, -2.0, 0.0], [0.0, 1.0j, 2.0]])
    with np.errstate(all="raise"):
        agreement = dovetail.coherence_spectrum(first, second)
    np.testing.assert_allclose(agreement, [[1.0, 0.0, 0.5], [1.0, 0.5, 0.9]], rtol=1e-14, atol=1e-15)
    assert dovetail.coherence_spectrum([1e-9], [1e-9]).tolist() == [1.0]
    single = np.array([1.0, 0.1], dtype=np.complex64)
    assert dovetail.coherence_spectrum(single, single[::-1]).dtype == np.float64
    second = float(np.float32(0.1))
    exact = 0.5 * (1.0 + second) ** 2 / (1.0 + second**2)
    np.testing.assert_allclose(dovetail.coherence_spectrum(single, single[::-1]), exact, rtol=1e-14)


def test_masked_values_are_refused_wherever_a_user_gives_arrays(assemblies):
    hidden = np.ma.masked_equal([1e6, 20.0], 20.0)
    with pytest.raises(dovetail.DovetailError, match="c of vector 0 is masked"):
        dovetail.load(assemblies / "sdof.yaml").frf(hidden)
    with pytest.raises(MeasurementError, match="frequency has a masked value at place 2"):
        dovetail.ModalParameters(np.ma.masked_equal([10.0, 20.0], 20.0))
    values = np.ma.masked_equal(np.ones((2, 1, 1), dtype=complex), 1.0)
    with pytest.raises(MeasurementError, match="values has a masked value"):
        dovetail.ReceptanceMatrix(np.array([1.0, 2.0]), values)
