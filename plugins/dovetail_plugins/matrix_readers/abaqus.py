"""Matrices of Abaqus (``*MATRIX OUTPUT``), and the nodes of its input files."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from dovetail import DofTable, MatrixMeaning, MatrixReader, RecordedMatrix, RecordedModel
from dovetail_plugins.matrix_readers.entries import DIRECTIONS_1_TO_6, matrix_of_entries, whole_numbers

_MEANINGS: dict[str, MatrixMeaning] = {"STIF": "K", "MASS": "M", "DMPV": "C", "DMPS": "D"}
_FILE_NAME = re.compile(r"_(STIF|MASS|DMPV|DMPS)\d*$", re.IGNORECASE)
"""How Abaqus ends the name of a file of matrices: that of the job, the matrix, the number of the step."""
_NUMBER = rb"[ \t]*[-+]?\d[\d.eEdD+-]*[ \t]*"
_ENTRY = re.compile(
    rb"(?:\A|\n)(?:[ \t]*\*\*[^\n]*\n)*(?:"
    + rb",".join([_NUMBER] * 5)
    + rb"|[ \t]*[-+]?\d\S*(?:[ \t]+[-+]?\d\S*){2}[ \t\r]*)[\r\n]"
)
_MOST_DOFS = 2_000_000
"""Which bounds the memory."""
_HELD = 1e35
"""Diagonal entry above which Abaqus holds a DOF, by a stiffness of 1e36."""
_NOT_GLOBAL = {
    "*SYSTEM": "nodes in a coordinate system of their own",
    "*TRANSFORM": "directions of nodes that are not those of the model",
    "*INCLUDE": "parts of the model in other files",
    "*NGEN": "nodes that it does not list",
    "*NCOPY": "nodes that it does not list",
}


class AbaqusMatrixReader(MatrixReader):
    """Entries between nodes and DOFs (FORMAT=MATRIX INPUT, the default, or LABELS) or rows (FORMAT=COORDINATE).

    Symmetric matrices have one half. Nodes with negative labels are internal ones of elements.
    """

    name = "abaqus_matrix"
    summary = "Matrices of Abaqus (*MATRIX OUTPUT, .mtx)"
    suffixes = (".mtx",)

    def sniff(self, content: bytes) -> bool:
        """Look for a line of five numbers with commas, or of three."""
        return not content.startswith(b"%%") and (_ENTRY.match(content) is not None or _is_substructure(content))

    def read(self, path: Path, content: bytes) -> RecordedModel:
        """Return the matrix, and the DOFs of its rows unless they are numbered only."""
        if _is_substructure(content):
            raise ValueError(
                "the file is of *SUBSTRUCTURE MATRIX OUTPUT: write it by *MATRIX GENERATE, *MATRIX OUTPUT."
            )
        if not any(line.strip() and not line.lstrip().startswith(b"*") for line in content.splitlines()):
            raise ValueError("the file has no entries.")
        lines = np.loadtxt(io.BytesIO(content.replace(b",", b" ")), comments="*", ndmin=2)
        if lines.shape[1] == 3:
            return self._coordinates(path, lines)
        if lines.shape[1] != 5:
            raise ValueError(f"the lines have {lines.shape[1]} numbers, not 5 (node, DOF, node, DOF, entry) or 3.")
        pairs = whole_numbers(lines[:, :4], "the label of a node or DOF").reshape(-1, 2)
        dofs, index = np.unique(pairs, axis=0, return_inverse=True)
        rows, columns = index.reshape(-1, 2).T
        labels = [f"DOF {direction} of node {node}" for node, direction in dofs]
        matrix = matrix_of_entries(rows, columns, lines[:, 4], labels)
        if (held := np.flatnonzero(matrix.diagonal() > _HELD)).size:
            raise ValueError(
                f"{labels[held[0]]} is held by a boundary condition, a stiffness of {matrix.diagonal()[held[0]]:g}. "
                "Export the matrices without boundary conditions, and hold the part by a joint."
            )
        nodes, directions = (tuple(map(str, column)) for column in dofs.T)
        table = DofTable(nodes, directions, np.arange(len(dofs)), None, str(path))
        recorded = RecordedMatrix(matrix, _meaning(path), is_half=True)
        return RecordedModel({path.name: recorded}, table, axes=DIRECTIONS_1_TO_6, has_units=False)

    def _coordinates(self, path: Path, lines: np.ndarray) -> RecordedModel:
        """Return a matrix whose rows are numbered from 1."""
        numbers = whole_numbers(lines[:, :2], "the number of a row or column")
        if numbers.min() < 1:
            raise ValueError(f"the number of a row or column is {numbers.min()}: they count from 1.")
        if numbers.max() > _MOST_DOFS:
            raise ValueError(f"there is a row {numbers.max()}; matrices of up to {_MOST_DOFS} rows are read.")
        labels = [f"row {row}" for row in range(1, int(numbers.max()) + 1)]
        matrix = matrix_of_entries(numbers[:, 0] - 1, numbers[:, 1] - 1, lines[:, 2], labels)
        recorded = RecordedMatrix(matrix, _meaning(path), is_half=True)
        return RecordedModel({path.name: recorded}, axes=DIRECTIONS_1_TO_6, has_units=False)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a spring between two nodes in both formats."""
        by_labels, by_rows = folder / "job_STIF1.mtx", folder / "rows.mtx"
        by_labels.write_text("1,1, 1,1,  1.0e+06\n2,1, 1,1, -1.0e+06\n2,1, 2,1,  1.0e+06\n")
        by_rows.write_text("1 1 1.0e+06\n2 1 -1.0e+06\n2 2 1.0e+06\n")
        return [by_labels, by_rows]


class AbaqusInputReader(MatrixReader):
    """The coordinates of ``*NODE`` in a flat input file, without parts and instances."""

    name = "abaqus_input"
    summary = "Coordinates of nodes in an input file of Abaqus (.inp)"
    suffixes = (".inp",)

    def sniff(self, content: bytes) -> bool:
        """Look for a keyword at the beginning of a line."""
        return re.search(rb"^\s*\*[A-Za-z]", content, re.MULTILINE) is not None

    def read(self, path: Path, content: bytes) -> RecordedModel:  # noqa: ARG002
        """Return the coordinates of the nodes."""
        points: dict[str, tuple[float, float, float]] = {}
        for keyword, lines in _blocks(content.decode("latin-1")):
            name, _, options = keyword.upper().replace(" ", "").partition(",")
            if name in _NOT_GLOBAL:
                raise ValueError(f"the file has {_NOT_GLOBAL[name]} ({name}); write a flat input file.")
            if name == "*INSTANCE" and any(line.strip() for line in lines):
                raise ValueError("an instance is moved; write a flat input file, without parts and instances.")
            if name == "*NODE":
                _add_nodes(points, options, lines)
        if not points:
            raise ValueError("the file has no *NODE.")
        return RecordedModel(points=points, has_units=False)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write two nodes."""
        file = folder / "job.inp"
        file.write_text("*HEADING\na spring\n*NODE, NSET=all\n1, 0., 0., 0.\n2, 100., 0., 0.\n")
        return [file]


def _is_substructure(content: bytes) -> bool:
    return re.search(rb"^\*(USER ELEMENT|MATRIX, *TYPE)", content[:4096], re.MULTILINE | re.IGNORECASE) is not None


def _meaning(path: Path) -> MatrixMeaning | None:
    """Return what matrix a file has by the name that Abaqus gave it."""
    match = _FILE_NAME.search(path.stem)
    return _MEANINGS[match.group(1).upper()] if match else None


def _blocks(text: str) -> Iterator[tuple[str, list[str]]]:
    """Yield the keywords of an input file with their data lines."""
    keyword, lines = "", list[str]()
    for line in text.splitlines():
        if line.lstrip().startswith("**"):
            continue
        if line.lstrip().startswith("*"):
            yield keyword, lines
            keyword, lines = line.strip(), []
        else:
            lines.append(line)
    yield keyword, lines


def _add_nodes(points: dict[str, tuple[float, float, float]], options: str, lines: Sequence[str]) -> None:
    """Add the nodes of a block; a node that is given twice must be at one point.

    Raises
    ------
    ValueError
        A line is not a node, or a node has two places.
    """
    if "INPUT=" in options or "SYSTEM=" in options:
        raise ValueError(f"*NODE has the option {options}; list the nodes in global coordinates in this file.")
    for line in (line for line in lines if line.strip()):
        cells = [cell.strip() for cell in line.split(",")]
        try:
            label, coordinates = int(cells[0]), [float(cell or 0.0) for cell in cells[1:4]]
        except ValueError:
            raise ValueError(f"'{line.strip()[:60]}' is not a node: a label and three coordinates.") from None
        x, y, z = [*coordinates, 0.0, 0.0, 0.0][:3]
        if points.setdefault(str(label), (x, y, z)) != (x, y, z):
            raise ValueError(
                f"node {label} is given twice, at {points[str(label)]} and {(x, y, z)}: labels of several parts? "
                "Write a flat input file, without parts and instances."
            )
