"""Calls of libraries in C that read binary files, for a process of its own; it imports nothing of Dovetail."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np


def full_parts(path: Path, content: bytes) -> dict[str, Any]:  # noqa: ARG001
    """Return the entries of K and M of a ``.full`` file of Ansys, and the node and DOF of each row.

    Raises
    ------
    ValueError
        A matrix is missing.
    """
    from ansys.mapdl.reader import read_binary

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "file.full"
        file.write_bytes(content)
        dofs, stiffness, mass = read_binary(str(file)).load_km(sort=False)
    parts: dict[str, Any] = {"dofs": np.asarray(dofs)}
    for name, matrix in (("K", stiffness), ("M", mass)):
        if matrix is None:
            raise ValueError(f"the file has no matrix {name}: run a modal analysis.")
        parts |= _entries(name, matrix)
    return parts


def _entries(name: str, matrix: Any) -> dict[str, Any]:
    entries = matrix.tocoo()
    return {f"{name} data": entries.data, f"{name} row": entries.row, f"{name} column": entries.col}
