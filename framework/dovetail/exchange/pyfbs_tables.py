"""FRFs with the tables of channels and impacts that pyFBS uses."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.errors import Fault, MeasurementError, listing, require_package
from dovetail.frf import Frf, Quantity

_MOTIONS: dict[Quantity, str] = {"accelerance": "Acceleration", "mobility": "Velocity", "receptance": "Displacement"}
_AXES = "xyz"
_DOF = re.compile(r"(.*?)([+-]?)([xyzXYZ])")
_INDEX = ("unnamed", "index", "level_0", "comment", "note", "serial")
"""Columns that do not change what the numbers mean."""


class PyfbsTables(NamedTuple):
    """FRFs as pyFBS takes them.

    Parameters
    ----------
    Y : (n_freq, n_channels, n_impacts) complex array
        SI.
    freq : (n_freq,) array
        Hz.
    df_chn, df_imp : pandas.DataFrame
        Of channels and impacts: names, quantities, positions [m] and directions.
    """

    Y: NDArray[np.complex128]
    freq: NDArray[np.float64]
    df_chn: Any
    df_imp: Any


def to_pyfbs(frfs: Sequence[Frf], positions: Mapping[str, ArrayLike] | None = None) -> PyfbsTables:
    """Return FRFs between DOFs as the matrix and the tables of pyFBS (pandas is an extra).

    Parameters
    ----------
    frfs : sequence of Frf
        One for each pair of a response and a force, with the names of both DOFs, such as ``"5+x"``; of one quantity and
        on the same frequencies.
    positions : mapping of str to (3,) array, optional
        m, by the number or name of a point without its direction; the origin by default.

    Raises
    ------
    MeasurementError
        A pair is missing or occurs twice, a name is missing, or quantities or frequencies differ.
    DovetailError
        pandas is not installed.
    """
    pandas = require_package("pandas", "pandas", "to_pyfbs")
    first = frfs[0] if frfs else None
    if first is None or any(f.quantity != first.quantity or f.rotation or f.by_moment for f in frfs):
        raise MeasurementError(Fault("frfs", "FRFs of displacements by forces and of one quantity are needed."))
    if not all(np.array_equal(frf.frequency, first.frequency) for frf in frfs):
        raise MeasurementError(Fault("frfs", "they are not on the same frequencies.", remedy="Cut or resample them."))
    pairs = {(frf.response, frf.force): frf for frf in frfs}
    channels, impacts = (list(dict.fromkeys(getattr(f, end) for f in frfs)) for end in ("response", "force"))
    missing = [f"{o} by {i}" for o in channels for i in impacts if (o, i) not in pairs]
    if len(pairs) < len(frfs) or missing or not all((*channels, *impacts)):
        problem = f"the FRFs of {listing(missing)} are missing." if missing else "DOFs have no names, or occur twice."
        raise MeasurementError(Fault("frfs", problem, "one for each pair of a response and a force"))
    matrix = np.array([[pairs[o, i].values for i in impacts] for o in channels]).transpose(2, 0, 1)
    tables = [
        pandas.DataFrame([_row(name, quantity, positions or {}) for name in names])
        for names, quantity in ((channels, _MOTIONS[first.quantity]), (impacts, "Force"))
    ]
    return PyfbsTables(matrix, np.array(first.frequency), *tables)


def from_pyfbs(Y: ArrayLike, freq: ArrayLike, df_chn: Any, df_imp: Any) -> tuple[Frf, ...]:
    """Return an FRF for each pair of a channel and an impact of pyFBS's matrix and tables, channel by channel.

    Parameters
    ----------
    Y : (n_freq, n_channels, n_impacts) complex array
        SI.
    freq : (n_freq,) array
        Hz; a line at 0 Hz is left out.
    df_chn, df_imp : pandas.DataFrame
        With the columns Name and, of channels, Quantity.

    Raises
    ------
    MeasurementError
        The tables do not fit the matrix, a channel is not of a motion, an impact not of a force, a name contradicts
        its direction, or a column is not understood.
    """
    values, axis = np.asarray(Y, dtype=np.complex128), np.asarray(freq, dtype=np.float64)
    shape = (len(axis), len(df_chn), len(df_imp))
    if values.shape != shape:
        raise MeasurementError(Fault("Y", f"its shape is {values.shape}.", f"{shape}, by freq, df_chn and df_imp"))
    for table, noun in ((df_chn, "df_chn"), (df_imp, "df_imp")):
        _check_table(table, noun)
    quantity_by_word = {word.lower(): quantity for quantity, word in _MOTIONS.items()}
    kinds = [quantity_by_word.get(str(word).lower()) for word in df_chn["Quantity"]]
    if None in kinds or any(str(word).lower() != "force" for word in df_imp.get("Quantity", ())):
        words = listing(dict.fromkeys(map(str, (*df_chn["Quantity"], *df_imp.get("Quantity", ())))))
        raise MeasurementError(Fault("Quantity", f"{words} in the tables.", f"{listing(quantity_by_word)} by force"))
    positive = axis > 0.0
    named = enumerate(zip(df_chn["Name"], kinds, strict=True))
    return tuple(
        Frf(
            axis[positive],
            values[positive, o, i],
            kind,
            response=str(name),
            force=str(force),
            label=f"{name} by {force}",
        )
        for o, (name, kind) in named
        if kind is not None
        for i, force in enumerate(df_imp["Name"])
    )


def _check_table(table: Any, noun: str) -> None:
    """Refuse columns that are not understood, and names of DOFs that contradict their directions."""
    ways = [f"Direction_{number}" for number in (1, 2, 3)]
    known = {"Name", "Description", "Quantity", "Grouping", "Weight", *ways, *(f"Position_{n}" for n in (1, 2, 3))}
    for column in map(str, table.columns):
        if column not in known and not column.lower().startswith(_INDEX) and table[column].notna().any():
            problem = f"the column '{column[:40]}' may change what the numbers mean."
            raise MeasurementError(Fault(noun, problem, remedy="Convert Y to SI, and remove the column."))
    if not all(way in table.columns for way in ways):
        return
    for name, way in zip(map(str, table["Name"]), table[ways].to_numpy(dtype=np.float64), strict=True):
        match = _DOF.fullmatch(name)
        if match and match[2]:
            along = float(way[_AXES.index(match[3].lower())]) * (-1.0 if match[2] == "-" else 1.0)
            if along <= 0.0:
                problem = f"the direction of '{name}' is ({', '.join(f'{part:g}' for part in way)})."
                raise MeasurementError(Fault(noun, problem, remedy="Correct the name or the direction."))


def _row(name: str, quantity: str, positions: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """Return the row of a DOF in a table."""
    match = _DOF.fullmatch(name)
    point, sign, axis = match.groups() if match else (name, "+", "x")
    position = np.asarray(positions.get(point.rstrip("+-"), (0.0, 0.0, 0.0)), dtype=np.float64)
    direction = np.zeros(3)
    direction[_AXES.index(axis.lower())] = -1.0 if sign == "-" else 1.0
    return {
        "Name": name,
        "Description": point,
        "Quantity": quantity,
        "Grouping": 1,
        **{f"Position_{n}": value for n, value in enumerate(position.tolist(), 1)},
        **{f"Direction_{n}": value for n, value in enumerate(direction.tolist(), 1)},
    }
