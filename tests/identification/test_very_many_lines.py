"""Measurements of more lines than are fitted: means of neighbouring lines, and results that keep all lines."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.identification import measured_lines, reconstruction
from dovetail.identification.measured_lines import MeasuredLines
from dovetail.inference.fitting import refine
from dovetail.interfaces import silent
from dovetail.problem import Problem
from dovetail.problem import merged_lines as merging

TRUTH = np.array([3e6, 4.0])
FEW = 500


@pytest.fixture
def few(monkeypatch):
    """Fit at most 500 lines."""
    for module in (measured_lines, reconstruction, merging):
        monkeypatch.setattr(module, "MOST_LINES", FEW)


def measured(assembly, lines, *, noise=0.01, seed=0, theta=TRUTH, **fields):
    """A resonance at 275.7 Hz, 0.64 Hz wide, with noise."""
    frequency = np.linspace(260.0, 300.0, lines)
    clean = assembly.on(frequency).frf(theta)
    rng = np.random.default_rng(seed)
    size = noise * np.abs(clean)
    scatter = size * (rng.standard_normal(lines) + 1j * rng.standard_normal(lines)) / np.sqrt(2.0)
    return dovetail.Frf(frequency, clean + scatter, "accelerance", **fields)


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize("known", [False, True], ids=["scatter", "known variance"])
@pytest.mark.parametrize("seed", range(4))
def test_merged_lines_give_the_fit_and_the_errors_of_all_lines(sdof, few, seed, known):
    frf = measured(sdof, 6000, seed=seed)
    if known:
        frf = replace(frf, variance=(0.01 * frf.amplitude) ** 2)
    every = MeasuredLines.of(sdof, frf)
    merged = every.merged(0, silent)
    assert abs(sum(len(one.frequency) for one in merged.frfs) - FEW) < 5
    fits = [refine(Problem.of(lines.assembly, lines.frfs), [TRUTH]) for lines in (every, merged)]
    covariance = [np.linalg.inv(fit.information) for fit in fits]
    deviation = np.sqrt(np.diagonal(covariance[0]))
    fractions = [sdof.to_unit(fit.theta[np.newaxis])[0] for fit in fits]
    assert np.all(np.abs(fractions[1] - fractions[0]) < 0.2 * deviation)
    np.testing.assert_allclose(np.sqrt(np.diagonal(covariance[1])), deviation, rtol=0.1)
    assert 0.8 < fits[1].chi_squared < 1.2


def test_every_nth_line_alone_would_lose_what_the_means_keep(sdof, few):
    every = MeasuredLines.of(sdof, measured(sdof, 6000))
    thinned = every.every_nth
    deviations = [
        np.sqrt(np.diagonal(np.linalg.inv(refine(Problem.of(lines.assembly, lines.frfs), [TRUTH]).information)))
        for lines in (every, thinned)
    ]
    np.testing.assert_allclose(deviations[1] / deviations[0], np.sqrt(12.0), rtol=0.15)


def test_groups_end_at_gaps(sdof, few):
    frf = measured(sdof, 6000)
    kept = (frf.frequency < 266.003) | (frf.frequency > 270.0)
    cut = replace(frf, frequency=frf.frequency[kept], values=frf.values[kept])
    (merged,) = MeasuredLines.of(sdof, cut).merged(0, silent).frfs
    assert not np.any((merged.frequency > 266.003) & (merged.frequency < 270.0))


@pytest.mark.parametrize("spacing", ["logarithmic", "random"])
def test_uneven_lines_are_merged_too(sdof, few, spacing):
    steps = np.exp(np.linspace(0.0, 4.0, 6000)) if spacing == "logarithmic" else np.random.default_rng(0).random(6000)
    frequency = 200.0 + 300.0 * np.cumsum(steps) / steps.sum()
    frf = dovetail.Frf(frequency, sdof.on(frequency).frf(TRUTH), "accelerance")
    (merged,) = MeasuredLines.of(sdof, frf).merged(0, silent).frfs
    assert len(merged.frequency) < 2 * FEW
    np.testing.assert_allclose(merged.values, sdof.on(merged.frequency).frf(TRUTH), rtol=1e-3)


def test_amplitudes_are_thinned_and_not_averaged(sdof, few):
    """The mean of an amplitude that is mostly noise is not that of the amplitude."""
    frf = measured(sdof, 6000)
    amplitude = replace(frf, values=frf.amplitude, has_phase=False)
    (thinned,) = MeasuredLines.of(sdof, amplitude).merged(0, silent).frfs
    assert set(thinned.values.real) <= set(amplitude.values.real)
    assert len(thinned.frequency) == FEW


def test_the_result_keeps_all_lines_and_says_how_many_were_fitted(sdof, few):
    frf = measured(sdof, 6000)
    result = dovetail.identify(sdof, frf, form="laplace")
    assert len(result.measured.frequency) == len(result.frf.frequency) == 6000
    np.testing.assert_array_equal(result.measured.values, frf.values)
    low, high = result.interval["k"]
    assert low < TRUTH[0] < high
    said = "The measurement has 6,000 lines: 500 were fitted, as means of neighbouring ones."
    assert any(warning == said for warning in result.warnings)
    assert result.adequacy.word == "to the noise"


@pytest.mark.parametrize("method", ["refined", "multistart"])
def test_other_methods_fit_fewer_lines_too(sdof, few, method):
    result = dovetail.identify(sdof, measured(sdof, 6000), method)
    assert result.fit.variance.size == FEW
    values = [parameter.value for parameter in result.parameters.values()]
    np.testing.assert_allclose(values, TRUTH, rtol=0.01)


def test_an_unknown_sign_is_determined_from_fewer_lines(sdof, few):
    plain = json.loads(sdof.description.text)
    plain["response"]["calibration"] = {"sign": "unknown"}
    frf = measured(sdof, 6000)
    result = dovetail.identify(dovetail.load(plain), replace(frf, values=-frf.values), "refined")
    assert result.known["response.sign"] == -1.0
    assert result.parameters["k"].value == pytest.approx(TRUTH[0], rel=0.01)


def test_two_responses_share_the_lines(sdof, few):
    plain = json.loads(sdof.description.text)
    place = plain.pop("response")
    plain["responses"] = [{**place, "name": "soft"}, {**place, "name": "hard"}]
    first, second = measured(sdof, 6000), measured(sdof, 3000, seed=1)
    amplitude = replace(second, values=second.amplitude, has_phase=False)
    result = dovetail.identify(dovetail.load(plain), [first, amplitude], form="laplace")
    assert [len(response.frf.frequency) for response in result.responses] == [6000, 3000]
    assert result.fit.variance.size < FEW + 5
    assert result.adequacy.word == "to the noise"
    for name, true in zip(("k", "c"), TRUTH, strict=True):
        low, high = result.interval[name]
        assert low < true < high


def test_no_line_is_merged_where_all_can_be_fitted(sdof):
    lines = MeasuredLines.of(sdof, measured(sdof, 6000))
    assert lines.merged(0, silent) is lines
    assert lines.every_nth is lines


MILLION = """
import resource, sys
import numpy as np
import dovetail
from dovetail.report.result_files import write_results
from pathlib import Path
assembly = dovetail.load(sys.argv[1])
frequency = np.linspace(1.0, 600.0, 1_000_000)
clean = np.concatenate([assembly.on(block).frf([3e6, 40.0]) for block in np.split(frequency, 20)])
rng = np.random.default_rng(0)
noise = rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size)
frf = dovetail.Frf(frequency, clean * (1.0 + 0.005 * noise), "accelerance")
result = dovetail.identify(assembly, frf)
write_results(result, Path(sys.argv[2]), None, assembly)
low, high = result.interval["k"]
assert low < 3e6 < high, (low, high)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_a_million_lines_take_less_than_two_gigabytes(assemblies, tmp_path):
    arguments = [sys.executable, "-c", MILLION, str(assemblies / "sdof.yaml"), str(tmp_path)]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 2_000_000
    assert sum(1 for _ in (tmp_path / "frf.csv").open()) > 1_000_000
