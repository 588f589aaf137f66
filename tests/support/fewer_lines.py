"""A measurement on fewer of its lines."""

from __future__ import annotations

from dataclasses import replace

import dovetail


def every(step: int, frf: dovetail.Frf) -> dovetail.Frf:
    """Return an FRF on every `step`-th of its lines."""
    arrays = {name: getattr(frf, name) for name in ("frequency", "values", "coherence", "variance")}
    return replace(frf, **{name: array[::step] for name, array in arrays.items() if array is not None})
