"""Files of every format that state a unit, a quantity or anything else in one given place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from scipy.io import savemat

from support.labview_files import HEADER, SEGMENT
from support.matlab_files import matlab_7_3
from support.measured_files import set_58, write_sets

FREQUENCY = 10.0 + 2.5 * np.arange(12)
VALUES = (1 + 2j) / FREQUENCY


class Said(NamedTuple):
    """What a file says: lines around the table, texts and numbers under names, labels and units of its columns."""

    lines: tuple[str, ...] = ()
    texts: dict[str, str | float] = {}  # noqa: RUF012
    names: tuple[str, str] = ("Real", "Imag")
    units: tuple[str, str] = ("", "")
    frequency: str = "Frequency"
    below: bool = False


def with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def csv(path: Path, said: Said) -> Path:
    units = ("", "") if said.below else said.units
    cells = [said.frequency, *map(with_unit, said.names, units)]
    below = [",".join(("Hz", *said.units))] if said.below else []
    rows = [f"{f:.17g},{v.real:.17g},{v.imag:.17g}" for f, v in zip(FREQUENCY, VALUES, strict=True)]
    path.write_text("\n".join([*said.lines, ",".join(cells), *below, *rows]) + "\n", encoding="utf-8")
    return path


def tsv(path: Path, said: Said) -> Path:
    csv(path, said._replace(lines=()))
    path.write_text("".join(f"{line}\n" for line in said.lines) + path.read_text().replace(",", "\t"))
    return path


def with_footer(path: Path, said: Said) -> Path:
    csv(path, said._replace(lines=()))
    path.write_text(path.read_text() + "".join(f"{line}\n" for line in said.lines), encoding="utf-8")
    return path


def lvm(path: Path, said: Said) -> Path:
    segment = SEGMENT.replace("m/s^2/N", "{}").format(*said.units)
    segment = segment.replace("FRF (Real)", f"FRF ({said.names[0]})").replace("FRF (Imag)", f"FRF ({said.names[1]})")
    entries = "".join(f"{key}\t{text}\t{text}\t\n" for key, text in said.texts.items())
    rows = "".join(f"{f:.17g}\t{v.real:.17g}\t{v.imag:.17g}\n" for f, v in zip(FREQUENCY, VALUES, strict=True))
    path.write_text(HEADER + segment.replace("X0\t", f"{entries}X0\t").partition("10.0\t1.5")[0] + rows)
    return path


def cutpro(path: Path, said: Said) -> Path:
    labels = f"Freq Hz {said.names[0]} {said.units[0]} {said.names[1]} {said.units[1]}"
    rows = [f"{f:.17g} {v.real:.17g} {v.imag:.17g}" for f, v in zip(FREQUENCY, VALUES, strict=True)]
    path.write_text("\n".join([f"{rows[0]} {labels}", *rows[1:]]) + "\n")
    return path


def npz(path: Path, said: Said) -> Path:
    np.savez(path, frequency=FREQUENCY, H=VALUES, **said.texts)
    return path


def npy(path: Path, said: Said) -> Path:
    real, imag = said.names
    kinds = [("frequency", float), (real, float), (imag, float)]
    np.save(path, np.array([*zip(FREQUENCY, VALUES.real, VALUES.imag, strict=True)], dtype=kinds))
    return path


def mat_5(path: Path, said: Said) -> Path:
    savemat(path, {"frequency": FREQUENCY, "H": VALUES, **said.texts})
    return path


def mat_7_3_file(path: Path, said: Said) -> Path:
    return matlab_7_3(path, frequency=FREQUENCY, H=VALUES, **said.texts)


def mat_struct(path: Path, said: Said) -> Path:
    savemat(path, {"test": {"frequency": FREQUENCY, "H": VALUES, **said.texts}})
    return path


def hdf5(path: Path, said: Said) -> Path:
    with h5py.File(path, "w") as file:
        file["frequency"], file["H"] = FREQUENCY, VALUES
        for name, text in said.texts.items():
            file[name] = text
    return path


def attributes(path: Path, said: Said, place: str = "test/H") -> Path:
    with h5py.File(path, "w") as file:
        file["test/frequency"], file["test/H"] = FREQUENCY, VALUES
        for name, text in said.texts.items():
            file[place].attrs[name] = text
    return path


def of_group(path: Path, said: Said) -> Path:
    return attributes(path, said, "test")


def of_file(path: Path, said: Said) -> Path:
    return attributes(path, said, "/")


def uff(path: Path, said: Said, binary: int = 0) -> Path:
    fields = {f"id{number}": text for number, text in enumerate(said.lines, start=1)}
    labels = {"ordinate_spec_data_type": 0, "orddenom_spec_data_type": 13, "orddenom_axis_lab": "Force"}
    labels |= {name: str(text) for name, text in said.texts.items()}
    return write_sets(path, set_58(FREQUENCY, VALUES, binary=binary, **(labels | fields)))


def binary_uff(path: Path, said: Said) -> Path:
    return uff(path, said, binary=1)


Writer = Callable[[Path, Said], Path]
LINES: dict[str, tuple[str, Writer]] = {
    "csv": ("a.csv", csv),
    "txt": ("a.txt", tsv),
    "tsv": ("a.tsv", tsv),
    "footer": ("a.csv", with_footer),
    "uff": ("a.uff", uff),
    "binary uff": ("a.unv", binary_uff),
}
"""Formats with lines of text."""
TEXTS: dict[str, tuple[str, Writer]] = {
    "npz": ("a.npz", npz),
    "mat 5": ("a.mat", mat_5),
    "mat 7.3": ("a.mat", mat_7_3_file),
    "struct": ("a.mat", mat_struct),
    "hdf5": ("a.h5", hdf5),
    "attribute": ("a.h5", attributes),
    "attribute of the group": ("a.hdf5", of_group),
    "attribute of the file": ("a.h5", of_file),
    "lvm": ("a.lvm", lvm),
}
"""Formats with texts and numbers under names."""
COLUMNS: dict[str, tuple[str, Writer]] = {
    "csv": ("a.csv", csv),
    "tsv": ("a.tsv", tsv),
    "lvm": ("a.lvm", lvm),
    "cutpro": ("a.frf", cutpro),
}
"""Formats whose columns have a name and a unit."""
