"""The reference description and the measurement that ships with it, as the README shows them."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail


@pytest.mark.slow
def test_the_quick_description_identifies_the_measurement_that_ships(assemblies):
    model = dovetail.train(dovetail.load(assemblies / "bt40_er32_quick.yaml"))
    measurement = assemblies / "measurements" / "h0_j_t0_60Nm.uff"
    result = model.identify(dovetail.read_frf(measurement), "network")
    assert result.mean_coherence >= 0.95
    truth = json.loads(measurement.with_suffix(".truth.json").read_text())["natural_frequencies_Hz"]
    found = [mode.natural_frequency for mode in result.modes][: len(truth)]
    np.testing.assert_allclose(found, truth, rtol=0.03)


def test_the_measurement_that_ships_needs_no_further_batch_of_searches(assemblies):
    """Four searches begin the fit, and one from each low point along a parameter confirms it, of four at most."""
    measurement = dovetail.read_frf(assemblies / "measurements" / "h0_j_t0_60Nm.uff")
    result = dovetail.identify(dovetail.load(assemblies / "bt40_er32_quick.yaml"), measurement, "refined")
    assert result.adequacy.word == "to the noise"
    assert 4 <= result.fit.starts <= 8
    assert result.fit.agreeing > result.fit.starts / 2
