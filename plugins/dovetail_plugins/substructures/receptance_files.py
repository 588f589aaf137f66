"""Measured receptance matrices, from an archive or from the sets of a UFF file."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    DIRECTIONS,
    PLANAR,
    DovetailError,
    Fault,
    Frf,
    ModelDof,
    NodeDofs,
    PartNode,
    ReceptanceMatrix,
    Role,
    check_receptance_units,
    check_roles,
    is_rotation,
    read_frf,
    read_receptance,
)
from dovetail_plugins.substructures.dof_table import TABLE_ARRAYS, table_in
from dovetail_plugins.substructures.matrix_files import read_archive
from dovetail_plugins.substructures.measured_checks import check_drive_points, reciprocal

Place = float | tuple[float, float, float]
"""Position of a node along the part, or its coordinates [m]."""
Dof = tuple[str, str]
"""A node and a direction."""


@dataclass(frozen=True, eq=False)
class KnownReceptance:
    """A receptance between some DOFs of some nodes.

    Parameters
    ----------
    matrix : ReceptanceMatrix
    nodes : tuple of PartNode
    dofs : tuple of int
        The DOF of each row.
    motion : (d, n) array, optional
        Of all DOFs of the nodes by those of the rows; without it, those without a row were not measured.
    """

    matrix: ReceptanceMatrix
    nodes: tuple[PartNode, ...]
    dofs: tuple[int, ...]
    motion: NDArray[np.float64] | None = None

    @staticmethod
    def between(matrix: ReceptanceMatrix, pairs: Sequence[Dof], place_of: Mapping[str, Place]) -> KnownReceptance:
        """Return a receptance whose rows are these DOFs of nodes at some places.

        A part with x and rz alone, at positions, is planar: each of its nodes has both. Otherwise a node moves in the
        directions that were measured.
        """
        planar = all(each in PLANAR for _, each in pairs) and not any(isinstance(at, tuple) for at in place_of.values())
        nodes = []
        for label, at in place_of.items():
            own = {each for node, each in pairs if node == label}
            directions = PLANAR if planar else tuple(each for each in DIRECTIONS if each in own)
            point = at if isinstance(at, tuple) else None
            nodes.append(PartNode(label, 0.0 if isinstance(at, tuple) else at, directions, point))
        numbers, labels = NodeDofs.from_nodes(nodes), list(place_of)
        dofs = tuple(numbers.among([labels.index(node)], [each])[0] for node, each in pairs)
        return KnownReceptance(matrix, tuple(nodes), dofs)


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
        one_point = reciprocal(read_receptance(path), PLANAR, file)
        check_drive_points(one_point, PLANAR, file)
        return KnownReceptance.between(one_point, [("m1", each) for each in PLANAR], {"m1": 0.0})
    return _with_table(archive, file)


def _with_table(archive: Mapping[str, NDArray[np.generic]], file: str) -> KnownReceptance:
    """Return the receptance of an archive with a table of DOFs."""
    missing = [name for name in ("frequency", "receptance") if name not in archive]
    if missing:
        raise DovetailError(Fault(file, f"there is no '{missing[0]}'; there is: {', '.join(sorted(archive)[:12])}."))
    frequency, values = _numbers(archive["frequency"], "f", file), _numbers(archive["receptance"], "c", file)
    check_receptance_units(file, {name: array for name, array in archive.items() if name not in TABLE_ARRAYS})
    for name in sorted(set(archive) & {"mobility", "accelerance", "inertance"}):
        text = f"the array '{name}' is not used; the receptance is read."
        warnings.warn(f"{file}: {text} Keep one of the two.", stacklevel=2)
    whole = receptance_matrix(frequency, values.astype(np.complex128), file)
    table = table_in(archive, file, values.shape[1])
    assert table is not None
    if strange := [direction for direction in table.directions if direction not in DIRECTIONS]:
        raise DovetailError(Fault(file, f"'{strange[0]}' is not a direction.", ", ".join(DIRECTIONS)))
    place_of: dict[str, Place] = dict.fromkeys(table.nodes, 0.0)
    if table.points is not None:
        place_of = {node: (x, y, z) for node, (x, y, z) in zip(table.nodes, table.points.tolist(), strict=True)}
    elif table.positions is not None:
        place_of = dict(zip(table.nodes, table.positions.tolist(), strict=True))
    pairs = list(zip(table.nodes, table.directions, strict=True))
    chosen = whole.values[:, table.rows[:, np.newaxis], table.rows]
    names = [f"{node} {direction}" for node, direction in pairs]
    matrix = reciprocal(receptance_matrix(whole.frequency, chosen, file), names, file)
    check_drive_points(matrix, names, file)
    return KnownReceptance.between(matrix, pairs, place_of)


def from_sets(
    file: str, place_of: Mapping[str, Place], sets: Sequence[tuple[int, Dof, Dof]], *, ignore_dofs: bool = False
) -> KnownReceptance:
    """Read the receptance between DOFs of some nodes from the sets of a UFF file.

    Parameters
    ----------
    file : str
    place_of : mapping of str to float or three floats
        Labels, and positions or coordinates [m].
    sets : sequence of (int, (str, str), (str, str))
        Number of the set, node and direction of the response and those of the force.
    ignore_dofs : bool
        Whether the DOFs in the file are wrong.

    Raises
    ------
    DovetailError
        A set cannot be read, has other frequencies than the first or no phase, or its DOFs in the file contradict those
        of the others; or a pair of DOFs has no set.
    """
    pairs = list(dict.fromkeys(dof for _, *ends in sets for dof in ends))
    pairs.sort(key=lambda dof: (list(place_of).index(dof[0]), DIRECTIONS.index(dof[1])))
    read = [
        (read_frf(file, index=number, ignore_dofs=ignore_dofs).to("receptance"), number, out, into)
        for number, out, into in sets
    ]
    frequency = read[0][0].frequency
    values = np.full((len(frequency), len(pairs), len(pairs)), np.nan, dtype=np.complex128)
    for frf, number, out, into in read:
        where = f"{file}  set {number}"
        if not np.array_equal(frf.frequency, frequency):
            raise DovetailError(Fault(where, f"its frequencies are not those of set {read[0][1]}."))
        kinds = frf.rotation == is_rotation(out[1]), frf.by_moment == is_rotation(into[1])
        if not frf.has_phase or not all(kinds):
            motion, load = ("rotation" if is_rotation(out[1]) else "displacement"), _LOADS[is_rotation(into[1])]
            raise DovetailError(Fault(where, f"it is not a complex FRF of a {motion} per {load}."))
        values[:, pairs.index(out), pairs.index(into)] = frf.values
    one_direction = len({each for _, each in pairs}) == 1
    names = [node if one_direction else f"{node} {each}" for node, each in pairs]
    _check_places(file, pairs, names, read)
    values = np.where(np.isnan(values), np.swapaxes(values, 1, 2), values)
    for row, column in np.argwhere(np.isnan(values[0])):
        raise DovetailError(Fault(file, f"no set is between '{names[row]}' and '{names[column]}'."))
    matrix = reciprocal(receptance_matrix(frequency, values, file), names, file)
    return KnownReceptance.between(matrix, pairs, place_of)


_LOADS = {False: "force", True: "moment"}
_REMEDY = "If the file's DOFs are wrong, add 'ignore_dofs: true'."


def _check_places(
    file: str, pairs: Sequence[Dof], names: Sequence[str], read: Sequence[tuple[Frf, int, Dof, Dof]]
) -> None:
    """Compare the DOFs in the file with those at which the sets are used."""
    labels = tuple(dict.fromkeys(node for node, _ in pairs))
    dof_at = {
        pair: ModelDof(f"'{name}'", is_rotation(pair[1]), label=pair[0], labels=labels)
        for pair, name in zip(pairs, names, strict=True)
    }
    roles = [Role(frf, dof_at[out], dof_at[into], f"{file}  set {number}", _REMEDY) for frf, number, out, into in read]
    if len(pairs) == len(labels):
        check_roles(roles)
        return
    _check_one_to_one(roles)  # several directions of a node
    are_given = all(role.frf.response and role.frf.force for role in roles)
    unnamed = [replace(role, frf=replace(role.frf, response="", force="")) for role in roles]
    check_roles(unnamed, distinct=not are_given)


def _check_one_to_one(roles: Sequence[Role]) -> None:
    """Refuse sets in which a DOF of the file is used as two DOFs, or two DOFs of the file as one."""
    used: dict[str, tuple[str, Role]] = {}
    name_at: dict[str, tuple[str, Role]] = {}
    for role in roles:
        for noun, text, place in (
            ("response", role.frf.response, role.response.place),
            ("force", role.frf.force, role.force.place),
        ):
            name = text.replace("+", "").replace("-", "").lower()
            if not name:
                continue
            other, first = used.setdefault(name, (place, role))
            known, second = name_at.setdefault(place, (name, role))
            if other != place or known != name:
                earlier = first if other != place else second
                problem = (
                    f"its file says {role.dofs}: the {noun} {text} is used as {place}, and in {earlier.name} "
                    f"({earlier.dofs}) "
                )
                problem += f"as {other}." if other != place else "another DOF is."
                raise DovetailError(
                    Fault(role.name, problem, remedy=f"Correct the nodes and directions. {role.remedy}")
                )


def _numbers(array: NDArray[np.generic], kind: str, file: str) -> NDArray[np.generic]:
    accepted = "fiu" if kind == "f" else "fiuc"
    if array.dtype.kind not in accepted or array.ndim != (1 if kind == "f" else 3):
        name = "frequency" if kind == "f" else "receptance"
        problem = f"'{name}' has the shape {array.shape} and the type {array.dtype}."
        raise DovetailError(Fault(file, problem, "(n_freq,) real numbers" if kind == "f" else "(n_freq, n, n) numbers"))
    return array


def receptance_matrix(frequency: NDArray[np.generic], values: NDArray[np.complex128], file: str) -> ReceptanceMatrix:
    """Return a receptance matrix, or raise a DovetailError that names its file."""
    try:
        return ReceptanceMatrix(frequency.astype(np.float64), values, Path(file).name)
    except DovetailError as error:
        raise DovetailError(Fault(file, error.faults[0].problem)) from None
