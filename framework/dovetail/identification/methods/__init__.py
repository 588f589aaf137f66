"""The ways to identify a joint, a file each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from dovetail.frf import Frf
from dovetail.identification.methods import network, refined
from dovetail.identification.result import Identification

if TYPE_CHECKING:
    from dovetail.identification.identifier import Identifier

__all__ = ["METHODS"]

METHODS: Mapping[str, Callable[[Identifier, Frf], Identification]] = {
    "network": network.identify,
    "refined": refined.identify,
}
