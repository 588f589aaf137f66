"""The parts of an FRF by the names that people give them in tables, archives and workspaces."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, did_you_mean, listing
from dovetail.frf import Quantity

__all__ = ["NUMBERS", "PARTS", "chosen_names", "combined", "plain_name", "quantity_of_name"]

_QUANTITY_NAMES: dict[str, Quantity] = {
    "receptance": "receptance",
    "compliance": "receptance",
    "mobility": "mobility",
    "accelerance": "accelerance",
    "inertance": "accelerance",
}
PARTS: dict[str, tuple[str, ...]] = {
    "frequency": ("frequency", "frequency_hz", "frequencies", "freq", "freq_hz", "f", "f_hz"),
    "values": ("values", "value", "frf", "h", "h1", "h2", "hv", *_QUANTITY_NAMES),
    "real": ("real", "re", "real_part"),
    "imag": ("imag", "im", "imaginary", "imag_part", "imaginary_part"),
    "amplitude": ("amplitude", "magnitude", "mag", "abs", "modulus"),
    "phase_deg": ("phase_deg", "phase_degrees", "angle_deg"),
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
"""Parts of an FRF, and the names under which each is found without being told; capitals do not matter."""
NUMBERS = ("frequency", "values", "real", "imag", "amplitude", "phase_deg", "phase_rad", "coherence", "variance")
"""The parts that have a number for each line."""
_VALUES = (("values",), ("real", "imag"), ("amplitude", "phase_deg"), ("amplitude", "phase_rad"), ("amplitude",))
_PHASE = ("phase", "angle", "arg")
_ACCEPTED = "values (complex) | real, imag | amplitude, phase_deg (or phase_rad) | amplitude"


def plain_name(name: str) -> str:
    """Return the last part of a path as a word of small letters, digits and underscores."""
    return re.sub(r"[^a-z0-9]+", "_", re.split(r"[/.]", name)[-1].lower()).strip("_")


def quantity_of_name(name: str) -> Quantity | None:
    """Return the quantity that a variable's own name tells, such as ``compliance``."""
    return _QUANTITY_NAMES.get(plain_name(name))


def chosen_names(where: str, held: Mapping[str, str], given: Mapping[str, str]) -> dict[str, str]:
    """Decide which name of a file is which part of the FRF.

    Parameters
    ----------
    where : str
    held : mapping of str to str
        The names in the file, and what each holds in words.
    given : mapping of str to str
        From parts to names, as the caller says.

    Returns
    -------
    dict of str to str
        From parts to names: a frequency, and one way to give the values.

    Raises
    ------
    MeasurementError
        A part or a name that is not there, two names for one part, no frequency, no values or two kinds of them.
    """
    chosen = _given(where, held, given)
    taken = set(chosen.values())
    for part, spellings in PARTS.items():
        if part in chosen or _is_replaced(part, given):
            continue
        found = [name for name in held if plain_name(name) in spellings and name not in taken]
        if len(found) > 1:
            what = f"{listing(repr(name) for name in found)} may each be the {part}; the file holds:{_table(held)}"
            raise MeasurementError(Fault(where, what, remedy=f"Say which, for example {part}={found[0]}."))
        if found:
            chosen[part] = found[0]
    _check_phase(where, held, chosen)
    _check_complete(where, held, chosen)
    return chosen


def _given(where: str, held: Mapping[str, str], given: Mapping[str, str]) -> dict[str, str]:
    for part, name in given.items():
        if part not in PARTS:
            hint = did_you_mean(part, PARTS)
            raise MeasurementError(
                Fault("the argument names", f"'{part}' is no part of an FRF.", ", ".join(PARTS), hint)
            )
        if name not in held:
            hint = did_you_mean(name, held)
            raise MeasurementError(Fault(where, f"there is no '{name}' in the file; it holds:{_table(held)}", "", hint))
    return dict(given)


def _is_replaced(part: str, given: Mapping[str, str]) -> bool:
    """Whether the caller gives the values in another way, so that this part is not looked for."""
    of_values = {name for kind in _VALUES for name in kind}
    return part in of_values and any(name in of_values for name in given)


def _check_phase(where: str, held: Mapping[str, str], chosen: Mapping[str, str]) -> None:
    """Refuse a phase that may be in degrees or in radians."""
    unclear = [name for name in held if plain_name(name) in _PHASE and name not in chosen.values()]
    if "amplitude" in chosen and unclear and not {"phase_deg", "phase_rad"} & set(chosen):
        problem = f"'{unclear[0]}' may be in degrees or in radians; the file holds:{_table(held)}"
        remedy = f"Say phase_deg={unclear[0]} or phase_rad={unclear[0]}."
        raise MeasurementError(Fault(where, problem, remedy=remedy))


def _check_complete(where: str, held: Mapping[str, str], chosen: Mapping[str, str]) -> None:
    if "frequency" not in chosen:
        problem = f"the frequency is not to be found by its name; the file holds:{_table(held)}"
        raise MeasurementError(Fault(where, problem, ", ".join(PARTS["frequency"]), "Say which it is: frequency=NAME."))
    parts = {name for kind in _VALUES for name in kind if name in chosen}
    if parts in [set(kind) for kind in _VALUES]:
        return
    what = "the file gives the values in two ways" if len(parts) > 1 else "the values are not to be found by their name"
    problem = f"{what}; the file holds:{_table(held)}"
    raise MeasurementError(Fault(where, problem, _ACCEPTED, "Say which they are, for example values=NAME."))


def _table(held: Mapping[str, str], most: int = 20) -> str:
    rows = [f"\n    {name[:60]}{': ' if what else ''}{what}" for name, what in list(held.items())[:most]]
    hidden = len(held) - most
    return ("".join(rows) or " nothing") + (f"\n    and {hidden} more" if hidden > 0 else "")


def combined(parts: Mapping[str, NDArray[Any]], place: Callable[[int], str]) -> tuple[NDArray[Any], bool]:
    """Return the values of an FRF from its parts, and whether they have a phase.

    Raises
    ------
    MeasurementError
        A negative amplitude, at its `place`.
    """
    negative = np.flatnonzero(parts["amplitude"] < 0) if "amplitude" in parts else np.zeros(0, dtype=np.intp)
    if negative.size:
        problem = f"the amplitude {parts['amplitude'][negative[0]]:.6g} is negative (decibels are not read)."
        raise MeasurementError(Fault(place(int(negative[0])), problem, "an amplitude of zero or more"))
    if "values" in parts:
        return parts["values"], True
    if "amplitude" in parts and not {"phase_deg", "phase_rad"} & set(parts):
        return parts["amplitude"], False
    values = np.empty(parts["frequency"].size, dtype=np.complex128)
    if "real" in parts:
        values.real, values.imag = parts["real"], parts["imag"]
        return values, True
    phase = np.deg2rad(parts["phase_deg"]) if "phase_deg" in parts else parts["phase_rad"]
    with np.errstate(invalid="ignore"):  # an infinite phase becomes NaN, and the recording refuses it
        values.real, values.imag = parts["amplitude"] * np.cos(phase), parts["amplitude"] * np.sin(phase)
    return values, True
