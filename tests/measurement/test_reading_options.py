"""A simulated FRF is written in every format and unit, and read with each option: right, or refused."""

from __future__ import annotations

import itertools

import h5py
import numpy as np
import pytest
import scipy.io

import dovetail

pytestmark = pytest.mark.sweep

FREQUENCY = np.arange(20.0, 60.0)
RECEPTANCE = 1.0 / (4e4 * (1.0 + 0.02j) - (2.0 * np.pi * FREQUENCY) ** 2)
UNITS = {
    "receptance": ["m/N", "um/N", "mm/kN", "in/lbf", "mil/lbf", "um/kgf"],
    "mobility": ["m/s/N", "mm/s/N", "in/s/lbf", "mm/(N s)"],
    "accelerance": ["m/s^2/N", "g/N", "g/lbf", "mm/s^2/N"],
}
WRITTEN = [(quantity, unit) for quantity, units in UNITS.items() for unit in (None, *units)]
FORMATS = ["csv", "npz", "uff", "unv"]
DOFS = [("1+x", "1+x"), ("1-x", "1+x"), ("3+z", "3-z"), ("2+x", "1+x"), ("tool:5+x", "tool:5+x")]


def simulated(quantity: str, **points: str) -> dovetail.Frf:
    return dovetail.Frf(FREQUENCY, RECEPTANCE, "receptance", **points).to(quantity)


def check(frf: dovetail.Frf, expected=RECEPTANCE) -> None:
    np.testing.assert_allclose(frf.frequency, FREQUENCY, rtol=1e-6)
    np.testing.assert_allclose(frf.to("receptance").values, expected, rtol=1e-5)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize(("quantity", "unit"), WRITTEN)
@pytest.mark.parametrize("option", ["none", "quantity", "unit", "another quantity", "another unit", "converted"])
def test_options_agree_with_a_written_file_or_are_refused(tmp_path, suffix, quantity, unit, option):
    path, own = tmp_path / f"a.{suffix}", unit or UNITS[quantity][0]
    dovetail.write_frf(simulated(quantity), path, unit=unit)
    if option == "converted":
        for other in FORMATS:
            dovetail.write_frf(dovetail.read_frf(path), tmp_path / f"b.{other}")
            check(dovetail.read_frf(tmp_path / f"b.{other}"))
    elif option.startswith("another"):
        different = {"quantity": "mobility" if quantity == "receptance" else "receptance", "unit": "nm/N"}
        name = option.removeprefix("another ")
        with pytest.raises(dovetail.MeasurementError):
            dovetail.read_frf(path, **{name: different[name]})
    else:
        check(dovetail.read_frf(path, **{"quantity": {"quantity": quantity}, "unit": {"unit": own}}.get(option, {})))


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("dofs", DOFS)
def test_dofs_and_senses_stay_in_every_format(tmp_path, suffix, dofs):
    dovetail.write_frf(simulated("accelerance", response=dofs[0], force=dofs[1]), tmp_path / f"a.{suffix}")
    frf = dovetail.read_frf(tmp_path / f"a.{suffix}")
    check(frf)
    assert (frf.response, frf.force) == dofs
    with pytest.raises(dovetail.MeasurementError):
        dovetail.read_frf(tmp_path / f"a.{suffix}", dofs=("7+x", "1+x"))


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("quantity", UNITS)
def test_the_mass_of_an_accelerometer_is_removed_in_every_quantity(tmp_path, suffix, quantity):
    accelerance = simulated("accelerance").values
    measured = dovetail.Frf(FREQUENCY, accelerance / (1.0 + 0.05 * accelerance), "accelerance")
    dovetail.write_frf(measured.to(quantity), tmp_path / f"a.{suffix}")
    check(dovetail.read_frf(tmp_path / f"a.{suffix}", accelerometer_mass=0.05))


MARKS = [(",", "."), (";", ","), ("\t", "."), (" ", "."), ("\t", ",")]


@pytest.mark.parametrize("order", list(itertools.permutations(("frequency", "real", "imag"))))
@pytest.mark.parametrize(("mark", "decimal"), MARKS)
def test_columns_are_read_in_any_order_and_notation(tmp_path, order, mark, decimal):
    columns = {"frequency": FREQUENCY, "real": 1e6 * RECEPTANCE.real, "imag": 1e6 * RECEPTANCE.imag}
    rows = zip(*(columns[name] for name in order), strict=True)
    lines = [mark.join(f"{value:.9e}".replace(".", decimal) for value in row) for row in rows]
    (tmp_path / "a.txt").write_text("\n".join(lines) + "\n")
    check(dovetail.read_frf(tmp_path / "a.txt", columns=order, unit="um/N"))


@pytest.mark.parametrize("axis", [("frequency", 1.0), ("frequency [kHz]", 1e-3), ("frequency [rad/s]", 2.0 * np.pi)])
@pytest.mark.parametrize("size", ["amplitude", "db"])
@pytest.mark.parametrize("angle", ["phase_deg", "phase_rad"])
def test_amplitudes_and_phases_are_converted_from_the_units_of_their_columns(tmp_path, axis, size, angle):
    amplitude, phase = 1e6 * np.abs(RECEPTANCE), np.angle(RECEPTANCE)
    sizes = 20.0 * np.log10(amplitude) if size == "db" else amplitude
    angles = np.degrees(phase) if angle == "phase_deg" else phase
    np.savetxt(tmp_path / "a.txt", np.column_stack([FREQUENCY * axis[1], sizes, angles]), "%.12g")
    check(dovetail.read_frf(tmp_path / "a.txt", columns=(axis[0], size, angle), unit="um/N"))


def written(path, suffix, values) -> None:
    arrays = {"frequency": FREQUENCY, "values": values, "quantity": "receptance"}
    if suffix == "npz":
        np.savez(path, **arrays)
    elif suffix == "mat":
        scipy.io.savemat(path, arrays)
    else:
        with h5py.File(path, "w") as file:
            file["frequency"], file["values"] = FREQUENCY, values
            file.attrs["quantity"] = "receptance"


@pytest.mark.usefixtures("unguarded")
@pytest.mark.parametrize("suffix", ["npz", "mat", "h5"])
@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_one_of_several_frfs_is_chosen_from_an_array_of_any_order(tmp_path, suffix, order):
    path, factors = tmp_path / f"a.{suffix}", np.array([[1.0, 2.0], [3.0, 4.0]])
    written(path, suffix, np.transpose(factors * RECEPTANCE[:, np.newaxis, np.newaxis], order))
    is_turned = [axis for axis in order if axis] == [2, 1]
    for output, force in itertools.product((1, 2), (1, 2)):
        factor = (factors.T if is_turned else factors)[output - 1, force - 1]
        check(dovetail.read_frf(path, response=str(output), force=str(force)), factor * RECEPTANCE)
    with pytest.raises(dovetail.MeasurementError):
        dovetail.read_frf(path)
