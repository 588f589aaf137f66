"""The measured lines within a band, its ends without lines, and gaps."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.frf import Frf
from dovetail.measurement import check_cover, find_gaps, find_missing_ends, within_band


def frf_on(frequency, **options):
    frequency = np.asarray(frequency, dtype=np.float64)
    values = frequency * (1.0 + (0.5j if options.get("has_phase", True) else 0.0))
    return Frf(frequency, values, "accelerance", label="bench", **options)


def test_lines_within_the_band_are_kept_as_they_are():
    lines = np.arange(90.0, 210.0, 2.5)
    coherence, variance = np.linspace(0.5, 1.0, len(lines)), np.linspace(1.0, 2.0, len(lines))
    whole = frf_on(lines, coherence=coherence, variance=variance, averages=7, response="5+x", force="5+x", note="n")
    part = within_band(whole, [100.0, 103.0, 200.0])
    inside = slice(4, 45)
    for name in ("frequency", "values", "coherence", "variance"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[inside])
    for name in ("quantity", "label", "averages", "response", "force", "note", "has_phase", "rotation"):
        assert getattr(part, name) == getattr(whole, name)
    assert within_band(whole, [90.0, 207.5]) is whole


def test_the_band_has_the_tolerance_of_rounding():
    ends = frf_on([100.0 * (1 - 0.9e-9), 150.0, 200.0 * (1 + 0.9e-9)])
    assert len(within_band(ends, [100.0, 200.0]).frequency) == 3
    beyond = frf_on([100.0 * (1 - 1.1e-9), 150.0, 200.0 * (1 + 1.1e-9)])
    assert within_band(beyond, [100.0, 200.0]).frequency.tolist() == [150.0]


def test_two_real_numbers_are_the_least():
    with pytest.raises(MeasurementError) as caught:
        within_band(frf_on([10.0, 20.0]), [100.0, 200.0])
    assert str(caught.value) == (
        "bench\n  no line of the measurement is within 100 to 200 Hz: the measurement covers 10 to 20 Hz.\n"
        "  Check the unit of the frequencies, measure there, or change 'frequency' in the description."
    )
    lines = [50.0, 150.0, 250.0]
    assert len(within_band(frf_on(lines), [100.0, 200.0]).frequency) == 1
    with pytest.raises(MeasurementError, match="a single line, without a phase, of the measurement is within"):
        within_band(frf_on(lines, has_phase=False), [100.0, 200.0])


@pytest.mark.parametrize(
    ("lines", "missing"),
    [
        (np.arange(100.0, 201.0), []),
        (np.arange(102.0, 199.0), []),
        (np.arange(102.5, 201.0), [(100.0, 102.5)]),
        (np.arange(103.0, 198.0), [(100.0, 103.0), (197.0, 200.0)]),
        (np.arange(115.0, 200.0, 10.0), []),
        ([150.0], [(100.0, 150.0), (150.0, 200.0)]),
    ],
)
def test_ends_are_missing_by_more_than_two_steps(lines, missing):
    frf = frf_on(lines)
    assert list(find_missing_ends(frf, [100.0, 200.0])) == missing
    if missing:
        with pytest.raises(MeasurementError, match=r"the measurement covers .*, and 100 to 200 Hz are wanted"):
            check_cover(frf, [100.0, 200.0])
    else:
        check_cover(frf, [100.0, 200.0])


@pytest.mark.parametrize(
    "lines",
    [
        [5.0],
        [5.0, 500.0],
        [5.0, 6.0, 7.0],
        np.geomspace(1.0, 1e4, 20),
        np.geomspace(1.0, 1e4, 20)[-1] + 1.0 - np.geomspace(1.0, 1e4, 20)[::-1],
        np.concatenate([np.arange(10.0, 100.0), np.arange(100.0, 2000.0, 20.0)]),
        np.concatenate([np.arange(10.0, 100.0, 10.0), np.arange(100.0, 120.0, 0.5), np.arange(120.0, 200.0, 10.0)]),
        np.delete(np.arange(100.0, 200.0), [1, 30, 31, 60, 97, 98]),
    ],
    ids=["one", "two", "three", "logarithmic", "from above", "stepped", "zoomed", "two missing"],
)
def test_no_gap_is_found_where_the_spacing_changes(lines):
    assert find_gaps(frf_on(lines)) == ()


def test_gaps_are_found_wherever_they_are():
    lines = np.arange(100.0, 200.0)
    kept = np.delete(lines, [1, 2, 3, 40, 41, 42, 60, 61, 62, 63, 65, 66, 67, 96, 97, 98])
    assert find_gaps(frf_on(kept)) == ((100.0, 104.0), (139.0, 143.0), (159.0, 164.0), (164.0, 168.0), (195.0, 199.0))
    logarithmic = np.geomspace(10.0, 1e4, 100)
    assert find_gaps(frf_on(np.delete(logarithmic, range(50, 60)))) == ((logarithmic[49], logarithmic[60]),)
