"""Discovery of components: one hook, entry points, single files."""

from dovetail.registry.hookspec import GROUP, hookimpl
from dovetail.registry.registry import LoadFailure, Offer, Registry, installed_components

__all__ = ["GROUP", "LoadFailure", "Offer", "Registry", "hookimpl", "installed_components"]
