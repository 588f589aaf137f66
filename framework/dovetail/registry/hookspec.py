"""The hook by which a plugin offers its components."""

from __future__ import annotations

import pluggy

from dovetail.interfaces import Component

__all__ = ["GROUP", "HookSpecification", "hookimpl"]

GROUP = "dovetail"
"""Entry-point group, and pluggy's project name."""

hookimpl = pluggy.HookimplMarker(GROUP)
"""Decorator of a plugin's function ``dovetail_components``."""

_hookspec = pluggy.HookspecMarker(GROUP)


class HookSpecification:
    """The functions that a plugin may define."""

    @staticmethod
    @_hookspec
    def dovetail_components() -> list[type[Component]]:  # type: ignore[empty-body]
        """Return the component classes that the plugin offers."""
