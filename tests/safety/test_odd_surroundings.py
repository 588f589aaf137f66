"""Unusual environments: names not in UTF-8, lone surrogates, locales, matplotlib settings in the folder, pipes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.errors import DovetailError
from dovetail.identification.result_file import load_result
from dovetail_plugins.readers import uff_data, uff_sets
from dovetail_plugins.readers.uff_sets import parse_set
from support.waiting import PATIENCE, processor_time

FRF = dovetail.Frf(np.arange(1.0, 5.0), np.arange(4) + 1j, "accelerance")
RUN = "from dovetail.cli import main; main()"
SIMULATE = ("simulate", "--set", "k=3 MN/m", "--set", "c=40", "--overwrite", "-o", "a.png")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="names of bytes, locales and pipes are of POSIX")


def dovetail_command(folder: Path, *words: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command with safe paths, as the installed script has them."""
    path = os.pathsep.join(str(Path(module.__file__).parents[1]) for module in (dovetail,))
    plugins = str(Path(__file__).parents[2] / "plugins")
    return subprocess.run(
        [sys.executable, "-P", "-c", RUN, *map(str, words)],
        cwd=folder, capture_output=True, text=True, errors="surrogateescape", timeout=PATIENCE, check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([path, plugins]), **environment},
    )  # fmt: skip


@pytest.mark.parametrize("suffix", [".csv", ".uff", ".npz"])
def test_files_whose_names_are_not_utf_8_are_read_and_written(suffix: str, tmp_path: Path) -> None:
    source, target = tmp_path / f"m\udcffx{suffix}", tmp_path / f"again\udc80{suffix}"
    dovetail.write_frf(FRF, source)
    read = dovetail.read_frf(source)
    dovetail.write_frf(
        dovetail.Frf(read.frequency, read.values, read.quantity, label=read.label, note="\udcff a"), target
    )
    np.testing.assert_array_equal(dovetail.read_frf(target).values, FRF.values)


def test_settings_of_matplotlib_in_the_current_folder_are_not_read(tmp_path: Path, assemblies: Path) -> None:
    shutil.copy(assemblies / "sdof.yaml", tmp_path / "a.yaml")
    pictures = []
    for content in (b"\xff\xfe text.usetex: true", b"text.usetex: true\nlines.linewidth: 20\n"):
        (tmp_path / "matplotlibrc").write_bytes(content)
        done = dovetail_command(tmp_path, SIMULATE[0], "a.yaml", *SIMULATE[1:])
        assert done.returncode == 0, done.stderr
        assert done.stderr == "Written: a.png\n"
        pictures.append((tmp_path / "a.png").read_bytes())
    assert pictures[0] == pictures[1]


def test_names_in_unicode_work_in_another_locale(tmp_path: Path, assemblies: Path) -> None:
    shutil.copy(assemblies / "sdof.yaml", tmp_path / "\u00e9\u4e2d.yaml")
    plain = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    done = dovetail_command(tmp_path, "check", "\u00e9\u4e2d.yaml", **plain)
    assert done.returncode == 0, done.stderr
    done = dovetail_command(tmp_path, "check", "\u00e9\u4e2d.csv", **plain)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr


INPUTS = {
    "description": lambda pipe: dovetail.load(pipe.rename(pipe.with_suffix(".yaml"))),
    "base": lambda pipe: dovetail.load({"extends": str(pipe)}),
    "dataset": lambda pipe: dovetail.Dataset(pipe),
    "model": lambda pipe: dovetail.load_model(pipe),
    "plugin": lambda pipe: dovetail.load({}, plugins=pipe),
    "result": lambda pipe: load_result(pipe),
    "receptance": lambda pipe: dovetail.read_receptance(pipe),
    "matrices": lambda pipe: part(file=str(pipe.rename(pipe.with_suffix(".npz")))),
    "table of DOFs": lambda pipe: part(mass="m.mtx", stiffness="k.mtx", dofs=str(pipe)),
}


def part(**options: str) -> None:
    from dovetail_plugins.substructures.dof_table import read_dof_table
    from dovetail_plugins.substructures.matrix_files import read_archive

    if "dofs" in options:
        read_dof_table(Path(options["dofs"]), 2)
    read_archive(Path(options["file"]))


@pytest.mark.parametrize("name", INPUTS)
@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_a_pipe_or_a_device_as_an_input_is_refused_at_once(name: str, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "input"
    os.mkfifo(path) if kind == "pipe" else os.symlink("/dev/zero", path)
    start = processor_time()
    with pytest.raises(DovetailError):
        INPUTS[name](path)
    assert processor_time() - start < 5


def test_of_a_file_of_thousands_of_sets_only_headers_and_one_set_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each header is read once, and the data of one set; nothing is read of what stands around it."""
    sizes: list[int] = []

    def counted(content: bytes, **options: bool) -> dict[str, Any]:
        sizes.append(len(content))
        return parse_set(content, **options)

    for module in (uff_sets, uff_data):
        monkeypatch.setattr(module, "parse_set", counted)
    dovetail.write_frf(FRF, tmp_path / "one.uff")
    one = (tmp_path / "one.uff").read_bytes()
    (tmp_path / "many.uff").write_bytes(one * 2000)
    assert dovetail.read_frf(tmp_path / "many.uff", index=1999).values.size == 4
    assert len(sizes) <= 2000 + 2
    assert max(sizes) <= len(one)
