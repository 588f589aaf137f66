"""Matrices of Ansys: Harwell-Boeing files of HBMAT, their mapping, lists of nodes, and the binary ``.full`` file."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from dovetail import (
    Direction,
    DofTable,
    MatrixMeaning,
    MatrixReader,
    RecordedMatrix,
    RecordedModel,
    call_guarded,
    require_package,
)
from dovetail_plugins.matrix_readers.entries import sparse_parts
from dovetail_plugins.matrix_readers.guarded_libraries import full_parts
from dovetail_plugins.matrix_readers.harwell_boeing import read_harwell_boeing

DIRECTIONS: dict[Direction, str] = {"x": "UX", "y": "UY", "z": "UZ", "rx": "ROTX", "ry": "ROTY", "rz": "ROTZ"}
_MEANINGS: dict[str, MatrixMeaning] = {"stiffness": "K", "mass": "M", "damping": "C"}
_HEADER = re.compile(rb"\A[^\n]*\n(?:[ \t]*\d+){3,5}[ \t\r]*\n[RrCcPp][SsUuHhZzRr][AaEe] ")
_MAPPING = re.compile(rb"\A\s*Matrix Eqn\s+Node\s+DOF", re.IGNORECASE)
_NODE = re.compile(rb"\s*\d+(?:[ \t]+[-+]?[\d.][\d.eEdD+-]*)*[ \t\r]*(?:\n|\Z)")
_WORDS = (*DIRECTIONS.values(),)
_LENGTH, _FULL = struct.pack("<i", 100), struct.pack("<i", 4)
"""Words in the first record, and the number that marks a file of assembled matrices."""
_MEMORY = 12 << 30
"""Address space for the library that reads ``.full`` files, which loads VTK."""


class HarwellBoeingReader(MatrixReader):
    """A square real matrix in Harwell-Boeing format, as ``HBMAT`` and ``*EXPORT`` of Ansys write it in ASCII."""

    name = "harwell_boeing"
    summary = "Harwell-Boeing matrices, as of HBMAT of Ansys"
    suffixes = (".matrix", ".hb", ".rsa", ".rua")
    default_for = (".matrix", ".hb", ".rsa", ".rua")

    def sniff(self, content: bytes) -> bool:
        """Look for the type of the matrix in the third line."""
        return _HEADER.match(content) is not None

    def read(self, path: Path, content: bytes) -> RecordedModel:
        """Return the matrix; its title says which one it is."""
        title, matrix, is_half = read_harwell_boeing(content)
        meaning = next((meaning for word, meaning in _MEANINGS.items() if title.lower().startswith(word)), None)
        matrices = {path.name: RecordedMatrix(matrix, meaning, is_half)}
        return RecordedModel(matrices, axes=DIRECTIONS, has_units=False, texts=[(title, f"{path}:1")])

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a spring between two nodes."""
        file = folder / "K.matrix"
        pointers, rows, values = (1, 3, 4), (1, 2, 2), ("0.1D+07", "-0.1D+07", "0.1D+07")
        lines = ["Stiffness matrix from ANSYS FULL file dumped into Harwell-Boeing format".ljust(80)]
        lines += [
            "".join(f"{number:14d}" for number in (9, 3, 3, 3, 0)),
            "RSA" + " " * 11 + f"{2:14d}{2:14d}{3:14d}{0:14d}",
        ]
        lines += ["(I14)           (I14)           (d25.15)            (d25.15)            "]
        lines += [f"{number:14d}" for number in (*pointers, *rows)] + [f"{value:>25}" for value in values]
        file.write_text("\n".join(lines) + "\n")
        return [file]


class AnsysMappingReader(MatrixReader):
    """The mapping that ``HBMAT`` writes with a matrix: the node and the DOF of each row."""

    name = "ansys_mapping"
    summary = "DOFs of the rows of a matrix of Ansys (.mapping)"
    suffixes = (".mapping",)
    default_for = (".mapping",)

    def sniff(self, content: bytes) -> bool:
        """Look for the first line."""
        return _MAPPING.match(content) is not None

    def read(self, path: Path, content: bytes) -> RecordedModel:
        """Return the table of DOFs."""
        if not self.sniff(content):
            raise ValueError("the first line is not 'Matrix Eqn  Node  DOF'.")
        cells = [line.split() for line in content.decode("ascii", "replace").splitlines()[1:] if line.strip()]
        if any(len(line) != 3 or not line[0].isdigit() or not line[1].isdigit() for line in cells) or not cells:
            raise ValueError("a line is not the number of a row, a node and the name of a DOF.")
        rows = np.array([int(row) for row, _, _ in cells], dtype=np.intp) - 1
        nodes, directions = tuple(node for _, node, _ in cells), tuple(direction for _, _, direction in cells)
        return RecordedModel(table=DofTable(nodes, directions, rows, None, str(path)), axes=DIRECTIONS, has_units=False)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write the rows of a spring."""
        file = folder / "K.mapping"
        file.write_text("    Matrix Eqn          Node    DOF     \n             1             1    UX  \n"
                        "             2             2    UX  \n")  # fmt: skip
        return [file]


class AnsysNodesReader(MatrixReader):
    """A list of nodes in global Cartesian coordinates, as ``NWRITE`` writes it."""

    name = "ansys_nodes"
    summary = "Coordinates of nodes from NWRITE of Ansys (.node)"
    suffixes = (".node", ".nodes")
    default_for = (".node", ".nodes")

    def sniff(self, content: bytes) -> bool:
        """Look for a line of numbers."""
        return _NODE.match(content) is not None

    def read(self, path: Path, content: bytes) -> RecordedModel:  # noqa: ARG002
        """Return the coordinates; zeros at the end of a line are left out."""
        points: dict[str, tuple[float, float, float]] = {}
        for line in (line.split() for line in content.decode("ascii", "replace").splitlines() if line.strip()):
            try:
                label, *numbers = int(line[0]), *map(float, line[1:])
            except ValueError:
                raise ValueError(f"'{' '.join(line)[:60]}' is not a node: a number and three coordinates.") from None
            if len(numbers) > 6:
                raise ValueError(f"node {label} has {len(numbers)} numbers, not three coordinates and three angles.")
            x, y, z, *angles = *numbers, *[0.0] * (6 - len(numbers))
            if any(angles):
                raise ValueError(f"the DOFs of node {label} are turned (NROTAT); export them along the global axes.")
            if str(label) in points:
                raise ValueError(f"node {label} is given twice.")
            points[str(label)] = (x, y, z)
        if not points:
            raise ValueError("there are no nodes.")
        return RecordedModel(points=points, has_units=False)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write two nodes."""
        file = folder / "job.node"
        file.write_text("        1\n        2  100.000000000000      1.00000000000000\n")
        return [file]


class AnsysFullReader(MatrixReader):
    """The file of assembled matrices of an analysis, with the DOFs of the rows, by ansys-mapdl-reader.

    DOFs that a constraint holds are left out.
    """

    name = "ansys_full"
    summary = "Assembled matrices of Ansys (.full), by ansys-mapdl-reader"
    suffixes = (".full",)
    default_for = (".full",)
    package = "ansys"

    def sniff(self, content: bytes) -> bool:
        """Look for the length of the first record and the number of the file, 4."""
        return len(content) > 12 and content[:4] == _LENGTH and content[8:12] == _FULL

    def read(self, path: Path, content: bytes) -> RecordedModel:
        """Return K and M and their DOFs."""
        require_package("ansys", "ansys", str(path), load=False)
        parts = call_guarded(full_parts, path, content, memory=_MEMORY, seconds=120.0)
        nodes, numbers = parts["dofs"].T
        directions = tuple(_WORDS[number] if number < len(_WORDS) else f"DOF{number}" for number in numbers)
        table = DofTable(tuple(map(str, nodes)), directions, np.arange(len(nodes)), None, str(path))
        matrices = {
            name: RecordedMatrix(sparse_parts(parts, name, len(nodes)), name, is_half=True) for name in ("K", "M")
        }
        return RecordedModel(matrices, table, axes=DIRECTIONS, has_units=False)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Copy the example of the library."""
        spec = find_spec("ansys.mapdl.reader")
        example = Path(str(spec and spec.origin)).parent / "examples" / "file.full"
        file = folder / "file.full"
        file.write_bytes(example.read_bytes())
        return [file]
