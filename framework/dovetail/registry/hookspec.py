"""The one hook by which components come in."""

from __future__ import annotations

import pluggy

from dovetail.interfaces import Component

__all__ = ["GROUP", "HookSpecification", "hookimpl"]

GROUP = "dovetail"
"""Entry-point group, and pluggy's project name."""

hookimpl = pluggy.HookimplMarker(GROUP)
"""Marks a plugin's ``dovetail_components`` function."""

_hookspec = pluggy.HookspecMarker(GROUP)


class HookSpecification:
    """What a plugin module may define."""

    @staticmethod
    @_hookspec
    def dovetail_components() -> list[type[Component]]:  # type: ignore[empty-body]
        """Return the component classes that the plugin offers."""
