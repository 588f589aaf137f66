"""Measured receptance matrices, from an archive or from the sets of a UFF file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    DovetailError,
    Fault,
    Frf,
    ModelDof,
    ReceptanceMatrix,
    Role,
    check_receptance_units,
    check_roles,
    read_frf,
    read_receptance,
)
from dovetail_plugins.substructures.dof_table import TABLE_ARRAYS, table_in
from dovetail_plugins.substructures.matrix_files import read_archive

_DIRECTIONS = ("x", "rz")

_MOST_ANTISYMMETRIC = 2.0
"""Ratio of the difference of two reciprocal receptances to their sum above which a sign is wrong; 1 for pure noise."""


@dataclass(frozen=True, eq=False)
class KnownReceptance:
    """A receptance between some DOFs of some nodes.

    Parameters
    ----------
    matrix : ReceptanceMatrix
    nodes : mapping of str to float
        Labels and positions [m].
    dofs : tuple of int
        The DOF of each row: 2 i for x of node i, 2 i + 1 for its rz.
    """

    matrix: ReceptanceMatrix
    nodes: Mapping[str, float]
    dofs: tuple[int, ...]


def from_archive(file: str) -> KnownReceptance:
    """Read an NPZ archive with x and rz of one point, or with a table of DOFs.

    Raises
    ------
    DovetailError
        The file or its table cannot be used.
    """
    path = Path(file)
    if path.suffix.lower() != ".npz":
        remedy = "For a UFF file, give 'nodes' and 'frfs'."
        raise DovetailError(Fault(file, f"'{path.suffix}' is not the ending of an archive.", ".npz", remedy))
    try:
        archive = read_archive(path)
    except DovetailError:
        archive = {}  # `read_receptance` reports what is wrong
    if "nodes" not in archive and "directions" not in archive:
        one_point = _reciprocal(read_receptance(path), ("x", "rz"), file)
        _check_drive_points(one_point, ("x", "rz"), file)
        return KnownReceptance(one_point, {"m1": 0.0}, (0, 1))
    return _with_table(archive, file)


def _with_table(archive: Mapping[str, NDArray[np.generic]], file: str) -> KnownReceptance:
    """Return the receptance of an archive with a table of DOFs."""
    missing = [name for name in ("frequency", "receptance") if name not in archive]
    if missing:
        raise DovetailError(Fault(file, f"there is no '{missing[0]}'; there is: {', '.join(sorted(archive)[:12])}."))
    frequency, values = _numbers(archive["frequency"], "f", file), _numbers(archive["receptance"], "c", file)
    check_receptance_units(file, {name: array for name, array in archive.items() if name not in TABLE_ARRAYS})
    whole = _matrix(frequency, values.astype(np.complex128), file)
    table = table_in(archive, file, values.shape[1])
    assert table is not None
    if strange := [direction for direction in table.directions if direction not in _DIRECTIONS]:
        raise DovetailError(Fault(file, f"'{strange[0]}' is not a direction.", ", ".join(_DIRECTIONS)))
    nodes = dict.fromkeys(table.nodes, 0.0)
    if table.positions is not None:
        nodes = dict(zip(table.nodes, table.positions.tolist(), strict=True))
    index_of = {label: index for index, label in enumerate(nodes)}
    pairs = list(zip(table.nodes, table.directions, strict=True))
    dofs = tuple(2 * index_of[node] + _DIRECTIONS.index(direction) for node, direction in pairs)
    chosen = whole.values[:, table.rows[:, np.newaxis], table.rows]
    names = [f"{node} {direction}" for node, direction in pairs]
    matrix = _reciprocal(_matrix(whole.frequency, chosen, file), names, file)
    _check_drive_points(matrix, names, file)
    return KnownReceptance(matrix, nodes, dofs)


def _check_drive_points(matrix: ReceptanceMatrix, names: Sequence[str], file: str) -> None:
    """Refuse a matrix with receptances on the diagonal that deliver power, as those of a reversed sign do."""
    for index, name in enumerate(names):
        frf = Frf(matrix.frequency, matrix.values[:, index, index], "receptance", label=name)
        dof = ModelDof(f"'{name}'")
        check_roles([Role(frf, dof, dof, f"{file}  the receptance of {name}", "")])


def _reciprocal(matrix: ReceptanceMatrix, names: Sequence[str], file: str) -> ReceptanceMatrix:
    """Return the mean of both directions, since the coupling takes a part to be reciprocal.

    Raises
    ------
    DovetailError
        Two receptances that should be equal have opposite signs.
    """
    mirrored = np.swapaxes(matrix.values, 1, 2)
    difference, total = (np.linalg.norm(part, axis=0) for part in (matrix.values - mirrored, matrix.values + mirrored))
    opposite = np.argwhere(difference > _MOST_ANTISYMMETRIC * total)
    if len(opposite):
        first, second = (names[dof] for dof in opposite[0])
        problem = (
            f"the receptance of {first} by a load in {second} has the opposite sign of that of {second} by a load in "
            f"{first}, and by reciprocity they are equal."
        )
        raise DovetailError(Fault(file, problem, remedy="Check the signs of rotations and moments."))
    return replace(matrix, values=(matrix.values + mirrored) / 2.0)


def from_sets(
    file: str, nodes: Mapping[str, float], frfs: Sequence[tuple[int, str, str]], *, ignore_dofs: bool = False
) -> KnownReceptance:
    """Read the receptance between the displacements of some nodes from the sets of a UFF file.

    Parameters
    ----------
    file : str
    nodes : mapping of str to float
        Labels and positions [m].
    frfs : sequence of (int, str, str)
        Number of the set, the node of the response and that of the force.
    ignore_dofs : bool
        Whether the DOFs in the file are wrong.

    Raises
    ------
    DovetailError
        A set cannot be read, has other frequencies than the first or no phase, or its DOFs in the file contradict those
        of the others; or a pair of nodes has no set.
    """
    index_of = {label: index for index, label in enumerate(nodes)}
    read = [
        (read_frf(file, index=number, ignore_dofs=ignore_dofs).to("receptance"), number, out, into)
        for number, out, into in frfs
    ]
    frequency = read[0][0].frequency
    values = np.full((len(frequency), len(nodes), len(nodes)), np.nan, dtype=np.complex128)
    for frf, number, out, into in read:
        where = f"{file}  set {number}"
        if not np.array_equal(frf.frequency, frequency):
            raise DovetailError(Fault(where, f"its frequencies are not those of set {read[0][1]}."))
        if not frf.has_phase or frf.rotation:
            raise DovetailError(Fault(where, "it is not a complex FRF of a displacement per force."))
        values[:, index_of[out], index_of[into]] = frf.values
    _check_places(file, nodes, read)
    values = np.where(np.isnan(values), np.swapaxes(values, 1, 2), values)
    for out, row in index_of.items():
        for into, column in index_of.items():
            if np.isnan(values[0, row, column]):
                raise DovetailError(Fault(file, f"no set is between '{out}' and '{into}'."))
    matrix = _reciprocal(_matrix(frequency, values, file), list(nodes), file)
    return KnownReceptance(matrix, dict(nodes), tuple(2 * index for index in index_of.values()))


def _check_places(file: str, nodes: Mapping[str, float], read: Sequence[tuple[Frf, int, str, str]]) -> None:
    """Compare the DOFs in the file with the nodes at which the sets are used."""
    dof_at = {label: ModelDof(f"'{label}'", label=label, labels=tuple(nodes)) for label in nodes}
    check_roles(
        [
            Role(
                frf,
                dof_at[out],
                dof_at[into],
                f"{file}  set {number}",
                "If the file's DOFs are wrong, add 'ignore_dofs: true'.",
            )
            for frf, number, out, into in read
        ]
    )


def _numbers(array: NDArray[np.generic], kind: str, file: str) -> NDArray[np.generic]:
    accepted = "fiu" if kind == "f" else "fiuc"
    if array.dtype.kind not in accepted or array.ndim != (1 if kind == "f" else 3):
        name = "frequency" if kind == "f" else "receptance"
        problem = f"'{name}' has the shape {array.shape} and the type {array.dtype}."
        raise DovetailError(Fault(file, problem, "(n_freq,) real numbers" if kind == "f" else "(n_freq, n, n) numbers"))
    return array


def _matrix(frequency: NDArray[np.generic], values: NDArray[np.complex128], file: str) -> ReceptanceMatrix:
    try:
        return ReceptanceMatrix(frequency.astype(np.float64), values, Path(file).name)
    except DovetailError as error:
        raise DovetailError(Fault(file, error.faults[0].problem)) from None
