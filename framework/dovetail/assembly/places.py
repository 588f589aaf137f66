"""Where on a substructure: a position, or the label of a node."""

from __future__ import annotations

import re
from typing import Annotated

from dovetail.units import InUnit

__all__ = ["NodePlace"]

_LABEL = re.compile(r"node\s+(\S.*)|([^\W\d][\w.-]*)")
"""``node 1042``, or a word that begins with a letter."""


class _LabelOrPosition(InUnit):
    """A float in metres that may be written with a unit; a text that names a node stays a text."""

    def _parse(self, value: object) -> float | str:  # type: ignore[override]
        if isinstance(value, str) and (label := _LABEL.fullmatch(value.strip())):
            return str(label[1] or label[2])
        return super()._parse(value)


NodePlace = Annotated[float | str, _LabelOrPosition("m")]
