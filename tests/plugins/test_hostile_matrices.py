"""Malicious matrix files of parts: one error, in bounded memory and time, and the process goes on."""

from __future__ import annotations

import io
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from support.waiting import PATIENCE

MATRIX_MARKET = b"%%MatrixMarket matrix coordinate real general\n"
READ = """
import sys
from pathlib import Path
from dovetail import DovetailError
from dovetail_plugins.substructures.matrix_files import matrix_market, read_archive, sound_matrix
for name in sys.argv[1:]:
    path = Path(name)
    try:
        if path.suffix == ".mtx":
            sound_matrix("K", matrix_market(path, path.read_bytes()), name)
        else:
            sound_matrix("K", read_archive(path).get("K", 0), name)
        print(path.name, "read")
    except DovetailError as error:
        print(path.name, len(error.faults), error.faults[0].problem)
status = open("/proc/self/status").read()  # not getrusage, which begins with what the parent had
print("megabytes", int(status.partition("VmHWM:")[2].split()[0]) // 1024)
"""


def many_entries() -> bytes:
    """An archive of empty arrays, whose end record is small and whose ZIP64 record is true."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for number in range(66_000):
            archive.writestr(f"{number:x}", b"")
    return stream.getvalue()


def packed(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, K=array)
    return stream.getvalue()


def short_of_its_shape() -> bytes:
    """An array whose header announces 4 GB."""
    stream, array = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(array, {"descr": "<f8", "fortran_order": False, "shape": (500_000_000,)})
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("K.npy", array.getvalue() + bytes(80))
    return stream.getvalue()


def changed_workspace() -> bytes:
    """A workspace whose sparse matrix has another count of entries than it says."""
    import scipy.sparse as sp

    stream = io.BytesIO()
    savemat(stream, {"K": sp.csc_array(np.eye(3))})
    content = bytearray(stream.getvalue())
    content[128 + 8 + 8 + 4] = 0xFF
    content[128 + 8 + 8 + 5] = 0xFF
    return bytes(content)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded by Linux")
def test_hostile_matrices_are_refused_in_bounded_memory(tmp_path: Path) -> None:
    files = {
        "crash.mtx": b"1\n-1E",
        "wide.mtx": MATRIX_MARKET + b"600000000 600000000 1\n1 1 1.0\n",
        "full.mtx": b"%%MatrixMarket matrix array real general\n9999 9999\n" + b"0\n" * 9,
        "zeros.npz": packed(np.zeros((6_000, 6_000))),
        "entries.npz": many_entries(),
        "short.npz": short_of_its_shape(),
        "changed.mat": changed_workspace(),
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    done = subprocess.run(
        [sys.executable, "-c", READ, *(str(tmp_path / name) for name in files)],
        capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    *lines, last = done.stdout.splitlines()
    answers = {line.split()[0]: line.partition(" ")[2] for line in lines}
    assert [name for name in files if not answers[name].startswith("1 ")] == []
    assert int(last.split()[1]) < 700
