"""Natural frequencies within the assembly's band, as commands show them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dovetail.cli.terminal import say

if TYPE_CHECKING:
    from dovetail.assembly import Assembly, Theta

_MOST = 10


def natural_frequencies(assembly: Assembly, theta: Theta = None) -> tuple[list[float], list[float], str]:
    """Return the natural frequencies [Hz] that commands show, their damping ratios, and why there are none."""
    from dovetail.assembly import modes_in_band

    modes, reason = modes_in_band(assembly, theta, count=_MOST)
    return [mode.natural_frequency for mode in modes], [mode.damping_ratio for mode in modes], reason


def say_natural_frequencies(natural: list[float], damping: list[float], reason: str) -> None:
    """Print natural frequencies [Hz] in one line, and damping ratios in the next."""
    from dovetail.plain_text import hertz, number

    if not natural:
        say(reason)
        return
    say(f"{', '.join(map(hertz, natural))} Hz")
    say(f"damping ratio {', '.join(number(100.0 * ratio, 3, padded=False) for ratio in damping)} %")
