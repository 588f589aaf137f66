"""Altered files through every reader in pure Python: read, or refused in one error, quickly and in little memory.

The corpus is what our own writers make, and lines as laboratories have them. By default a few cases of each, the same
in every run; ``pytest -m slow tests/fuzz`` runs twenty thousand, and with ``DOVETAIL_FUZZ_CASES=1000000`` for hours.
"""

from __future__ import annotations

import os
import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from test_labview_files import HEADER, SEGMENT

import dovetail
from dovetail.documents.fault_list import FaultList
from dovetail.documents.yaml_reader import read_yaml
from dovetail.errors import DovetailError
from dovetail_plugins.substructures.dof_table import read_dof_table
from dovetail_plugins.substructures.matrix_files import read_archive

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
    folder = tmp_path_factory.mktemp("corpus")
    files = {}
    for name, options in (("a.csv", {}), ("a.npz", {}), ("a.uff", {"binary": False}), ("b.uff", {"binary": True})):
        dovetail.write_frf(FRF, folder / name, **options)
        files[name] = (folder / name).read_bytes()
    np.save(folder / "a.npy", np.column_stack([FRF.frequency, FRF.values]))
    files["a.npy"] = (folder / "a.npy").read_bytes()
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


def check_frf(path: Path) -> None:
    """What is accepted is finite, on frequencies that increase, and read again the same."""
    frf = dovetail.read_frf(path, quantity="accelerance")
    assert np.all(np.isfinite(frf.values))
    assert np.all(np.diff(frf.frequency) > 0)
    copy = path.with_name("copy.npz")
    dovetail.write_frf(frf, copy, overwrite=True)
    np.testing.assert_array_equal(dovetail.read_frf(copy).values, frf.values)


READERS: dict[str, Callable[[Path], Any]] = {
    **dict.fromkeys(("a.csv", "a.npz", "a.uff", "b.uff", "a.npy", "a.lvm", "a.frf", "a.tsv", "a.txt"), check_frf),
    "a.yaml": read_description,
    "matrices.npz": read_archive,
    "dofs.csv": lambda path: read_dof_table(path, 3),
}


def altered(content: bytes, chance: random.Random) -> bytes:
    """Return a content with some bytes changed, left out, repeated or put in; seldom cut off or put together anew."""
    data = bytearray(content)
    for _ in range(chance.randint(1, 6)):
        place, length = chance.randrange(len(data) + 1), chance.randint(1, 1 + len(data) // 8)
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


def read_or_refuse(read: Callable[[Path], Any], path: Path) -> None:
    """Anything but an answer or one of our errors is a failure, and so is a long time."""
    start = time.process_time()
    message = "read"
    try:
        read(path)
    except DovetailError as error:
        message = str(error)
    assert message
    assert "\x1b" not in message
    assert time.process_time() - start < SECONDS


def fuzz(name: str, corpus: dict[str, bytes], path: Path, cases: int) -> None:
    @seed(0)
    @settings(ONCE, max_examples=cases)
    @given(number=st.integers(0, 2**32))
    def one(number: int) -> None:
        path.write_bytes(altered(corpus[name], random.Random(number)))
        read_or_refuse(READERS[name], path)

    before = peak_megabytes()
    one()
    assert peak_megabytes() - before < MEGABYTES


def peak_megabytes() -> float:
    resource = pytest.importorskip("resource")
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1024


@pytest.mark.parametrize("name", READERS)
def test_altered_files(name: str, corpus: dict[str, bytes], tmp_path: Path) -> None:
    fuzz(name, corpus, tmp_path / name, 30 if name == "a.yaml" else 150)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_many_altered_files(name: str, corpus: dict[str, bytes], tmp_path: Path) -> None:
    fuzz(name, corpus, tmp_path / name, MANY // (len(READERS) + 2))


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


OPEN: dict[str, Callable[[Path], Any]] = {
    "dataset": lambda path: dovetail.Dataset(path).amplitude[:],
    "model": dovetail.load_model,
}


def fuzz_folder(name: str, folders: dict[str, Path], path: Path, cases: int) -> None:
    files = sorted(file.relative_to(folders[name]) for file in folders[name].rglob("*") if file.is_file())
    for number in range(cases):
        chance = random.Random(number)
        shutil.copytree(folders[name], path)
        file = path / files[number % len(files)]
        file.write_bytes(altered(file.read_bytes(), chance))
        read_or_refuse(OPEN[name], path)
        shutil.rmtree(path)


@pytest.mark.parametrize("name", OPEN)
def test_altered_folders(name: str, folders: dict[str, Path], tmp_path: Path) -> None:
    fuzz_folder(name, folders, tmp_path / name, 30)


@pytest.mark.slow
@pytest.mark.parametrize("name", OPEN)
def test_many_altered_folders(name: str, folders: dict[str, Path], tmp_path: Path) -> None:
    fuzz_folder(name, folders, tmp_path / name, MANY // (len(READERS) + 2))
