"""The structures of the campaign as they are struck: parameters at a torque, finer mesh, accelerometer, spindle."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import dovetail
from dovetail.units import to_si

__all__ = ["ACCELEROMETER", "HERE", "described", "finer", "on_spindle", "parameters_at", "with_accelerometer"]

HERE = Path(__file__).resolve().parent
ACCELEROMETER = 1.2e-3
"""kg."""

FINER = 4
"""Elements of the struck structure for one of the descriptions."""

_TRUTH = {
    "Dc": (33.306e-3, 36.119e-3),
    "dc": (13.181e-3, 12.839e-3),
    "mn1": (0.083245, 0.048748),
    "mn2": (0.073369, 0.088281),
    "kt_tc": (5.9704e8, 8.1204e8),
    "kr_tc": (1.7616e4, 1.9413e4),
    "ct_tc": (400.0, 240.0),
    "cr_tc": (1.2, 0.6),
    "kt_hc": (1.3022e9, 2.1673e9),
    "kr_hc": (3.5244e5, 7.3429e5),
    "ct_hc": (500.0, 300.0),
    "cr_hc": (2.2, 1.21),
}
"""The joint's parameters at 20 and at 100 N m, SI."""

Structure = dict[str, Any]


def parameters_at(torque: float) -> dict[str, float]:
    """Return the true parameters at a tightening torque between 20 and 100 N m."""
    share = (1 - math.exp(-(torque - 20) / 30)) / (1 - math.exp(-80 / 30))
    return {name: low * (high / low) ** share for name, (low, high) in _TRUTH.items()}


def described(name: str) -> Structure:
    """Return a description of this folder with what it extends, as a mapping."""
    structure: Structure = json.loads(dovetail.load(HERE / f"{name}.yaml").description.text)
    return structure


def finer(structure: Structure) -> Structure:
    """Divide every element in four, also those of the collet.

    Nodes of the coarse mesh stay nodes, so that contact nodes, nut masses and measuring points are the same points of
    the structure: the collet's springs stand 10 mm apart as before. What changes is the discretisation, and the taper,
    which has four times as many steps.
    """
    for part in structure["substructures"].values():
        for section in part.get("sections", ()):
            section["elements"] = FINER * section.get("elements", 1)
    for joint in structure.get("joints", {}).values():
        if joint["model"] == "collet":
            joint["elements_per_segment"] = FINER
    return structure


def with_accelerometer(structure: Structure, position: float) -> Structure:
    """Fix the accelerometer's mass to the structure's measured part at a position [m]."""
    part = structure["response"]["at"]
    structure["substructures"]["accelerometer"] = {"model": "lumped", "masses": [{"mass": ACCELEROMETER}]}
    structure.setdefault("joints", {})["wax"] = {
        "model": "rigid",
        "direction": "x",
        "connect": {"a": {"to": part, "at": position}, "b": {"to": "accelerometer", "at": 0.0}},
    }
    return structure


def on_spindle(structure: Structure) -> Structure:
    """Mount a holder that is described up to its flange on the campaign's spindle."""
    spindle = described("spindle")
    holder = structure["substructures"]["holder"]["sections"]
    flange = math.fsum(to_si(section["length"], "m") for section in holder)
    structure["substructures"] |= spindle["substructures"]
    structure["joints"] = structure.get("joints", {}) | spindle["joints"]
    structure["joints"]["flange"] = {
        "model": "rigid",
        "connect": {"a": {"to": "holder", "at": flange}, "b": {"to": "spindle", "at": 0.0}},
    }
    return structure
