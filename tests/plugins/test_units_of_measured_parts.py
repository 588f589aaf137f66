"""Units, quantities and factors in the archive of a measured part: SI, or one clear error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dovetail import DovetailError
from dovetail_plugins.substructures.receptance_files import from_archive

FREQUENCY = np.arange(50.0, 100.0, 10.0)
POINT = np.array([[1.0, 0.1], [0.1, 2.0]]) * np.ones((5, 1, 1)) + 0j
TABLE = {"nodes": np.array(["tip", "tip"]), "directions": np.array(["x", "rz"])}
OTHER = {
    "unit": ["um/N", "mm/N", "g/N", "furlong/N", "EU", "N/m"],
    "units": ["um/N", "mm/kN"],
    "receptance_unit": ["um/N"],
    "H_unit": ["mm/s/N"],
    "frequency_unit": ["kHz", "rad/s", "ms"],
    "force_unit": ["lbf", "kN"],
    "response_unit": ["um", "g"],
    "quantity": ["accelerance", "mobility", "dynamic stiffness"],
    "info": ["um/N"],
    "comment": ["values in um/N", "gain 10 dB"],
    "scale": [1e-6],
    "gain": [10.0],
    "factor": [1000.0],
    "delay": [1e-3],
}
SOUND = {
    "unit": ["m/N", "SI"],
    "frequency_unit": ["Hz"],
    "quantity": ["receptance"],
    "comment": ["hammer 086C03, 2026-03-01"],
    "gain": [1.0],
    "fs": [4096.0],
    "note": ["spindle 7"],
}


def cases(table: dict[str, list[Any]]) -> list[tuple[str, Any]]:
    return [(name, value) for name, values in table.items() for value in values]


def written(folder: Path, with_table: bool, **arrays: Any) -> str:
    named = TABLE if with_table else {}
    np.savez(folder / "part.npz", frequency=FREQUENCY, receptance=POINT, **named, **arrays)
    return str(folder / "part.npz")


@pytest.mark.parametrize("with_table", [False, True])
@pytest.mark.parametrize(("name", "value"), cases(OTHER))
def test_another_unit_or_a_factor_is_refused(tmp_path: Path, name: str, value: Any, with_table: bool) -> None:
    with pytest.raises(DovetailError) as caught:
        from_archive(written(tmp_path, with_table, **{name: value}))
    assert "part.npz" in caught.value.faults[0].where


@pytest.mark.parametrize("with_table", [False, True])
@pytest.mark.parametrize(("name", "value"), cases(SOUND))
def test_an_archive_in_si_units_is_read(tmp_path: Path, name: str, value: Any, with_table: bool) -> None:
    known = from_archive(written(tmp_path, with_table, **{name: value}))
    np.testing.assert_allclose(known.matrix.values, POINT)
