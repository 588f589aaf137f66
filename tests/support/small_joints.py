"""Small joints with their measurements, on which marginal likelihoods are compared with other ways to compute them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import dovetail

ASSEMBLIES = Path(__file__).parents[2] / "assemblies"
_LOG = {"scale": "log"}


def _axis(start: int, stop: int, step: int) -> dict[str, str]:
    return {"start": f"{start} Hz", "stop": f"{stop} Hz", "step": f"{step} Hz"}


def _on_mounts(mounts: dict[str, dict[str, Any]], frequency: dict[str, str]) -> dict[str, Any]:
    connect = {"a": {"to": "mass", "at": "0 mm"}, "b": {"to": "base", "at": "0 mm"}}
    mount = {"model": "spring_damper", "direction": "x", "connect": connect}
    return {
        "dovetail": 1,
        "name": "mass-on-mounts",
        "frequency": frequency,
        "substructures": {"mass": {"model": "lumped", "masses": [{"mass": "1 kg"}]}, "base": {"model": "ground"}},
        "joints": {name: {**mount, "parameters": parameters} for name, parameters in mounts.items()},
        "response": {"at": "mass", "position": "0 mm", "direction": "x", "quantity": "accelerance"},
    }


def _rod(**parameters: Any) -> dict[str, Any]:
    described = {
        "extends": str(ASSEMBLIES / "series" / "clamped_rod.yaml"),
        "frequency": _axis(100, 6000, 50),
    }
    return {**described, "joints": {"clamp": {"parameters": parameters}}} if parameters else described


_K = {"range": ["1e5 N/m", "1e7 N/m"], **_LOG}
_C = {"range": ["1 N s/m", "300 N s/m"], **_LOG}

CASES: dict[str, tuple[dict[str, Any], dict[str, float], float]] = {
    "mount": (_on_mounts({"mount": {"k": _K, "c": _C}}, _axis(50, 400, 5)), {"k": 1e6, "c": 30.0}, 0.05),
    "mount in noise": (
        _on_mounts({"mount": {"k": _K, "c": _C}}, _axis(50, 400, 50)),
        {"k": 1e6, "c": 100.0},
        0.8,
    ),
    "two mounts": (  # only the sum of the stiffnesses shows: a curved valley on logarithmic scales
        _on_mounts({"left": {"k": _K, "c": "10 N s/m"}, "right": {"k": _K, "c": "10 N s/m"}}, _axis(50, 400, 5)),
        {"left.k": 4e5, "right.k": 8e5},
        0.05,
    ),
    "clamped rod": (_rod(), {"k": 3e7, "kr": 3e4, "c": 60.0, "cr": 0.6}, 0.02),
    "clamped rod without rotation": (
        _rod(kr="3e4 N m/rad", cr="0.6 N m s/rad"),
        {"k": 3e7, "c": 60.0},
        0.02,
    ),
}
"""Descriptions, true parameters, and the noise of each line over the mean amplitude."""


def measured(case: str) -> tuple[dovetail.Assembly, dovetail.Frf]:
    """Return the assembly of a case and its FRF with noise of a known size."""
    described, truth, noise = CASES[case]
    assembly = dovetail.load(described)
    values = assembly.frf(truth)
    variance = np.full(len(values), (noise * np.abs(values).mean()) ** 2)
    error = np.random.default_rng(5).standard_normal((len(values), 2)) @ [1.0, 1.0j]
    frf = dovetail.Frf(assembly.frequency, values + np.sqrt(variance / 2.0) * error, "accelerance")
    return assembly, replace(frf, variance=variance)
