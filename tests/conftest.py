"""Assemblies and truths that several tests share."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import dovetail

# Before torch or numba load OpenMP: threads that spin while they wait starve each other on a busy machine.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
PARALLEL = "PYTEST_XDIST_WORKER" in os.environ
if PARALLEL:  # every core has a process of its own already
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parent.parent
ASSEMBLIES = ROOT / "assemblies"


@pytest.fixture(scope="session", autouse=PARALLEL)
def one_thread_of_linear_algebra():
    """NumPy is loaded already, so that its libraries do not look at the environment again."""
    with threadpool_limits(1, user_api="blas"):
        yield


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
