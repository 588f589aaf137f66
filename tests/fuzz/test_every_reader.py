"""Altered files through every reader: read, or refused in one error, quickly and in little memory.

What is read is what a strict reader of the format reads too, or the liberty that ours takes has a name in
`strict_readers`. The corpus is what our own writers make, and lines as laboratories have them. By default a few cases
of each, the same in every run; ``pytest -m slow tests/fuzz`` runs twenty thousand, and with
``DOVETAIL_FUZZ_CASES=1000000`` for hours; ``-rP`` shows how many were read, and by which liberties.
"""

from __future__ import annotations

import faulthandler
import io
import os
import random
import shutil
import sys
import time
import zipfile
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from scipy.io import savemat

import dovetail
from dovetail.documents.fault_list import FaultList
from dovetail.documents.yaml_reader import read_yaml
from dovetail.errors import DovetailError
from dovetail.units import to_si
from dovetail_plugins.readers import guarded_arrays as guarded
from dovetail_plugins.substructures.dof_table import read_dof_table
from dovetail_plugins.substructures.matrix_files import read_archive
from support import strict_readers
from support.labview_files import HEADER, SEGMENT

MANY = int(os.environ.get("DOVETAIL_FUZZ_CASES", "20000"))
SECONDS, MEGABYTES = 10.0, 1000
ONCE = settings(
    deadline=None,
    derandomize=True,
    database=None,
    phases=(Phase.generate, Phase.shrink),
    suppress_health_check=list(HealthCheck),
)
FRF = dovetail.Frf(np.arange(1.0, 9.0), np.arange(8) / 7 + 1j, "accelerance", coherence=np.full(8, 0.9))
ODD = (
    b"1_0",
    b"\xef\xbc\x91",
    b"nan",
    b"1e999",
    b"-",
    b"\x1b[2J",
    b"=",
    b"\x00",
    b"\xff",
    b"\n",
    b",",
    b"9" * 30,
    b"*a",
)
DESCRIPTION = Path(__file__).parents[2] / "assemblies" / "sdof.yaml"


def archive(path: Path, **arrays: Any) -> bytes:
    np.savez(path, **arrays)
    return path.read_bytes()


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A small file for each reader, by the file's name."""
    to_si("1 mm", "m")  # loads what each fork would load anew
    folder = tmp_path_factory.mktemp("corpus")
    files = {}
    for name, options in (("a.csv", {}), ("a.npz", {}), ("a.uff", {"binary": False}), ("b.uff", {"binary": True})):
        dovetail.write_frf(FRF, folder / name, **options)
        files[name] = (folder / name).read_bytes()
    np.save(folder / "a.npy", np.column_stack([FRF.frequency, FRF.values]))
    savemat(folder / "a.mat", {"frequency": FRF.frequency, "values": FRF.values})
    with h5py.File(folder / "a.h5", "w") as file:
        file.update(frequency=FRF.frequency, values=FRF.values)
        file["values"].attrs["unit"] = "m/s^2/N"
    with h5py.File(folder / "b.mat", "w", userblock_size=512) as file:
        parts = np.rec.fromarrays([FRF.values.real, FRF.values.imag], names="real,imag")
        for name, array in (("frequency", FRF.frequency), ("values", parts)):
            file.create_dataset(name, data=array.reshape(1, -1)).attrs["MATLAB_class"] = np.bytes_("double")
    files |= {name: (folder / name).read_bytes() for name in ("a.npy", "a.h5", "a.mat", "b.mat")}
    files["a.lvm"] = (HEADER + SEGMENT).encode()
    files["a.frf"] = b"1,5\t2E-005\t3\tFreq\tHz\tReal\tm/s^2/N\n2\t3\t4\n3\t4\t5\n"
    files["a.tsv"] = b"Freq\tReal\tImag\nHz\tg/N\tg/N\n1\t2\t3\n2\t-3e-005\t4\n"
    files["a.txt"] = "Kanal 7\nf;Real;Imag\nHz;g/N;g/N\n1;2,5;3\n2;-3e-005;4\n".encode("latin-1")
    files["a.yaml"] = DESCRIPTION.read_bytes()
    table = {"nodes": ["1", "2"], "directions": ["x", "x"]}
    files["matrices.npz"] = archive(folder / "m.npz", M=np.eye(2), K=np.eye(2), **table)
    files["dofs.csv"] = b"node,direction,position,row\n1,x,0,1\n1,rz,0,2\n2,x,0.1,3\n"
    return files


def read_description(path: Path) -> None:
    faults = FaultList()
    read_yaml(str(path), 0, faults)
    faults.raise_if_any()
    dovetail.load(path)


def check_frf(path: Path) -> str:
    """What is accepted is finite, on frequencies that increase, read again the same, and as strictly read."""
    frf = dovetail.read_frf(path, quantity="accelerance")
    assert np.all(np.isfinite(frf.values))
    assert np.all(np.diff(frf.frequency) > 0)
    copy = path.with_name("copy.npz")
    dovetail.write_frf(frf, copy, overwrite=True)
    np.testing.assert_array_equal(dovetail.read_frf(copy).values, frf.values)
    return compare(frf, path)


def compare(frf: dovetail.Frf, path: Path) -> str:
    """Return by which liberty an FRF was read, or that it is that of the strict reader."""
    try:
        frequency, values = strict_readers.READERS[path.name](path.read_bytes())
    except strict_readers.LibertyError as liberty:
        return f"read with liberty: {liberty}"
    first = 1 if frequency[0] == 0 else 0
    np.testing.assert_array_equal(frf.frequency, frequency[first:])
    np.testing.assert_allclose(frf.values, values[first:], rtol=1e-14)
    return "read as by the strict reader"


GUARDED = ("a.h5", "a.mat", "b.mat")


def check_in_a_fork(path: Path) -> str:
    """`check_frf` where a crash, a hang or a gigabyte ends a fork of this process, as it ends the guarded process."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        faulthandler.disable()
        guarded.call_guarded = lambda function, *arguments, error: function(*arguments)  # type: ignore[assignment]
        resource = __import__("resource")
        resource.setrlimit(resource.RLIMIT_CPU, (int(SECONDS), int(SECONDS)))
        try:
            said = f"+{check_frf(path)}"
        except DovetailError as error:
            said = f"-{error}"
        except BaseException as error:
            said = f"!{error!r}"
        os.write(writing, said.encode("utf-8", "replace")[:4000])
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as stream:
        said = stream.read().decode()
    _, status, usage = os.wait4(child, 0)
    assert usage.ru_maxrss / 1024 < MEGABYTES + peak_megabytes()
    if status != 0:
        with suppress(DovetailError):  # what was written beyond an array may end one process and not another
            compare(dovetail.read_frf(path, quantity="accelerance"), path)
        return f"contained: the library ended its process with {status}"
    if said[0] == "-":
        raise DovetailError(said[1:])
    assert said[0] == "+", said
    return said[1:]


READERS: dict[str, Callable[[Path], str | None]] = {
    **dict.fromkeys(strict_readers.READERS, check_frf),
    **dict.fromkeys(GUARDED, check_in_a_fork),
    "a.yaml": read_description,
    "matrices.npz": lambda path: read_archive(path) and None,
    "dofs.csv": lambda path: read_dof_table(path, 3) and None,
}


def altered(content: bytes, chance: random.Random) -> bytes:
    """Return a content with some bytes changed, left out, repeated or put in; seldom cut off or put together anew."""
    data = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 6))):
        longest = chance.choice((1, 10, 1 + len(data) // 8))
        place, length = chance.randrange(len(data) + 1), chance.randint(1, longest)
        kind = chance.randrange(7)
        if kind == 0 and data:
            data[place % len(data)] = chance.randrange(256)
        elif kind == 1:
            del data[place : place + length]
        elif kind == 2:
            data[place:place] = data[place : place + length]
        elif kind in (3, 4):
            data[place:place] = chance.choice(ODD)
        elif kind == 5 and data:
            data[place % len(data)] ^= 1 << chance.randrange(8)
        elif chance.random() < 0.2:
            del data[place:]
    return bytes(data)


def altered_within(content: bytes, chance: random.Random) -> bytes:
    """Return an archive with one of its members altered; its sums are right, so that the alteration is read."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as archive, zipfile.ZipFile(stream, "w") as fresh:
        chosen = chance.choice(archive.namelist())
        for name in archive.namelist():
            fresh.writestr(name, altered(archive.read(name), chance) if name == chosen else archive.read(name))
    return stream.getvalue()


def read_or_refuse(read: Callable[[Path], str | None], path: Path) -> str:
    """Return what became of it. Anything but an answer or one of our errors is a failure, and so is a long time."""
    start = time.process_time()
    try:
        outcome = message = read(path) or "read"
    except DovetailError as error:
        outcome, message = "refused", str(error)
    assert message
    assert "\x1b" not in message
    assert time.process_time() - start < SECONDS
    return outcome


def fuzz(name: str, corpus: dict[str, bytes], path: Path, cases: int) -> None:
    if name in GUARDED and sys.platform == "win32":
        pytest.skip("processes are forked")
    outcomes: Counter[str] = Counter()

    @seed(0)
    @settings(ONCE, max_examples=cases)
    @given(number=st.integers(0, 2**32))
    def one(number: int) -> None:
        alter = altered_within if name.endswith(".npz") and number % 2 else altered
        path.write_bytes(alter(corpus[name], random.Random(number)))
        outcomes[read_or_refuse(READERS[name], path)] += 1

    before = peak_megabytes()
    one()
    assert peak_megabytes() - before < MEGABYTES
    print(name, sum(outcomes.values()), "cases:", dict(outcomes.most_common()))


def peak_megabytes() -> float:
    resource = pytest.importorskip("resource")
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1024


@pytest.mark.parametrize("name", READERS)
def test_altered_files_are_read_or_refused(name: str, corpus: dict[str, bytes], tmp_path: Path) -> None:
    fuzz(name, corpus, tmp_path / name, {"a.yaml": 20, **dict.fromkeys(GUARDED, 25)}.get(name, 40))


@pytest.mark.parametrize("name", strict_readers.READERS)
def test_the_corpus_is_read_strictly(name: str, corpus: dict[str, bytes], tmp_path: Path) -> None:
    """Else no altered file would be compared."""
    (tmp_path / name).write_bytes(corpus[name])
    assert check_frf(tmp_path / name) == "read as by the strict reader"


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_many_altered_files_are_read_or_refused(name: str, corpus: dict[str, bytes], tmp_path: Path) -> None:
    fuzz(name, corpus, tmp_path / name, -(-MANY // (len(READERS) + 2)))


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A dataset and a model."""
    folder = tmp_path_factory.mktemp("folders")
    small = {
        "samples": 30,
        "reducer": {"model": "none"},
        "regressor": {"model": "mlp", "hidden": [4, 4], "max_epochs": 1},
    }
    assembly = dovetail.load({"extends": str(DESCRIPTION), "frequency": {"lines": 20}, "identification": small})
    dataset = dovetail.generate(assembly, folder / "data.zarr").path
    dovetail.train(assembly, dovetail.Dataset(dataset)).save(folder / "model")
    return {"dataset": dataset, "model": folder / "model"}


def read_dataset(path: Path) -> None:
    assert dovetail.Dataset(path).amplitude[:] is not None


def read_model(path: Path) -> None:
    dovetail.load_model(path)


OPEN = {"dataset": read_dataset, "model": read_model}


def fuzz_folder(name: str, folders: dict[str, Path], path: Path, cases: int) -> None:
    files = sorted(file.relative_to(folders[name]) for file in folders[name].rglob("*") if file.is_file())
    outcomes: Counter[str] = Counter()
    for number in range(cases):
        chance = random.Random(number)
        shutil.copytree(folders[name], path)
        file = path / files[number % len(files)]
        file.write_bytes(altered(file.read_bytes(), chance))
        outcomes[read_or_refuse(OPEN[name], path)] += 1
        shutil.rmtree(path)
    print(name, cases, "cases:", dict(outcomes))


@pytest.mark.parametrize("name", OPEN)
def test_altered_folders_are_read_or_refused(name: str, folders: dict[str, Path], tmp_path: Path) -> None:
    fuzz_folder(name, folders, tmp_path / name, 30)


@pytest.mark.slow
@pytest.mark.parametrize("name", OPEN)
def test_many_altered_folders_are_read_or_refused(name: str, folders: dict[str, Path], tmp_path: Path) -> None:
    fuzz_folder(name, folders, tmp_path / name, -(-MANY // (len(READERS) + 2)))
