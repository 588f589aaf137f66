"""The sections of docs/imported_models.md for finite element programs, with files of a frame, against beams."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import dovetail
from support import fe_files

PAGE = Path(__file__).resolve().parents[2] / "docs" / "imported_models.md"
WRITERS = {
    "frame.op4": fe_files.write_op4,
    "frame.pch": fe_files.write_dmig,
    "frame_STIF2.mtx": fe_files.write_abaqus,
    "K.matrix": fe_files.write_ansys,
}
ERROR = {"frame.pch": 3e-6}


def sections():
    text = PAGE.read_text(encoding="utf-8").partition("## Finite element programs")[2].partition("\n## ")[0]
    return [yaml.safe_load(block)["holder"] for block in re.findall(r"```yaml\n(.*?)```", text, flags=re.S)]


@pytest.fixture(scope="module")
def expected():
    return dovetail.load(fe_files.beams()).frf()


def test_the_page_has_an_example_for_each_program():
    assert {part.get("file", part.get("stiffness")) for part in sections()} == set(WRITERS)


@pytest.mark.parametrize("number", range(5))
def test_the_example_of_the_page_is_the_frame_of_beams(number, expected, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    part = sections()[number]
    file = part.get("file", part.get("stiffness"))
    WRITERS[file](tmp_path)
    found = dovetail.load(fe_files.assembly(part)).frf()
    largest = 1e-3 if "reduce" in part else ERROR.get(file, 1e-8)
    assert np.abs(found - expected).max() < largest * np.abs(expected).max()
