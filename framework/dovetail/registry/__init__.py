"""Discovery of components by one hook, from installed packages and single files."""

from dovetail.registry.catalogue import (
    HOW_TO_OFFER,
    LoadFailure,
    Offer,
    PluginPaths,
    Registry,
    components,
    installed_components,
)
from dovetail.registry.hookspec import GROUP, hookimpl

__all__ = [
    "GROUP",
    "HOW_TO_OFFER",
    "LoadFailure",
    "Offer",
    "PluginPaths",
    "Registry",
    "components",
    "hookimpl",
    "installed_components",
]
