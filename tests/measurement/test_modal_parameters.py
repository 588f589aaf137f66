"""Tables of natural frequencies and damping ratios, written by hand."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dovetail import Assembly, MeasurementError, ModalParameters, identify, read_frf, read_modal_parameters
from dovetail.measurement import is_modal_table
from support.measured_files import damaged

TABLES = {
    "mode,frequency_Hz,damping_ratio,frequency_sd_Hz,damping_ratio_sd\n1,100,0.01,0.1,0.001\n2,250.5,0.02,0.2,0.002\n",
    "frequency_Hz,damping_percent,frequency_sd_Hz,damping_sd_percent\n100,1,0.1,0.1\n250.5,2,0.2,0.2\n",
    "EMA 3\n\nNr;Natural frequency [kHz];Damping [%];Frequency SD [Hz];Damping SD [%]\n"
    "1;0,1;1;0,1;0,1\n2;0,2505;2;0,2;0,2\n",
    "Frequency\tZeta\tfrequency_sd\tzeta_sd\nHz\t-\tHz\t-\n100\t0.01\t0.1\t0.001\n250.5\t0.02\t0.2\t0.002\n",
    "f_n (Hz),zeta (%),f_sd (Hz),zeta_sd (%)\n100,1,0.1,0.1\n250.5,2,0.2,0.2\n",
    "f_Hz damping_ratio[%] frequency_sd_percent zeta_sd\n100 1 0.1 0.001\n250.5 2 0.07984031936127745 0.002\n",
}


@pytest.mark.parametrize("text", sorted(TABLES))
def test_a_table_of_natural_frequencies_is_read(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    modes = read_modal_parameters(tmp_path / "a.csv")
    np.testing.assert_allclose(modes.frequency, [100, 250.5], rtol=1e-15)
    np.testing.assert_allclose(modes.damping_ratio, [0.01, 0.02], rtol=1e-15)
    np.testing.assert_allclose(modes.frequency_sd, [0.1, 0.2], rtol=1e-15)
    np.testing.assert_allclose(modes.damping_sd, [0.001, 0.002], rtol=1e-15)
    assert modes.label == str(tmp_path / "a.csv")


def test_frequencies_alone_and_in_radians_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("Frequency [rad/s]  Mode\n628.3185307179587  1\n1000  2\n")
    modes = read_modal_parameters(tmp_path / "a.txt")
    np.testing.assert_allclose(modes.frequency, [100, 500 / np.pi], rtol=1e-15)
    assert (modes.damping_ratio, modes.frequency_sd, modes.damping_sd) == (None, None, None)


SINGLE_COLUMNS = (
    "frequency_Hz\n100\n250.5\n",
    "EMA 3\n\n# Natural frequency [kHz]\n\n0.1\n0.2505\n",
    "f_Hz\n1e2\n250.5\nend\n",
)


@pytest.mark.parametrize("text", SINGLE_COLUMNS)
def test_a_single_column_of_natural_frequencies_is_read(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    assert is_modal_table(tmp_path / "a.csv")
    np.testing.assert_allclose(read_modal_parameters(tmp_path / "a.csv").frequency, [100, 250.5], rtol=1e-15)


def test_a_number_below_a_frequency_in_the_lines_above_a_table_is_no_column(tmp_path: Path) -> None:
    rows = "frequency_Hz,real,imag\n1,2,3\n2,3,4\n"
    (tmp_path / "frf.csv").write_text(f"Frequency [Hz]\n1024\n{rows}")
    assert not is_modal_table(tmp_path / "frf.csv")
    assert read_frf(tmp_path / "frf.csv", quantity="receptance").values.tolist() == [2.0 + 3.0j, 3.0 + 4.0j]
    for more in ("", "250.5,0.2\n"):
        (tmp_path / "modes.csv").write_text(f"Frequency [Hz]\n1024\nf_Hz,zeta\n100,0.1\n{more}")
        assert read_modal_parameters(tmp_path / "modes.csv").frequency.tolist() == [100.0, 250.5][: 1 + bool(more)]


def test_the_modes_of_a_single_column_are_identified(tmp_path: Path, sdof: Assembly) -> None:
    natural = sdof.natural_frequencies(sdof.from_unit(np.full(len(sdof.parameters), 0.5)), 1)[0]
    (tmp_path / "a.csv").write_text(f"frequency_Hz\n{natural:.6f}\n")
    result = identify(sdof, tmp_path / "a.csv", "refined")
    assert result.modes[0].natural_frequency == pytest.approx(natural, rel=1e-3)


FAULTS = {
    "frequency,zeta\n1,0.1\n": "a.csv:1\n  'frequency' has no unit.\n  Accepted: Hz, kHz, rad/s",
    "frequency [rpm],zeta\n1,0.1\n": "a.csv:1\n  the unit of 'frequency' is 'rpm'.\n  Accepted: Hz, kHz, rad/s",
    "f_Hz,damping\n1,0.1\n": "a.csv:1\n  'damping' may be a ratio or in per cent.\n  Call it damping_ratio or",
    "f_Hz,damping_percent,damping_sd\n1,1,0.1\n": "a.csv:1\n  'damping_sd' may be a ratio or in per cent.\n",
    "f_Hz,stiffness\n1,0.1\n": "a.csv:1\n  the column 'stiffness' is not understood.\n",
    "f_Hz,frequency_Hz\n1,0.1\n": "a.csv:1\n  the header names a parameter twice, or no frequency.\n",
    "f_Hz,zeta\n1,x\n": "a.csv:2\n  'x' in column zeta is not a number.",
    "f_Hz,zeta\n1,1.5\n": "a.csv: damping_ratio of mode 1 is 1.5; it must be from 0 to below 1.",
    "f_Hz,zeta\n1,-0.1\n": "a.csv: damping_ratio of mode 1 is -0.1; it must be from 0 to below 1.",
    "f_Hz,zeta\n5,0\n5,0\n": "a.csv: the frequency does not increase after mode 1.",
    "f_Hz,zeta\nnan,0\n5,0\n": "a.csv: frequency of mode 1 is nan; it must be positive, from 1e-30 to 1e+30.",
    "f_Hz,frequency_sd_Hz\n5,0\n": "a.csv: frequency_sd of mode 1 is 0; it must be positive, from 1e-30 to 1e+30.",
    "f_Hz,zeta_sd\n5,0.1\n": "a.csv: there are standard deviations of the damping, and no damping.",
    "f_Hz\n100\nabc\n300\n": "a.csv:3\n  'abc' in column f_Hz is not a number.",
    "f_Hz\n100\n200 0.1\n": "a.csv:3\n  the line has 2 columns, the header 1.",
    "amplitude\n100\n200\n": "a.csv\n  there is no header.\n  Accepted: frequency_Hz[,",
    "1,2\n3,4\n": "a.csv:1\n  the table has no header.\n  Accepted: frequency_Hz[,",
    "f_Hz,zeta\n" + "".join(f"{n},0\n" for n in range(1, 10_002)): "a.csv\n  the table has 10,001 modes.",
}


@pytest.mark.parametrize("text", FAULTS, ids=range(len(FAULTS)))
def test_faulty_input_is_refused_with_its_message(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(MeasurementError) as caught:
        read_modal_parameters(tmp_path / "a.csv")
    assert len(caught.value.faults) == 1
    assert str(caught.value).strip().replace(f"{tmp_path}/", "").startswith(FAULTS[text])


def test_a_file_that_is_not_a_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match="this is not a table of modal parameters"):
        read_modal_parameters(tmp_path / "a.uff")
    with pytest.raises(MeasurementError, match=r"damping_ratio has the shape \(1,\), not \(n_modes,\)"):
        ModalParameters(np.array([1.0, 2.0]), np.array([0.1]))


@given(data=st.data())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_tables_are_read_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    content = damaged(data, data.draw(st.sampled_from(sorted(TABLES))).encode())
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    modes, message = None, ""
    try:
        modes = read_modal_parameters(path)
    except MeasurementError as error:
        message = str(error) if len(error.faults) == 1 else "several faults"
    assert str(path) in message or (modes is not None and np.all(np.isfinite(modes.frequency)))


CONTRADICTIONS = {
    "mode,f_Hz\n2,212\n1,812\n": "mode 1 follows mode 2",
    "mode,f_Hz\n1,212\n1,812\n": "mode 1 follows mode 1",
    "number of modes: 3\nmode,f_Hz\n1,212\n2,812\n": "there are 3 modes here, and 2 in the table.",
    "Frequency range: 0 - 500 Hz\nmode,f_Hz\n1,212\n2,812\n": "the band ends at 500 Hz here, and a mode is at 812 Hz.",
    "Start frequency: 300 Hz\nmode,f_Hz\n1,212\n2,812\n": "the band begins at 300 Hz here, and a mode is at 212 Hz.",
}


@pytest.mark.parametrize(("text", "said"), CONTRADICTIONS.items())
def test_modes_that_contradict_their_numbers_or_the_band_are_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(MeasurementError) as caught:
        read_modal_parameters(tmp_path / "a.csv")
    assert said in str(caught.value)


ODD = {
    "f_Hz,zeta\n212,0.31\n": "a damping ratio of 0.31 is 31 %. Is the column in per cent?",
    "f_Hz,damping_percent\n212,0.003\n": "no damping exceeds 0.003 %. Is the column a ratio?",
    "f_Hz,frequency_sd_kHz\n212,0.2\n": "the standard deviation in row 1 is 200, of 212",
    "f_Hz,damping_percent,damping_ratio_sd\n212,0.31,0.02\n": "the standard deviation in row 1 is 0.02, of 0.0031",
}


@pytest.mark.parametrize(("text", "said"), ODD.items())
def test_sizes_whose_unit_is_hardly_right_are_reported(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.warns(UserWarning, match=re.escape(said)):
        read_modal_parameters(tmp_path / "a.csv")


def test_each_size_whose_unit_is_hardly_right_is_reported(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("f_Hz,frequency_sd_kHz,zeta\n212,0.2,0.31\n")
    with (
        pytest.warns(UserWarning, match="a damping ratio of 0.31"),
        pytest.warns(UserWarning, match="the standard deviation in row 1"),
    ):
        read_modal_parameters(tmp_path / "a.csv")


def test_modes_with_names_gaps_and_a_band_that_holds_them_are_read(tmp_path: Path) -> None:
    for rows in ("mode,f_Hz\n1,212\n4,812\n", "mode,f_Hz\nbending,212\ntorsion,812\n"):
        (tmp_path / "a.csv").write_text(f"Frequency range: 0 - 1 kHz\nnumber of modes: 2\n{rows}")
        assert read_modal_parameters(tmp_path / "a.csv").frequency.tolist() == [212, 812]
