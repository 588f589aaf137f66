"""An identification result as a user gets it, from a hand-made FRF of two modes and the collet's twelve parameters."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dovetail.frf import Frf
from dovetail.identification import Identification, IdentifiedParameter, Mode
from dovetail.identification.truth import TrueValues

PARAMETERS = (  # name, unit, lower, upper, scale, identified, true, description
    ("Dc", "m", 26e-3, 40e-3, "linear", 35.18e-3, 34.9e-3, "equivalent outer diameter of the collet"),
    ("dc", "m", 10e-3, 18e-3, "linear", 12.4e-3, 12.97e-3, "equivalent inner diameter of the collet"),
    ("mn1", "kg", 0.02, 0.20, "linear", 0.0612, 0.0593, "nut mass on the first collet node"),
    ("mn2", "kg", 0.02, 0.20, "linear", 0.112, 0.0823, "nut mass on the second collet node"),
    ("kt_tc", "N/m", 1e8, 2e9, "log", 7.31e8, 7.218e8, "translational stiffness of the tool-collet layer, per node"),
    ("kr_tc", "N m/rad", 2e3, 6e4, "log", 1.702e4, 1.871e4, "rotational stiffness of the tool-collet layer, per node"),
    ("ct_tc", "N s/m", 10.0, 1000.0, "log", 133.0, 290.0, "translational damping of the tool-collet layer, per node"),
    ("cr_tc", "N m s/rad", 0.01, 5.0, "log", 0.402, 0.779, "rotational damping of the tool-collet layer, per node"),
    ("kt_hc", "N/m", 3e8, 5e9, "log", 5.62e9, 1.812e9, "translational stiffness of the holder-collet layer, per node"),
    ("kr_hc", "N m/rad", 5e4, 2e6, "log", 6.05e5, 5.641e5, "rotational stiffness of the holder-collet layer, per node"),
    ("ct_hc", "N s/m", 10.0, 1000.0, "log", 121.0, 360.0, "translational damping of the holder-collet layer, per node"),
    ("cr_hc", "N m s/rad", 0.01, 5.0, "log", 0.216, 1.497, "rotational damping of the holder-collet layer, per node"),
)


def two_modes(frequency: np.ndarray, modes: tuple[tuple[float, float], ...], mass: float = 1.2) -> np.ndarray:
    """Accelerance of a free body of this mass with modes (natural frequency [Hz], modal constant [1/kg])."""
    omega = 2 * np.pi * frequency
    receptance = -1.0 / (mass * omega**2) + 0j
    for natural, constant in modes:
        own = (2 * np.pi * natural) ** 2
        receptance += constant / (own * (1 + 0.02j) - omega**2)
    return -(omega**2) * receptance


@pytest.fixture(scope="session")
def result() -> Identification:
    frequency = np.arange(100.0, 9001.0, 2.0)
    noise = np.random.default_rng(1).standard_normal((2, frequency.size))
    clean = two_modes(frequency, ((1330.0, 4.0), (6610.0, 6.5), (8240.0, 2.0)))
    measured = clean * (1 + 0.01 * (noise[0] + 1j * noise[1]))
    parameters = {
        name: IdentifiedParameter(
            name, value, unit, lower, upper, scale, lower <= value <= upper, description, "collet"
        )
        for name, unit, lower, upper, scale, value, _, description in PARAMETERS
    }
    return Identification(
        method="network",
        parameters=parameters,
        known={},
        frf=Frf(
            frequency, two_modes(frequency, ((1352.0, 4.2), (6540.0, 6.0), (8330.0, 2.2))), "accelerance", label="model"
        ),
        measured=Frf(frequency, measured, "accelerance", label="h0_j_t0_60Nm.uff"),
        modes=(Mode(1352.0, 1352.4, 1330.2), Mode(6540.0, 6539.2, 6609.1), Mode(8330.0, 8331.1, 8241.7)),
        warnings=("kt_hc = 5.62e+09 N/m lies outside its range, 3e+08 N/m to 5e+09 N/m.",),
        provenance=_provenance(),
    )


@pytest.fixture(scope="session")
def truth() -> TrueValues:
    return TrueValues(
        {name: true for name, _, _, _, _, _, true, _ in PARAMETERS},
        (1330.0, 6610.0, 8240.0),
        synthetic=True,
        note="Truth behind h0_j_t0_60Nm.uff: mesh 4 times finer, 1 % noise.",
    )


@pytest.fixture(scope="session")
def amplitude_only(result: Identification) -> Identification:
    """The same result from a measurement without phase."""
    measured = Frf(
        result.measured.frequency, result.measured.amplitude, "accelerance", has_phase=False, label="amplitude.csv"
    )
    return replace(result, measured=measured)


def _provenance() -> dict[str, Any]:
    metrics = {
        name: {
            "r2": 0.97 - 0.08 * index,
            "rmse": 0.05 + 0.01 * index,
            "mae": 0.03 + 0.01 * index,
            "rmse_si": 0.05 * (upper - lower),
            "mae_si": 0.03 * (upper - lower),
            "unit": unit,
        }
        for index, (name, unit, lower, upper, *_) in enumerate(PARAMETERS)
    }
    return {
        "assembly": "bt40-er32-t0",
        "description_sha256": "c0ffee" * 10 + "abcd",
        "measurement": "h0_j_t0_60Nm.uff",
        "measured_quantity": "accelerance",
        "seed": 0,
        "training_samples": 4800,
        "components": {"substructure timoshenko_beam": "dovetail-frf 0.1.0", "joint collet": "dovetail-frf 0.1.0"},
        "packages": {"python": "3.11.7", "dovetail-frf": "0.1.0", "numpy": "2.1.0", "torch": "2.5.0"},
        "description": json.dumps({"dovetail": 1, "name": "bt40-er32-t0", "frequency": {"start": 100.0}}),
        "evaluation": {
            "parameters": metrics,
            "training_samples": 4800,
            "test_samples": 1200,
            "seed": 0,
            "seconds": {"dataset": 12.0},
        },
    }
