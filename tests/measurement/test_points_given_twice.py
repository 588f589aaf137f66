"""A file that gives the DOF of a response or of a force twice: the two agree, or its use is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.identification.measured_lines import check_measured
from dovetail.measurement import read_frf
from support.mass_on_mount import mass_on_mount
from support.measured_files import fault_of, set_58, write_sets

FREQUENCY = np.arange(10.0, 60.0, 10.0)
VALUES = 1.0 / (5e4 - (2 * np.pi * FREQUENCY) ** 2 + 1j * FREQUENCY)
HEADER = {"rsp_node": 1, "rsp_dir": 3, "ref_node": 1, "ref_dir": 3}


@pytest.fixture(scope="module")
def description():
    parameters = {"k": {"range": ["1e4 N/m", "1e5 N/m"]}, "c": "1 N s/m"}
    return dovetail.load(mass_on_mount({"start": "10 Hz", "stop": "50 Hz", "step": "10 Hz"}, parameters)).description


@pytest.mark.parametrize(
    ("line", "kind"),
    [("response: 7+z", "points"), ("force: 1-z", "directions"), ("Response node: 3", "points"),
     ("Reference DOF: 2+z", "points"), ("Force: 1x", "directions")],
)  # fmt: skip
def test_an_id_line_with_another_dof_than_the_header_is_refused(
    tmp_path: Path, description, line: str, kind: str
) -> None:
    path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, **HEADER, id4=line))
    frf = read_frf(path)
    assert (frf.response, frf.force) == ("1+z", "1+z")
    with pytest.raises(dovetail.MeasurementError, match=f"its file gives two {kind} for its"):
        check_measured(description, frf)
    check_measured(description, read_frf(path, ignore_dofs=True))
    check_measured(description, read_frf(path, names={"skip": line}))


@pytest.mark.parametrize("line", ["response: 1+z", "Response: 1z", "force: 1", "Reference node: 1", "sensor: 352C22"])
def test_an_id_line_that_agrees_with_the_header_is_read(tmp_path: Path, description, line: str) -> None:
    path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, **HEADER, id4=line))
    check_measured(description, read_frf(path))


@pytest.mark.parametrize(("key", "text"), [("rsp_dir", 1), ("output", "1-z"), ("output", "1+x")])
def test_another_direction_in_an_entry_is_refused(tmp_path: Path, description, key: str, text: int | str) -> None:
    path = tmp_path / "a.npz"
    points = {"response": "1+z", "force": "1+z", key: text}
    np.savez(path, frequency=FREQUENCY, receptance=VALUES, **{name: np.array(point) for name, point in points.items()})
    with pytest.raises(dovetail.MeasurementError, match="its file gives two directions for its response"):
        check_measured(description, read_frf(path))


def test_numbers_of_averages_in_two_id_lines_are_compared(tmp_path: Path) -> None:
    fields = {**HEADER, "id2": "averages: 10"}
    assert read_frf(write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, **fields))).averages == 10
    path = write_sets(tmp_path / "b.uff", set_58(FREQUENCY, VALUES, **fields, id3="Averages: 20"))
    assert "averages" in fault_of(path)
