"""The engine multiplies by the factors of lines and derivatives itself: residuals against those made step by step."""

import copy
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.problem import Problem
from dovetail.problem.residuals import ModelFrfs
from support.noisy_measurements import noisy

ASSEMBLIES = Path(__file__).parents[2] / "assemblies"
OSCILLATOR = {
    "dovetail": 1,
    "name": "oscillators",
    "frequency": {"start": "2 Hz", "stop": "300 Hz", "lines": 61},
    "substructures": {
        "lower": {"model": "lumped", "masses": [{"mass": "2 kg", "inertia": "0.01 kg m^2"}]},
        "upper": {"model": "lumped", "masses": [{"mass": "1 kg", "inertia": "0.02 kg m^2"}]},
        "base": {"model": "ground"},
    },
    "joints": {
        "foot": {
            "model": "spring_damper",
            "connect": {"a": {"to": "lower", "at": 0}, "b": {"to": "base", "at": 0}},
            "parameters": {"kr": 1e4, "cr": 1.0},
        },
        "link": {
            "model": "spring_damper",
            "connect": {"a": {"to": "upper", "at": 0}, "b": {"to": "lower", "at": 0}},
            "parameters": {"kr": 2e4, "cr": 1.0},
        },
    },
    "responses": [{"at": "lower", "position": 0, "quantity": "receptance"}, {"at": "upper", "position": 0}],
}


def changed(**entries):
    description = copy.deepcopy(OSCILLATOR)
    for path, value in entries.items():
        place = description
        *steps, last = path.split("__")
        for step in steps:
            place = place[int(step)] if step.isdecimal() else place[step]
        place[last] = value
    return dovetail.load(description)


def oscillator_of(frequency, k, c):
    omega = 2.0 * np.pi * frequency
    return -(omega**2) / (k + 1j * omega * c - 2.0 * omega**2)


RANGES = [dovetail.Parameter("k", "N/m", 1e5, 1e7, "log"), dovetail.Parameter("c", "N s/m", 1.0, 100.0, "log")]
ONE = [{"at": "upper", "position": 0}]
MODELS = {
    "one response": lambda: changed(responses=ONE),
    "two responses": changed,
    "two responses on lines of their own": lambda: changed().on(np.linspace(3, 200, 30), np.linspace(5, 250, 41)),
    "a tie": lambda: changed(joints__link__parameters__k={"same_as": "foot.k", "ratio": 0.5}),
    "an unknown gain": lambda: changed(responses__0__calibration={"gain": {"range": [0.5, 2.0]}}),
    "an unknown mass of the sensor": lambda: changed(responses=ONE, responses__0__calibration={"mass": "5 g"}),
    "a delay": lambda: dovetail.load(ASSEMBLIES / "oscillator.yaml"),
    "a function": lambda: dovetail.CallableModel(oscillator_of, RANGES, np.arange(10.0, 200.0, 5.0)),
}


@pytest.mark.parametrize("phase", [True, False], ids=["complex", "amplitudes"])
@pytest.mark.parametrize("model", MODELS)
def test_residuals_and_derivatives_are_those_of_frfs_multiplied_afterwards(model, phase):
    assembly = MODELS[model]()
    fraction = 0.2 + 0.6 * np.random.default_rng(1).random((3, len(assembly.parameters)))
    theta = assembly.from_unit(fraction)
    frfs = [noisy(each, each.frf(theta[0]), 0.02, number) for number, each in enumerate(assembly.each_response)]
    frfs = frfs if phase else [dovetail.Frf(frf.frequency, frf.amplitude, frf.quantity) for frf in frfs]
    problem, frf_model = Problem.of(assembly, frfs), ModelFrfs.of(assembly)
    residual = problem.observations.weighted(problem.variance, np.arange(len(problem.variance)) % 7 > 0)
    found = problem.residuals(residual).linearise(fraction)
    values, derivatives = frf_model.frf_jacobian(theta)
    by_fractions = np.swapaxes(derivatives, 1, 2) * frf_model.slopes(theta)[:, :, np.newaxis]
    expected = residual.jacobian(values, by_fractions)
    np.testing.assert_allclose(
        found.residuals, residual.of(values), rtol=1e-9, atol=1e-9 * np.abs(found.residuals).max()
    )
    np.testing.assert_allclose(found.jacobian, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(problem.residuals(residual).residuals(fraction), found.residuals, rtol=1e-12, atol=1e-12)


def test_scales_of_derivatives_multiply_those_that_are_solved_with_pivoting_too():
    assembly = changed(responses=ONE)
    engine, theta = assembly.engine, assembly.by_joint(assembly.from_unit(np.full((2, 4), 0.4)))
    frfs, jacobian = engine.frfs_jacobian(theta)
    scales = np.arange(1.0, 9.0).reshape(2, 4)
    for pivots in (False, True):
        if pivots:
            engine._failed_lines = lambda theta, result, _: (
                ({name: values[n : n + 1] for name, values in theta.items()}, n, np.arange(0, 61, 2)) for n in range(2)
            )
        again, scaled = engine.frfs_jacobian(theta, scales=scales)
        np.testing.assert_allclose(again, frfs, rtol=1e-9)
        np.testing.assert_allclose(scaled, jacobian * scales[:, np.newaxis, np.newaxis], rtol=1e-7)
