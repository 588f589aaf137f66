"""Intervals of strongly damped structures whose model is a little wrong, against FRFs of a dense solve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import dovetail
from support.noisy_measurements import noisy

FREQUENCY = np.arange(1.0, 30.0, 0.05)
POWERS = {"receptance": 0, "mobility": 1, "accelerance": 2}


@dataclass(frozen=True)
class Structure:
    """Two masses in a row on springs and dampers, and a small one on the first that the model lacks."""

    masses: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Structure:
        """Draw one whose first resonance has a damping ratio between 0.2 and 0.5."""
        masses = np.array([1.0, rng.uniform(0.3, 1.5), rng.uniform(0.01, 0.05)])
        moved = np.array([masses[:2].sum(), 1.0 / (1.0 / masses[:2]).sum(), masses[2]])
        natural = 2.0 * np.pi * rng.uniform([3.0, 8.0, 2.0], [6.0, 16.0, 25.0])
        ratios = [rng.uniform(0.2, 0.5), np.exp(rng.uniform(np.log(0.02), np.log(0.3))), 0.05]
        return cls(masses, moved * natural**2, 2.0 * np.array(ratios) * natural * moved)

    def accelerance(self, errors: np.ndarray) -> np.ndarray:
        """Return that of the first mass, where masses differ from the model's by relative errors."""
        chain = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
        stiffness, damping = (chain.T @ np.diag(values) @ chain for values in (self.stiffness, self.damping))
        s = 2j * np.pi * FREQUENCY[:, np.newaxis, np.newaxis]
        dynamic = stiffness + s * damping + s**2 * np.diag(self.masses * (1.0 + errors))
        return s[:, 0, 0] ** 2 * np.linalg.inv(dynamic)[:, 0, 0]

    def model(self, quantity: str) -> dovetail.Assembly:
        """Return the model without the small mass."""

        def joint(index: int, below: str, above: str) -> dict:
            k, c = self.stiffness[index], self.damping[index]
            ranges = {"k": [k / 8.0, 8.0 * k], "c": [c / 20.0, 20.0 * c]}
            return {
                "model": "spring_damper",
                "direction": "x",
                "connect": {"a": {"to": above, "at": 0}, "b": {"to": below, "at": 0}},
                "parameters": {name: {"range": ends, "scale": "log"} for name, ends in ranges.items()},
            }

        lumped = {
            name: {"model": "lumped", "masses": [{"mass": mass}]}
            for name, mass in zip(["lower", "upper"], self.masses[:2].tolist(), strict=True)
        }
        return dovetail.load(
            {
                "dovetail": 1,
                "name": "strongly-damped",
                "frequency": {"start": FREQUENCY[0], "stop": FREQUENCY[-1], "lines": len(FREQUENCY)},
                "substructures": {**lumped, "base": {"model": "ground"}},
                "joints": {"first": joint(0, "base", "lower"), "second": joint(1, "lower", "upper")},
                "response": {"at": "lower", "position": 0, "quantity": quantity},
            }
        )


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("cases", [3, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("quantity", POWERS)
def test_intervals_hold_the_truth_whatever_the_quantity(quantity, cases):
    held = 0
    for number in range(cases):
        rng = np.random.default_rng([11, number])
        structure = Structure.draw(rng)
        frf = structure.accelerance(rng.normal(0.0, [0.03, 0.03, 0.0]))
        frf = frf / (2j * np.pi * FREQUENCY) ** (2 - POWERS[quantity])
        model = structure.model(quantity)
        result = dovetail.identify(
            model, noisy(model, frf, 0.005, number), method="posterior", form="laplace", cause_seconds=0.0
        )
        truth = np.stack([structure.stiffness, structure.damping], axis=1)[:2].ravel()
        intervals = result.posterior.interval().values()
        held += sum(low <= value <= high for value, (low, high) in zip(truth, intervals, strict=True))
    assert 0.85 * 4 * cases <= held
