"""A state of arrays as plain values for JSON, and back, without a change of any bit."""

from __future__ import annotations

import base64
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

_ARRAY = "__array__"
_TYPES = ("<f8", "|b1")


def to_plain(value: Any) -> Any:
    """Return numbers, arrays, tuples and dataclasses of them as plain values; arrays as base64 of their bytes."""
    if isinstance(value, np.ndarray):
        kind = _TYPES[1] if value.dtype == np.bool_ else _TYPES[0]
        content = base64.b64encode(np.ascontiguousarray(value.astype(kind)).tobytes()).decode("ascii")
        return {_ARRAY: content, "type": kind, "shape": list(value.shape)}
    if is_dataclass(value):
        return {field.name: to_plain(getattr(value, field.name)) for field in fields(value)}
    return [to_plain(one) for one in value] if isinstance(value, (list, tuple)) else value


def from_plain(value: Any) -> Any:
    """Return plain values with arrays in place of their base64, and tuples of lists.

    Raises
    ------
    ValueError, KeyError, TypeError
        An array is damaged.
    """
    if isinstance(value, dict) and _ARRAY in value:
        if value["type"] not in _TYPES:
            raise ValueError(value["type"])
        numbers = np.frombuffer(base64.b64decode(value[_ARRAY], validate=True), value["type"])
        return numbers.reshape(value["shape"]).copy()
    if isinstance(value, dict):
        return {name: from_plain(one) for name, one in value.items()}
    return tuple(from_plain(one) for one in value) if isinstance(value, list) else value
