"""The five problems that Dovetail and its peers solve; every program gets the same arrays and the same simulator."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import dovetail

KNOWN = {"dc": "3 mm", "mn2": "0.2 kg"}
NOISE, CASES, COLLETS = 0.01, 60, 10
"""Relative noise, and cases of the single mass and of the collet; slower programs solve the first ones only."""
POLES = ((180.0, 0.004), (420.0, 0.01), (433.0, 0.008), (760.0, 0.02))
"""Natural frequencies [Hz] and damping ratios of the FRF whose modal parameters are estimated."""


def one_mass() -> dovetail.Assembly:
    """A mass on a spring and a damper; two unknown."""
    return dovetail.examples.load("sdof")


def collet(every: int = 20) -> dovetail.Assembly:
    """The tool in its collet on every 20th line; all twelve unknown."""
    assembly = dovetail.examples.load("collet")
    return assembly.on(assembly.frequency[::every])


def measurement(assembly: dovetail.Assembly, seed: int) -> tuple[np.ndarray, dovetail.Frf]:
    """Return a random truth in the middle of the ranges, and its FRF with noise of 1 %, whose variance is known."""
    random = np.random.default_rng(seed)
    truth = assembly.from_unit(random.uniform(0.2, 0.8, len(assembly.parameters)))
    return truth, dovetail.noisy_frf(assembly.simulate(truth), NOISE, random)


def residuals(assembly: dovetail.Assembly, measured: dovetail.Frf) -> Callable[[np.ndarray], np.ndarray]:
    """Return the whitened residuals of one or many sets of fractions of the ranges: the likelihood of all."""
    deviation = np.sqrt(measured.variance / 2.0)

    def whitened(fraction: np.ndarray) -> np.ndarray:
        difference = (assembly.frf(assembly.from_unit(np.clip(fraction, 0.0, 1.0))) - measured.values) / deviation
        return np.concatenate([difference.real, difference.imag], axis=-1)

    return whitened


def modal_frf() -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and a receptance of four modes, two of them close, with noise of 1 % of its deviation."""
    frequency, random = np.arange(50.0, 900.0, 0.5), np.random.default_rng(5)
    s, values = 2j * np.pi * frequency, np.zeros(len(frequency), dtype=complex)
    for natural, damping in POLES:
        omega = 2 * np.pi * natural
        values += 1.0 / (s**2 + 2 * damping * omega * s + omega**2)
    noise = random.standard_normal((2, len(frequency))).T @ [1.0, 1.0j] / np.sqrt(2.0)
    return frequency, values + 0.01 * np.abs(values).std() * noise


class Scores:
    """Errors, coverage and time over several cases of one problem."""

    def __init__(self, problem: str) -> None:
        self.problem, self.errors, self.inside, self.began = problem, [], [], time.process_time()

    def add(self, assembly: Any, truth: np.ndarray, fraction: np.ndarray, ends: np.ndarray | None = None) -> None:
        """Add the estimate (n_params,) of a case, and the ends (2, n_params) of its intervals, as fractions."""
        expected = assembly.to_unit(truth)
        self.errors.append(np.abs(fraction - expected))
        if ends is not None:
            self.inside.append((ends[0] <= expected) & (expected <= ends[1]))

    def show(self, **more: Any) -> None:
        """Print the scores as a line of JSON."""
        seconds = (time.process_time() - self.began) / max(len(self.errors), 1)
        result = {"problem": self.problem, "cases": len(self.errors), "seconds": round(seconds, 3), **more}
        if self.errors:
            result["median_error"] = float(np.median(self.errors))
        if self.inside:
            result["coverage"] = float(np.mean(self.inside))
        print(json.dumps(result))
        sys.stdout.flush()
