"""Files that are not measurements at all: one clear error, in bounded time and memory, whatever the bytes."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from dovetail.errors import FileError, MeasurementError
from dovetail.frf import Frf
from dovetail.measurement import read_frf, write_frf
from support.labview_files import HEADER, SEGMENT
from support.measured_files import damaged, set_58, write_sets
from support.waiting import PATIENCE

ACCEPTED = "  Accepted: .uff, .unv, .csv, .tsv, .txt, .txf, .asc, .dat, .lvm, .npz, .npy, .mat, .h5, .hdf5, .frf"
UNKNOWN_SUFFIX = f"  For the format of a plugin file, add `plugins=`.{ACCEPTED}"
SUFFIXES = (".uff", ".unv", ".csv", ".tsv", ".npz", ".npy", ".mat", ".h5", ".frf", ".lvm")
FUZZ = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def read_or_refuse(path: Path, content: bytes, **arguments: object) -> None:
    """Anything but an FRF and a MeasurementError of one fault is a failure."""
    path.write_bytes(content)
    frf, message = None, ""
    try:
        frf = read_frf(path, quantity="accelerance", **arguments)
    except MeasurementError as error:
        message = str(error) if len(error.faults) == 1 else "several faults"
    assert str(path) in message or (frf is not None and np.all(np.isfinite(frf.values)))


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(content=st.binary(min_size=1, max_size=3000))
@FUZZ
def test_random_bytes_are_read_or_refused(tmp_path: Path, suffix: str, content: bytes) -> None:
    read_or_refuse(tmp_path / f"a{suffix}", content)


PIECES = [
    b"    -1\n",
    b"    58\n",
    b"    58b     1     2          11          16\n",
    b"NONE\n",
    b"   164\n",
    b"1",
    b"\n",
]


@given(pieces=st.lists(st.sampled_from(PIECES) | st.binary(max_size=90), max_size=40))
@FUZZ
def test_random_pieces_of_universal_files_are_read_or_refused(tmp_path: Path, pieces: list[bytes]) -> None:
    read_or_refuse(tmp_path / "a.uff", b"".join(pieces) or b"\n")


CELLS = st.sampled_from(["1", "2.5", "-3", "nan", "inf", "1e999", "", "x", '"', "1_0", "0"])


@given(
    header=st.sampled_from(
        ["frequency_Hz,real,imag", "frequency_Hz,amplitude", "frequency_Hz,amplitude,phase_deg", "f"]
    ),
    rows=st.lists(st.lists(CELLS, min_size=1, max_size=4), max_size=5),
)
@FUZZ
def test_random_tables_are_read_or_refused(tmp_path: Path, header: str, rows: list[list[str]]) -> None:
    read_or_refuse(tmp_path / "a.csv", "\n".join([header, *map(",".join, rows)]).encode())


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """One small file of each form."""
    folder = tmp_path_factory.mktemp("intact")
    frequency = np.array([1.0, 2.0, 4.5, 8.0])
    frf = Frf(frequency, np.array([1 + 1j, 2, -3j, 4]), "accelerance", coherence=np.ones(4))
    contents = {}
    for name, options in (("a.csv", {}), ("a.npz", {}), ("a.uff", {"binary": False}), ("b.uff", {"binary": True})):
        write_frf(frf, folder / name, **options)
        contents[name] = (folder / name).read_bytes()
    units = {"type": 164, "units_code": 1, "length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 0.0}
    contents["c.uff"] = write_sets(folder / "c.uff", units, set_58(frequency, frf.values)).read_bytes()
    with h5py.File(folder / "a.h5", "w") as file:
        file["f"], file["H"], file.attrs["quantity"] = frequency, frf.values, "accelerance"
    for name, compressed in (("a.mat", True), ("b.mat", False)):
        savemat(folder / name, {"f": frequency, "frf": {"H": frf.values}}, do_compression=compressed)
    for name in ("a.h5", "a.mat", "b.mat"):
        contents[name] = (folder / name).read_bytes()
    contents["a.tsv"] = b"Freq\tReal\tImag\nHz\tg/N\tg/N\n1\t2\t3\n2\t-3e-005\t4\n"
    contents["b.csv"] = (
        "Analyser 7\n0 1600\nf;Signal 2 (Real);Signal 2 (Imag.);Kohärenz\nHz;g/N;g/N;-\n1;2,5;3;1\n2;-3e-005;4;1\n"
    ).encode("latin-1")
    contents["a.txt"] = b"by hand\n1,5 2 3 OK\n2,5 2,25 4 OK\n"
    np.save(folder / "a.npy", np.column_stack([frequency, frf.values]))
    contents["a.npy"] = (folder / "a.npy").read_bytes()
    contents["a.lvm"] = (HEADER + SEGMENT).encode()
    contents["a.frf"] = b"1\t2E-005\t3\tFreq\tHz\tReal\tm/s^2/N\n2\t3\t4\n3\t4\t5\n"
    return contents


FORMS = ["a.csv", "b.csv", "a.tsv", "a.txt", "a.lvm", "a.npy", "a.frf", "a.npz", "a.uff", "b.uff", "c.uff"]


@pytest.mark.parametrize("name", FORMS)
@given(data=st.data())
@FUZZ
def test_damaged_files_are_read_or_refused(
    tmp_path: Path, intact: dict[str, bytes], name: str, data: st.DataObject
) -> None:
    damage_and_read(tmp_path, intact, name, data)


@pytest.mark.parametrize("name", ["a.h5", "a.mat", "b.mat"])
@given(data=st.data())
@settings(FUZZ, max_examples=10)  # each starts a process
def test_damaged_files_that_another_process_reads_are_read_or_refused(
    tmp_path: Path, intact: dict[str, bytes], name: str, data: st.DataObject
) -> None:
    damage_and_read(tmp_path, intact, name, data)


def damage_and_read(tmp_path: Path, intact: dict[str, bytes], name: str, data: st.DataObject) -> None:
    content = damaged(data, intact[name])
    if name in ("a.txt", "b.csv"):
        read_or_refuse(tmp_path / name, content, columns=("frequency", "real", "imag", "skip"))
    read_or_refuse(tmp_path / name, content)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.xlsx", "a.xlsx\n  '.xlsx' is not the suffix of a known format.\n" + UNKNOWN_SUFFIX),
        ("a", "a\n  the name has no suffix.\n" + ACCEPTED),
        ("a.npz", "a.npz\n  the archive is damaged: File is not a zip file.\n  Accepted: a file of np.savez"),
    ],
)
def test_strange_file_names_are_refused(refused, name: str, message: str) -> None:
    assert refused(name, b"1") == message


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_missing_and_empty_files_and_directories_are_refused(tmp_path: Path, suffix: str, refused) -> None:
    name = f"a{suffix}"
    with pytest.raises(FileError, match=rf"a\{suffix}\n  there is no such file\.$"):
        read_frf(tmp_path / name)
    assert refused(f"b{suffix}", b"") == f"b{suffix}\n  the file is empty."
    (tmp_path / name).mkdir()
    with pytest.raises(MeasurementError, match=rf"a\{suffix}\n  this is a directory\."):
        read_frf(tmp_path / name)
    with pytest.raises(MeasurementError, match=r"this is a directory\."):
        read_frf(tmp_path)
    os.mkfifo(tmp_path / f"c{suffix}")
    with pytest.raises(FileError, match=r"this is a device or a pipe\."):
        read_frf(tmp_path / f"c{suffix}")


def test_a_file_name_that_no_system_accepts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="the file cannot be read: "):
        read_frf(tmp_path / "a\0.csv")
    with pytest.raises(FileError, match="the file cannot be read: File name too long"):
        read_frf(tmp_path / ("a" * 300 + ".csv"))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_200_megabytes_are_refused_unread(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    with path.open("wb") as stream:
        stream.truncate(200_000_000)
    with pytest.raises(FileError, match="the file has 200 MB, far more than is read"):
        read_frf(path)


def matlab_of_parts(size: int) -> bytes:
    """A workspace of one struct without end: millions of empty elements."""
    inside = struct.pack("<4I2I2i", 6, 8, 2, 0, 5, 8, 1, 1) + struct.pack("<2I", 1, 0) + bytes(8) * (size // 8)
    element = struct.pack("<2I", 14, len(inside)) + inside
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + element


REFUSAL_AND_PEAK = """
import re, resource, sys
from pathlib import Path
seconds, memory = int(sys.argv[1]), int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
from dovetail.errors import FileError, MeasurementError
from dovetail.measurement import read_frf
for path in sys.argv[3:]:
    try:
        read_frf(path)
    except MeasurementError as error:
        peak = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())
        print(Path(path).name, int(peak[1]) // 1024, error.faults[0].problem.splitlines()[0])
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak memory is read from /proc")
@pytest.mark.parametrize(
    ("size", "seconds", "memory"),
    [
        (3_000_000, 20, 3 << 28),
        pytest.param(15_000_000, 40, 1 << 30, marks=pytest.mark.slow),
        pytest.param(60_000_000, 60, 2 << 30, marks=pytest.mark.slow),
    ],
    ids=["3 MB", "15 MB", "60 MB"],
)
def test_the_worst_files_take_bounded_time_and_memory(tmp_path: Path, size: int, seconds: int, memory: int) -> None:
    h5py_signature = b"\x89HDF\r\n\x1a\n"
    labels = b"%10d    0    0    0\n" * 4 % (18, 12, 13, 0)
    header = b"    -1\n    58\n" + b"NONE\n" * 5 + b"    4\n%10d%10d%10d  0.00000E+00  1.00000E+00  0.00000E+00\n"
    start = header % (6, 999_999, 1) + labels
    lines = min(size // 15, 999_000)  # few less than are read
    worst = {
        "lines.uff": b"    -1\n    58\n" + b"\n" * size + b"    -1\n",
        "data.uff": start + b"\n" * size + b"    -1\n",
        "tags.uff": b"    -1\n" * (size // 7),
        "noise.uff": np.random.default_rng(0).bytes(size),
        "lines.csv": b"frequency_Hz,amplitude\n" + b"\n" * size,
        "commas.csv": b"frequency_Hz,amplitude\n" + b"," * size,
        "one.csv": b"frequency_Hz,amplitude\n" + b"1" * size,
        "above.txt": b"f 1\n" * lines,
        "words.txt": b"f re im " * (size // 8),
        "quotes.csv": b"f;re;im\n" + b'"' * size,
        "blanks.txt": b"f re im\n" + b" 1" * (size // 2),
        "rows.csv": b"frequency_Hz,amplitude\n" + b"1,2\n" * lines,
        "units.tsv": b"f\tre\tim\n" + b"\t" * size,
        "rows.lvm": (HEADER + SEGMENT).encode() + b"20\t1\t2\n" * lines,
        "wide.lvm": (HEADER + SEGMENT).encode() + b"1\t" * (size // 2),
        "segments.lvm": (HEADER + SEGMENT).encode() + b"\n" * lines,
        "rows.frf": b"1 2 3\n" * lines,
        "one.frf": b"1 2 3 " + b"m" * size,
        "zeros.mat": b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + bytes(size),
        "parts.mat": matlab_of_parts(size),
        "zeros.h5": h5py_signature + bytes(size),
        "zeros.npz": bytes(size),
    }
    for name, content in worst.items():
        (tmp_path / name).write_bytes(content)
    result = subprocess.run(
        [sys.executable, "-c", REFUSAL_AND_PEAK, str(seconds), str(memory), *(str(tmp_path / name) for name in worst)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    answers = {line.split()[0]: line.split(maxsplit=2)[1:] for line in result.stdout.splitlines()}
    assert list(answers) == list(worst)
    assert answers["data.uff"][1] == "there are more data than the 999999 lines that the header announces."
    assert int(answers["zeros.npz"][0]) < 450, answers


def test_a_bad_argument_is_refused_before_the_file_is_read(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match="the argument quantity"):
        read_frf(tmp_path / "missing.csv", quantity="speed")
