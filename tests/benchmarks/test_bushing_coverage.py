"""The study of bushings runs in slices, which a file keeps."""

from __future__ import annotations

import bushing_coverage
import numpy as np
import pytest
from interval_coverage import Case


def case(number):
    missed = np.array([number == 1, False])
    return Case(number, 0, ("bushing.k_x", "bushing.c_x"), missed, ~missed & False, ("identified",) * 2, 0.5)


def test_a_slice_identifies_the_cases_that_its_file_lacks(tmp_path, monkeypatch):
    file, run = tmp_path / "cases.jsonl", []
    monkeypatch.setattr(bushing_coverage, "identified", lambda number, *_: run.append(number) or case(number))
    bushing_coverage.run_slice(2, 1, 0, 100, 0, file, 60.0)
    cases = bushing_coverage.run_slice(3, 1, 0, 100, 0, file, 60.0)
    assert run == [0, 1, 2]
    assert [one.number for one in cases] == [0, 1, 2]
    lines = []
    bushing_coverage.print_tables(cases, lines.append)
    assert "| all | 6 | 83.3% " in lines[0]


@pytest.mark.parametrize("limit", [0.0, -1.0])
def test_no_case_begins_once_the_time_is_over(limit, tmp_path, monkeypatch):
    monkeypatch.setattr(bushing_coverage, "identified", lambda *_: pytest.fail("a case was run"))
    assert bushing_coverage.run_slice(2, 1, 0, 100, 0, tmp_path / "cases.jsonl", limit) == []
