"""Measurements that the model cannot have produced are distinguished from those it can, and explained."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from noisy_measurements import noisy

import dovetail
from dovetail.assembly import Assembly
from dovetail.identification.fitting import refine
from dovetail.identification.fitting.residuals import Weighted
from dovetail.identification.misspecification import check_misspecification
from dovetail.identification.misspecification.explanations import PerturbedResiduals
from dovetail.identification.misspecification.frequency_bands import find_deviating_bands
from dovetail.identification.misspecification.overhang import find_overhangs
from dovetail.identification.misspecification.perturbations import (
    PerturbedAssembly,
    add_mass,
    list_perturbations,
    list_quantities,
    scale_by,
)
from dovetail.identification.misspecification.prior_predictive import find_missing_resonance
from dovetail.identification.misspecification.significance import assess_runs
from dovetail.identification.misspecification.whitened_residuals import Whitening
from dovetail.identification.result_file import read_identification
from dovetail.measurement import on_grid

with_unknown_noise = partial(noisy, known=False)


def perturbation(assembly, name):
    return next(entry for entry in list_perturbations(assembly) if entry.name == name)


@pytest.fixture(scope="module")
def with_sensor_mass(collet, torque_100):
    values = collet.frf(torque_100)
    return dovetail.identify(collet, with_unknown_noise(collet, values / (1 + 1.2e-3 * values)))


def test_a_mass_that_was_left_in_is_named(with_sensor_mass):
    misspecification = with_sensor_mass.misspecification
    assert misspecification.flagged
    assert misspecification.statistic > 10
    assert misspecification.looks_like == "It looks as if an accelerometer mass of 1.2 g was not compensated."
    assert misspecification.bands
    assert not any("the model is off" in warning for warning in with_sensor_mass.warnings)


def test_the_same_joint_without_it_is_genuine(collet, torque_100):
    for seed, level in enumerate((0.01, 0.05)):
        result = dovetail.identify(collet, with_unknown_noise(collet, collet.frf(torque_100), level, seed))
        assert not result.misspecification.flagged
        assert 0 < result.misspecification.statistic <= 1
        assert result.misspecification.bands == result.misspecification.reasons == ()


def test_it_is_kept_with_the_result(with_sensor_mass, tmp_path):
    file = tmp_path / "result.json"
    file.write_text(json.dumps(with_sensor_mass.to_dict(), allow_nan=False))
    assert read_identification(file).misspecification == with_sensor_mass.misspecification
    without = {key: value for key, value in with_sensor_mass.to_dict().items() if key != "misspecification"}
    file.write_text(json.dumps(without))
    assert read_identification(file).misspecification is None
    before = without | {"foreign": with_sensor_mass.misspecification.to_dict()}
    file.write_text(json.dumps(before))
    assert read_identification(file).misspecification == with_sensor_mass.misspecification


@pytest.mark.parametrize(
    ("by", "words"),
    [
        (9.80665, "all values were 9.807 times too large (m/s^2 read as g?)"),
        (1e-3, "all values were 1000 times too small (m read as mm?)"),
        (-1.0, "it had the wrong sign"),
    ],
)
def test_another_unit_is_named(sdof, by, words):
    result = dovetail.identify(sdof, with_unknown_noise(sdof, by * sdof.frf()))
    assert result.misspecification.flagged
    assert words in result.misspecification.looks_like


def test_another_quantity_is_named(sdof):
    mobility = sdof.frf() / (2j * np.pi * sdof.frequency)
    result = dovetail.identify(sdof, with_unknown_noise(sdof, mobility))
    assert "it were a mobility, not an accelerance" in result.misspecification.looks_like


def test_cut_off_peaks_are_named(sdof):
    values = sdof.frf()
    level = 0.5 * np.abs(values).max()
    limited = np.where(np.abs(values) > level, level * values / np.abs(values), values)
    misspecification = dovetail.identify(sdof, with_unknown_noise(sdof, limited, 0.005)).misspecification
    assert misspecification.flagged
    assert "cut off" in misspecification.looks_like


def test_what_nothing_explains_is_not_given_a_name(sdof):
    values = sdof.frf()
    other = with_unknown_noise(sdof, values * (1 + 0.5 * np.sin(sdof.frequency / 20)))
    misspecification = dovetail.identify(sdof, other).misspecification
    assert misspecification.flagged
    assert misspecification.looks_like == ""


def test_the_network_alone_tells_what_is_unlike_its_training(model, measured):
    assert not model.identify(measured).misspecification.flagged
    misspecification = model.identify(replace(measured, values=9.81 * measured.values)).misspecification
    assert misspecification.flagged
    assert misspecification.statistic > 1
    assert misspecification.reasons


def test_residuals_are_white_for_a_model_that_errs():
    rng = np.random.default_rng(3)
    errors, residuals = rng.standard_normal((3, 40)), rng.standard_normal((5, 40))
    plain = Weighted(np.zeros(20, complex), np.ones(20), np.ones(20), True)
    white = Whitening.against(plain, errors)
    covariance = np.eye(40) + errors.T @ errors
    values = residuals[:, 0::2] + 1j * residuals[:, 1::2]
    expected = np.einsum("nm,nm->n", residuals, np.linalg.solve(covariance, residuals.T).T)
    np.testing.assert_allclose(np.sum(white.of(values) ** 2, axis=1), expected, rtol=1e-10)


def test_derivatives_with_a_sensor_mass_or_a_factor(sdof):
    theta = sdof.from_unit(np.array([0.4, 0.6]))
    for transform in (add_mass(0.2, np.ones(len(sdof.frequency), complex)), scale_by(2j)):
        perturbed = PerturbedAssembly(sdof, transform)
        values, jacobian = perturbed.frf_jacobian(theta)
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
def test_what_lies_between_the_end_and_the_response_stays_as_it_is(collet, node):
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


def test_derivatives_by_joint_and_amount(collet, torque_100):
    axis = perturbation(collet, "axis")
    values = collet.frf(torque_100)
    residual = Weighted(values, np.ones(len(values)), np.ones(len(values)), True)
    problem = PerturbedResiduals(axis, residual)
    position = problem.position(collet.to_unit(torque_100), 0.01)
    assert problem.amount(position[0]) == pytest.approx(0.01)
    linear = problem.linearise(position)
    for column in range(position.shape[1]):
        step = np.zeros_like(position)
        step[0, column] = 1e-6
        difference = (problem.residuals(position + step) - problem.residuals(position - step))[0] / 2e-6
        assert np.linalg.norm(linear.jacobian[0, column] - difference) < 0.01 * np.linalg.norm(difference)


@pytest.mark.slow
def test_a_tool_that_stands_out_further_is_named(collet, torque_100):
    longer = perturbation(collet, "tool: overhang at 0 mm").apply(np.log(90 / 80))
    misspecification = dovetail.identify(collet, with_unknown_noise(collet, longer.frf(torque_100))).misspecification
    match = re.fullmatch(r"It looks as if the tool stood out of the collet by (\S+) mm.*", misspecification.looks_like)
    assert match is not None
    assert float(match[1]) == pytest.approx(90, abs=3)  # the joint compensates for a millimetre or two


def test_a_resonance_that_every_joint_has_is_missed(collet, torque_100):
    values = collet.frf(torque_100)
    first = collet.frequency < 2500
    assert find_missing_resonance(collet, with_unknown_noise(collet, values)) is None
    filtered = np.where(first, np.interp(collet.frequency, [100, 2500], np.abs(values[[0, 1200]])), values)
    low, high = find_missing_resonance(collet, with_unknown_noise(collet, filtered))
    resonance = collet.frequency[first][np.argmax(np.abs(values[first]))]
    assert low < resonance < high < 1500


def test_bands_are_where_residuals_are_large():
    lines = np.random.default_rng(0).standard_normal((1000, 2))
    frequency = 10.0 * np.arange(1, 1001)
    assert find_deviating_bands(frequency, lines) == ()
    lines[400:450] *= 4
    ((low, high),) = find_deviating_bands(frequency, lines)
    assert low == pytest.approx(4010, abs=40)  # eight seeds: 4010 to 4040 Hz, and 4470 to 4500 Hz
    assert high == pytest.approx(4500, abs=40)


def test_a_run_of_lines_that_are_off_alike_is_no_noise():
    lines = np.random.default_rng(1).standard_normal((4000, 2))
    assert assess_runs(lines) < 7
    lines[1000:1200] += 1.0
    assert assess_runs(lines) > 30


def test_a_finer_mesh_is_within_the_error_that_a_model_is_allowed(collet, assemblies):
    """The shipped measurement is of a mesh four times finer: a model said to be exact cannot have made it."""
    measured = on_grid(dovetail.read_frf(assemblies / "measurements" / "h0_j_t0_60Nm.uff"), collet.frequency)
    fit = refine(collet, measured)
    assert not check_misspecification(collet, measured, fit, explain=False).flagged
    assert check_misspecification(collet, measured, fit, 0.0, explain=False).flagged
