"""NASTRAN's bulk data: matrices (DMIG), nodes (GRID, SPOINT) and the DOFs of exported matrices (ASET, EXTRN)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dovetail import DofTable, MatrixMeaning, MatrixReader, RecordedMatrix, RecordedModel
from dovetail_plugins.matrix_readers.bulk_data import Card, cards, real, whole
from dovetail_plugins.matrix_readers.entries import DIRECTIONS_1_TO_6, matrix_of_entries
from dovetail_plugins.matrix_readers.nastran_grids import MOST_POINTS, Dof, Grids

_SETS = "GG|PP|AA|FF|LL|NN|TT|XX|HH|RR|SS|DD"
_NAME = re.compile(rf"^(K4|K|M|B)2?(?:{_SETS})X?\d*$")
"""Names of matrices of NASTRAN: a letter, and twice that of the set of DOFs."""
_MEANINGS: dict[str, MatrixMeaning] = {"K": "K", "M": "M", "B": "C", "K4": "D"}
_SQUARE, _SYMMETRIC = 1, 6
_COMPLEX = (3, 4)
_FOUND = re.compile(rb"^(?:GRID|DMIG|SPOINT|ASET1?|EXTRN)[ *,]", re.MULTILINE)


def matrix_meaning(name: str) -> MatrixMeaning | None:
    """Return what a matrix is by its customary name in NASTRAN, or None."""
    match = _NAME.match(name.upper())
    return _MEANINGS[match.group(1)] if match else None


class NastranBulkReader(MatrixReader):
    """DMIG matrices, and the nodes of a model, in the basic coordinate system.

    Without DMIG, the table of DOFs is that of an OUTPUT4 file of the same model. Its rows are the DOFs of ASET or EXTRN
    or, without those, six for each grid point and one for each scalar point, in the order of their numbers.
    """

    name = "nastran_bulk"
    summary = "DMIG matrices, nodes and DOFs in bulk data of NASTRAN"
    suffixes = (".pch", ".bdf", ".dat", ".nas", ".asm", ".blk")
    default_for = suffixes

    def sniff(self, content: bytes) -> bool:
        """Look for one of the entries."""
        return _FOUND.search(content) is not None

    def read(self, path: Path, content: bytes) -> RecordedModel:
        """Return matrices, DOFs and coordinates."""
        grids, matrices, chosen = Grids(), dict[str, _Dmig](), list[Dof]()
        for card in cards(content.decode("latin-1")):
            if card.name == "DMIG":
                _add_dmig(matrices, card)
            elif card.name in ("ASET", "ASET1", "EXTRN"):
                chosen += _chosen_dofs(card)
            else:
                grids.add(card)
        square = {name: matrix for name, matrix in matrices.items() if matrix.form in (_SQUARE, _SYMMETRIC)}
        dofs = sorted({dof for matrix in square.values() for pair in matrix.pairs for dof in pair})
        dofs = dofs or sorted(set(chosen)) or grids.dofs()
        if not dofs:
            raise ValueError("this is not bulk data of NASTRAN with DMIG, GRID, SPOINT, ASET or EXTRN.")
        nodes, directions = zip(*((str(node), str(component)) for node, component in dofs), strict=True)
        table = DofTable(nodes, directions, np.arange(len(dofs)), None, str(path))
        recorded = {name: matrix.recorded(name, dofs) for name, matrix in square.items()}
        points = grids.coordinates()
        places = {str(node): point for node, point in points.items()}
        frames = {str(node): axes for node, axes in grids.frames(points).items()}
        return RecordedModel(recorded, table, places, frames, DIRECTIONS_1_TO_6, has_units=False)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a spring between two nodes."""
        file = folder / "spring.pch"
        file.write_text(
            "DMIG    KAAX           0       6       2       0\n"
            "DMIG*   KAAX                           1               1\n"
            "*                      1               1 1.000000000D+06\n"
            "*                      2               1-1.000000000D+06\n"
            "DMIG*   KAAX                           2               1\n"
            "*                      2               1 1.000000000D+06\n"
            "GRID           1              0.      0.      0.\n"
            "GRID           2            100.      0.      0.\n"
        )
        return [file]


@dataclass
class _Dmig:
    """A matrix of DMIG entries: its form, the DOFs of row and column of each value, and the values."""

    form: int
    pairs: list[tuple[Dof, Dof]] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def recorded(self, name: str, dofs: Sequence[Dof]) -> RecordedMatrix:
        """Return the matrix over the given DOFs."""
        number = {dof: row for row, dof in enumerate(dofs)}
        places = np.array([(number[row], number[column]) for row, column in self.pairs], dtype=np.intp).reshape(-1, 2)
        labels = [f"component {component} of point {node} in {name}" for node, component in dofs]
        values = matrix_of_entries(places[:, 0], places[:, 1], np.array(self.values), labels)
        return RecordedMatrix(values, matrix_meaning(name), is_half=self.form == _SYMMETRIC)


def _add_dmig(matrices: dict[str, _Dmig], card: Card) -> None:
    """Add a header, or a column of a matrix.

    Raises
    ------
    ValueError
        The header is missing or repeated, or the matrix is complex.
    """
    name = card[0].upper()
    if card[1] == "0":
        if name in matrices:
            raise ValueError(f"line {card.line}: the matrix {name} begins a second time.")
        if whole(card[3], card) in _COMPLEX:
            raise ValueError(f"line {card.line}: the matrix {name} is complex.")
        matrices[name] = _Dmig(whole(card[2], card))
        return
    if name not in matrices:
        raise ValueError(f"line {card.line}: a column of {name} comes before its header 'DMIG {name} 0 ...'.")
    matrix, column = matrices[name], (whole(card[1], card), whole(card[2], card, 0))
    for first in range(4, len(card.fields), 4):
        if card[first]:
            row = whole(card[first], card), whole(card[first + 1], card, 0)
            matrix.pairs.append((row, column))
            matrix.values.append(real(card[first + 2], card))


def _chosen_dofs(card: Card) -> list[Dof]:
    """Return the DOFs that ASET, ASET1 or EXTRN names.

    Raises
    ------
    ValueError
        It names more points than a model can have.
    """
    if card.name != "ASET1":
        pairs = [(card[at], card[at + 1]) for at in range(0, len(card.fields), 2) if card[at]]
        return [dof for point, components in pairs for dof in _dofs(whole(point, card), components)]
    points = [each for each in card.fields[1:] if each]
    if len(points) == 3 and points[1].upper() == "THRU":
        first, last = whole(points[0], card), whole(points[2], card)
        if last - first > MOST_POINTS:
            raise ValueError(f"line {card.line}: ASET1 names {last - first} points.")
        points = [str(each) for each in range(first, last + 1)]
    return [dof for point in points for dof in _dofs(whole(point, card), card[0])]


def _dofs(point: int, components: str) -> list[Dof]:
    return [(point, int(one)) for one in components or "0" if one.isdigit()]
