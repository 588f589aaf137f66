"""Assemblies and truths that several tests share."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import dovetail

# Before torch or numba load OpenMP: threads that spin while they wait starve each other on a busy machine.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

ROOT = Path(__file__).resolve().parent.parent
ASSEMBLIES = ROOT / "assemblies"


@pytest.fixture(scope="session")
def assemblies() -> Path:
    return ASSEMBLIES


@pytest.fixture(scope="session")
def collet() -> dovetail.Assembly:
    """The reference assembly H0-J-T0."""
    return dovetail.load(ASSEMBLIES / "bt40_er32.yaml")


@pytest.fixture(scope="session")
def sdof() -> dovetail.Assembly:
    return dovetail.load(ASSEMBLIES / "sdof.yaml")


@pytest.fixture(scope="session")
def torque_20() -> np.ndarray:
    """Ground truth at 20 N m, in the order of the collet's parameters."""
    return np.array(
        [33.306e-3, 13.181e-3, 0.083245, 0.073369, 5.9704e8, 1.7616e4, 400, 1.2, 1.3022e9, 3.5244e5, 500, 2.2]
    )


@pytest.fixture(scope="session")
def torque_100() -> np.ndarray:
    return np.array(
        [36.119e-3, 12.839e-3, 0.048748, 0.088281, 8.1204e8, 1.9413e4, 240, 0.6, 2.1673e9, 7.3429e5, 300, 1.21]
    )
