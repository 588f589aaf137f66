"""Measured FRFs from format to format, and from hammer signals to an FRF, as a user types it."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import pyuff
from scipy.io import savemat

import dovetail
from dovetail.measurement import add_accelerometer_mass

AXIS = 10.0 + 2.5 * np.arange(200)
FORMATS = (".uff", ".csv", ".npz")


def accelerance(frequency, natural=200.0, mass=0.5):
    return -(frequency**2) / (mass * (natural**2 * (1 + 0.02j) - frequency**2))


@pytest.fixture
def analyser(tmp_path):
    """A workspace that calls everything by its own name, in g/N."""
    variables = {
        "Freq_Axis": AXIS,
        "FRF1": accelerance(AXIS) / 9.80665,
        "Coh": np.linspace(0.5, 1, AXIS.size),
        "N_avg": 10,
        "junk": np.eye(3),
    }
    savemat(tmp_path / "analyser.mat", {"Test": variables})
    return tmp_path / "analyser.mat"


NAMES = ("--name", "frequency=Test.Freq_Axis", "--name", "values=Test.FRF1", "--unit", "g/N")


def test_an_frf_converted_to_each_format_and_back_is_the_same(run, analyser, tmp_path):
    shown = run("convert", analyser, tmp_path / "0.uff", *NAMES)
    assert "200 lines from 10 to 507.5 Hz, accelerance, coherence, 10 averages" in shown.stdout
    taken = "'Test.Freq_Axis' is frequency, 'Test.FRF1' is values, 'Test.Coh' is coherence, 'Test.N_avg' is averages"
    assert f"Read analyser.mat: 200 rows; {taken}, 'Test.junk' is not read." in " ".join(shown.stderr.split())
    for number, suffix in enumerate((*FORMATS[1:], *FORMATS), start=1):
        before = FORMATS[(number - 1) % 3]
        run("convert", tmp_path / f"{number - 1}{before}", tmp_path / f"{number}{suffix}")
    frf = dovetail.read_frf(tmp_path / f"5{FORMATS[2]}")
    np.testing.assert_allclose(frf.values, accelerance(AXIS), rtol=1e-11)
    np.testing.assert_allclose(frf.coherence, np.linspace(0.5, 1, AXIS.size), rtol=1e-11)
    assert (frf.quantity, frf.averages) == ("accelerance", 10)


@pytest.mark.parametrize(("to", "unit"), [("receptance", "m/N"), ("um/N", "um/N"), ("mm/s/N", "mm/s/N")])
def test_convert_writes_another_quantity_or_unit(run, analyser, tmp_path, to, unit):
    said = run("convert", analyser, tmp_path / "a.csv", *NAMES, "--to", to).stdout
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert f"# unit: {unit}" in lines
    back = dovetail.read_frf(tmp_path / "a.csv")
    assert back.quantity == {"receptance": "receptance", "um/N": "receptance", "mm/s/N": "mobility"}[to]
    assert f"Hz, {back.quantity}" in said
    np.testing.assert_allclose(back.to("accelerance").values, accelerance(AXIS), rtol=1e-12)


def test_a_rotation_goes_through_every_format(run, tmp_path):
    (tmp_path / "a.csv").write_text("f,re [rad/(N m)],im [rad/(N m)]\n1,2,3\n2,3,4\n")
    for before, after in ((".csv", ".uff"), (".uff", ".npz"), (".npz", ".csv")):
        shown = run("convert", tmp_path / f"a{before}", tmp_path / f"{'a' if after != '.csv' else 'b'}{after}").stdout
        assert "rotation per moment" in shown
    assert dovetail.read_frf(tmp_path / "b.csv").rotation


def test_one_frf_of_several_is_chosen_by_its_dofs(run, tmp_path):
    path = tmp_path / "several.uff"
    for node in (1, 2):
        one = {"type": 58, "func_type": 4, "rsp_node": node, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "x": AXIS}
        kinds = {"abscissa_spec_data_type": 18, "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13}
        pyuff.UFF(str(path)).write_sets({**one, **kinds, "data": node * accelerance(AXIS)}, mode="add")
    fault = run("convert", path, tmp_path / "a.csv", code=1).stderr
    assert "the file holds 2 FRFs; choose one" in fault
    assert not (tmp_path / "a.csv").exists()
    shown = run("convert", path, tmp_path / "a.csv", "--response", "2+x", "--force", "1").stdout
    assert "from 1+x to 2+x" in shown
    np.testing.assert_allclose(dovetail.read_frf(tmp_path / "a.csv").values, 2 * accelerance(AXIS), rtol=1e-10)


def test_the_accelerometer_is_removed_from_a_transfer_function(run, tmp_path):
    drive = dovetail.Frf(AXIS, accelerance(AXIS), "accelerance", response="2+x", force="2+x")
    transfer = dovetail.Frf(AXIS, accelerance(AXIS, 350), "accelerance", response="2+x", force="1+x")
    dovetail.write_frf(add_accelerometer_mass(drive, 0.01), tmp_path / "drive.npz")
    dovetail.write_frf(add_accelerometer_mass(transfer, 0.01, drive=drive), tmp_path / "transfer.npz")
    fault = run("convert", tmp_path / "transfer.npz", tmp_path / "a.npz", "--accelerometer-mass", "10 g", code=1).stderr
    assert "the mass is taken off a drive point" in fault
    options = ("--accelerometer-mass", "10 g", "--drive-point", tmp_path / "drive.npz")
    run("convert", tmp_path / "transfer.npz", tmp_path / "a.npz", *options)
    np.testing.assert_allclose(dovetail.read_frf(tmp_path / "a.npz").values, transfer.values, rtol=1e-9)
    assert (
        "the mass is missing"
        in run("convert", tmp_path / "transfer.npz", tmp_path / "c.npz", *options[2:], code=2).stderr
    )
    run("convert", tmp_path / "drive.npz", tmp_path / "b.npz", *options[:2])
    np.testing.assert_allclose(dovetail.read_frf(tmp_path / "b.npz").values, drive.values, rtol=1e-9)


def test_wrong_input_of_convert_is_refused_with_what_is_accepted(run, analyser, tmp_path):
    assert "the file holds:" in run("convert", analyser, tmp_path / "a.uff", code=1).stderr
    assert "not PART=NAME" in run("convert", analyser, tmp_path / "a.uff", "--name", "values", code=2).stderr
    assert "Accepted: .uff, .unv, .csv, .npz" in run("convert", analyser, tmp_path / "a.mat", code=2).stderr
    assert (
        "'speed' is not understood"
        in run("convert", analyser, tmp_path / "a.uff", *NAMES, "--to", "speed", code=1).stderr
    )
    (tmp_path / "a.uff").write_text("old")
    assert "--overwrite" in run("convert", analyser, tmp_path / "a.uff", *NAMES, code=1).stderr
    assert (tmp_path / "a.uff").read_text() == "old"


def test_a_table_without_a_header_is_converted_once_its_columns_are_named(run, tmp_path):
    rows = "".join(f"{f:.2f};7;{v.real:.12e};{v.imag:.12e}\n" for f, v in zip(AXIS, accelerance(AXIS), strict=True))
    (tmp_path / "a.txt").write_text(f"by hand\n{rows.replace('.', ',')}")
    fault = run("convert", tmp_path / "a.txt", tmp_path / "a.uff", "--quantity", "accelerance", code=1).stderr
    assert fault.count("\n") == 3
    assert "the table has no header" in fault
    assert "--columns frequency,real,imag" in fault
    options = ("--columns", "frequency, skip,real,imag", "--quantity", "accelerance")
    run("convert", tmp_path / "a.txt", tmp_path / "a.uff", *options)
    np.testing.assert_allclose(dovetail.read_frf(tmp_path / "a.uff").values, accelerance(AXIS), rtol=1e-9)


def test_convert_writes_given_dofs_and_reports_a_coherence_above_one(run, tmp_path):
    (tmp_path / "a.csv").write_text("f,re [g/N],im [g/N],coh\n1,2,3,1.02\n2,3,4,1\n")
    done = run("convert", tmp_path / "a.csv", tmp_path / "a.uff", "--dofs", "3+x, 1-x")
    assert "from 1-x to 3+x" in done.stdout
    assert "Note: " in done.stderr
    assert "the coherence is above 1 at 1 of 2 lines, by up to 0.02; it is taken as 1 there." in done.stderr
    fields = pyuff.UFF(str(tmp_path / "a.uff")).read_sets(0)
    assert [fields[name] for name in ("rsp_node", "rsp_dir", "ref_node", "ref_dir")] == [3, 1, 1, -1]
    np.testing.assert_allclose(fields["data"], np.array([2 + 3j, 3 + 4j]) * 9.80665, rtol=1e-9)
    np.testing.assert_allclose(dovetail.read_frf(tmp_path / "a.uff").values, -fields["data"], rtol=1e-9)
    assert (
        "is not RESPONSE,FORCE"
        in run("convert", tmp_path / "a.csv", tmp_path / "b.uff", "--dofs", "3+x", code=2).stderr
    )


RATE, SAMPLES = 8192.0, 4096


@pytest.fixture
def hits():
    """Force [N] and acceleration [m/s^2] of four impacts on a mass of 0.5 kg on a spring."""
    frequency = np.fft.rfftfreq(SAMPLES, 1 / RATE)
    true = -(frequency**2) / (0.5 * (600.0**2 * (1 + 0.06j) - frequency**2))
    time = np.arange(SAMPLES) / RATE
    pulse = np.where((time > 0.01) & (time < 0.0106), np.sin(np.pi * (time - 0.01) / 0.0006), 0.0)
    force = np.outer([40.0, 50.0, 60.0, 55.0], pulse)
    response = np.fft.irfft(np.fft.rfft(force) * true, SAMPLES)
    random = np.random.default_rng(0)
    force, response = (one + 0.002 * random.standard_normal(one.shape) for one in (force, response))
    return time, force, response, (frequency[20:700], true[20:700])


def check(path, truth, rtol=0.01):
    frf = dovetail.read_frf(path)
    np.testing.assert_allclose(frf.frequency[19:699], truth[0], rtol=1e-6)
    np.testing.assert_allclose(frf.values[19:699], truth[1], rtol=rtol, atol=0.01)
    assert frf.averages == 4
    assert np.median(frf.coherence[19:699]) > 0.99


def test_an_archive_of_signals_becomes_an_frf(run, tmp_path, hits):
    time, force, response, truth = hits
    np.savez(tmp_path / "hits.npz", force=force, response=response / 9.80665, rate=RATE)
    shown = run("frf", tmp_path / "hits.npz", "-o", tmp_path / "a.uff", "--response-unit", "g").stdout
    assert "H1 from hits.npz" in shown
    assert "accelerance, coherence, 4 averages" in shown
    check(tmp_path / "a.uff", truth)
    assert "Note" not in shown
    np.savez(tmp_path / "long.npz", force=force, response=response, rate=RATE, record_length_s=999.0)
    shown = run("frf", tmp_path / "long.npz", "-o", tmp_path / "e.uff").stdout
    assert "a length of 999 s is stated" in " ".join(shown.split())
    savemat(tmp_path / "hits.mat", {"hammer": force.T / 4.4482216152605, "acceleration": response.T, "t": time})
    run("frf", tmp_path / "hits.mat", "-o", tmp_path / "b.npz", "--force-unit", "lbf", "--estimator", "H2")
    check(tmp_path / "b.npz", truth)
    with h5py.File(tmp_path / "hits.h5", "w") as file:
        file["test/hammer"], file["test/sensor"], file["fs"] = force, response, RATE
    run("frf", tmp_path / "hits.h5", "-o", tmp_path / "c.npz", "--name", "response=test/sensor")
    check(tmp_path / "c.npz", truth)


def test_a_table_of_signals_becomes_an_frf(run, tmp_path, hits):
    time, force, response, truth = hits
    names = ["time", *(f"{name} {n}" for n in range(1, 5) for name in ("Force", "Response"))]
    columns = [time, *(one[n] for n in range(4) for one in (force, response))]
    text = "\t".join(names) + "\n" + "\n".join("\t".join(f"{x:.9g}" for x in row) for row in zip(*columns, strict=True))
    (tmp_path / "hits.tsv").write_text(text)
    run("frf", tmp_path / "hits.tsv", "-o", tmp_path / "a.csv", "-o", tmp_path / "a.png")
    check(tmp_path / "a.csv", truth)
    assert (tmp_path / "a.png").stat().st_size > 1000
    (tmp_path / "bare.txt").write_text("Logger 3\n0\n" + text.partition("\n")[2].replace(".", ","))
    names = ",".join(["time", *4 * ["force", "response"]])
    run("frf", tmp_path / "bare.txt", "-o", tmp_path / "b.csv", "--columns", names)
    assert (tmp_path / "b.csv").read_text().split("\n")[4:] == (tmp_path / "a.csv").read_text().split("\n")[4:]


def test_signals_of_a_universal_file_become_an_frf(run, tmp_path, hits):
    time, force, response, truth = hits
    for pulse, signal in zip(force, response, strict=True):
        for kind, unit, data in ((13, "N", pulse), (12, "g", signal / 9.80665)):
            one = {"type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "x": time}
            one |= {"data": data, "binary": 1, "abscissa_spec_data_type": 17, "ordinate_axis_units_lab": unit}
            one |= {"ordinate_spec_data_type": kind, "orddenom_spec_data_type": 0}
            pyuff.UFF(str(tmp_path / "hits.uff")).write_sets(one, mode="add")
    run("frf", tmp_path / "hits.uff", "-o", tmp_path / "a.csv")
    check(tmp_path / "a.csv", truth)


def test_signals_in_volts_become_an_frf_by_their_sensitivities(run, tmp_path, hits):
    """With the sensitivities of hammer and accelerometer, in a file that states volts and milliseconds."""
    time, force, response, truth = hits
    names = ["time [ms]", *(f"{name} {n} [mV]" for n in range(1, 5) for name in ("Force", "Response"))]
    columns = [1e3 * time, *(one[n] for n in range(4) for one in (2.25 * force, 100 * response / 9.80665))]
    rows = "\n".join(",".join(f"{x:.12g}" for x in row) for row in zip(*columns, strict=True))
    (tmp_path / "volts.csv").write_text(f"{','.join(names)}\n{rows}\n")
    fault = run("frf", tmp_path / "volts.csv", "-o", tmp_path / "a.uff", code=1).stderr
    assert "the force is a voltage, in 'mV'." in fault
    assert "--force-sensitivity '2.25 mV/N'" in fault
    options = ("--force-sensitivity", "2.25 mV/N", "--response-sensitivity", "100 mV/g")
    shown = run("frf", tmp_path / "volts.csv", "-o", tmp_path / "a.uff", *options).stderr
    text = "4 impacts of 4096 samples at 8192 Hz; force in mV with 2.25 mV/N; response in mV with 100 mV/g."
    assert f"Read volts.csv: {text}" in " ".join(shown.split())
    check(tmp_path / "a.uff", truth)
    wrong = (*options[:2], "--response-sensitivity", "100 mV")
    assert "is not a sensitivity" in run("frf", tmp_path / "volts.csv", "-o", tmp_path / "b.uff", *wrong, code=1).stderr


def test_the_impacts_at_one_node_of_a_roving_hammer_become_an_frf(run, tmp_path, hits):
    """Two impacts at each of two nodes, with the force along -x at the second."""
    time, force, response, truth = hits
    for number, (pulse, signal) in enumerate(zip(force, response, strict=True)):
        node = number // 2 + 1
        for kind, unit, sign, data in ((13, "N", -1 if node == 2 else 1, pulse), (12, "m/s^2", 1, node * signal)):
            one = {"type": 58, "func_type": 1, "rsp_node": node if kind == 13 else 1, "rsp_dir": sign, "x": time}
            one |= {"data": data, "binary": 1, "abscissa_spec_data_type": 17, "ordinate_axis_units_lab": unit}
            one |= {"ordinate_spec_data_type": kind, "orddenom_spec_data_type": 0, "ref_node": 0, "ref_dir": 0}
            pyuff.UFF(str(tmp_path / "hits.uff")).write_sets(one, mode="add")
    fault = run("frf", tmp_path / "hits.uff", "-o", tmp_path / "a.uff", code=1).stderr
    assert "the file holds impacts at 2 pairs of points" in fault
    assert "response 1+x, force 2-x: 2 impacts" in fault
    shown = run("frf", tmp_path / "hits.uff", "-o", tmp_path / "a.uff", "--force", "1+x").stdout
    assert "2 averages, from 1+x to 1+x" in " ".join(shown.split())
    run("frf", tmp_path / "hits.uff", "-o", tmp_path / "b.uff", "--force", "2")
    frf = dovetail.read_frf(tmp_path / "b.uff")
    assert (frf.response, frf.force) == ("1+x", "2-x")
    np.testing.assert_allclose(frf.values[19:699], -2 * truth[1], rtol=0.02, atol=0.02)


def test_frf_applies_windows_and_leaves_bad_impacts_out(run, tmp_path, hits):
    _, force, response, _ = hits
    late = int(0.05 * RATE)
    force[1, late:] += 0.3 * force[1, :-late]
    np.savez(tmp_path / "hits.npz", force=force, response=response, fs=RATE)
    options = ("--force-window", "20 ms", "--exponential-window", "0.05")
    shown = run("frf", tmp_path / "hits.npz", "-o", tmp_path / "a.csv", *options).stdout
    assert "Note: impact 2: a second hit of 30 %" in shown
    assert "Note: the exponential window adds 5.991 1/s to the decay of each mode." in shown
    shown = run("frf", tmp_path / "hits.npz", "-o", tmp_path / "b.csv", "--leave-out-bad").stdout
    assert "Note: impact 2 is left out." in shown
    assert dovetail.read_frf(tmp_path / "b.csv").averages == 3


def fault_of(run, tmp_path, name, content, *options, code=1):
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    text = run("frf", path, "-o", tmp_path / "out.csv", *options, code=code).stderr
    assert not (tmp_path / "out.csv").exists()
    return text


def test_a_time_of_too_few_digits_is_left_out_as_the_error_says(run, tmp_path):
    """Steps of 0.25 ms in three digits, as a spreadsheet writes them."""
    rows = "".join(f"{n / 4000:.2E},{max(0, 9 - n)},{n % 5}\n" for n in range(4000))
    text = fault_of(run, tmp_path, "a.csv", "time,force,response\n" + rows)
    assert "leave it out (--columns skip,force,response) and give the rate (--rate)" in " ".join(text.split())
    options = ("--columns", "skip,force,response", "--rate", "4000")
    assert "from 1 to 1999 Hz" in run("frf", tmp_path / "a.csv", *options, "-o", tmp_path / "a.uff").stdout


def test_wrong_input_of_frf_is_refused_with_what_is_accepted(run, tmp_path, hits):
    table = "time,force,response\n" + "".join(f"{n / 100},{n % 7},{n % 5}\n" for n in range(50))
    assert "'speed' is not a unit of motion" in fault_of(run, tmp_path, "a.csv", table, "--response-unit", "speed")
    assert "'m' is not a unit of force" in fault_of(run, tmp_path, "a.csv", table, "--force-unit", "m")
    assert "not one of H1, H2" in fault_of(run, tmp_path, "a.csv", table, "--estimator", "H9", code=2)
    assert "does not increase in even steps" in fault_of(run, tmp_path, "a.csv", table.replace("0.25,", "0.29,"))
    assert "the force is nan at impact 1, sample 4" in fault_of(
        run, tmp_path, "a.csv", table.replace("3,3,3", "3,nan,3")
    )
    assert "a.csv:5\n  'x' in column force is not a number." in fault_of(
        run, tmp_path, "a.csv", table.replace("0.03,3", "0.03,x")
    )
    archive = b"PK\x05\x06" + bytes(18)  # without arrays
    assert "is for tables, not for .npz files" in fault_of(run, tmp_path, "a.npz", archive, "--columns", "time,force")
    assert "0 columns of force" in fault_of(run, tmp_path, "a.csv", table.replace("force", "power"))
    assert "does not say the sampling rate" in fault_of(run, tmp_path, "a.csv", table.replace("time", "turns"))
    assert "the file is empty" in fault_of(run, tmp_path, "a.csv", "")
    assert "is not the suffix of a known format" in fault_of(run, tmp_path, "a.xlsx", "x")
    assert "this is not an HDF5 file" in fault_of(run, tmp_path, "a.h5", "x")
    assert "the archive is damaged" in fault_of(run, tmp_path, "a.npz", b"PK")
    assert "0 time records of a force" in fault_of(run, tmp_path, "a.uff", "    -1\n   151\nx\n    -1\n")
    np.savez(tmp_path / "b.npz", force=hits[1])
    assert "a force or a response is missing" in run("frf", tmp_path / "b.npz", "-o", tmp_path / "c.csv", code=1).stderr
