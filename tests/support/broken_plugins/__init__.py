"""Plugins with a fault, for the checks of the conformance kit; `lists` holds them once their modules are imported."""

from __future__ import annotations

import importlib
import pkgutil


def load_broken_plugins() -> None:
    """Import every module of broken plugins, which enters them in the lists."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
