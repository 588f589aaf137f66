from __future__ import annotations

import sys
from pathlib import Path

import pytest

CAMPAIGN = Path(__file__).resolve().parents[2] / "assemblies" / "campaign"
sys.path.insert(0, str(CAMPAIGN))  # the script and its modules are run from there, not installed


@pytest.fixture(scope="session")
def campaign() -> Path:
    return CAMPAIGN
