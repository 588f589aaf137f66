"""The second interpreter that reads HDF5 and MATLAB files: what it imports, and what it needs."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

import dovetail

FREQUENCY = 10.0 + 2.5 * np.arange(7)
VALUES = (1 + 2j) * FREQUENCY


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """The same FRF as HDF5 and as a MATLAB workspace."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["f"], file["mobility"] = FREQUENCY, VALUES
    savemat(tmp_path / "a.mat", {"f": FREQUENCY, "mobility": VALUES})
    return tmp_path / "a.h5", tmp_path / "a.mat"


def test_nothing_of_the_current_folder_runs(
    files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("secrets", "numpy", "h5py", "scipy", "dovetail"):
        (tmp_path / f"{module}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    for path in files:
        np.testing.assert_array_equal(dovetail.read_frf(path.name).values, VALUES)
    assert not (tmp_path / "ran").exists()


def test_warnings_of_a_reader_in_the_second_process_are_shown(tmp_path: Path) -> None:
    frequency = np.arange(1.0, 101.0)
    table = {"f": frequency, "amplitude": frequency, "phase_deg": np.angle(np.exp(0.1j * frequency))}
    savemat(tmp_path / "a.mat", table)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update(table)
    for name in ("a.mat", "a.h5"):
        with pytest.warns(UserWarning, match=f"{name}: the phase in degrees never leaves"):
            dovetail.read_frf(tmp_path / name, quantity="mobility")


def test_a_missing_package_is_named(files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(dovetail.DovetailError) as caught:
        dovetail.read_frf(files[0])
    assert str(caught.value) == (
        f"{files[0]}\n  this needs the package h5py, which is not installed.\n"
        '  Install it by: pip install "dovetail-frf[hdf5]"'
    )
    np.testing.assert_array_equal(dovetail.read_frf(files[1]).values, VALUES)
    monkeypatch.setitem(sys.modules, "pyFRF", None)
    with pytest.raises(dovetail.DovetailError, match=r"the package pyFRF, .*\n.*dovetail-frf\[impact\]"):
        dovetail.frf_from_signals(np.eye(2, 64), np.eye(2, 64), 1000.0)
