"""A measurement, and helpers for files that are refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dovetail.frf import Frf
from dovetail_plugins.readers import guarded_arrays as guarded
from support.measured_files import accelerance, fault_of


@pytest.fixture
def measured() -> Frf:
    """An accelerance at 1.5625 Hz, with coherence."""
    frequency = 1.5625 * np.arange(64, 400)
    values = accelerance(frequency, (311.7, 0.01, 0.4), (540.2, 0.004, 0.7))
    return Frf(frequency, values, "accelerance", coherence=np.linspace(0.8, 1.0, frequency.size), label="bench")


@pytest.fixture
def refused(tmp_path: Path) -> Callable[..., str]:
    """Write bytes or text to a file of that name and return how it is refused."""

    def refuse(name: str, content: bytes | str, **arguments: Any) -> str:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return fault_of(path, **arguments)

    return refuse


@pytest.fixture
def unguarded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read HDF5 files and MATLAB workspaces in this process: sound ones need no guard, which starts slowly."""
    monkeypatch.setattr(guarded, "call_guarded", lambda function, *arguments, error: function(*arguments))
