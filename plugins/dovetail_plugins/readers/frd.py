"""MATLAB's frequency response data (frd): structs of arrays, and objects that only MATLAB can open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import ArrayEntry, Fault, MeasurementError

_MODELS = ("frd", "idfrd", "genfrd", "ufrd")
"""Classes of frequency response data."""
_HERTZ = {
    **dict.fromkeys(("hz", "cycles/second", "cycles/s"), "Hz"),
    "khz": "kHz",
    **dict.fromkeys(("rad/s", "rad/sec", "rad/second"), "rad/s"),
}
"""Accepted units of the frequency; ``TimeUnit`` is a second unless another one is given."""
_SECONDS = ("", "s", "second", "seconds")


def closed_object(path: Path, name: str, label: str) -> tuple[ArrayEntry, Fault | None]:
    """Return the entry of an object that only MATLAB can open and, if it is an frd, what to type there.

    Parameters
    ----------
    path : Path
    name, label : str
        Of the object and of its class.
    """
    problem = f"'{name}' is an object of the class {label[:40]}, which only MATLAB opens."
    typed = f"{name} = chgFreqUnit({name},'Hz'); [H,f] = frdata({name},'v'); save('frf.mat','H','f')"
    remedy = f"Type there: {typed}" if label in _MODELS else ""
    fault = Fault(str(path), problem, "arrays, or a struct with ResponseData, Frequency and FrequencyUnit", remedy)
    entry = ArrayEntry(f"an object of the class {label[:40]}, which only MATLAB opens", partial(_refuse, fault))
    return entry, fault if remedy else None


def with_frd_units(path: Path, entries: Mapping[str, ArrayEntry], separator: str) -> dict[str, ArrayEntry]:
    """Return the entries with the units of frd structs attached, as their fields state them.

    Parameters
    ----------
    path : Path
    entries : mapping of str to ArrayEntry
    separator : str
        Between a struct and its fields.
    """
    completed = dict(entries)
    for key in entries:
        prefix, _, field = key.rpartition(separator)
        if field != "ResponseData" or not prefix or f"{prefix}{separator}Frequency" not in entries:
            continue
        fields = {name[len(prefix) + 1 :]: name for name in entries if name.startswith(f"{prefix}{separator}")}
        texts = {name: _text(entries[full]) for name, full in fields.items() if "Unit" in name}
        completed[fields["Frequency"]] = _frequency(path, prefix, entries[fields["Frequency"]], texts)
        units = [_unit(name, texts) for name in ("OutputUnit", "InputUnit")]
        attributes = {"unit": f"({units[0]})/({units[1]})"} if any(units) else {}
        response = partial(_complex, entries[key])
        completed[key] = replace(entries[key], load=response, attributes=attributes)
        for name in texts:
            del completed[fields[name]]
    return completed


def _frequency(path: Path, name: str, entry: ArrayEntry, texts: Mapping[str, str]) -> ArrayEntry:
    label = " and ".join(dict.fromkeys(texts[key].strip() for key in ("FrequencyUnit", "Units") if texts.get(key)))
    per = "/s" if texts.get("TimeUnit", "").strip().lower() in _SECONDS else "/TimeUnit"
    if (unit := _HERTZ.get(label.lower().replace("/timeunit", per))) is not None:
        return replace(entry, attributes={"unit": unit})
    problem = f"'{name}' is frequency response data, and its frequency is in '{label[:40]}'."
    remedy = "Set it in MATLAB, for example FrequencyUnit = 'Hz', and save again."
    accepted = "FrequencyUnit or Units: Hz, kHz, rad/s, rad/TimeUnit in seconds"
    return replace(entry, load=partial(_refuse, Fault(str(path), problem, accepted, remedy)))


def _unit(name: str, texts: Mapping[str, str]) -> str:
    """Return the unit of all channels; for a cell, all different units."""
    return " and ".join(sorted({text.strip() for field, text in texts.items() if field.partition("{")[0] == name}))


def _text(entry: ArrayEntry) -> str:
    array = entry.load() if entry.what == "text" else np.array("")
    return str(array.reshape(())[()]) if array.size == 1 and array.dtype.kind == "U" else ""


def _complex(entry: ArrayEntry) -> NDArray[Any]:
    array = entry.load()
    return array.astype(np.complex128) if array.dtype.kind in "fiu" else array


def _refuse(fault: Fault) -> NDArray[Any]:
    raise MeasurementError(fault)
