"""The network learns a stiffness and a damper from the resonance alone."""

from pathlib import Path

import numpy as np

import dovetail

EXAMPLE = Path(__file__).parents[1] / "example.yaml"


def test_the_frequency_axis_is_that_of_the_assembly():
    assembly = dovetail.load(EXAMPLE)
    model = dovetail.train(assembly)
    amplitude = assembly.accelerance_amplitude({"k": 4e6, "c": 80.0})
    peak = model.network.reducer.transform(np.log10(amplitude[None] + 1))[0, 0]
    assert abs(peak - np.sqrt(4e6) / (2 * np.pi)) < 1.0
    assert min(metrics.r2 for metrics in model.evaluation.parameters.values()) > 0.95
