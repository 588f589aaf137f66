"""The content of the report's tables, before it is rendered."""

from __future__ import annotations

import math
from dataclasses import replace
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail.identification import Adequacy, Cause, Identification, Mode, ModelError
from dovetail.identification.truth import TrueValues
from dovetail.inference.fitting import refine
from dovetail.plain_text import ABSENT
from dovetail.problem import Problem
from dovetail.report.content import (
    adequacy_sentences,
    fit_sentence,
    is_synthetic,
    misfit_sentence,
    mode_rows,
    parameter_rows,
    truth_sentence,
    warnings_of,
)
from dovetail.report.html_report import evaluation_rows, write_report


def test_the_band_of_least_agreement_is_reported_unless_the_curves_agree_everywhere(result: Identification) -> None:
    said = misfit_sentence(result)
    assert said.startswith("The agreement is least from ")
    low, high = (float(word) for word in said.split("from ")[1].split(" Hz")[0].split(" to "))
    assert 1230 <= low < high <= 7000  # around one of the resonances that differ
    assert misfit_sentence(replace(result, frf=result.measured)) == ""


def with_value(result: Identification, name: str, value: float) -> Identification:
    parameter = replace(result.parameters[name], value=value, in_range=False)
    return replace(result, parameters={name: parameter})


def test_a_value_lies_on_its_range_on_the_parameters_own_scale(result: Identification, truth: TrueValues) -> None:
    rows = {row.identified.name: row for row in parameter_rows(result, truth)}
    assert rows["Dc"].place == pytest.approx((35.18 - 26) / 14)
    assert rows["Dc"].true_place == pytest.approx((34.9 - 26) / 14)
    assert rows["kt_tc"].place == pytest.approx(math.log(7.31) / math.log(20))
    assert rows["kt_hc"].place == pytest.approx(math.log(56.2 / 3) / math.log(50 / 3))


@pytest.mark.parametrize(("name", "value"), [("kt_tc", -1e8), ("kt_tc", math.nan), ("Dc", math.nan)])
def test_a_value_without_a_place_on_its_range_has_none(result: Identification, name: str, value: float) -> None:
    (row,) = parameter_rows(with_value(result, name, value), None)
    assert row.place is None
    assert row.error == ABSENT


def test_zero_lies_below_a_logarithmic_range(result: Identification) -> None:
    (row,) = parameter_rows(with_value(result, "kt_tc", 0.0), None)
    assert row.place == -math.inf


def test_each_true_natural_frequency_is_held_against_the_identified_one_that_is_nearest(
    result: Identification,
) -> None:
    rows = mode_rows(result, TrueValues(natural_frequencies=(1330.0, 6610.0, 8240.0)))
    assert [row.error for row in rows] == ["+1.65", "\N{MINUS SIGN}1.06", "+1.09"]
    assert [row.difference for row in rows] == ["+1.67", "\N{MINUS SIGN}1.06", "+1.08"]


def test_a_natural_frequency_that_the_model_misses_has_a_row_of_its_own(result: Identification) -> None:
    missed = replace(result, modes=(result.modes[0], result.modes[2]))
    rows = mode_rows(missed, TrueValues(natural_frequencies=(1330.0, 6610.0, 8240.0, 12000.0)))
    assert [(row.natural, row.true_natural) for row in rows] == [
        ("1352.0", "1330.0"),
        (ABSENT, "6610.0"),
        ("8330.0", "8240.0"),
    ]


def test_a_natural_frequency_that_the_truth_does_not_have_is_held_against_none(result: Identification) -> None:
    rows = mode_rows(result, TrueValues(natural_frequencies=(1330.0, 8240.0)))
    assert [row.true_natural for row in rows] == ["1330.0", ABSENT, "8240.0"]


def test_a_natural_frequency_that_is_not_a_number_comes_last(result: Identification) -> None:
    rows = mode_rows(replace(result, modes=(Mode(math.nan, None, None), result.modes[0])), TrueValues({}, (1330.0,)))
    assert [row.natural for row in rows] == ["1352.0", ABSENT]
    assert [row.error for row in rows] == ["+1.65", ABSENT]


def test_errors_of_the_network_are_shown_in_the_units_of_the_parameters(result: Identification) -> None:
    rows = {row.name: row for row in evaluation_rows(result)}
    assert (rows["Dc"].mae, rows["Dc"].unit) == ("0.420", "mm")
    assert (rows["kt_tc"].mae, rows["kt_tc"].unit) == ("57.0", "MN/m")
    assert rows["kt_tc"].mae_of_range == "7.0"


def test_a_parameter_whose_r2_is_undefined_has_none(result: Identification) -> None:
    metrics = {"Dc": {"r2": None, "mae": 0.1, "mae_si": 1e-3}}
    undefined = replace(result, provenance={"evaluation": {"parameters": {"Dc": {**metrics["Dc"], "unit": "m"}}}})
    assert [row.r2 for row in evaluation_rows(undefined)] == [ABSENT]


def test_the_warning_of_synthetic_data_appears_once(result: Identification) -> None:
    warned = replace(result, warnings=("This measurement is synthetic.",))
    assert is_synthetic(warned, TrueValues(synthetic=True))
    assert warnings_of(warned, TrueValues(synthetic=True)) == ["This measurement is synthetic."]


SIZE = ModelError(0.012, damping=0.2, magnitude=0.15, phase=0.1)
CAUSE = Cause("sign", "the sign reversed", (0.504, 0.991), 12.3)


def test_a_model_that_does_not_fit_is_reported_before_any_number(result, tmp_path):
    misfit = Adequacy("does not fit", replace(SIZE, phase=3.0), None, (CAUSE,), ("It is off.",), ((100.0, 250.0),))
    sentences = adequacy_sentences(replace(result, adequacy=misfit))
    assert sentences[0] == "The model does not fit the measurement: do not trust the numbers."
    assert sentences[1].startswith(
        "The model does not fit, unless natural frequencies are off by 1.2 %, damping by 20 %"
    )
    assert sentences[2:4] == ["It is off.", CAUSE.sentence]
    bands = replace(result, adequacy=misfit).responses[0].poor_bands  # of its FRFs, whatever was judged before
    named = ", ".join(f"{low:.6g} to {high:.6g} Hz" for low, high in bands)
    assert sentences[4:] == [f"The model is off (coherence below 0.9) at {named}."]
    page = write_report(replace(result, adequacy=misfit), tmp_path / "report.html").read_text(encoding="utf-8")
    places = [page.index(text) for text in (sentences[0], "sign reversed", "Identified parameters")]
    assert 0 < places[0] < places[1] < places[2]
    assert 'class="warnings misfit" role="alert"' in page


def test_a_good_model_is_reported_with_its_errors_and_what_they_mean(result, tmp_path):
    good = replace(result, adequacy=Adequacy("good", SIZE, None, (CAUSE,), bands=((100.0, 250.0),)))
    sentences = adequacy_sentences(good)
    assert sentences == [good.adequacy.sentence, good.adequacy.meaning, CAUSE.sentence]
    assert sentences[0].startswith("The model fits well: natural frequencies are off by 1.2 %")
    assert "amplitudes by 15 %, phases by 5.7 degrees" in sentences[0]
    page = write_report(good, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "The model fits well" in page
    assert 'role="alert"' not in page


def test_a_fit_that_was_not_judged_has_no_verdict_in_the_report(result):
    assert adequacy_sentences(replace(result, adequacy=None)) == []
    assert adequacy_sentences(replace(result, adequacy=Adequacy("not judged"))) == []
    assert adequacy_sentences(replace(result, adequacy=Adequacy("to the noise")))[0] == "The model fits to the noise."


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (9, "assumed to be 1 % of the largest value, since fewer than 10 lines cannot show it;"),
        (10, "estimated from the scatter"),
    ],
)
def test_an_assumed_random_error_is_reported_as_assumed(sdof: dovetail.Assembly, lines: int, said: str) -> None:
    oscillator = sdof.on(np.linspace(100.0, 300.0, lines))
    measured = dovetail.Frf(oscillator.frequency, -3.0 * oscillator.frf(), "accelerance")
    assert said in fit_sentence(refine(Problem.of(oscillator, measured)))


@pytest.mark.parametrize(("missed", "by_chance"), [(1, True), (3, True), (4, False), (8, False)])
def test_more_missed_truths_than_chance_explains_are_called_so(missed, by_chance):
    """Of eight intervals of 90 % four or more lack the truth with a probability of 0.5 %, three or more with 3.8 %."""
    rows = [
        SimpleNamespace(identified=SimpleNamespace(name=f"p{number}"), within=number >= missed) for number in range(8)
    ]
    sentence = truth_sentence(rows)
    assert ("as one of ten is expected to be" in sentence) is by_chance
    assert ("more than the one of ten that is expected" in sentence) is not by_chance


def test_the_report_gives_the_command_with_the_options_that_were_used(sdof, tmp_path):
    frf = dovetail.Frf(sdof.frequency, sdof.frf(), "accelerance", label="m.csv")
    result = dovetail.identify(sdof, frf, "multistart", starts=3, weights="amplitude", phase=False, cause_seconds=0)
    page = unescape(write_report(result, tmp_path / "report.html", assembly=sdof).read_text(encoding="utf-8"))
    assert "\"multistart\", weights='amplitude', phase=False, starts=3, cause_seconds=0, seed=0)" in page
