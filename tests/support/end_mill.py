"""An end mill in a machine whose spindle and joints are unknown, and a measurement with another tool."""

from __future__ import annotations

import numpy as np
import yaml

import dovetail
from support.noisy_measurements import noisy

MACHINE = """
dovetail: 1
name: end mill
frequency: {start: 400 Hz, stop: 3500 Hz, step: 4 Hz}
substructures:
  tool:
    model: timoshenko_beam
    material: {young: 580 GPa, density: 14400 kg/m^3, poisson: 0.22, loss_factor: 0.003}
    sections:
      - {length: 38 mm, outer: 13 mm, elements: 4}
      - {length: 66 mm, outer: 16 mm, elements: 6}
  holder:
    model: timoshenko_beam
    material: {young: 205 GPa, density: 7800 kg/m^3, poisson: 0.3, loss_factor: 0.003}
    sections: [{length: 104 mm, outer: 50 mm, inner: 18 mm, elements: 10}]
  spindle:
    model: lumped
    masses: [{mass: {range: [1 kg, 30 kg], scale: log}, inertia: {range: [1e-3 kg m^2, 1 kg m^2], scale: log}}]
  housing: {model: ground}
joints:
  collet:
    model: spring_damper
    connect: {a: {to: tool, at: 104 mm}, b: {to: holder, at: 0 mm}}
  taper:
    model: spring_damper
    connect: {a: {to: holder, at: 104 mm}, b: {to: spindle, at: 0 mm}}
  bearings:
    model: spring_damper
    connect: {a: {to: spindle, at: 0 mm}, b: {to: housing, at: 0 mm}}
response: {at: tool, position: 0 mm, quantity: receptance}
"""
RANGES = {
    "k": ["1e6 N/m", "1e10 N/m"],
    "c": ["1 N s/m", "1e4 N s/m"],
    "kr": ["1e3 N m/rad", "1e7 N m/rad"],
    "cr": ["0.01 N m s/rad", "100 N m s/rad"],
}


def machine(*diameters: str) -> dovetail.Assembly:
    """Load the machine, with other diameters of the tool if some are given."""
    description = yaml.safe_load(MACHINE)
    for joint in description["joints"].values():
        joint["parameters"] = {name: {"range": ends, "scale": "log"} for name, ends in RANGES.items()}
    for section, diameter in zip(description["substructures"]["tool"]["sections"], diameters, strict=False):
        section["outer"] = diameter
    return dovetail.load(description)


def measured_with_another_tool(case: int) -> tuple[dovetail.Assembly, dovetail.Frf]:
    """Return the machine and the FRF of one with a thicker tool, with noise."""
    model, truth = machine(), machine("14.4 mm", "18 mm")
    theta = model.from_unit(0.25 + 0.5 * np.random.default_rng(case).random(len(model.parameters)))
    return model, noisy(model, truth.frf(theta), 0.003, case)
