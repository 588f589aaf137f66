"""Limits for overload, double hits and truncated records in impact tests, each from both sides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.measurement.impact_test import signal_quality
from dovetail.measurement.impact_test.signal_files import _rate
from dovetail.measurement.impact_test.signal_quality import check_signals

RATE = 1000.0


def records(*, second=0.0, noise=0.0, tail=0.0, samples=800):
    """A force of one sample, or of two, over an even noise; a response with a tail of that amplitude."""
    force, response = np.full(samples, noise), np.zeros(samples)
    force[100], force[400] = 1.0, max(second, noise)
    response[100] = 1.0
    response[-(samples // 20) :] = tail * np.array([1.0, -1.0] * (samples // 40))[: samples // 20] / np.sqrt(2.0)
    return force[np.newaxis], response[np.newaxis]


def problems(force, response, full_scale=None):
    return [fault.problem for fault in check_signals(force, response, RATE, full_scale)]


@pytest.mark.parametrize(("equal", "overloaded"), [(2, False), (3, True)])
def test_three_samples_at_the_highest_level_are_an_overload(equal, overloaded):
    force, response = records()
    response[0, 100 : 100 + equal] = -1.0
    assert ("impact 1: the response is overloaded." in problems(force, response)) is overloaded


def test_a_level_at_full_scale_is_an_overload():
    assert problems(*records(), full_scale=(1.01, 1.01)) == []
    assert problems(*records(), full_scale=(1.0, 1.01)) == ["impact 1: the force is overloaded."]


@pytest.mark.parametrize(("second", "noise", "hit"), [(0.018, 0.0, False), (0.022, 0.0, True),
                                                      (0.1, 0.0135, False), (0.1, 0.0115, True)])  # fmt: skip
def test_a_second_hit_is_a_fiftieth_of_the_first_and_eight_times_the_noise(second, noise, hit):
    reported = [text for text in problems(*records(second=second, noise=noise)) if "second hit" in text]
    assert reported == ([f"impact 1: a second hit of {100 * second:.0f} % at 0.4 s."] if hit else [])


@pytest.mark.parametrize(("tail", "rings"), [(0.009, False), (0.011, True)])
def test_a_response_that_ends_above_a_hundredth_of_its_highest_value_rings_on(tail, rings):
    """The amplitude of a vibration with that root mean square."""
    reported = problems(*records(tail=tail))
    assert reported == (["impact 1: the response still has 1 % of its highest value at the end."] if rings else [])


@pytest.mark.parametrize(("samples", "asked"), [(1000, False), (1040, True)])
def test_the_spectrum_is_asked_for_two_hits_where_it_can_tell(monkeypatch, samples, asked):
    class Never:
        def is_data_ok(self, *_, **__):
            return True

    monkeypatch.setattr(signal_quality, "_pyfrf_checker", lambda _: Never())
    reported = problems(*records(second=0.1, samples=samples))
    assert reported == ([] if asked else ["impact 1: a second hit of 10 % at 0.4 s."])


@pytest.mark.parametrize("decimals", [8, 7, 6])
def test_times_of_few_decimals_are_even(decimals):
    """A step is 61.035 us. Where a sample is lacking, those behind it are one step late."""
    times = np.round(np.arange(4096) / 16384.0, decimals)
    assert _rate(Path("hits.csv"), times) == pytest.approx(16384.0, rel=1e-5)
    times[2000:] += 1.0 / 16384.0
    with pytest.raises(MeasurementError, match="does not increase in even steps"):
        _rate(Path("hits.csv"), times)
