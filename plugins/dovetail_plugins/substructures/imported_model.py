"""Matrices, DOFs and coordinates of a part, joined from the files that a description names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import Direction, DofTable, DovetailError, Fault, RecordedMatrix, RecordedModel, read_matrices
from dovetail_plugins.substructures.dof_table import read_dof_table
from dovetail_plugins.substructures.matrix_files import sound_matrix

NAMES = {"M": "mass", "K": "stiffness", "C": "damping", "D": "structural_damping"}
"""Matrices, and the options for separate files and names."""
_SAME_POINT = 1e-6
"""Largest distance, over the size of the part, of two places of one node; printed coordinates are rounded."""


@dataclass(frozen=True, eq=False)
class ImportedModel:
    """What the files of a part contain together, in their units.

    Parameters
    ----------
    matrices : mapping of str to (d, d) scipy.sparse array
        M, K and perhaps C and D, symmetric.
    where : mapping of str to str
        The file of each matrix.
    table : DofTable
    axes : mapping of str to str
        The format's words for directions.
    has_units : bool
    texts : sequence of (str, str)
    """

    matrices: Mapping[str, Any]
    where: Mapping[str, str]
    table: DofTable
    axes: Mapping[Direction, str]
    has_units: bool
    texts: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class SourceFiles:
    """Files and names of a description.

    Parameters
    ----------
    matrices : mapping of str to str
        File of each matrix, by M, K, C and D.
    names : mapping of str to str
        Names in the files of some of the matrices.
    dofs, coordinates : str, optional
        Files with the table of DOFs, and with coordinates of nodes.
    are_separate : bool
        A file was given for each matrix, which then has to be there.
    """

    matrices: Mapping[str, str]
    names: Mapping[str, str] = field(default_factory=dict)
    dofs: str | None = None
    coordinates: str | None = None
    are_separate: bool = False


def import_model(files: SourceFiles) -> ImportedModel:
    """Read the files of a part.

    Raises
    ------
    DovetailError
        A file cannot be read, a matrix or the table of DOFs is missing, or two files contradict each other.
    """
    read = cache(read_matrices)
    models = {name: read(file) for name, file in files.matrices.items()}
    chosen = {
        name: found for name, model in models.items() if (found := _chosen(name, model, files, files.matrices[name]))
    }
    where = {name: files.matrices[name] for name in chosen}
    for first, second in combinations(chosen, 2):
        if chosen[first] is chosen[second]:
            problem = f"the same matrix is given as '{NAMES[first]}' and as '{NAMES[second]}'."
            raise DovetailError(Fault(where[second], problem, remedy="Name the file, or the matrix, of each."))
    tables = [models[name].table for name in chosen]
    joined: DofTable | None
    if all(table is not None for table in tables) and len(set(where.values())) > 1:
        joined, values = _joined(chosen, dict(zip(chosen, tables, strict=True)), where)
    else:
        joined, values = tables[list(chosen).index("K")], {name: matrix.values for name, matrix in chosen.items()}
    matrices = {name: sound_matrix(name, matrix, where[name]) for name, matrix in values.items()}
    _check_sizes(matrices, where)
    others = [read(file) for file in (files.dofs, files.coordinates) if file and not _is_table(file)]
    sources = [*dict.fromkeys([*models.values(), *others])]
    table = _table(files, joined, matrices["K"].shape[0], read, where["K"])
    axes = next((model.axes for model in sources if model.axes), {})
    turned = _along_axes(matrices, table, sources, axes)
    return ImportedModel(
        turned,
        where,
        _with_points(table, sources, files, axes),
        axes,
        all(model.has_units for model in sources),
        [text for model in sources for text in model.texts],
    )


def _is_table(file: str) -> bool:
    """Return whether a file is a table of DOFs in CSV."""
    return Path(file).suffix.lower() == ".csv"


def _chosen(name: str, model: RecordedModel, files: SourceFiles, file: str) -> RecordedMatrix | None:
    """Return the matrix of a file that is M, K, C or D; None if there is none in the one file for all.

    Raises
    ------
    DovetailError
        It is missing, there are several, or the file says that it is another one.
    """
    matrices = {key: each for key, each in model.matrices.items() if not _is_placeholder(each, model)}
    listed, option = ", ".join(list(model.matrices)[:12]) or "none", NAMES[name]
    if wanted := files.names.get(name):
        if wanted not in matrices:
            raise DovetailError(Fault(file, f"there is no matrix '{wanted}', see 'names.{option}'.", listed))
        return matrices[wanted]
    means = {key: each for key, each in matrices.items() if each.meaning == name}
    if len(means) > 1:
        problem = f"the matrices {' and '.join(means)} can be the {option.replace('_', ' ')}."
        raise DovetailError(Fault(file, problem, remedy=f"Choose one by 'names: {{{option}: NAME}}'."))
    if means:
        return next(iter(means.values()))
    if files.are_separate and len(matrices) == 1:
        (only,) = matrices.values()
        if only.meaning is None:
            return only
        problem = f"the file is given as '{option}', and says that it is '{NAMES[only.meaning]}'."
        raise DovetailError(Fault(file, problem, remedy="Exchange the files, or rename this one."))
    if name in ("M", "K") or files.are_separate:
        remedy = f"Choose one by 'names: {{{option}: NAME}}'." if matrices else ""
        raise DovetailError(Fault(file, f"no matrix of the file is known as '{option}'.", listed, remedy))
    return None


def _is_placeholder(matrix: RecordedMatrix, model: RecordedModel) -> bool:
    """Return whether a matrix is the single zero that NASTRAN writes where a matrix is missing."""
    largest = max(np.shape(each.values)[0] for each in model.matrices.values())
    return np.shape(matrix.values) == (1, 1) and largest > 1 and not abs(matrix.values).sum()


def _joined(
    matrices: Mapping[str, RecordedMatrix], tables: Mapping[str, Any], where: Mapping[str, str]
) -> tuple[DofTable, dict[str, Any]]:
    """Return the DOFs of several files, and their matrices over all of these."""
    from scipy.sparse import coo_array

    pairs = dict.fromkeys(pair for table in tables.values() for pair in zip(table.nodes, table.directions, strict=True))
    number = {pair: row for row, pair in enumerate(pairs)}
    values = {}
    for name, matrix in matrices.items():
        entries, table = coo_array(matrix.values), tables[name]
        place = np.array([number[pair] for pair in zip(table.nodes, table.directions, strict=True)], dtype=np.intp)
        coordinates = place[entries.row], place[entries.col]
        values[name] = coo_array((entries.data, coordinates), shape=(len(pairs), len(pairs)))
    nodes, directions = zip(*pairs, strict=True)
    return DofTable(nodes, directions, np.arange(len(pairs)), None, where["K"]), values


def _check_sizes(matrices: Mapping[str, Any], where: Mapping[str, str]) -> None:
    """Raise a DovetailError if the matrices differ in size, or if a mass is negative."""
    size = matrices["K"].shape[0]
    for name, matrix in matrices.items():
        if matrix.shape[0] != size:
            raise DovetailError(Fault(where[name], f"{name} has {matrix.shape[0]} rows, K has {size}."))
    if (masses := matrices["M"].diagonal()).min() < 0:
        row = int(np.argmin(masses))
        raise DovetailError(Fault(where["M"], f"the mass of row {row + 1} is negative: {masses[row]:g}."))


def _table(files: SourceFiles, joined: DofTable | None, size: int, read: Any, file: str) -> DofTable:
    """Return the table of DOFs: that of the files with matrices, or of the option `dofs`.

    Raises
    ------
    DovetailError
        There is none, it does not fit the matrices, or there are two that differ.
    """
    named: DofTable | None = None
    if files.dofs:
        named = read_dof_table(Path(files.dofs), size) if _is_table(files.dofs) else read(files.dofs).table
        if named is None:
            raise DovetailError(Fault(files.dofs, "the file has no table of DOFs.", remedy="See 'coordinates'."))
    if joined is not None and named is not None:
        _check_equal(joined, named)
    table = named or joined
    if table is None:
        remedy = "Name a file with 'dofs'."
        raise DovetailError(Fault(file, "there is no table of DOFs: no 'nodes', no 'directions'.", "", remedy))
    if files.dofs and not _is_table(files.dofs) and len(table.rows) != size:
        problem = f"the table has {len(table.rows)} DOFs, the matrices have {size} rows."
        raise DovetailError(Fault(table.where, problem, "the model from which the matrices were written"))
    return table.checked(size)


def _check_equal(table: DofTable, other: DofTable) -> None:
    """Raise a DovetailError if two tables name a row differently."""
    names = {int(row): pair for row, *pair in zip(table.rows, table.nodes, table.directions, strict=True)}
    for row, *pair in zip(other.rows, other.nodes, other.directions, strict=True):
        if names.get(int(row), pair) != pair:
            node, direction = names[int(row)]
            problem = f"row {row + 1} is {pair[1]} of node '{pair[0]}' here, and {direction} of node '{node}' in "
            raise DovetailError(Fault(other.where, f"{problem}{table.where}.", remedy="Leave out one of the tables."))


def _along_axes(
    matrices: Mapping[str, Any], table: DofTable, sources: Sequence[RecordedModel], words: Mapping[Direction, str]
) -> Mapping[str, Any]:
    """Return matrices whose DOFs are along the axes of the coordinates at every node.

    Raises
    ------
    DovetailError
        A node with axes of its own has some displacements, or some rotations, without the others.
    """
    from scipy.sparse import eye_array

    frames = {node: axes for model in sources for node, axes in model.frames.items()}
    if not frames:
        return matrices
    row_of = dict(zip(zip(table.nodes, table.directions, strict=True), map(int, table.rows), strict=True))
    turn = eye_array(next(iter(matrices.values())).shape[0], format="lil")
    for node in dict.fromkeys(each for each in table.nodes if each in frames):
        for triple in (("x", "y", "z"), ("rx", "ry", "rz")):
            rows = [row_of[pair] for each in triple if (pair := (node, words[each])) in row_of]
            if len(rows) == len(triple):
                turn[np.ix_(rows, rows)] = frames[node]
            elif rows and not np.allclose(frames[node], np.eye(3), atol=1e-9):
                problem = f"node '{node}' has directions of its own, and only some of {', '.join(triple)}."
                raise DovetailError(Fault(table.where, problem, "all three, or directions along the axes of the model"))
    columns = turn.tocsc()
    return {name: (columns.T @ matrix @ columns).tocsc() for name, matrix in matrices.items()}


def _with_points(
    table: DofTable, sources: Sequence[RecordedModel], files: SourceFiles, axes: Mapping[Direction, str]
) -> DofTable:
    """Return the table with the coordinates of its nodes.

    Raises
    ------
    DovetailError
        A node has two places, or no coordinates where others have some.
    """
    points = dict[str, tuple[float, float, float]]()
    known = np.array([point for model in sources for point in model.points.values()]).reshape(-1, 3)
    tolerance = _SAME_POINT * float(np.ptp(known, axis=0).max(initial=0.0)) if len(known) else 0.0
    in_table = {} if table.points is None else dict(zip(table.nodes, map(tuple, table.points.tolist()), strict=True))
    for source in (in_table, *(model.points for model in sources)):
        for node, point in source.items():
            if np.abs(np.subtract(points.setdefault(node, point), point)).max() > tolerance:
                place = files.coordinates or table.where
                problem = f"node '{node}' is at {points[node]} in one file, and at {point} in another."
                raise DovetailError(Fault(place, problem, remedy="Are both of one model, in one unit?"))
    if not any(model.points for model in sources):
        return table
    kept = [index for index, node in enumerate(table.nodes) if node in points]
    lost = dict.fromkeys(node for node in table.nodes if node not in points)
    placed = {node for node, one in zip(table.nodes, table.directions, strict=True) if one in axes.values()}
    if missing := [node for node in lost if node in placed and not node.startswith("-")]:
        place = files.coordinates or table.where
        raise DovetailError(Fault(place, f"there are no coordinates of node '{missing[0]}', which has DOFs."))
    return replace(
        table,
        nodes=tuple(table.nodes[index] for index in kept),
        directions=tuple(table.directions[index] for index in kept),
        rows=table.rows[kept],
        positions=None if table.positions is None else table.positions[kept],
        points=_coordinates(table, kept, points),
    )


def _coordinates(table: DofTable, kept: Sequence[int], points: Mapping[str, Any]) -> NDArray[np.float64]:
    return np.array([points[table.nodes[index]] for index in kept]).reshape(-1, 3)
