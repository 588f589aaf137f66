"""The page of the kit's checks is up to date with the script that writes it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "docs" / "make_conformance.py"


def test_the_page_of_checks_is_up_to_date():
    spec = importlib.util.spec_from_file_location("make_conformance", SCRIPT)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert script.PAGE.read_text(encoding="utf-8") == script.page(), "run 'python docs/make_conformance.py'"
