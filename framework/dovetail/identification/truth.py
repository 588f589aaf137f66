"""The true parameters of a synthetic measurement, for comparison with the identified ones."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from dovetail.assembly import Assembly
from dovetail.atomic_files import read_bounded
from dovetail.errors import Fault, MeasurementError, UnitError, did_you_mean, listing
from dovetail.identification.parameters import IdentifiedParameter
from dovetail.units import to_si

_FORM = '{"parameters": {"k": "3 MN/m"}}, each by its name, with a unit'
_KEYS = ("synthetic", "note", "parameters", "natural_frequencies_Hz")


class _Named(Protocol):
    """A parameter, identified or to be identified."""

    @property
    def name(self) -> str: ...

    @property
    def unit(self) -> str: ...


@dataclass(frozen=True)
class TrueValues:
    """True parameters and natural frequencies.

    Parameters
    ----------
    parameters : mapping of str to float
        SI values by name; some parameters may be missing.
    natural_frequencies : tuple of float
        Hz.
    synthetic : bool
        Whether the measurement was simulated.
    note : str
        Source of the truth, for the reader.
    """

    parameters: Mapping[str, float] = field(default_factory=dict)
    natural_frequencies: tuple[float, ...] = ()
    synthetic: bool = False
    note: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "natural_frequencies", tuple(self.natural_frequencies))

    def with_tied(self, parameters: Iterable[IdentifiedParameter]) -> dict[str, float]:
        """Return the true values by name; those of tied parameters are derived unless they are given."""
        values: dict[str, float] = {}
        for parameter in parameters:
            if parameter.name in self.parameters:
                values |= parameter.with_tied(self.parameters[parameter.name])
        return {**values, **self.parameters}


def read_truth(path: str | Path, parameters: Iterable[_Named]) -> TrueValues:
    """Read the truth behind a measurement.

    Parameters
    ----------
    path : str or Path
        JSON: ``{"synthetic": true, "note": "...", "parameters": {"Dc": "34.6 mm", ...}, "natural_frequencies_Hz":
        [1319.0, ...]}``. Each key may be missing; a value without a unit is SI.
    parameters : iterable
        All parameters that the file may contain, with ``name`` and ``unit``, such as ``assembly.parameters``; those of
        a result, ``result.parameters.values()``, with the parameters that are tied to them.

    Returns
    -------
    TrueValues

    Raises
    ------
    DovetailError
        The file cannot be read, or contains an unknown parameter or key, or a value of a wrong dimension; all such
        faults are reported together.
    """
    file = Path(path)
    content = _object(file)
    faults = [_unknown(file, key, _KEYS, "a key of a truth file") for key in content if key not in _KEYS]
    values = _parameters(file, content.get("parameters", {}), parameters, faults)
    frequencies = _frequencies(file, content.get("natural_frequencies_Hz", []), faults)
    synthetic, note = content.get("synthetic", False), content.get("note", "")
    if not isinstance(synthetic, bool):
        faults.append(Fault(f"{file}  synthetic", f"{synthetic!r} is not a truth value.", "true, false"))
    if not isinstance(note, str):
        faults.append(Fault(f"{file}  note", f"{note!r} is not a text.", 'a text in "quotes"'))
    if faults:
        raise MeasurementError(*faults)
    return TrueValues(values, frequencies, synthetic, note)


def truth_text(
    assembly: Assembly, theta: Mapping[str, float], natural_frequencies: Sequence[float], noise: float = 0.0
) -> str:
    """Return the content of a file for `read_truth`: parameters [SI] and natural frequencies [Hz] of a simulation."""
    content = {
        "synthetic": True,
        "note": f"Simulated from {assembly.name}, noise {noise:g}.",
        "parameters": {p.name: f"{theta[p.name]:.9g} {p.unit}".removesuffix(" 1") for p in assembly.parameters},
        "natural_frequencies_Hz": list(natural_frequencies),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _object(file: Path) -> dict[str, Any]:
    content = read_bounded(file)
    try:
        entries = json.loads(content, object_pairs_hook=_without_duplicates)
    except (ValueError, RecursionError) as error:
        raise MeasurementError(Fault(str(file), f"this is not JSON: {error}.", _FORM)) from None
    if not isinstance(entries, dict):
        raise MeasurementError(
            Fault(str(file), f"a truth file holds one object, not {entries!r:.40}.", listing(_KEYS), "Write {...}.")
        )
    return entries


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for key, value in pairs:
        if key in entries:
            raise ValueError(f"the key '{key}' occurs twice")
        entries[key] = value
    return entries


def _parameters(file: Path, entries: object, parameters: Iterable[_Named], faults: list[Fault]) -> dict[str, float]:
    if not isinstance(entries, dict):
        faults.append(Fault(f"{file}  parameters", f"{entries!r:.40} is not an object of names and values."))
        return {}
    every = list(parameters)
    units = {parameter.name: parameter.unit for parameter in every}
    for parameter in every:
        if isinstance(parameter, IdentifiedParameter):
            units |= {tied.name: parameter.unit for tied in parameter.tied}
    values = {}
    for name, value in entries.items():
        if name not in units:
            faults.append(_unknown(file, f"parameters.{name}", units, "a parameter of this assembly"))
            continue
        try:
            values[name] = to_si(value, units[name])
        except UnitError as error:
            faults.append(Fault(f"{file}  parameters.{name}", error.faults[0].problem, f"a unit of {units[name]}"))
    return values


def _frequencies(file: Path, value: object, faults: list[Fault]) -> tuple[float, ...]:
    entries = value if isinstance(value, list) else [value]
    try:
        frequencies = tuple(to_si(entry, "Hz") for entry in entries)
    except UnitError as error:
        faults.append(
            Fault(f"{file}  natural_frequencies_Hz", error.faults[0].problem, "a list such as [1319.0, 6446]")
        )
        return ()
    if any(frequency <= 0 for frequency in frequencies):
        faults.append(Fault(f"{file}  natural_frequencies_Hz", "a natural frequency is not positive."))
    return tuple(sorted(frequencies))


def _unknown(file: Path, path: str, accepted: Iterable[str], kind: str) -> Fault:
    names = list(accepted)
    word = path.rpartition("parameters.")[2]
    return Fault(f"{file}  {path}", f"'{word}' is not {kind}.", listing(names, 20), did_you_mean(word, names))
