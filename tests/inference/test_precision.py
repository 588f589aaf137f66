"""How well a parameter is known: from its interval and what the measurement adds, not from the width of its range."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest
import scipy

import dovetail
from dovetail.inference.posterior import Posterior, typical_model_error
from dovetail.inference.posterior.verdicts import Known, ends_cut, precision_text, word_for
from dovetail.interfaces import Parameter
from dovetail.problem.definition import end_reached

LEVELS = (np.arange(2000) + 0.5) / 2000
VALUES = {"k": 3e6, "c": 40.0}
IDENTIFIED = dovetail.VerdictLimits().identified


def posterior_of(parameter: Parameter, fraction: np.ndarray) -> Posterior:
    count = len(fraction)
    random = np.random.default_rng(1).permutation(count)  # both halves of the samples are of the same distribution
    column = fraction[random, np.newaxis]
    return Posterior(
        names=(parameter.name,),
        theta=parameter.from_unit(column),
        fraction=column,
        weight=np.full(count, 1.0 / count),
        estimate=parameter.from_unit(column.mean(axis=0)),
        model_error=typical_model_error(0.0),
        searches=count,
        lines=10,
        seconds=0.0,
    )


def measured(value: float, deviation: float, parameter: Parameter) -> Posterior:
    """A measurement that says `value` with a Gaussian error, a part of it, and nothing beyond the range."""
    middle = float(parameter.to_unit(np.array(value)))
    width = np.log(parameter.upper / parameter.lower) if parameter.scale == "log" else parameter.upper - parameter.lower
    sigma = deviation / width * (1.0 if parameter.scale == "log" else value)
    ends = (np.array([0.0, 1.0]) - middle) / sigma
    return posterior_of(parameter, middle + sigma * scipy.stats.truncnorm.ppf(LEVELS, *ends))


def around(value: float, half: float, scale: str) -> Parameter:
    """A range that reaches to `half` of a value on either side, or by the factor 1 + half on a logarithmic scale."""
    if scale == "log":
        return Parameter("k", "N/m", value / (1.0 + half), value * (1.0 + half), "log")
    return Parameter("k", "N/m", value * (1.0 - half), value * (1.0 + half))


@pytest.mark.parametrize("deviation", [0.001, 0.01, 0.05, 0.11, 0.14, 0.3, 0.6])
@pytest.mark.parametrize(("scale", "place"), [("log", 0.0), ("log", 0.3), ("linear", 0.0), ("linear", -0.3)])
def test_a_wider_range_changes_no_verdict_that_the_measurement_determines(deviation, scale, place):
    """Doubled up to ten times, and the value at the middle of the range or off it."""
    first = 3.0 * deviation if scale == "log" else min(0.999, 3.0 * deviation)
    words, precisions = [], []
    for double in range(10 if scale == "log" else 4):
        half = first * 2.0**double
        if scale == "linear" and half >= 1.0:
            break
        parameter = around(5e6 * (1.0 + place * first), half, scale)
        verdict = measured(5e6, deviation, parameter).verdicts["k"]
        if verdict.gain >= 0.9:
            words.append(verdict.word)
            precisions.append(verdict.precision)
    assert len(set(words)) <= 1
    assert words or (scale == "linear" and deviation > 0.1)
    expected = 1.645 * deviation if scale == "linear" else np.expm1(1.645 * deviation)
    if words and abs(expected - IDENTIFIED) > 0.02:
        assert (words[0] == "identified") == (expected <= IDENTIFIED)
    assert len({text.split(" ")[0] for text in precisions}) <= 2  # of rounding


@pytest.mark.parametrize(("scale", "half"), list(product(["log", "linear"], [0.02, 0.1, 0.5, 0.99])))
@pytest.mark.parametrize("doubled", [1.0, 2.0, 10.0])
def test_what_the_measurement_does_not_determine_is_never_identified(scale, half, doubled):
    """A range as narrow as 2 % makes it known, but not by the measurement."""
    if scale == "linear" and half * doubled >= 1.0:
        return
    verdict = posterior_of(around(5e6, half * doubled, scale), LEVELS).verdicts["k"]
    assert (verdict.word, verdict.precision) == ("not identifiable", "range only")


@pytest.mark.parametrize("decades", [1.0, 2.0, 4.0, 8.0, 16.0])
@pytest.mark.parametrize("end", ["lower", "upper"])
def test_a_parameter_with_one_bound_is_never_identified(decades, end):
    """Stiffer than 1e6 N/m, or softer, is all that the measurement says, whatever the range is."""
    low, high = (1e6 / 10.0, 1e6 * 10.0**decades) if end == "lower" else (1e6 * 10.0**-decades, 1e6 * 10.0)
    parameter = Parameter("k", "N/m", low, high, "log")
    at = float(parameter.to_unit(np.array(1e6)))
    fraction = at + (1.0 - at) * LEVELS if end == "lower" else at * LEVELS
    verdict = posterior_of(parameter, fraction).verdicts["k"]
    assert verdict.word != "identified"
    if verdict.gain >= 0.5:
        assert (verdict.precision, verdict.word) == (f"{end} bound", "weakly identified")
        assert "which cuts its interval off" in verdict.reason


@pytest.mark.parametrize("doubled", [1.0, 2.0, 4.0, 16.0, 256.0])
def test_a_factor_of_six_is_not_identified_in_any_range(doubled):
    """Three decades made an interval of a factor 6.4 a narrow one."""
    parameter = Parameter("bearing.k", "N/m", 1e4 / doubled, 1e10 * doubled, "log")
    deviation = np.log(6.4) / 2.0 / 1.645
    verdict = measured(1.6e7, deviation, parameter).verdicts["bearing.k"]
    assert verdict.gain > 0.97
    assert (verdict.word, verdict.precision) == ("weakly identified", "factor 2.5")
    wider = measured(1.6e7, 2.0 * deviation, parameter).verdicts["bearing.k"]
    assert (wider.word, wider.precision) == ("not identifiable", "factor 6.4")
    assert "determines it only roughly" in wider.reason


@pytest.mark.parametrize("seed", range(30))
def test_the_reported_precision_holds_for_nine_samples_of_ten(seed):
    """Skewed on either side, on both scales: the estimate within the given per cent, or within the given factor."""
    random = np.random.default_rng(seed)
    scale = ("log", "linear")[seed % 2]
    parameter = Parameter("k", "N/m", 1e3, 1e9 if scale == "log" else 1e6, scale)
    shape = random.beta(random.uniform(2.0, 30.0), random.uniform(2.0, 30.0), 2000)
    posterior = posterior_of(parameter, random.uniform(0.02, 0.6) + random.uniform(0.001, 0.3) * shape)
    verdict, estimate = posterior.verdicts["k"], posterior.estimate[0]
    number = float(verdict.precision.strip("±factor %"))
    if verdict.precision.startswith("±"):
        within = np.abs(posterior.theta / estimate - 1.0) <= 1.05 * number / 100.0  # of two digits
    else:
        within = np.abs(np.log(posterior.theta / estimate)) <= np.log(1.05 * number)
    assert within.mean() >= 0.899


@pytest.mark.parametrize(
    ("estimate", "low", "high", "text", "word"),
    [
        (100.0, 96.0, 104.0, "±4 %", "identified"),
        (100.0, 80.1, 119.0, "±20 %", "identified"),
        (100.0, 79.0, 119.0, "±21 %", "weakly identified"),
        (100.0, 99.999, 100.0, "±0.01 %", "identified"),
        (100.0, 70.0, 149.0, "±49 %", "weakly identified"),
        (100.0, 70.0, 160.0, "factor 1.6", "weakly identified"),
        (100.0, 34.0, 160.0, "factor 2.9", "weakly identified"),
        (100.0, 33.0, 160.0, "factor 3", "not identifiable"),
        (100.0, 1e-9, 160.0, "factor over 100", "not identifiable"),
        (-100.0, -104.0, -96.0, "±4 %", "identified"),
        (-100.0, -160.0, -50.0, "factor 2", "weakly identified"),
        (1.0, -2.0, 3.0, "may be zero", "weakly identified"),
        (0.0, -2.0, 3.0, "may be zero", "weakly identified"),
        (1.0, 0.0, 3.0, "may be zero", "weakly identified"),
    ],
)
def test_the_precision_is_the_farther_end_of_the_interval(estimate, low, high, text, word):
    known = Known(estimate, low, high, gain=0.99)
    assert (precision_text(known), word_for(known)) == (text, word)


def test_an_interval_that_the_range_cuts_is_taken_to_be_twice_as_wide():
    for high, word in ((109.0, "identified"), (112.0, "weakly identified")):
        known = Known(100.0, 98.0, high, gain=0.99, cut="upper")
        assert word_for(known) == word
        assert precision_text(known) == ("±9 %" if word == "identified" else "lower bound")


@pytest.mark.parametrize(
    ("low", "high", "cut"),
    [
        (0.3, 0.7, ""),
        (0.0, 0.5, "lower"),
        (0.5, 0.999, "upper"),
        (0.05, 0.95, "both"),
        (0.06, 0.5, ""),
        (0.5, 0.94, ""),
    ],
)
def test_an_end_of_the_range_within_a_tenth_of_the_interval_cuts_it(low, high, cut):
    assert ends_cut(low, high) == cut


@pytest.mark.parametrize(
    ("values", "weights"),
    [
        ((1.0, 2.0), (0.3, 0.7)),
        ((1.0, 2.0, 3.0), (0.3, 0.3, 0.4)),
        ((1.0, 1.9, 3.0), (0.6, 0.2, 0.2)),
        ((1.0, 4.0), (0.93, 0.07)),
    ],
)
def test_separate_groups_are_listed_with_their_weights_and_not_averaged(values, weights):
    parameter = Parameter("k", "N/m", 0.5, 5.0)
    random = np.random.default_rng(0)
    numbers = np.repeat(np.arange(len(values)), np.round(4000 * np.array(weights)).astype(int))
    theta = np.array(values)[numbers] * (1.0 + 0.01 * random.standard_normal(len(numbers)))
    posterior = posterior_of(parameter, parameter.to_unit(theta))
    groups = posterior.groups["k"]
    assert [group.weight for group in groups] == pytest.approx(weights, abs=1e-9)
    assert [group.estimate for group in groups] == pytest.approx(values, rel=0.005)
    assert all(1.3 < float(group.precision.strip("± %")) < 2.1 for group in groups)
    for group, value in zip(groups, values, strict=True):
        assert group.interval_low < value < group.interval_high
    verdict = posterior.verdicts["k"]
    assert (verdict.word, verdict.precision) == ("weakly identified", f"{len(values)} groups")
    assert "separate groups; the estimate is that of the likeliest" in verdict.reason


def test_the_estimates_of_several_parameters_are_of_one_combination_of_groups(sdof):
    """Exchanged values: (2e6, 80) or (4e6, 20), never (2e6, 20)."""
    random = np.random.default_rng(3)
    first = random.random(400) < 0.45
    theta = np.where(first[:, np.newaxis], [2e6, 80.0], [4e6, 20.0]) * (1.0 + 0.001 * random.standard_normal((400, 2)))
    fraction = sdof.to_unit(theta)
    options = {"model_error": typical_model_error(0.0), "searches": 400, "lines": 600, "seconds": 0.0}
    posterior = Posterior.from_fractions(sdof.parameters, fraction, np.full(400, 1.0 / 400), **options)
    assert posterior.estimate == pytest.approx([4e6, 20.0], rel=0.001)
    assert tuple(posterior.groups) == ("k", "c")


@pytest.mark.parametrize(
    ("value", "lower", "upper", "scale", "end"),
    [
        (1000.0, 10.0, 1000.0, "log", "upper"),
        (999.98, 10.0, 1000.0, "log", "upper"),
        (999.5, 10.0, 1000.0, "log", ""),
        (10.0004, 10.0, 1000.0, "log", "lower"),
        (10.03, 10.0, 1000.0, "log", ""),
        (1e-12, 0.0, 5e-3, "linear", "lower"),
        (1e-6, 0.0, 5e-3, "linear", ""),
        (4.9999e-3, 0.0, 5e-3, "linear", "upper"),
        (1.00001, 1.00000, 1.00002, "linear", ""),
        (1.00002, 1.00000, 1.00002, "linear", "upper"),
        (np.nan, 1.0, 2.0, "linear", ""),
        (-1.0, 1.0, 2.0, "log", ""),
    ],
)
def test_a_value_within_rounding_of_an_end_is_at_the_end(value, lower, upper, scale, end):
    assert end_reached(value, lower, upper, scale) == end


@pytest.mark.parametrize(("scale", "noise"), [("log", 0.02), ("log", 1.0), ("linear", 0.02), ("linear", 2.0)])
def test_a_joint_gets_the_same_verdicts_in_wider_ranges(sdof, scale, noise):
    """From a measurement with little noise, and from one with much."""
    clean = dovetail.Frf(sdof.frequency, sdof.frf(VALUES), "accelerance")
    frf = dovetail.noisy_frf(clean, noise, 5)
    words = []
    for factor in (1.0, 2.0, 4.0):
        description = json.loads(sdof.description.text)
        for name, value in VALUES.items():
            half = 0.9 if scale == "linear" else 2.0
            upper = value * (1.0 + half * factor)
            lower = value * (0.1 / factor) if scale == "linear" else value / (1.0 + half * factor)
            unit = {"k": "N/m", "c": "N s/m"}[name]
            entry = {"range": [f"{lower} {unit}", f"{upper} {unit}"], "scale": scale}
            description["joints"]["mount"]["parameters"][name] = entry
        result = dovetail.identify(dovetail.load(description), frf, form="laplace", model_error=0.0)
        words.append([row.verdict for row in result.table])
        assert {row.precision for row in result.table}.isdisjoint({"range only"})
    assert words[1:] == words[:-1]


def test_the_words_follow_limits_that_a_user_gives(sdof, tmp_path):
    """From one measurement, and in the files of its result."""
    clean = dovetail.Frf(sdof.frequency, sdof.frf(VALUES), "accelerance")
    frf = dovetail.noisy_frf(clean, 0.3, 5)
    usual = dovetail.identify(sdof, frf, seed=1)
    off = {row.name: max(row.estimate - row.interval_low, row.interval_high - row.estimate) for row in usual.table}
    stiffness, damping = (off[row.name] / row.estimate for row in usual.table)
    assert stiffness < damping < IDENTIFIED
    between = dovetail.identify(sdof, frf, seed=1, identified=(stiffness + damping) / 2.0)
    strict = dovetail.identify(sdof, frf, seed=1, identified=stiffness / 4.0, weakly_identified=1.0 + stiffness / 2.0)
    words = [[row.verdict for row in result.table] for result in (usual, between, strict)]
    assert words == [["identified"] * 2, ["identified", "weakly identified"], ["not identifiable"] * 2]
    assert [row.precision for row in strict.table] == [row.precision for row in usual.table]
    assert strict.provenance["options"]["identified"] == stiffness / 4.0
    (tmp_path / "result.json").write_text(json.dumps(strict.to_dict()), encoding="utf-8")
    expected = dovetail.VerdictLimits(stiffness / 4.0, 1.0 + stiffness / 2.0)
    read = dovetail.load_result(tmp_path / "result.json")
    assert [row.verdict for row in read.table] == words[2]
    assert read.posterior.limits == strict.posterior.limits == expected


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ({"identified": 0.0}, "identified.*0.0 is not a limit"),
        ({"identified": "5 %"}, "identified.*'5 %' is not a limit"),
        ({"weakly_identified": float("nan")}, "weakly_identified.*nan is not a limit"),
        ({"weakly_identified": 1.0}, "weakly_identified.*1.0 is not a limit.*Accepted: a number greater than 1"),
        ({"weakly_identified": 1.1}, "0.2 is more than 'weakly_identified', a factor of 1.1.*at most 0.1"),
    ],
)
def test_impossible_limits_of_words_are_refused(sdof, limits, problem):
    frf = dovetail.Frf(sdof.frequency, sdof.frf(VALUES), "accelerance")
    with pytest.raises(dovetail.ParameterError, match=f"(?s){problem}"):
        dovetail.identify(sdof, frf, **limits)


def test_a_method_without_intervals_has_no_limits_of_their_words(sdof):
    frf = dovetail.Frf(sdof.frequency, sdof.frf(VALUES), "accelerance")
    with pytest.raises(dovetail.ParameterError, match="'refined' has no option 'identified'"):
        dovetail.identify(sdof, frf, "refined", identified=0.1)
