"""Modes within an assembly's band, or the reason why there are none."""

from __future__ import annotations

from dovetail.assembly.model import Assembly
from dovetail.assembly.theta import Theta
from dovetail.assembly.vibration_modes import VibrationMode
from dovetail.errors import DovetailError


def modes_in_band(assembly: Assembly, theta: Theta = None, *, count: int) -> tuple[tuple[VibrationMode, ...], str]:
    """Return those of the `count` lowest modes whose natural frequencies lie within the assembly's frequencies.

    Returns
    -------
    modes : tuple of VibrationMode
        By increasing frequency. Empty where a part has no matrices.
    reason : str
        Why there are none; empty where there are some.
    """
    try:
        modes = assembly.modes(theta, count=count)
    except DovetailError as error:
        return (), error.faults[0].problem
    low, high = assembly.frequency[[0, -1]]
    inside = tuple(mode for mode in modes if low <= mode.natural_frequency <= high)
    return inside, "" if inside else "none lies within the frequencies"
