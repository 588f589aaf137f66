"""Fits of a model that is wrong: which minimum is found hardly depends on the seed of the searches."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
import yaml

import dovetail
from dovetail.inference.fitting import refine
from dovetail.problem import Problem
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


def chi_squared_by_seed(case: int, seeds: Iterable[int] = range(3)) -> np.ndarray:
    """Return chi-squared of fits of the machine to a measurement with another tool."""
    model, truth = machine(), machine("14.4 mm", "18 mm")
    theta = model.from_unit(0.25 + 0.5 * np.random.default_rng(case).random(len(model.parameters)))
    problem = Problem.of(model, noisy(model, truth.frf(theta), 0.003, case))
    return np.array([refine(problem, seed=seed).chi_squared for seed in seeds])


def test_another_seed_finds_the_same_minimum_of_a_wrong_model():
    """Three of these seeds end in a minimum that is 1.6 % higher where ends that fall together are not merged, and two
    where no start evolves."""
    found = chi_squared_by_seed(5, (0, 1, 4, 7))
    assert found.min() > 100.0
    np.testing.assert_allclose(found, found.min(), rtol=0.005)


@pytest.mark.slow
def test_most_seeds_find_the_best_minimum_of_wrong_models():
    found = np.array([chi_squared_by_seed(case) for case in range(10, 30)])
    assert np.mean(found < 1.01 * found.min(axis=1, keepdims=True)) >= 0.8
