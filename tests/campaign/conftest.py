from __future__ import annotations

from pathlib import Path

import pytest

CAMPAIGN = Path(__file__).resolve().parents[2] / "assemblies" / "campaign"


@pytest.fixture(scope="session")
def campaign() -> Path:
    return CAMPAIGN
