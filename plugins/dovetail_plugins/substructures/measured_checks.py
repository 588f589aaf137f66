"""Whether measured receptances are those of a structure: equal in both directions, and not delivering power."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dovetail import DovetailError, Fault, Frf, ModelDof, ReceptanceMatrix, Role, check_roles

_MOST_ANTISYMMETRIC = 2.0
"""Ratio of the difference of two reciprocal receptances to their sum above which a sign is wrong; 1 for pure noise."""
_MOST_LINES = 0.6
"""Share of the lines at which that must be so: 0.2 for pure noise, whatever lines are largest."""
_ROUNDING = 1e-6
"""Size of two reciprocal receptances, over the mean of those on the diagonal, below which they are zero."""
_UNEQUAL = 0.2
"""Difference of two reciprocal receptances, over the mean of those on the diagonal, from which there is a warning."""
_DELIVERED = 0.015
"""Share of the power that the matrix delivers from which there is a warning.

Of 60 random structures with 3 to 11 DOFs it was at most 0.014 with 10 % noise; with one pair of receptances of the
wrong sign it was at least 0.018."""
_FEWEST_DOFS = 3
"""DOFs from which the power of a matrix is judged. The two of a flange that was found by decoupling deliver 9 % of it,
since decoupling amplifies errors; their drive points are checked alone."""
_CLEAR = 0.1
"""Size of an eigenvalue, over that of the receptance, from which it counts as power."""


def check_drive_points(matrix: ReceptanceMatrix, names: Sequence[str], file: str, *, most: float = 0.0) -> None:
    """Refuse a matrix with receptances on the diagonal that deliver power, as those of a reversed sign do.

    Parameters
    ----------
    matrix : ReceptanceMatrix
    names : sequence of str
        Of its DOFs.
    file : str
        For messages.
    most : float
        Share of them that may do so, since noise can be larger than a motion that channels hardly see.
    """
    wrong = []
    for index, name in enumerate(names):
        frf = Frf(matrix.frequency, matrix.values[:, index, index], "receptance", label=name)
        dof = ModelDof(f"'{name}'")
        try:
            check_roles([Role(frf, dof, dof, f"{file}  the receptance of {name}", "")])
        except DovetailError as error:
            wrong.append(error)
    if len(wrong) > most * len(names):
        raise wrong[0]


def reciprocal(matrix: ReceptanceMatrix, names: Sequence[str], file: str) -> ReceptanceMatrix:
    """Return the mean of both directions, since the coupling takes a part to be reciprocal.

    Raises
    ------
    DovetailError
        Two receptances that should be equal have opposite signs.
    """
    mirrored = np.swapaxes(matrix.values, 1, 2)
    difference, total = (np.linalg.norm(part, axis=0) for part in (matrix.values - mirrored, matrix.values + mirrored))
    drive = np.linalg.norm(np.diagonal(matrix.values, axis1=1, axis2=2), axis=0)
    lines = np.abs(matrix.values - mirrored) > _MOST_ANTISYMMETRIC * np.abs(matrix.values + mirrored)
    wrong = difference > np.maximum(_MOST_ANTISYMMETRIC * total, _ROUNDING * np.sqrt(np.outer(drive, drive)))
    opposite = np.argwhere(wrong & (lines.mean(axis=0) > _MOST_LINES))
    if len(opposite):
        first, second = (names[dof] for dof in opposite[0])
        problem = (
            f"the receptance of {first} by a load in {second} has the opposite sign of that of {second} by a load in "
            f"{first}, and by reciprocity they are equal."
        )
        raise DovetailError(Fault(file, problem, remedy="Check the signs of rotations and moments."))
    return replace(matrix, values=(matrix.values + mirrored) / 2.0)


def matrix_warnings(values: NDArray[np.complex128], names: Sequence[str]) -> Iterator[str]:
    """Yield warnings about receptances (n_freq, n, n) that differ in both directions, or together deliver power."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diagonal(values, axis1=1, axis2=2)), np.finfo(np.float64).tiny))
    balanced = values * scale[:, :, np.newaxis] * scale[:, np.newaxis, :]
    unequal = np.median(np.abs(balanced - np.swapaxes(balanced, 1, 2)), axis=0)
    row, column = divmod(int(np.argmax(unequal)), len(names))
    if unequal[row, column] > _UNEQUAL:
        yield (
            f"the receptance of {names[row]} by a load in {names[column]} and that of {names[column]} by a load in "
            f"{names[row]} differ by {100 * unequal[row, column]:.0f} % of the drive points' mean (median of the "
            "lines). By reciprocity they are equal, and their mean is used."
        )
        return  # what causes that makes powers negative too
    share = delivered_share(balanced) if len(names) >= _FEWEST_DOFS else 0.0
    if share > _DELIVERED:
        yield (
            f"loads at several of its DOFs together get {100 * share:.0f} % of the power out of the part, which no "
            "passive structure does: errors of some FRFs are large, or the sign or the place of a DOF is wrong."
        )


def delivered_share(balanced: NDArray[np.complex128]) -> float:
    """Return the share of the power that balanced receptances (n_freq, n, n) deliver, by the eigenvalues of -Im H.

    Eigenvalues count if they are at least a tenth of the receptance itself, as at a resonance: elsewhere force and
    velocity are nearly 90 degrees apart, and the least error changes the sign of the power.
    """
    symmetric = (balanced + np.swapaxes(balanced, 1, 2)) / 2.0
    power = np.linalg.eigvalsh(-symmetric.imag)
    counted = power[np.abs(power) > _CLEAR * np.linalg.norm(symmetric, ord=2, axis=(1, 2))[:, np.newaxis]]
    total = np.abs(counted).sum()
    return float(-counted[counted < 0.0].sum() / total) if total else 0.0
