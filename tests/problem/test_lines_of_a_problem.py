"""A problem refuses an FRF on other lines than its assembly's, and what is done with it the fit of another problem."""

import re
from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail import MeasurementError, ParameterError, Problem

OTHER_LINES = {
    "every second line": (lambda axis: axis[::2], "300 lines from 1 to 599 Hz, and the assembly 'sdof' has 600 lines"),
    "a part of the band": (lambda axis: axis[:50], "50 lines from 1 to 50 Hz, and the assembly 'sdof' has 600 lines"),
    "as many, moved": (lambda axis: axis + 0.25, "600 lines from 1.25 to 600.25 Hz, and the assembly 'sdof' has 600"),
    "as many between the same ends": (
        lambda axis: np.geomspace(axis[0], axis[-1], len(axis)),
        "600 lines from 1 to 600 Hz, and the assembly 'sdof' has 600 lines from 1 to 600 Hz, but between these they",
    ),
}


def measured_on(assembly: dovetail.Assembly, frequency: np.ndarray) -> dovetail.Frf:
    return replace(dovetail.noisy_frf(assembly.on(frequency).simulate(), 0.01, 1), label="plate.csv")


@pytest.mark.parametrize(("lines", "message"), OTHER_LINES.values(), ids=OTHER_LINES)
def test_a_measurement_on_other_lines_is_refused_with_both_axes(sdof, lines, message):
    right, other = measured_on(sdof, sdof.frequency), measured_on(sdof, lines(sdof.frequency))
    says = rf"plate\.csv\n.*{re.escape(message)}[\s\S]*assembly\.on\(measured\.frequency\)"
    with pytest.raises(MeasurementError, match=says):
        Problem.of(sdof, other)
    with pytest.raises(MeasurementError, match=says):
        Problem.of(sdof, right, unweighted=other)
    with pytest.raises(MeasurementError, match=says):
        Problem.of(sdof, right).with_frfs([other])
    with pytest.raises(MeasurementError, match=re.escape(f"'{sdof.name}'")):
        Problem.of(sdof, right).with_assembly(sdof.on(other.frequency))
    assert Problem.of(sdof.on(other.frequency), other).frf(np.array([[4e6, 60.0]])).shape == (1, len(other.frequency))


def test_the_second_of_two_measurements_on_other_lines_is_refused():
    described = {"model": "lumped", "masses": [{"mass": "2 kg"}]}
    spring = {"model": "spring_damper", "direction": "x", "parameters": {"k": {"range": [1e5, 1e7]}}}
    both = dovetail.load(
        {
            "dovetail": 1,
            "name": "two",
            "frequency": {"start": "2 Hz", "stop": "600 Hz", "lines": 30},
            "substructures": {"left": described, "right": described},
            "joints": {"link": {**spring, "connect": {"a": {"to": "left", "at": 0}, "b": {"to": "right", "at": 0}}}},
            "responses": [{"at": "left", "position": 0}, {"at": "right", "position": 0}],
        }
    )
    first, second = (dovetail.Frf(both.frequency, values, "accelerance", label="2.uff") for values in both.frfs())
    assert len(Problem.of(both, [first, second]).values) == 60
    with pytest.raises(MeasurementError, match=r"2\.uff\n.*15 lines .* has 30 lines"):
        Problem.of(both, [first, dovetail.Frf(second.frequency[::2], second.values[::2], "accelerance", label="2.uff")])


@pytest.fixture(scope="module")
def fit_of_half(sdof):
    half = measured_on(sdof, sdof.frequency[::2])
    return dovetail.refine(Problem.of(sdof.on(half.frequency), half), [np.array([4e6, 60.0])])


@pytest.mark.parametrize("work", [dovetail.judge, dovetail.sample_posterior, dovetail.laplace_posterior])
def test_the_fit_of_another_problem_is_refused(sdof, fit_of_half, work):
    problem = Problem.of(sdof, measured_on(sdof, sdof.frequency))
    with pytest.raises(ParameterError, match="2 parameters and 300 measured values, and the problem has 2 parameters"):
        work(problem, fit_of_half)
