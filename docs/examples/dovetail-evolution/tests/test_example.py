"""A joint is identified by the method that the description names, with intervals that hold the truth."""

from pathlib import Path

import pytest

import dovetail

EXAMPLE = Path(__file__).parents[1] / "example.yaml"
TRUTH = {"k": 4e6, "c": 80.0}


def test_the_description_names_the_method():
    assembly = dovetail.load(EXAMPLE)
    measured = dovetail.noisy_frf(assembly.simulate(TRUTH), 0.01, 0)
    result = dovetail.identify(assembly, measured, population=10)
    assert result.method == "evolution"
    assert result.provenance["method_options"] == {"population": 10, "generations": 100, "samples": 500}
    assert result.adequacy.word == "to the noise"
    for name, (low, high) in result.interval.items():
        assert low < TRUTH[name] < high
        assert result.parameters[name].value == pytest.approx(TRUTH[name], rel=0.03)
