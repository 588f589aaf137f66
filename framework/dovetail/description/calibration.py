"""The measurement chains of a description: gain, sign, phase, delay, a sensor's mass, an exponential window."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dovetail.description.checked import SHARED, ParameterEntry, Tie
from dovetail.description.parameter_sections import DescribedParameters
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Item, Path, format_value, plain_values
from dovetail.errors import did_you_mean, listing
from dovetail.interfaces import Parameter
from dovetail.units import format_quantity

MASS = Parameter("mass", "kg", 0.0, 0.05, "linear", "Of the sensor at the response")
WINDOW = Parameter("window", "1/s", 0.0, 100.0, "linear", "Decay rate of an exponential window over the signals")
CHAIN = (
    Parameter("gain", "1", 0.8, 1.25, "log", "Measured over true amplitude"),
    Parameter("phase", "rad", -0.5, 0.5, "linear", "Of the measured FRF ahead of the true one, on all lines"),
    Parameter("delay", "s", 0.0, 1e-4, "linear", "Of the response behind the force"),
    MASS,
    WINDOW,
)
"""What may be unknown of a response's measurement chain; a description states the ranges."""
SIGN = Parameter("sign", "1", -1.0, 1.0, "linear", "1, or -1 where the sensor or the force points the other way")
"""Known, or determined from the measurement before anything is fitted; NaN until then."""
_ROUNDED = 1e-3
"""Share by which 3.1416 may exceed half a turn."""


def read_calibration(path: Path, faults: FaultList, others: Sequence[str] = ()) -> ParameterEntry:
    """Read the measurement chain of a response, or what the chains of all responses share.

    Parameters
    ----------
    path : Path
        Of the section ``calibration:``, which need not exist.
    faults : FaultList
        Collects the faults.
    others : sequence of str
        Keys of the section that are read elsewhere.
    """
    section = faults.root.at(path)
    if section is None:
        return ParameterEntry()
    if not section.is_mapping:
        faults.add(path, f"{format_value(section.value)} is not a section of keys and values.", key=True)
        return ParameterEntry()
    known = {parameter.name: parameter for parameter in CHAIN}
    described = DescribedParameters({name: known[name] for name in known if name in section.entries})
    for name, entry in section.entries.items():
        if name in known:
            described.read((*path, name), name, entry.item, faults)
        elif name == "sign":
            described.known[name] = SIGN
            described.fixed[name] = _read_sign((*path, name), entry.item, faults)
        elif name not in others:
            accepted = listing([*(f"{p.name} [{p.unit}]" for p in CHAIN), "sign", *others])
            problem = f"{format_value(name)} is not a key of a calibration."
            faults.add((*path, name), problem, accepted, did_you_mean(name, [*known, "sign", *others]), key=True)
    for name, parameter in described.known.items():
        lowest = described.fixed.get(name, parameter.lower)
        if name in ("gain", "mass", "window") and (lowest < 0 or (name == "gain" and lowest == 0)):
            bound = "positive" if name == "gain" else "0 or more"
            problem = f"{name} must be {bound}, but is {format_quantity(lowest, parameter.unit)} here."
            remedy = "Write 'sign: unknown' or 'sign: -1' for the sign, and 'scale: log' with a wide 'sd'."
            faults.add((*path, name), problem, remedy=remedy if name == "gain" else "")
    _check_phase(path, described, faults)
    return ParameterEntry(**described.entry)


def _check_phase(path: Path, described: DescribedParameters, faults: FaultList) -> None:
    """Report a phase of more than half a turn, which is hardly in radians, and one that is also the sign."""
    if "phase" not in described.known:
        return
    parameter, value = described.known["phase"], described.fixed.get("phase")
    largest = max(map(abs, (parameter.lower, parameter.upper) if value is None else (value,)))
    if largest > np.pi * (1.0 + _ROUNDED):
        problem = f"a phase of {largest:g} rad is more than half a turn."
        remedy = f"Were {largest:g} deg meant? A number without a unit is in rad."
        faults.add((*path, "phase"), problem, "-180 deg to 180 deg", remedy)
    elif largest > np.pi / 2 and "sign" in described.known and described.fixed["sign"] != 1.0:
        problem = "a phase of more than 90 deg turns the sign too, and 'sign' is given."
        faults.add((*path, "phase"), problem, remedy="Keep one of the two, or a phase within 90 deg.")


def shared_by(shared: ParameterEntry, own: ParameterEntry) -> ParameterEntry:
    """Return a response's entry completed by ties to the shared parameters; the shared mass is at sensors instead."""
    common = [parameter for parameter in shared.parameters if parameter.name != "mass"]
    ties = {parameter.name: Tie(SHARED, parameter.name) for parameter in common if parameter.name != "sign"}
    sign = {"sign": shared.fixed["sign"]} if "sign" in shared.fixed else {}
    return ParameterEntry(parameters=(*own.parameters, *common), fixed={**own.fixed, **sign}, ties={**own.ties, **ties})


def _read_sign(path: Path, sign: Item, faults: FaultList) -> float:
    """Return 1 or -1, or NaN for a sign that is to be determined from the measurement."""
    if sign.value == "unknown":
        return np.nan
    if isinstance(sign.value, (int, float)) and not isinstance(sign.value, bool) and abs(sign.value) == 1:
        return float(sign.value)
    faults.add(path, f"{format_value(plain_values(sign))} is not a sign.", "1, -1 or unknown")
    return 1.0
