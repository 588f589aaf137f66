"""Natural frequencies as the commands show them: those within the assembly's frequencies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dovetail.cli.terminal import say

if TYPE_CHECKING:
    from dovetail.assembly import Assembly, Theta

__all__ = ["natural_frequencies", "say_natural_frequencies"]

_MOST = 10


def natural_frequencies(assembly: Assembly, theta: Theta = None) -> tuple[list[float], str]:
    """Return the natural frequencies [Hz] within the assembly's frequencies, and why there are none if so."""
    import numpy as np

    from dovetail.errors import DovetailError

    try:
        natural = assembly.natural_frequencies(theta, count=_MOST)
    except DovetailError as error:
        return [], error.faults[0].problem
    elastic = natural[np.isfinite(natural)]
    inside = elastic[(elastic >= assembly.frequency[0]) & (elastic <= assembly.frequency[-1])]
    return inside.tolist(), "" if inside.size else "none lies within the frequencies"


def say_natural_frequencies(natural: list[float], reason: str) -> None:
    """Print natural frequencies [Hz] in one line."""
    from dovetail.report.wording import hertz

    say(f"{', '.join(map(hertz, natural))} Hz" if natural else reason)
