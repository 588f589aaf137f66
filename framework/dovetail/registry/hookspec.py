"""The hooks by which a plugin offers components and commands, and gives defaults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import pluggy

if TYPE_CHECKING:
    from dovetail.interfaces import Component
    from dovetail.registry.command import Command

GROUP = "dovetail"
"""Entry-point group, and pluggy's project name."""

hookimpl = pluggy.HookimplMarker(GROUP)
"""Decorator of the functions of a plugin that are named in `HookSpecification`."""

_hookspec = pluggy.HookspecMarker(GROUP)


class HookSpecification:
    """The functions that a plugin may define."""

    @staticmethod
    @_hookspec
    def dovetail_components() -> list[type[Component]]:  # type: ignore[empty-body]
        """Return the component classes that the plugin offers."""

    @staticmethod
    @_hookspec
    def dovetail_commands() -> list[Command]:  # type: ignore[empty-body]
        """Return the commands that the plugin adds to the command line."""

    @staticmethod
    @_hookspec
    def dovetail_defaults() -> Mapping[str, Any]:  # type: ignore[empty-body]
        """Return the defaults for sections that a user omits; Dovetail's own plugins provide all of them.

        Returns
        -------
        mapping
            Plain values. ``identification``: sections that are used if a description lacks them.
            ``robustness`` and ``compare``: the methods that these commands try.
        """
