"""Series of tests of a mass on a mount, built without files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import dovetail
from dovetail.series.description import Covariate, Role, SeriesDescription, SeriesTest
from dovetail.series.fitted_tests import FittedTest, fit_test

ASSEMBLY = Path(__file__).parents[2] / "assemblies" / "sdof.yaml"
NORMAL = {"k": {"about": "1e6 N/m", "sd": "0.02 %"}, "c": {"about": "20 N s/m", "sd": "0.2 %"}}
"""Priors so narrow that FRFs are linear in the parameters."""


def mount(parameters: Mapping[str, object], frequency: Sequence[float] | np.ndarray) -> dovetail.Assembly:
    """Return the mass on its mount, with these parameters, on some lines."""
    described = {"extends": str(ASSEMBLY), "joints": {"mount": {"parameters": dict(parameters)}}}
    return dovetail.load(described).on(np.asarray(frequency, dtype=float))


def measured(assembly: dovetail.Assembly, theta: Mapping[str, float], noise: float, seed: int) -> dovetail.Frf:
    """Return an FRF with noise of a known size: this part of the mean amplitude at every line."""
    values = assembly.frf(dict(theta))
    variance = np.full(len(values), (noise * np.abs(values).mean()) ** 2)
    error = np.random.default_rng([seed, 77]).standard_normal((len(values), 2)) @ [1.0, 1.0j]
    noisy = values + np.sqrt(variance / 2.0) * error
    return replace(dovetail.Frf(assembly.frequency, noisy, "accelerance"), variance=variance)


def series(
    assembly: dovetail.Assembly,
    truths: Sequence[Mapping[str, float]],
    roles: Mapping[str, Role],
    noise: float,
    covariates: Sequence[float] = (),
    seed: int = 0,
) -> tuple[SeriesDescription, tuple[FittedTest, ...]]:
    """Return a series with a test for each true parameter vector, and its fitted tests; the models are exact."""
    levels = covariates or [float(number) for number in range(len(truths))]
    tests = tuple(SeriesTest(f"T{n}", assembly, (), {"level": level}) for n, level in enumerate(levels))
    described = SeriesDescription("mounts", tests, {"level": Covariate("level", "1")}, roles)
    frfs = [measured(assembly, theta, noise, seed + number) for number, theta in enumerate(truths)]
    fitted = tuple(fit_test(test, [frf], 0, 0.0) for test, frf in zip(tests, frfs, strict=True))
    return described, fitted
