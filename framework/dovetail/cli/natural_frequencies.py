"""Natural frequencies within the assembly's band, as commands print them."""

from __future__ import annotations

from dovetail.cli.terminal import say


def say_natural_frequencies(natural: list[float], damping: list[float], reason: str) -> None:
    """Print natural frequencies [Hz] in one line, and damping ratios in the next."""
    from dovetail.plain_text import hertz, number

    if not natural:
        say(reason)
        return
    say(f"{', '.join(map(hertz, natural))} Hz")
    say(f"damping ratio {', '.join(number(round(100.0 * ratio, 9) + 0.0, 3, padded=False) for ratio in damping)} %")
