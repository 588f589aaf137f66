"""Tests that need an optional package."""

from __future__ import annotations

from importlib.util import find_spec

import pytest


def skip_module_without(package: str) -> None:
    """Skip all tests of the calling module if a package is not installed.

    Unlike `pytest.importorskip` this imports nothing: every worker collects every module, and runs few of them.
    """
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed", allow_module_level=True)
