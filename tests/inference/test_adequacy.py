"""Every output says how well the model fits; perturbations, overhangs and bands are what they claim to be."""

from __future__ import annotations

import json
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from typer.testing import CliRunner

import dovetail
from dovetail.assembly import Assembly
from dovetail.assembly.overhangs import find_overhangs
from dovetail.cli.app import app
from dovetail.frf.resonance_peaks import PairedPeaks, resonance_peaks
from dovetail.identification.result_file import load_result
from dovetail.inference.adequacy.error_effects import distance_of_lost_peaks
from dovetail.inference.adequacy.judgement import judge
from dovetail.inference.adequacy.perturbations import PerturbedResiduals, list_perturbations
from dovetail.inference.adequacy.quick_fits import LogRatio
from dovetail.inference.adequacy.resonances import describe_lacking, lacking_resonances
from dovetail.inference.adequacy.verdict import Adequacy, AtPoint, Cause, ModelError
from dovetail.inference.fitting import refine
from dovetail.inference.fitting.whiteness import find_deviating_bands
from dovetail.problem import Problem
from dovetail.problem.part_quantities import list_quantities
from dovetail.problem.residuals import Weighted
from dovetail.report.content import adequacy_sentences
from support.fewer_lines import every
from support.noisy_measurements import noisy

FREQUENCY = np.arange(1.0, 2049.0)


def perturbation(assembly, name):
    return next(entry for entry in list_perturbations(assembly) if entry.name == name)


@pytest.fixture(scope="module")
def with_gain(sdof):
    return replace(noisy(sdof, 1.2 * sdof.frf(), 0.01, 1), variance=None)


@pytest.fixture(scope="module")
def good(sdof, with_gain):
    return dovetail.identify(sdof, with_gain, "refined")


def test_lines_of_pure_noise_give_no_warning_about_a_fit_to_the_noise(sdof):
    """A receptance far above its resonance is lost in an even noise, and so is its coherence with the model."""
    description = replace(sdof.description, responses=(replace(sdof.description.response, quantity="receptance"),))
    result = dovetail.identify(Assembly(description), noisy(Assembly(description), Assembly(description).frf(), 0.5, 3))
    assert result.adequacy.word == "to the noise"
    assert result.responses[0].mean_coherence < 0.9
    assert [warning for warning in result.warnings if "coherence" in warning] == []


@pytest.mark.parametrize(
    ("agreeing", "starts", "warned"), [(3, 16, True), (4, 16, False), (1, 4, False), (0, 0, False)]
)
def test_a_fit_to_the_noise_in_which_few_of_many_searches_ended_is_reported(sdof, agreeing, starts, warned):
    measured = noisy(sdof, sdof.frf(), 0.01, 1)
    problem = Problem.of(sdof, measured)
    fit = replace(refine(problem), agreeing=agreeing, starts=starts)
    adequacy = judge(problem, fit).adequacy
    assert adequacy.word == "to the noise"
    assert any("3 of 16 searches ended in this fit" in reason for reason in adequacy.reasons) == (agreeing == 3)


@pytest.mark.parametrize(
    ("limits", "word"),
    [
        ({}, "good"),
        ({"good": ModelError(0.0)}, "rough"),
        ({"good": ModelError(0.0), "rough": ModelError(0.0)}, "does not fit"),
    ],
)
def test_the_words_follow_the_limits_that_are_given(sdof, with_gain, limits, word):
    result = dovetail.identify(sdof, with_gain, "refined", cause_seconds=0.0, **limits)
    assert (result.adequacy.word, result.is_trustworthy) == (word, word != "does not fit")


def test_a_good_model_is_trustworthy_with_its_errors_and_causes_in_every_output(good, with_gain, assemblies, tmp_path):
    """The exit code is 3 for a model that does not fit only: tests/cli/test_not_trustworthy.py."""
    assert good.adequacy.word == "good"
    assert good.is_trustworthy
    assert good.warning == ""
    assert good.adequacy.causes
    dovetail.write_frf(with_gain, tmp_path / "measured.uff")
    command = ["identify", assemblies / "sdof.yaml", tmp_path / "measured.uff", "--method", "refined"]
    done = CliRunner().invoke(app, [str(word) for word in [*command, "-o", tmp_path / "results"]])
    assert done.exit_code == 0, done.output
    said = adequacy_sentences(good)
    assert len(said) == 2 + len(good.adequacy.reasons) + len(good.adequacy.causes)
    page = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    plain = json.loads((tmp_path / "results" / "result.json").read_text())
    for text in (" ".join(done.stdout.split()), page):
        assert [sentence for sentence in said if sentence not in unescape(text)] == []
    assert plain["adequacy"]["word"] == "good"
    assert [cause["sentence"] for cause in plain["adequacy"]["causes"]] == [
        cause.sentence for cause in good.adequacy.causes
    ]
    assert plain["is_trustworthy"]


def test_the_adequacy_is_stored_with_the_result(good, tmp_path):
    file = tmp_path / "result.json"
    file.write_text(json.dumps(good.to_dict(), allow_nan=False))
    assert load_result(file).adequacy == good.adequacy
    without = {key: value for key, value in good.to_dict().items() if key != "adequacy"}
    file.write_text(json.dumps(without))
    assert load_result(file).adequacy is None


def test_a_network_reports_only_whether_a_measurement_is_unlike_its_training(model, measured):
    result = model.identify(measured, "network")
    assert result.adequacy == dovetail.Adequacy("not judged")
    assert result.is_trustworthy
    other = model.identify(replace(measured, values=9.81 * measured.values), "network")
    assert other.adequacy.word == "does not fit"
    assert other.adequacy.reasons
    assert not other.is_trustworthy


def test_a_mass_that_was_left_in_shifts_the_frf_as_it_says(sdof):
    theta = sdof.from_unit(np.array([0.4, 0.6]))
    perturbed = perturbation(sdof, "mass").apply(0.2)
    values, jacobian = perturbed.frf_jacobian(theta)
    np.testing.assert_allclose(values, sdof.frf(theta) / (1.0 + 0.2 * sdof.frf(theta)))
    np.testing.assert_allclose(values, perturbed.frf(theta))
    step = 1e-6 * theta[0] * np.array([1.0, 0.0])
    difference = (perturbed.frf(theta + step) - perturbed.frf(theta - step)) / (2 * step[0])
    np.testing.assert_allclose(jacobian[:, 0], difference, rtol=1e-5, atol=1e-9 * np.abs(difference).max())


def test_each_number_of_a_part_can_be_changed(collet):
    tool = collet.description.substructures["tool"]
    quantities = {quantity.name: quantity for quantity in list_quantities(tool)}
    assert {"material.young", "material.density", "sections[0].length", "sections[0].outer"} <= set(quantities)
    longer = quantities["sections[0].length"].replace(tool, 0.11)
    assert longer.nodes[-1].position == pytest.approx(0.11)
    assert tool.nodes[-1].position == pytest.approx(0.1)


def test_a_part_that_stands_out_further_is_one_with_a_longer_section_there(collet, assemblies):
    overhang, *_ = find_overhangs(collet.description, 1000)
    assert (overhang.substructure, overhang.joint, overhang.length) == ("tool", "collet", pytest.approx(0.08))
    tool = overhang.lengthen(collet.description.substructures["tool"], 0.09)
    positions = [1e3 * node.position for node in tool.nodes]
    assert positions == pytest.approx([0, *np.linspace(10, 90, 8), 100, 110])
    longer = perturbation(collet, "tool: overhang at 0 mm").apply(np.log(90 / 80))
    description = json.loads(dovetail.load(assemblies / "bt40_er32.yaml").description.text)
    (section,) = description["substructures"]["tool"]["sections"]
    pieces = {"10 mm": 1, "80 mm": 7, "20 mm": 2}
    description["substructures"]["tool"]["sections"] = [dict(section, length=k, elements=n) for k, n in pieces.items()]
    description["joints"]["collet"]["connect"]["tool"]["at"] = ["90 mm", "100 mm", "110 mm"]
    np.testing.assert_allclose(longer.frf(), dovetail.load(description).frf(), rtol=1e-9)


@pytest.mark.parametrize("node", range(8))
def test_a_longer_overhang_keeps_the_nodes_up_to_the_response(collet, node):
    (response,) = collet.description.responses
    description = replace(collet.description, responses=(replace(response, node=node),))
    overhang, *_ = find_overhangs(description, 1000)
    assert overhang.substructure == "tool"
    assert overhang.unchanged == pytest.approx(0.01 * node)
    tool = overhang.lengthen(description.substructures["tool"], 0.09)
    positions = np.array([node.position for node in tool.nodes])
    np.testing.assert_allclose(positions[: node + 1], 0.01 * np.arange(node + 1), atol=1e-12)
    assert np.all(np.diff(positions) > 0)
    shortest = perturbation(Assembly(description), "tool: overhang at 0 mm")
    altered = shortest.apply(shortest.lower).description.substructures["tool"]
    assert np.all(np.diff([node.position for node in altered.nodes]) > 0)


@pytest.mark.parametrize(("node", "part"), [(0, None), (7, 0.05 + 0.95 * 70 / 80)])
def test_overhangs_are_shortened_to_no_less_than_a_twentieth_beyond_the_response(collet, node, part):
    """Of 80 mm that protrude from the collet, those up to the response stay; else the logarithm is -0.5 at least."""
    (response,) = collet.description.responses
    assembly = Assembly(replace(collet.description, responses=(replace(response, node=node),)))
    lower = perturbation(assembly, "tool: overhang at 0 mm").lower
    assert lower == pytest.approx(-0.5 if part is None else np.log(part))


def test_a_section_that_tapers_is_not_divided(collet):
    """The elements of the holder's taper are not what sections of their own would be, so it is lengthened as one."""
    holder = collet.description.substructures["holder"]
    _, overhang = find_overhangs(collet.description, 1000)
    assert not list(find_overhangs(collet.description, 5))
    longer = overhang.lengthen(holder, overhang.length + 0.02)
    assert longer.config.sections[-1].elements == holder.config.sections[-1].elements == 10
    assert longer.nodes[-1].position == pytest.approx(holder.nodes[-1].position + 0.02)
    within = replace(overhang, first=12)
    assert within.lengthen(holder, overhang.length).config.sections[-1].elements == 6


@pytest.mark.parametrize("name", ["mass", "tool: overhang at 0 mm", "tool: material.young"])
def test_derivatives_by_joint_and_amount_are_their_differences(collet, torque_100, name):
    """By a quantity of the tool, whose matrices are those of a joint of finite elements anew, to 1 %."""
    entry = perturbation(collet, name)
    values = collet.frf(torque_100)
    residual = Weighted(values, np.ones(len(values)), np.ones(len(values)), True)
    problem = PerturbedResiduals(entry, residual)
    position = problem.position(collet.to_unit(torque_100), 0.1 * entry.upper)
    assert problem.amount(position[0]) == pytest.approx(0.1 * entry.upper)
    linear = problem.linearise(position)
    for column in (0, 4, position.shape[1] - 1):
        step = np.zeros_like(position)
        step[0, column] = 1e-6
        difference = (problem.residuals(position + step) - problem.residuals(position - step))[0] / 2e-6
        assert np.linalg.norm(linear.jacobian[0, column] - difference) < 0.01 * np.linalg.norm(difference)


@pytest.mark.parametrize("has_phase", [True, False])
def test_derivatives_of_logarithms_are_their_differences(sdof, has_phase):
    theta = sdof.from_unit(np.array([0.4, 0.6]))
    residual = LogRatio.against(sdof.frf(), np.linspace(1e-4, 1.0, len(sdof.frequency)), has_phase)
    values, jacobian = sdof.frf_jacobian(theta[np.newaxis])
    found = residual.jacobian(values, np.moveaxis(jacobian, -1, 1))[0]
    assert found.shape == (2, (2 if has_phase else 1) * len(sdof.frequency))
    for index, step in enumerate(1e-6 * theta * np.eye(2)):
        ahead, behind = (residual.of(sdof.frf((theta + sign * step)[np.newaxis]))[0] for sign in (1.0, -1.0))
        difference = (ahead - behind) / (2.0 * step[index])
        np.testing.assert_allclose(found[index], difference, atol=1e-5 * np.abs(difference).max())


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


@pytest.mark.parametrize("lines", [15, 16, 63, 64, 65])
def test_a_short_measurement_has_bands_in_the_windows_that_fit_into_it(lines):
    """A square of 5 of each line is an excess of 4: more than 6 / sqrt(16)."""
    bands = find_deviating_bands(FREQUENCY[:lines], np.full((lines, 2), np.sqrt(5.0)))
    assert len(bands) == (1 if lines >= 16 else 0)


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


def test_bands_are_where_residuals_are_large():
    lines = np.random.default_rng(0).standard_normal((1000, 2))
    frequency = 10.0 * np.arange(1, 1001)
    assert find_deviating_bands(frequency, lines) == ()
    lines[400:450] *= 4
    ((low, high),) = find_deviating_bands(frequency, lines)
    assert low == pytest.approx(4010, abs=40)
    assert high == pytest.approx(4500, abs=40)


def test_a_cause_that_moves_parameters_beyond_their_intervals_says_so():
    cause = Cause("part", "the mass at 150 g", (0.99, 1.0), 3.5)
    named, unnamed = (Adequacy("good", ModelError(0.001), causes=causes) for causes in ((cause,), ()))
    assert named.meaning.startswith(unnamed.meaning)
    assert "make it and identify again" in named.meaning
    assert "identify again" not in unnamed.meaning + Adequacy("does not fit", ModelError(0.1), causes=(cause,)).meaning


def test_what_lies_far_beyond_its_interval_with_a_named_change_is_not_called_identified(sdof, with_gain, tmp_path):
    """A gain of 1.2 is a sixth of the mass too: with that, stiffness and damping are smaller by as much.

    The damping is known to 10 % only, so that it is not far beyond.
    """
    result = dovetail.identify(sdof, with_gain, form="laplace")
    gain, mass, *_ = result.adequacy.causes
    assert (gain.name, mass.name) == ("gain", "mass")
    middle = sdof.from_unit(np.full(2, 0.5))
    assert gain.theta == pytest.approx(middle, rel=0.03)
    assert mass.theta == pytest.approx(middle / 1.2, rel=0.03)
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict(), allow_nan=False))
    for answer in (result, load_result(tmp_path / "result.json")):
        stiffness, damping = answer.table
        assert stiffness.verdict == "weakly identified"
        assert stiffness.why.startswith(f"With {mass.words} it is ")
        assert "With" not in damping.why
    alone = replace(result, adequacy=replace(result.adequacy, causes=(gain,)))
    assert alone.posterior.verdicts["k"].word == "identified"


AXIS = np.arange(20.0, 400.0, 0.5)


def peaks(*resonances):
    """Return an FRF with resonances (Hz, residue), damped to 1 %, over a small background."""
    return 1e-3 + sum(residue / (AXIS - at * (1.0 + 0.01j)) for at, residue in resonances)


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ([(100.0, 1.0), (300.0, 1.0)], [(101.0, -0.1), (300.0, 1.0)], []),  # the model's too, where it has no peak
        ([(100.0, 1.0), (300.0, 1.0), (80.0, 1.0)], [(300.0, 1.0), (80.2, 1.0)], ["79.95 Hz"]),  # named once
        (
            [(100.0, 1.0), (300.0, 1.0), (50.2, 1.0), (80.0, 1.0)],
            [(300.0, 1.0), (249.5, 1.0)],
            ["50.18, 79.98, 249.3 Hz", "Of these, 50.18, 249.3 Hz are multiples of 50 Hz: the hum of the mains?"],
        ),
        ([(100.0, 1.0), (300.0, 1.0), (120.0, 1.0)], [(300.0, 1.0)], ["120.1 Hz"]),  # one alone may be by chance
    ],
)
def test_resonances_that_the_model_lacks_are_listed(first, second, said):
    measured = [dovetail.Frf(AXIS, peaks(*resonances), "receptance") for resonances in (first, second)]
    modelled = [dovetail.Frf(AXIS, peaks(*of), "receptance") for of in ([(100.0, 1.0), (300.0, 1.0)], [(300.0, 1.0)])]
    at_points = [AtPoint("", model, frf) for model, frf in zip(modelled, measured, strict=True)]
    words = [*describe_lacking(lacking_resonances(at_points, 0.01), measured)]
    assert len(words) == len(said)
    assert all(word.endswith(f" {end}." if end.endswith("Hz") else end) for word, end in zip(words, said, strict=True))


@pytest.mark.parametrize(
    ("model", "distance"),
    [
        ([50.0, 140.0, 349.0], np.sqrt((0.4**2 + 0.3**2 + (1.0 / 350.0) ** 2) / 3.0)),  # one of three has a counterpart
        ([101.0, 140.0, 349.0], 0.0),  # two of three have one
        ([350.0], 0.0),  # the model lacks two resonances, and it is clear which the third is
        ([], 0.0),
    ],
)
def test_how_far_peaks_are_from_the_model_if_most_have_no_counterpart(model, distance):
    measured = dovetail.Frf(AXIS, peaks((100.0, 1.0), (200.0, 1.0), (350.0, 1.0)), "receptance")
    modelled = dovetail.Frf(AXIS, peaks(*((at, 1.0) for at in model)) + 0j * AXIS, "receptance")
    paired = PairedPeaks(resonance_peaks(measured), resonance_peaks(modelled))
    assert distance_of_lost_peaks([paired]) == pytest.approx(distance, abs=2e-3)


def test_a_model_that_does_not_show_which_resonance_is_which_does_not_fit(assemblies):
    """A shaft in a hub without its flange: two of three measured peaks have no counterpart."""
    steel = {"young": "206 GPa", "density": "7850 kg/m^3", "poisson": 0.3, "loss_factor": 0.003}
    shaft = [{"length": f"{mm} mm", "outer": "20 mm", "elements": count} for mm, count in ((160, 16), (40, 4))]
    hub = [{"length": f"{mm} mm", "outer": "45 mm", "inner": "20 mm", "elements": n} for mm, n in ((40, 4), (15, 1))]
    fit = {
        "model": "interference_fit",
        "length": "40 mm",
        "connect": {
            "shaft": {"to": "shaft", "at": ["160 mm", "180 mm", "200 mm"]},
            "hub": {"to": "hub", "at": [0, "20 mm", "40 mm"]},
        },
        "parameters": {
            "k": {"range": ["1e8 N/m^2", "1e12 N/m^2"], "scale": "log"},
            "kr": {"range": ["1e4 N", "1e8 N"], "scale": "log"},
            "c": {"range": ["10 N s/m^2", "1e6 N s/m^2"], "scale": "log"},
            "cr": {"range": ["1e-3 N s", "1e3 N s"], "scale": "log"},
        },
    }
    draft = {
        "dovetail": 1,
        "name": "draft",
        "frequency": {"start": "100 Hz", "stop": "10 kHz", "lines": 2000},
        "substructures": {
            "shaft": {"model": "timoshenko_beam", "material": steel, "sections": shaft},
            "hub": {"model": "timoshenko_beam", "material": steel, "sections": hub},
        },
        "joints": {"joint": fit},
        "response": {"at": "shaft", "position": 0, "quantity": "accelerance"},
    }
    measured = every(4, dovetail.read_frf(assemblies / "measurements" / "shaft_hub.uff"))
    adequacy = dovetail.identify(dovetail.load(draft), measured, "refined", cause_seconds=0.0).adequacy
    assert adequacy.word == "does not fit"
    assert 0.1 < adequacy.size.natural_frequency < 0.3


@pytest.mark.parametrize(("factor", "is_reported"), [(1.0, False), (4.0, False), (400.0, True)])
def test_a_given_variance_far_above_that_of_the_residuals_is_reported(sdof, factor, is_reported):
    """As that of a file with standard deviations in place of variances."""
    measured = noisy(sdof, sdof.frf(), 1e-3, 1)
    error = np.abs(measured.values - np.ravel(sdof.frf()))
    variance = np.full(measured.frequency.shape, factor * np.mean(error**2))
    adequacy = dovetail.identify(sdof, replace(measured, variance=variance), "refined").adequacy
    assert adequacy.word == "to the noise"
    said = [reason for reason in adequacy.reasons if "The random error that the measurement gives is" in reason]
    assert len(said) == is_reported


def test_a_fit_with_as_many_values_as_unknowns_is_not_judged(sdof):
    """One complex value, and two unknowns that meet it."""
    line = sdof.on([220.0])
    adequacy = dovetail.identify(line, noisy(line, line.frf(), 1e-3, 1), "refined").adequacy
    assert adequacy.word == "not judged"
    assert adequacy.reasons == (
        "The measurement has no more values than there are unknowns: the fit cannot be judged.",
        "So few lines show no resonance: intervals allow for no error of natural frequencies or damping.",
    )


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize("mass", ["known", "unknown"])
@pytest.mark.parametrize("size", [0.0, 0.05])
def test_a_gain_that_the_parameters_can_compensate_is_mentioned(sdof, mass, size):
    """Ten per cent too much of the FRF are ten too little of k, c and the mass, to the noise or with a wrong model."""
    described = json.loads(sdof.description.text)
    if mass == "unknown":
        described["substructures"]["mass"]["masses"][0]["mass"] = {"range": [0.2, 5.0], "scale": "log"}
    assembly = dovetail.load(described)
    truth = {"k": 2e6, "c": 30.0} | ({"mass.masses.0.mass": 1.0} if mass == "unknown" else {})
    ripple = 1.0 + size * np.sin(np.arange(len(assembly.frequency)) / 9.0)
    measured = noisy(assembly, assembly.frf(truth) * ripple, 0.005, 3)
    result = dovetail.identify(assembly, measured, "refined", cause_seconds=0)
    said = [reason for reason in result.adequacy.reasons if "does not reveal its own gain" in reason]
    assert bool(said) == (mass == "unknown")
    assert not said or "k, c, mass.masses.0.mass are wrong by as much" in said[0]
