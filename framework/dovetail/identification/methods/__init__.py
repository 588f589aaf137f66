"""The ways to identify a joint, a file each."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from dovetail.identification.methods import multistart, network, posterior, refined
from dovetail.identification.result import Identification

__all__ = ["METHODS"]

METHODS: Mapping[str, Callable[..., Identification]] = {
    "network": network.identify,
    "refined": refined.identify,
    "multistart": multistart.identify,
    "posterior": posterior.identify,
}
"""Each takes an assembly, a measurement on its frequencies, a trained model or None, and its own options by name."""
