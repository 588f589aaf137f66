"""Bands, plateaus, units and missing resonances: from which size on they are told, from both sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import qmc

import dovetail
from dovetail.assembly import Assembly
from dovetail.identification.misspecification.clipping import find_clipping
from dovetail.identification.misspecification.frequency_bands import find_deviating_bands
from dovetail.identification.misspecification.perturbations import list_perturbations
from dovetail.identification.misspecification.prior_predictive import (
    find_missing_resonance,
    list_unit_errors,
    prior_distance,
    prior_width,
)

FREQUENCY = np.arange(1.0, 2049.0)


def even(*bands):
    """Two residuals of 1 for each line, so that there is no excess, and of other squares over (first, last) lines."""
    lines = np.ones((len(FREQUENCY), 2))
    for first, last, square in bands:
        lines[first:last] = np.sqrt(square)
    return lines


@pytest.mark.parametrize("length", [16, 64, 256])
def test_a_band_stands_out_by_six_standard_deviations_of_a_window(length):
    """The mean of n squares of two residuals scatters by 1 / sqrt(n): windows of 16, 64 and 256 lines."""
    for factor, shown in ((0.95, False), (1.05, True)):
        bands = find_deviating_bands(FREQUENCY, even((600, 600 + length, 1.0 + factor * 6.0 / np.sqrt(length))))
        assert bool(bands) is shown


def test_bands_hold_nine_tenths_of_the_excess_and_are_five_at_most():
    large, small = (100, 200, 100.0), (1000, 1100, 8.0)  # 9900 and 700: the first has 93 %
    assert len(find_deviating_bands(FREQUENCY, even(large, small))) == 1
    assert len(find_deviating_bands(FREQUENCY, even(large, (1000, 1100, 15.0)))) == 2  # 88 %
    many = [(first, first + 10, 5.0) for first in range(50, 2000, 280)]  # no two in one window of 256 lines
    assert len(many) == 7
    assert len(find_deviating_bands(FREQUENCY, even(*many))) == 5


def test_the_ends_of_a_band_are_where_single_lines_are_clearly_off():
    """Squares of 3.5 are no part of it; of flanks with squares of 8, 2 % of the clear excess, 50 lines, are none."""
    ((low, high),) = find_deviating_bands(FREQUENCY, even((400, 460, 3.5), (460, 560, 100.0), (560, 620, 3.5)))
    assert (low, high) == (pytest.approx(462.0, abs=1.5), pytest.approx(558.0, abs=1.5))
    ((low, high),) = find_deviating_bands(FREQUENCY, even((400, 460, 8.0), (460, 560, 100.0), (560, 620, 8.0)))
    assert (low, high) == (pytest.approx(451.0, abs=1.5), pytest.approx(570.0, abs=1.5))


def plateau(share, beside=0.1, alone=0.1):
    """An FRF of 0.1 with a plateau of 1 over that share of all lines, another level beside it, and a line alone."""
    values = np.full(2000, 0.1)
    count = round(share * 2000)
    values[500 : 500 + count], values[500 + count : 540 + count], values[1500] = 1.0, beside, alone
    return dovetail.Frf(np.arange(1.0, 2001.0), values + 0j, "accelerance", variance=np.full(2000, 1e-8))


def clipped_lines(target):
    found = find_clipping(target)
    assert found.level == pytest.approx(1.0)
    variance = found.unclipped.variance
    assert variance.max() == pytest.approx((1e3 * found.level) ** 2)  # they count next to nothing
    return np.flatnonzero(variance == variance.max())


@pytest.mark.parametrize(
    ("share", "clipped"), [(0.0045, False), (0.0075, True), (0.29, True), (0.31, False)]
)  # five lines are averaged, which costs a short plateau two lines
def test_a_plateau_has_half_a_per_cent_to_a_third_of_the_lines(share, clipped):
    assert (find_clipping(plateau(share)) is not None) is clipped


def test_lines_of_three_quarters_of_the_largest_belong_to_the_plateau():
    """At the step the average of five lines is above 0.75 for one or two lines more."""
    assert len(clipped_lines(plateau(0.12, beside=0.72))) == pytest.approx(240, abs=2)
    assert len(clipped_lines(plateau(0.12, beside=0.78))) == pytest.approx(280, abs=2)


def test_a_single_line_of_nine_tenths_of_the_plateau_is_clipped_too():
    assert 1500 not in clipped_lines(plateau(0.12, alone=0.88))
    assert 1500 in clipped_lines(plateau(0.12, alone=0.92))


@pytest.mark.parametrize(("factor", "tried"), [(9.80665, True), (9.80665 * 1.2, True), (9.80665 * 1.35, False)])
def test_a_factor_near_that_of_a_unit_error_is_tried(sdof, factor, tried):
    """Within a logarithm of 0.25 of the median joint; m/s^2 read as g."""
    target = of_median(sdof, factor)
    words = [words for _, words in list_unit_errors(sdof, target, target)]
    assert any("9.807 times too large" in text for text in words) is tried


def test_a_factor_of_the_root_of_two_is_tried_and_none_of_one(sdof):
    target = of_median(sdof, 1.4)
    tried = [words for _, words in list_unit_errors(sdof, target, target) if "wrong sign" not in words]
    assert tried == ["all values were 1.414 times too large (peak read as RMS?)"]
    target = of_median(sdof, 1.0)
    assert all("wrong sign" in words for _, words in list_unit_errors(sdof, target, target))


def of_median(assembly, factor):
    """The median of the prior's amplitudes, which `list_unit_errors` compares with, times a factor."""
    from dovetail.identification.misspecification.prior_predictive import _sample_amplitudes

    median = np.exp(np.median(np.log(_sample_amplitudes(assembly)), axis=0))
    return dovetail.Frf(assembly.frequency, factor * median + 0j, "accelerance", variance=np.full(len(median), 1e-8))


def test_distances_are_mean_differences_of_logarithms_that_no_peak_dominates(sdof):
    """A joint of the sample itself is at no distance; all of it ten times as large is cut off at 1."""
    from dovetail.identification.misspecification.prior_predictive import _sample_amplitudes

    amplitudes = _sample_amplitudes(sdof)
    assert len(amplitudes) == 64
    target = dovetail.Frf(
        sdof.frequency, amplitudes[5] + 0j, "accelerance", variance=np.full(len(sdof.frequency), 1e-12)
    )
    assert prior_distance(sdof, target) == pytest.approx(0.0, abs=1e-12)
    assert prior_distance(sdof, replace(target, values=1e4 * target.values)) == 1.0
    hidden = replace(target, variance=(amplitudes[5] / 3.5) ** 2)  # nothing is four times its noise
    assert prior_distance(sdof, hidden) == 1.0
    shown = replace(target, variance=(amplitudes[5] / 4.5) ** 2)
    assert prior_distance(sdof, shown) == pytest.approx(0.0, abs=1e-12)
    assert 0.0 < prior_width(sdof) < 1.0


def with_bump(collet, decibels):
    """The FRF of a joint whose first resonance is cut down to a bump of that height over a straight line."""
    values = np.abs(collet.frf(collet.from_unit(np.full(12, 0.5))))
    first = collet.frequency < 2500
    at = collet.frequency[first][np.argmax(values[first])]
    bump = 10.0 ** (decibels / 20.0 * np.exp(-(((collet.frequency - at) / 30.0) ** 2)))
    shown = np.where(first, values[1200] * bump, values)
    return dovetail.Frf(collet.frequency, shown, "accelerance", has_phase=False, variance=np.full(len(values), 1e-8))


def test_a_resonance_of_three_decibels_is_one(collet):
    missing = [find_missing_resonance(collet, with_bump(collet, size)) is not None for size in (0.0, 2.5, 3.5)]
    assert missing == [True, True, False]


def test_a_resonance_is_missed_within_a_twentieth_of_where_nine_joints_of_ten_have_it(collet):
    """Of joints with much damping, the peak is not at the natural frequency: within 2 %."""
    low, high = find_missing_resonance(collet, with_bump(collet, 0.0))
    joints = collet.from_unit(qmc.LatinHypercube(12, rng=np.random.default_rng(0)).random(64))
    lowest, highest = np.quantile([collet.natural_frequencies(joint, 1)[0] for joint in joints], [0.05, 0.95])
    assert low == pytest.approx(0.95 * lowest, rel=0.02)
    assert high == pytest.approx(1.05 * highest, rel=0.02)


@pytest.mark.parametrize(("node", "part"), [(0, None), (7, 0.05 + 0.95 * 70 / 80)])
def test_overhangs_are_shortened_to_no_less_than_a_twentieth_beyond_the_response(collet, node, part):
    """Of 80 mm that stand out of the collet, those up to the response stay; else the logarithm is -0.5 at least."""
    (response,) = collet.description.responses
    assembly = Assembly(replace(collet.description, responses=(replace(response, node=node),)))
    by_name = {entry.name: entry for entry in list_perturbations(assembly)}
    assert by_name["tool: overhang at 0 mm"].lower == pytest.approx(-0.5 if part is None else np.log(part))


def test_the_derivative_of_each_perturbation_is_the_difference_that_it_makes(collet, torque_100):
    values = collet.frf(torque_100)
    parts = ("tool: overhang at 0 mm", "tool: material.young", "holder: sections[3].length")
    tried = [entry for entry in list_perturbations(collet) if not entry.of_substructure or entry.name in parts]
    assert len(tried) == 9
    for entry in tried:
        size = 1e-5 * (entry.upper - entry.lower)
        ahead, behind = (entry.apply(sign * size).frf(torque_100) for sign in (1.0, -1.0))
        difference = (ahead - behind) / (2.0 * size)
        error = np.linalg.norm(entry.derivative(torque_100, values) - difference) / np.linalg.norm(difference)
        assert error < 0.02, entry.name
