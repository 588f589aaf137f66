"""The power delivered at a drive point: genuine ones with noise pass, and those with a wrong sign do not."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.frf import Frf
from dovetail.measurement import ModelDof, Role, check_roles, complex_noise, read_frf
from dovetail.measurement.roles import PHASE_ERROR, SUSPICIOUS, power_delivered

FREQUENCY = np.arange(20.0, 2000.0, 1.0)
QUANTITIES = ("receptance", "mobility", "accelerance")
TIP = ModelDof("tool, 0 mm")


def drawn(seed: int, *, noise: float = 0.0) -> tuple[Frf, Frf]:
    """Return a drive-point FRF and a transfer FRF of a random structure, free or held, with 1 to 8 modes."""
    rng = np.random.default_rng(seed)
    natural = rng.uniform(40.0, 1900.0, rng.integers(1, 9))
    damping = 10.0 ** rng.uniform(-3.5, -1.3, natural.size)
    shapes = rng.normal(size=(2, natural.size))
    omega, poles = 2 * np.pi * FREQUENCY[:, np.newaxis], 2 * np.pi * natural
    modal = 1.0 / (poles**2 - omega**2 + 2j * damping * poles * omega)
    rigid = -rng.uniform(0.0, 0.3) / (2 * np.pi * FREQUENCY) ** 2
    quantity = QUANTITIES[seed % 3]
    ends = [modal @ (shapes[0] * shapes[end]) + rigid for end in (0, 1)]
    frfs = [Frf(FREQUENCY, values, "receptance").to(quantity) for values in ends]
    noisy = [replace(frf, values=complex_noise(frf.values, noise, seed)) for frf in frfs]
    return noisy[0], noisy[1]


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05, 0.1, 0.3])
def test_drive_points_with_noise_pass_and_reversed_ones_do_not(noise: float) -> None:
    for seed in range(1000, 1060):
        drive_point, _ = drawn(seed, noise=noise)
        assert power_delivered(drive_point, turn=PHASE_ERROR) < SUSPICIOUS / 2
        assert power_delivered(replace(drive_point, values=-drive_point.values), turn=PHASE_ERROR) > 0.85


def test_small_delays_do_not_matter() -> None:
    """A delay of 20 microseconds turns the phase by 14 degrees at the end of the band."""
    for seed in range(1000, 1060):
        drive_point, _ = drawn(seed, noise=0.01)
        late = drive_point.values * np.exp(-2j * np.pi * FREQUENCY * 20e-6)
        assert power_delivered(replace(drive_point, values=late), turn=PHASE_ERROR) == 0.0


def test_a_known_variance_decides_what_is_noise() -> None:
    drive_point, _ = drawn(4, noise=0.01)
    reversed_sign = replace(drive_point, values=-drive_point.values)
    certain = np.full(FREQUENCY.size, 1e4 * drive_point.amplitude.max() ** 2)
    assert power_delivered(reversed_sign, certain) == 0.0
    assert power_delivered(replace(reversed_sign, variance=certain)) == 0.0


def test_amplitudes_and_two_lines_show_no_power() -> None:
    drive_point, _ = drawn(4)
    assert power_delivered(replace(drive_point, values=drive_point.amplitude, has_phase=False)) == 0.0
    assert power_delivered(Frf(FREQUENCY[:2], -drive_point.values[:2], drive_point.quantity)) == 0.0


def test_a_reversed_sign_is_refused_and_half_a_wrong_phase_is_reported() -> None:
    drive_point, _ = drawn(4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_roles([Role(drive_point, TIP, TIP)])
        check_roles([Role(replace(drive_point, values=-drive_point.values), TIP, TIP)], passive=False)
    with pytest.raises(MeasurementError, match=r"as the drive point at tool, 0 mm, it delivers 100 % of the power"):
        check_roles([Role(replace(drive_point, values=-drive_point.values), TIP, TIP)])
    turned = drive_point.values * np.sign(np.median(FREQUENCY) - 0.5 - FREQUENCY)
    share = power_delivered(replace(drive_point, values=turned))
    assert 0.3 < share < 0.9
    with pytest.warns(UserWarning, match=r"delivers \d+ % of the power, .* perhaps a phase or a point is wrong"):
        check_roles([Role(replace(drive_point, values=turned), TIP, TIP)])


def test_transfer_frfs_of_random_structures_are_seldom_taken_for_drive_points() -> None:
    shares = np.array([power_delivered(drawn(seed, noise=0.01)[1], turn=PHASE_ERROR) for seed in range(1000, 1100)])
    assert np.count_nonzero(shares > SUSPICIOUS) > 50


def test_shipped_drive_points_deliver_no_power(assemblies) -> None:
    files = [*assemblies.glob("measurements/*.uff"), *assemblies.glob("campaign/measurements/*.uff")]
    frfs = [read_frf(file, index=1) for file in files]
    driving_points = [frf for frf in frfs if frf.response and frf.response == frf.force]
    assert len(driving_points) > 15
    for frf in driving_points:
        assert power_delivered(frf) < 0.001
    for frf in frfs:  # among them genuine ones with an unknown delay and sign
        assert power_delivered(frf) < 0.9
