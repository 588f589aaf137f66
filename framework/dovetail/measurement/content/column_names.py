"""The fields of an FRF, recognised by their usual names in tables, archives and workspaces."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, argument, did_you_mean, listing
from dovetail.frf import Quantity

_QUANTITY_NAMES: dict[str, Quantity] = {
    "receptance": "receptance",
    "compliance": "receptance",
    "mobility": "mobility",
    "accelerance": "accelerance",
    "inertance": "accelerance",
}
_MOTION_NAMES: dict[str, Quantity] = {
    "displacement": "receptance",
    "velocity": "mobility",
    "acceleration": "accelerance",
}
FIELD_NAMES: dict[str, tuple[str, ...]] = {
    "frequency": ("frequency", "frequency_hz", "frequencies", "freq", "freq_hz", "f", "f_hz"),
    "values": ("values", "value", "frf", "h", "h1", "h2", "hv", "responsedata", *_QUANTITY_NAMES),
    "real": ("real", "re", "real_part"),
    "imag": ("imag", "im", "imaginary", "imag_part", "imaginary_part"),
    "amplitude": ("amplitude", "magnitude", "mag", "abs", "modulus"),
    "db": ("db", "amplitude_db", "magnitude_db", "mag_db"),
    "phase_deg": ("phase_deg", "phase_degrees", "phase_degree", "angle_deg"),
    "phase_rad": ("phase_rad", "phase_radians", "angle_rad"),
    "coherence": ("coherence", "coh", "gamma2"),
    "variance": ("variance", "var"),
    "averages": ("averages", "n_averages", "num_averages", "number_of_averages", "navg", "n_avg"),
    "quantity": ("quantity",),
    "unit": ("unit", "units"),
    "note": ("note",),
    "response": ("response", "response_dof"),
    "force": ("force", "force_dof"),
}
"""The fields of an FRF, and the names by which each is recognised, in upper or lower case."""
VALUE_FIELDS = frozenset(("values", "real", "imag", "amplitude", "db", "phase_deg", "phase_rad"))
"""The fields that make up the values."""
NUMERIC_FIELDS = (
    *("frequency", "values", "real", "imag", "amplitude", "db", "phase_deg", "phase_rad"),
    *("coherence", "variance"),
)
"""The fields with a number for each line."""
_VALUES = (
    *(("values",), ("real", "imag"), ("amplitude", "phase_deg"), ("amplitude", "phase_rad"), ("amplitude",)),
    *(("db", "phase_deg"), ("db", "phase_rad"), ("db",)),
)
PHASES = ("phase", "angle", "arg")
"""Names of a phase that leave open whether it is in degrees or in radians."""
FIELD_WORDS = frozenset(word for field in NUMERIC_FIELDS for word in FIELD_NAMES[field])
"""The names of the fields with a number for each line."""
_VALUE_WORDS = frozenset(word for field in VALUE_FIELDS for word in FIELD_NAMES[field]) | set(PHASES)
_BRACKET = re.compile(r"([^\[(]*?)\s*[\[(](.*)[\])]")
_SLASH = re.compile(r"(.+?)\s+/\s+(\S.*)")
"""A name and its unit according to DIN 1313: ``Frequency / Hz``."""
_LONGEST = 1000
_ANGLES = {
    **dict.fromkeys(("deg", "deg.", "degree", "degrees", "°"), "phase_deg"),
    **dict.fromkeys(("rad", "radian", "radians"), "phase_rad"),
}
_PARTS = ("real", "imag", "amplitude", "db", "phase_deg", "phase_rad", "coherence")
"""Fields that the last word of a name may state, after the name of a signal."""
_NO_FRF = frozenset(("force", "excitation", "hammer", "psd", "power", "autopower", "spectrum", "autospectrum", "time"))
"""Words which show that a signal is not an FRF."""
_ESTIMATORS = ("h1", "h2", "hv")
_PART_WORDS = frozenset(
    (
        *(
            word
            for field in VALUE_FIELDS
            for name in FIELD_NAMES[field]
            for word in name.split("_")
            if word not in _ESTIMATORS
        ),
        *(*PHASES, "part", "deg", "rad", "frf", "function", "response", "transfer", "h", "hz", "col", *_MOTION_NAMES),
    )
)
"""Words of a column's name that do not distinguish signals; quantities are compared by themselves."""
_PART = re.compile(
    r"[(\[]?\b(?:real|re|imag|imaginary|im|amplitude|magnitude|mag|abs|modulus|phase|angle|deg|rad|db|part)\b\.?[)\]]?",
    re.IGNORECASE,
)
"""The part of the values in a column's name."""
_SHOWN = 60
"""Characters of a name that are shown."""
_MOST_LISTED = 20
"""Names that are listed of a file."""
_MANY_LINES = 100
_HALF_TURN, _NEARLY_A_TURN = 3.15, 6.0
"""Largest phase, and smallest jump of a wrapped phase, of numbers labelled in degrees that are in fact radians."""
_RESONANCE = 3.0
"""Amplitude over those on both sides from which a resonance turns the phase by more than 100 degrees."""
_SPAN_OF_DECIBELS = 1e-3, 300.0
"""Smallest and largest range of the decibels of a measured FRF: a rigid mass has noise, and sensors have a range."""
_ACCEPTED = "values (complex) | real, imag | amplitude (or db), phase_deg (or phase_rad) | amplitude"


def plain_name(name: str) -> str:
    """Return the last part of a path as a word of lower-case letters, digits and underscores."""
    return re.sub(r"[^a-z0-9]+", "_", re.split(r"[/.]", name)[-1].lower()).strip("_")


@lru_cache(maxsize=1000)
def column_word(name: str, unit: str = "") -> str:
    """Return the word that identifies a column of a table, such as ``imag`` for ``Signal 2 (Imag.)``.

    Parameters
    ----------
    name : str
        Of the column.
    unit : str
        Its unit, which turns ``Phase`` into ``phase_deg`` or ``phase_rad``, and an amplitude into ``db``.
    """
    word = _plain_words(name)
    spellings = [spelling for field in _PARTS for spelling in FIELD_NAMES[field]] + list(PHASES)
    if not any(word in names for names in FIELD_NAMES.values()):
        tails = [spelling for spelling in spellings if word.endswith(f"_{spelling}")]
        tail = max(tails, key=len, default=word)
        word = word if _NO_FRF & set(word.removesuffix(tail).split("_")) else tail
    angle = _ANGLES.get(unit.strip().lower(), "")
    if word in PHASES or any(word in FIELD_NAMES[other] for other in _ANGLES.values() if angle not in ("", other)):
        return angle if word in PHASES and angle else PHASES[0]
    return "db" if word in FIELD_NAMES["amplitude"] and unit.strip().lower().startswith("db") else word


def _plain_words(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.replace("°", " deg").lower()).strip("_")


def quantities_in(name: str, *, motions: bool = False) -> list[Quantity]:
    """Return the quantities that a column's name states, such as ``Accelerance magnitude``.

    Parameters
    ----------
    name : str
    motions : bool
        Look for ``acceleration``, ``velocity`` and ``displacement``, which do not state that they are per force.
    """
    spellings = _MOTION_NAMES if motions else _QUANTITY_NAMES
    return [spellings[word] for word in _plain_words(name).split("_") if word in spellings]


def quantity_of_name(name: str) -> Quantity | None:
    """Return the quantity that the name of a variable states, such as ``compliance``."""
    return _QUANTITY_NAMES.get(plain_name(name))


def assign_fields(
    where: str, contents: Mapping[str, str], names: Mapping[str, str], words: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Assign the names in a file to the fields of the FRF.

    Parameters
    ----------
    where : str
    contents : mapping of str to str
        The names in the file, with a description of their contents.
    names : mapping of str to str
        From fields to names, as the caller specifies them.
    words : mapping of str to str, optional
        The word that identifies each name; by default its last part, in lower case.

    Returns
    -------
    dict of str to str
        From fields to names: a frequency, and one form of the values.

    Raises
    ------
    MeasurementError
        A field or a name that does not exist, two names for one field, no frequency, no values or two forms of them.
    """
    assigned = _check_names(where, contents, names)
    words = {name: plain_name(name) for name in contents} if words is None else words
    taken = set(assigned.values())
    for field, spellings in FIELD_NAMES.items():
        if field in assigned or _is_overridden(field, names):
            continue
        candidates = [name for name in contents if words[name] in spellings and name not in taken]
        if field in NUMERIC_FIELDS:
            candidates = [name for name in candidates if contents[name] != "text"] or candidates
        if len(candidates) > 1:
            candidates = _in_folders(candidates, names.values()) or candidates
        if len(candidates) > 1:
            shown = listing(repr(name) for name in candidates)
            problem = f"{shown} may each be the {field}; the file holds:{_inventory(contents)}"
            raise MeasurementError(
                Fault(where, problem, remedy=f"Say which, for example {argument('names', {field: candidates[0]})}.")
            )
        if candidates:
            assigned[field] = candidates[0]
    _check_phase(where, contents, assigned, words)
    _check_complete(where, contents, assigned)
    return assigned


def _in_folders(candidates: Sequence[str], chosen: Iterable[str]) -> list[str]:
    """Return the candidates in a folder or struct from which the caller has chosen another name."""
    folders = {folder for name in chosen if (folder := re.sub(r"[^/.]*$", "", name))}
    return [name for name in candidates if re.sub(r"[^/.]*$", "", name) in folders]


def check_same_signal(where: str, fields: Mapping[str, str]) -> list[str]:
    """Return what the names of the values say besides their parts, once for all: ``Point 1`` for ``Point 1 (Real)``.

    Raises
    ------
    MeasurementError
        The parts are from different signals, such as ``Point 1 (Real)`` and ``Point 2 (Imag)``.
    """
    signals = {name: signal for field, name in fields.items() if field in VALUE_FIELDS and (signal := _signal(name))}
    if len(set(signals.values())) > 1:
        shown = listing(repr(name) for name in signals)
        problem = f"{shown} are not parts of one FRF."
        raise MeasurementError(Fault(where, problem, _ACCEPTED, "Say what each column holds: `columns=` or `names=`."))
    bare = (re.sub(r"[\W_]+$|^[\W_]+", "", _PART.sub(" ", name)) for name in signals)
    return list(dict.fromkeys(text for text in bare if text))


def _signal(name: str) -> str:
    """Return what a name says besides the part of the values: ``point 1`` for ``Point 1 (Real)``."""
    return " ".join(word for word in _plain_words(name).split("_") if word not in _PART_WORDS)


def taken_for(fields: Mapping[str, str], names: Sequence[str], units: Sequence[str] = ()) -> list[str]:
    """Return sentences on what each name in a file was taken for; names that are read come first.

    Parameters
    ----------
    fields : mapping of str to str
        From fields of the FRF to names.
    names : sequence of str
        All names in the file.
    units : sequence of str, optional
        Unit of each name.
    """
    meant = {name: field for field, name in fields.items()}
    labels = [f" [{unit[:_SHOWN]}]" if unit else "" for unit in units] or [""] * len(names)
    read_first = sorted(zip(names, labels, strict=True), key=lambda pair: pair[0] not in meant)
    return [f"'{name[:_SHOWN]}'{label} is {meant.get(name, 'not read')}" for name, label in read_first]


def _check_names(where: str, contents: Mapping[str, str], names: Mapping[str, str]) -> dict[str, str]:
    for field, name in names.items():
        if field not in FIELD_NAMES:
            hint = did_you_mean(field, FIELD_NAMES)
            raise MeasurementError(
                Fault("the argument names", f"'{field}' is not a field of an FRF.", ", ".join(FIELD_NAMES), hint)
            )
        if name not in contents:
            hint = did_you_mean(name, contents)
            problem = f"there is no '{name}' in the file; it holds:{_inventory(contents)}"
            raise MeasurementError(Fault(where, problem, remedy=hint))
    return dict(names)


def _is_overridden(field: str, names: Mapping[str, str]) -> bool:
    """Return whether the caller specifies another form of the values, so that this field is not looked for."""
    value_fields = {name for kind in _VALUES for name in kind}
    return field in value_fields and any(name in value_fields for name in names)


def _check_phase(
    where: str, contents: Mapping[str, str], assigned: Mapping[str, str], words: Mapping[str, str]
) -> None:
    """Refuse a phase that may be in degrees or in radians."""
    unclear = [name for name in contents if words[name] in PHASES and name not in assigned.values()]
    if {"amplitude", "db"} & set(assigned) and unclear and not {"phase_deg", "phase_rad"} & set(assigned):
        problem = f"'{unclear[0]}' may be in degrees or in radians; the file holds:{_inventory(contents)}"
        remedy = (
            " or ".join(argument("names", {unit: unclear[0]}) for unit in ("phase_deg", "phase_rad")) + " says which."
        )
        raise MeasurementError(Fault(where, problem, remedy=remedy))


def _check_complete(where: str, contents: Mapping[str, str], assigned: Mapping[str, str]) -> None:
    if "frequency" not in assigned:
        problem = f"the frequency cannot be found by its name; the file holds:{_inventory(contents)}"
        raise MeasurementError(
            Fault(
                where, problem, ", ".join(FIELD_NAMES["frequency"]), "Say which it is: `names={'frequency': 'NAME'}`."
            )
        )
    fields = {name for kind in _VALUES for name in kind if name in assigned}
    if fields in [set(kind) for kind in _VALUES]:
        return
    several = len(fields) > 1
    reason = "the file gives the values in two ways" if several else "the values cannot be found by their names"
    problem = f"{reason}; the file holds:{_inventory(contents)}"
    raise MeasurementError(
        Fault(where, problem, _ACCEPTED, "Say which they are, for example `names={'values': 'NAME'}`.")
    )


def _inventory(contents: Mapping[str, str]) -> str:
    rows = [f"\n    {name[:60]}{': ' if what else ''}{what}" for name, what in list(contents.items())[:_MOST_LISTED]]
    hidden = len(contents) - _MOST_LISTED
    return ("".join(rows) or " nothing") + (f"\n    and {hidden} more" if hidden > 0 else "")


def _likely_mistakes(fields: Mapping[str, NDArray[Any]]) -> Iterator[str]:
    """Yield what looks as if it were in another unit than its name says: decibels, and phases next to amplitudes."""
    if "db" in fields and _look_linear(db := fields["db"]):
        problem = f"the decibels lie between {db.min():.4g} and {db.max():.4g}: they look like amplitudes"
        yield f"{problem}. If they are, call them amplitude."
    if "phase_deg" in fields and (sign := _sign_of_radians(fields["phase_deg"], fields["amplitude"])):
        problem = f"the phase in degrees never leaves +-3.15 and {sign}: it looks like radians"
        yield f"{problem}. If it is in radians, call it phase_rad."
    if "phase_rad" in fields and _looks_like_degrees(phase := fields["phase_rad"]):
        problem = f"the phase in radians reaches {np.abs(phase).max():.4g} and jumps by more than pi"
        yield f"{problem}: it looks like degrees. If it is in degrees, call it phase_deg."


def _sign_of_radians(phase: NDArray[np.float64], amplitude: NDArray[np.float64]) -> str:
    """Return what shows that a phase labelled in degrees is in radians; empty without a sign of it."""
    if phase.size < _MANY_LINES or not np.all(np.abs(phase) <= _HALF_TURN):
        return ""
    if np.abs(np.diff(phase)).max() > _NEARLY_A_TURN:
        return "jumps by nearly 2 pi"
    peak = int(np.argmax(amplitude))
    passed = amplitude[peak] > _RESONANCE * max(amplitude[: peak + 1].min(), amplitude[peak:].min())
    return "does not turn where the amplitude passes a resonance" if passed else ""


def _looks_like_degrees(phase: NDArray[np.float64]) -> bool:
    """Return whether a phase in radians looks like degrees: it is neither within a turn, nor free of jumps."""
    wide = phase.size > 1 and bool(np.abs(phase).max() > 2.0 * _HALF_TURN)
    return wide and bool(np.abs(np.diff(phase)).max() > _HALF_TURN)


def _look_linear(db: NDArray[np.float64]) -> bool:
    """Return whether decibels look like amplitudes: none is negative, and their span is no measurement's."""
    span = np.ptp(db) if db.size >= _MANY_LINES and np.isfinite(db).all() and db.min() >= 0.0 else 1.0
    return not _SPAN_OF_DECIBELS[0] <= span <= _SPAN_OF_DECIBELS[1]


def combine_values(fields: Mapping[str, NDArray[Any]], locate: Callable[[int], str]) -> tuple[NDArray[Any], bool]:
    """Return the values of an FRF from its fields, and whether they have a phase.

    Raises
    ------
    MeasurementError
        A negative amplitude; `locate` returns its place in the file.
    """
    if "db" in fields:
        with np.errstate(over="ignore"):  # the recording refuses what is infinite
            fields = {**fields, "amplitude": 10.0 ** (fields["db"] / 20.0)}
    negative = np.flatnonzero(fields["amplitude"] < 0) if "amplitude" in fields else np.zeros(0, dtype=np.intp)
    if negative.size:
        problem = f"the amplitude {fields['amplitude'][negative[0]]:.6g} is negative (decibels are called db)."
        raise MeasurementError(Fault(locate(int(negative[0])), problem, "an amplitude of zero or more"))
    for mistake in _likely_mistakes(fields):
        place = re.sub(r"(?:[:,]\D*|\s+line )\d+\D*$", "", locate(0))
        warnings.warn(f"{place}: {mistake}", stacklevel=2)
    if "values" in fields:
        return fields["values"], True
    if "amplitude" in fields and not {"phase_deg", "phase_rad"} & set(fields):
        return fields["amplitude"], False
    values = np.empty(fields["frequency"].size, dtype=np.complex128)
    if "real" in fields:
        values.real, values.imag = fields["real"], fields["imag"]
        return values, True
    phase = np.deg2rad(fields["phase_deg"]) if "phase_deg" in fields else fields["phase_rad"]
    with np.errstate(invalid="ignore"):  # an infinite phase becomes NaN, and the recording refuses it
        values.real, values.imag = fields["amplitude"] * np.cos(phase), fields["amplitude"] * np.sin(phase)
    return values, True


def names_and_units(cells: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split cells such as ``Real [um/N]`` or ``Frequency / Hz`` into names and units; a missing unit is empty.

    Brackets may also contain the kind of values, as in ``Signal 2 (Real)``, which is part of the name.
    """
    pairs = [_name_and_unit(cell) for cell in cells]
    return [name for name, _ in pairs], [unit for _, unit in pairs]


def _name_and_unit(cell: str) -> tuple[str, str]:
    if match := _BRACKET.fullmatch(cell[:_LONGEST]):
        part, unit = _name_and_unit(match[2].strip())
        if column_word(part, unit) in _VALUE_WORDS:
            return (f"{match[1]} ({part})" if unit else cell), unit
        return match[1], match[2].strip()
    match = _SLASH.fullmatch(cell[:_LONGEST])
    if match and column_word(match[1]) in (*FIELD_WORDS, *PHASES):
        return match[1], re.sub(r"^[\[(](.*)[\])]$", r"\1", match[2])
    return cell, ""
