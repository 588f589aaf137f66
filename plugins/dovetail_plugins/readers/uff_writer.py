"""FRFs written to universal files with pyuff, each set into a separate empty file."""

from __future__ import annotations

import re
import struct
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import Fault, Frf, FrfToWrite, MeasurementError
from dovetail_plugins.readers.uff_sets import COHERENCE, DIRECTIONS, FORCE, FRF, GENERAL, ORDINATE

VARIANCE = "variance of the FRF"
"""First words in the id line of a set with the variance of each line."""
_BYTE_COUNT = slice(38, 50)
"""Position of the number of data bytes in the first set of a file, if it is binary."""
_DOF = re.compile(r"(?:([^\s:]{1,10}):)?(\d{1,9})(?:([+-]?)(rx|ry|rz|x|y|z))?", re.IGNORECASE)
"""Substructure, node, sense and direction."""
_CODES = {name: code for code, name in DIRECTIONS.items() if name}


def encode(content: FrfToWrite, path: Path, binary: bool | None) -> bytes:
    """Return a universal file: the FRF, then its coherence and its variance as sets of the same points.

    An unknown DOF is written as node 0 without a direction. A DOF whose name does not look like ``5+x`` or ``tool:5+x``
    is written into an id line; its direction, as that of ``tool, 20 mm, x``, into the header too. If response and force
    have opposite senses, the values have the sign that belongs to these senses.

    Raises
    ------
    MeasurementError
        A single line, or `binary` is false and six digits cannot represent the frequencies.
    """
    frf = content.frf
    if frf.frequency.size < 2:
        raise MeasurementError(Fault(str(path), "a universal file needs two lines or more.", ".csv, .npz"))
    spacing = _spacing(frf.frequency)
    if spacing is None and binary is False:
        raise MeasurementError(
            Fault(
                str(path),
                "the six digits that ASCII gives to frequencies cannot hold these.",
                remedy="Write .csv, .npz or binary UFF.",
            )
        )
    common = {
        "type": 58,
        "binary": int(spacing is None if binary is None else binary),
        "x": frf.frequency,
        "abscissa_spacing": spacing or 0,
        "id1": _id_line(frf.note or frf.label),
        **_dofs(frf),
        "abscissa_spec_data_type": 18,
        "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz",
    }
    real = {"orddenom_spec_data_type": 0}
    file = _encode_set(common | _response(content))
    if frf.coherence is not None:
        file += _encode_set(common | {"func_type": COHERENCE, "data": frf.coherence, **real})
    if content.variance is not None:
        file += _encode_set(common | {"func_type": GENERAL, "id1": VARIANCE, "data": content.variance, **real})
    return file


def _response(content: FrfToWrite) -> dict[str, Any]:
    frf = content.frf
    number, name, unit = ORDINATE[frf.quantity]
    motion = f"rad{unit[1:]}" if frf.rotation else unit
    load = "N m" if frf.by_moment else "N"
    dofs = _dofs(frf)
    sign = -1.0 if dofs["rsp_dir"] * dofs["ref_dir"] < 0 else 1.0
    response = {
        "func_type": FRF,
        "data": sign * content.values if frf.has_phase else np.abs(content.values),
        "ordinate_spec_data_type": number,
        "ordinate_axis_lab": name,
        "ordinate_axis_units_lab": motion if content.factor == 1.0 else _id_line(content.unit),
        "orddenom_spec_data_type": FORCE,
        "orddenom_axis_lab": "Moment" if frf.by_moment else "Force",
        "orddenom_axis_units_lab": load if content.factor == 1.0 else "NONE",
    }
    return response if frf.averages is None else response | {"id2": f"averages: {frf.averages}"}


def _dofs(frf: Frf) -> dict[str, Any]:
    """Return the fields that name the DOFs."""
    fields: dict[str, Any] = {}
    for end, line, key, name in (("rsp", "id4", "response", frf.response), ("ref", "id5", "force", frf.force)):
        match = _DOF.fullmatch(name)
        if name and not match:
            fields[line] = _id_line(f"{key}: {name}")
        axis = (match[4] or "") if match else name.rpartition(", ")[2]
        code = _CODES.get(axis.lower(), 0)
        if match and match[1]:
            fields[f"{end}_ent_name"] = name[: len(match[1])]
        fields[f"{end}_node"] = int(match[2]) if match else 0
        fields[f"{end}_dir"] = -code if match and match[3] == "-" else code
    return fields


def _spacing(frequency: NDArray[np.float64]) -> int | None:
    """Return 1 or 0 if six digits can represent the frequencies with even or uneven spacing, else None."""
    first, step = (float(f"{value:.5e}") for value in (frequency[0], frequency[1] - frequency[0]))
    if np.allclose(first + step * np.arange(frequency.size), frequency, rtol=1e-12, atol=0.0):
        return 1
    if all(float(f"{value:.5e}") == value for value in frequency.tolist()):
        return 0
    return None


def _id_line(label: str) -> str:
    printable = "".join(c if 32 <= ord(c) < 127 else {"µ": "u", "μ": "u", "²": "^2"}.get(c, "?") for c in label)
    return printable.strip()[:80] or "NONE"


def _encode_set(dataset: dict[str, Any]) -> bytes:
    """Return the bytes of one set, which pyuff writes into an empty file, with the byte count corrected."""
    import pyuff

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "set.uff")
        pyuff.UFF(str(file)).write_sets(dict(dataset), mode="add")
        content = bytearray(file.read_bytes())
    if dataset["binary"]:
        numbers = (2 if np.iscomplexobj(dataset["data"]) else 1) + (dataset["abscissa_spacing"] == 0)
        content[_BYTE_COUNT] = b"%12d" % (struct.calcsize("d") * numbers * len(dataset["data"]))
    return bytes(content)
