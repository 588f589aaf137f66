"""Archives of matrices (NPZ, MATLAB) and Matrix Market files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dovetail import MatrixMeaning, MatrixReader, RecordedMatrix, RecordedModel
from dovetail_plugins.substructures.dof_table import table_in
from dovetail_plugins.substructures.matrix_files import archive_arrays, matrix_in, matrix_market
from dovetail_plugins.substructures.matrix_remarks import comments_in, texts_in, warn_of_unused

_SPRING = 1e6 * np.array([[1.0, -1.0], [-1.0, 1.0]])


class ArchiveReader(MatrixReader):
    """Arrays M, K, C and D of an archive, full or in parts of scipy's sparse arrays, and the table of DOFs."""

    name = "matrix_archive"
    summary = "Archives of matrices (NPZ, MATLAB up to version 7)"
    suffixes = (".npz", ".mat")
    default_for = (".npz", ".mat")

    def sniff(self, content: bytes) -> bool:
        """Look for the signatures of both formats."""
        return content.startswith((b"PK\x03\x04", b"MATLAB 5.0"))

    def read(self, path: Path, content: bytes) -> RecordedModel:
        """Return the matrices that are there, and the table."""
        archive = archive_arrays(path, content)
        meanings: tuple[MatrixMeaning, ...] = ("M", "K", "C", "D")
        arrays = {name: matrix_in(archive, name, str(path)) for name in meanings}
        matrices: dict[str, RecordedMatrix] = {
            name: RecordedMatrix(values, name) for name, values in arrays.items() if values is not None
        }
        if missing := [name for name in ("M", "K") if name not in matrices]:
            names = ", ".join(sorted(archive)[:12]) or "nothing"
            raise ValueError(f"there is no matrix '{missing[0]}'; there is: {names}.")
        shape = np.shape(arrays["K"])
        table = table_in(archive, str(path), shape[0] if shape else 0)
        warn_of_unused(archive, shape, str(path))
        return RecordedModel(matrices, table, texts=[*texts_in(archive, str(path))])

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a spring between two masses."""
        file = folder / "spring.npz"
        np.savez(file, M=0.1 * np.eye(2), K=_SPRING, nodes=["1", "2"], directions=["x", "x"])
        return [file]


class MatrixMarketReader(MatrixReader):
    """One matrix in NIST's exchange format, without names of its rows."""

    name = "matrix_market"
    summary = "Matrix Market (.mtx)"
    suffixes = (".mtx",)
    default_for = (".mtx",)

    def sniff(self, content: bytes) -> bool:
        """Look for the first line."""
        return content.startswith(b"%%MatrixMarket")

    def read(self, path: Path, content: bytes) -> RecordedModel:
        """Return the matrix and the comments in front of it."""
        values = matrix_market(path, content)
        return RecordedModel({path.name: RecordedMatrix(values)}, texts=[*comments_in(content, str(path))])

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a spring between two nodes."""
        file = folder / "spring.mtx"
        head = "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n"
        file.write_text(head + "1 1 1.0e6\n2 1 -1.0e6\n2 2 1.0e6\n")
        return [file]
