"""Natural frequencies within the assembly's band, as commands show them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dovetail.cli.terminal import say

if TYPE_CHECKING:
    from dovetail.assembly import Assembly, Theta

__all__ = ["natural_frequencies", "say_natural_frequencies"]

_MOST = 10


def natural_frequencies(assembly: Assembly, theta: Theta = None) -> tuple[list[float], str]:
    """Return the natural frequencies [Hz] that commands show, and the reason if there are none."""
    from dovetail.assembly import natural_in_band

    natural, reason = natural_in_band(assembly, theta, count=_MOST)
    return natural.tolist(), reason


def say_natural_frequencies(natural: list[float], reason: str) -> None:
    """Print natural frequencies [Hz] in one line."""
    from dovetail.report.wording import hertz

    say(f"{', '.join(map(hertz, natural))} Hz" if natural else reason)
