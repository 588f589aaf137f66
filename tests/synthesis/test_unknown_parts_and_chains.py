"""Unknown options of parts, ties and measurement chains, against descriptions with numbers in their place."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.report.drawing import mode_shapes
from dovetail.synthesis import assembly_matrices

MATERIAL = {"young": "206 GPa", "density": "7850 kg/m^3", "poisson": 0.3, "loss_factor": 0.004}
SECTIONS = [
    {"length": "120 mm", "outer": "30 mm", "inner": "12 mm", "elements": 4},
    {"length": "200 mm", "outer": "22 mm", "elements": 6},
]
PLAIN: dict[str, Any] = {
    "dovetail": 1,
    "name": "arm",
    "frequency": {"start": "20 Hz", "stop": "2500 Hz", "step": "10 Hz"},
    "substructures": {
        "arm": {"model": "timoshenko_beam", "material": MATERIAL, "sections": SECTIONS},
        "tip": {"model": "lumped", "masses": [{"mass": "80 g", "inertia": "2e-5 kg m^2"}]},
        "wall": {"model": "ground"},
    },
    "joints": {
        "foot": {
            "model": "spring_damper",
            "connect": {"a": {"to": "arm", "at": "0 mm"}, "b": {"to": "wall", "at": 0}},
            "parameters": {"k": "2e8 N/m", "c": "300 N s/m", "kr": "1e5 N m/rad", "cr": "1 N m s/rad"},
        },
        "weld": {"model": "rigid", "connect": {"a": {"to": "arm", "at": "node n11"}, "b": {"to": "tip", "at": 0}}},
    },
    "response": {"at": "arm", "position": "node n8"},
}
RANGES = {
    "material.young": (190e9, 220e9),
    "material.density": (7500.0, 8100.0),
    "material.poisson": (0.25, 0.35),
    "material.loss_factor": (1e-3, 1e-2),
    "sections.0.length": (0.10, 0.14),
    "sections.0.inner": (0.010, 0.016),
    "sections.1.outer": (0.020, 0.025),
}


def with_option(description: Mapping[str, Any], place: str, value: Any) -> dict[str, Any]:
    """Return a description with another value of an option."""
    changed: Any = copy.deepcopy(description)
    node = changed
    *steps, last = place.split(".")
    for step in steps:
        node = node[int(step)] if step.isdecimal() else node[step]
    node[last] = value
    return changed


def difference(values: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(values - expected).max() / np.abs(expected).max())


def by_differences(assembly: dovetail.Assembly, theta: np.ndarray, column: int) -> np.ndarray:
    step = np.zeros_like(theta)
    step[column] = 1e-4 * theta[column]
    near = assembly.frf(np.stack([theta - 2 * step, theta - step, theta + step, theta + 2 * step]))
    return np.array([1.0, -8.0, 8.0, -1.0]) @ near / (12.0 * step[column])


@pytest.mark.parametrize("option", RANGES)
def test_an_unknown_option_gives_the_frf_of_a_description_with_its_value(option):
    unknown = with_option(PLAIN, f"substructures.arm.{option}", {"range": list(RANGES[option])})
    assembly = dovetail.load(unknown)
    assert [parameter.name for parameter in assembly.parameters] == [f"arm.{option}"]
    theta = np.linspace(*RANGES[option], 3)[:, np.newaxis]
    known = [dovetail.load(with_option(PLAIN, f"substructures.arm.{option}", float(value))).frf() for [value] in theta]
    assert difference(assembly.frf(theta), np.stack(known)) < 1e-9
    _, jacobian = assembly.frf_jacobian(theta[1])
    assert difference(jacobian[:, 0], by_differences(assembly, theta[1], 0)) < 1e-6


def test_many_unknown_options_a_joint_and_a_mass_have_frf_and_derivatives_at_once():
    unknown = copy.deepcopy(PLAIN)
    for option, ends in RANGES.items():
        unknown = with_option(unknown, f"substructures.arm.{option}", {"range": list(ends)})
    unknown["substructures"]["tip"]["masses"][0]["mass"] = {"range": ["50 g", "120 g"], "scale": "log"}
    del unknown["joints"]["foot"]["parameters"]["k"]
    assembly = dovetail.load(unknown)
    theta = assembly.from_unit(np.random.default_rng(1).random((2, len(assembly.parameters))))
    for vector in theta:
        plain = copy.deepcopy(PLAIN)
        for parameter, value in zip(assembly.parameters, vector.tolist(), strict=True):
            owner, _, option = parameter.name.partition(".")
            place = f"substructures.{owner}.{option}" if option else f"joints.foot.parameters.{owner}"
            plain = with_option(plain, place, value)
        known = dovetail.load(plain)
        assert difference(assembly.frf(vector), known.frf()) < 1e-8
        assert assembly.natural_frequencies(vector, 4) == pytest.approx(known.natural_frequencies(None, 4), rel=1e-9)
    values, jacobian = assembly.frf_jacobian(theta)
    assert difference(values, assembly.frf(theta)) < 1e-12
    for column in range(len(assembly.parameters)):
        assert difference(jacobian[0, :, column], by_differences(assembly, theta[0], column)) < 2e-5


def test_a_part_without_batched_matrices_is_constructed_for_each_value(monkeypatch):
    unknown = with_option(PLAIN, "substructures.arm.material.young", {"range": [190e9, 220e9]})
    theta = np.array([[195e9], [214e9]])
    assembly = dovetail.load(unknown)
    part = type(assembly.description.substructures["arm"])
    monkeypatch.setattr(part, "scaled_matrices", dovetail.SubstructureModel.scaled_matrices)
    with_batch = dovetail.load(unknown).frf(theta)
    monkeypatch.setattr(part, "batched_matrices", dovetail.SubstructureModel.batched_matrices)
    assert difference(assembly.frf(theta), with_batch) < 1e-12


def test_an_unknown_part_takes_no_memory_for_pairs_of_nodes_at_each_line(peak_of):
    fine = with_option(PLAIN, "substructures.arm.sections.1.elements", 50)
    fine = with_option(fine, "frequency.step", "0.5 Hz")
    fine = with_option(fine, "substructures.arm.material.young", {"range": [190e9, 220e9]})
    fine["joints"]["weld"]["connect"]["a"]["at"] = "node n55"
    assembly = dovetail.load(fine)
    lines, dofs = len(assembly.frequency), 2 * 55
    assert peak_of(assembly.frf) < 0.25 * 16 * lines * dofs**2 / 1e6


def test_one_frf_and_its_derivatives_ask_the_part_for_its_matrices_once(monkeypatch):
    unknown = with_option(PLAIN, "substructures.arm.material.young", {"range": [190e9, 220e9]})
    assembly = dovetail.load(unknown)
    part, asked = type(assembly.description.substructures["arm"]), []
    monkeypatch.setattr(part, "scaled_matrices", dovetail.SubstructureModel.scaled_matrices)
    first, other = np.array([195e9]), np.array([214e9])
    expected = [assembly.frf_jacobian(theta) for theta in (first, other)]
    batched = part.batched_matrices

    def counted(self: dovetail.SubstructureModel, options: Any) -> Any:
        asked.append(options)
        return batched(self, options)

    monkeypatch.setattr(part, "batched_matrices", counted)
    for theta, (values, jacobian) in zip((first, other), expected, strict=True):
        asked.clear()
        assembly.frf_jacobian(theta)
        again = assembly.frf_jacobian(theta)
        assert len(asked) == 1
        assert np.array_equal(again[0], values)
        assert np.array_equal(again[1], jacobian)


def test_a_tie_is_the_same_as_one_parameter_in_both_places():
    tied = copy.deepcopy(PLAIN)
    tied["substructures"]["arm"]["material"]["young"] = {"range": [190e9, 220e9]}
    tied["substructures"]["arm"]["sections"][1]["outer"] = {"same_as": "arm.sections.0.inner", "ratio": 1.8}
    tied["substructures"]["arm"]["sections"][0]["inner"] = {"range": [0.010, 0.016]}
    tied["joints"]["foot"]["parameters"] = {
        "k": {"range": [1e7, 1e9], "scale": "log"},
        "c": "300 N s/m",
        "kr": {"range": [1e4, 1e6], "scale": "log"},
        "cr": {"same_as": "foot.c", "ratio": 0.004},
    }
    with pytest.raises(dovetail.DescriptionError, match=r"'foot\.c' is in N s/m, but 'foot\.cr' is in N m s/rad"):
        dovetail.load(tied)
    tied["joints"]["foot"]["parameters"]["cr"] = 1.2
    assembly = dovetail.load(tied)
    assert [p.name for p in assembly.parameters] == ["k", "kr", "arm.material.young", "arm.sections.0.inner"]
    theta = np.array([2e8, 1e5, 2.1e11, 0.0121])
    plain = with_option(PLAIN, "substructures.arm.material.young", 2.1e11)
    plain = with_option(plain, "substructures.arm.sections.0.inner", 0.0121)
    plain = with_option(plain, "substructures.arm.sections.1.outer", 1.8 * 0.0121)
    plain["joints"]["foot"]["parameters"]["cr"] = 1.2
    assert difference(assembly.frf(theta), dovetail.load(plain).frf()) < 1e-9
    _, jacobian = assembly.frf_jacobian(theta)
    assert difference(jacobian[:, 3], by_differences(assembly, theta, 3)) < 1e-6


def test_an_option_that_is_tied_to_a_number_is_known():
    described = with_option(PLAIN, "substructures.arm.sections.1.length", {"same_as": "arm.sections.0.length"})
    plain = with_option(PLAIN, "substructures.arm.sections.1.length", "120 mm")
    assert dovetail.load(described).parameters == ()
    assert difference(dovetail.load(described).frf(), dovetail.load(plain).frf()) < 1e-9


CHAIN = {
    "gain": {"range": [0.8, 1.25], "scale": "log"},
    "delay": {"range": ["-50 us", "50 us"]},
    "mass": {"range": ["0 g", "40 g"]},
    "window": {"range": ["0 1/s", "30 1/s"]},
}


def test_a_chain_changes_the_frf_as_its_formulas_say():
    assembly = dovetail.load({**PLAIN, "response": {**PLAIN["response"], "calibration": CHAIN}})
    assert [p.name for p in assembly.parameters] == [f"response.{name}" for name in CHAIN]
    gain, delay, mass, window = theta = np.array([1.13, 21e-6, 0.017, 12.0])
    plain = dovetail.load(PLAIN)
    matrices = assembly_matrices(plain.graph, plain.by_joint())
    omega = 2.0 * np.pi * plain.frequency - 1j * window
    point = int(plain.graph.substructure_dofs("arm")[2 * 7])
    M = matrices.M.copy()
    M[point, point] += mass
    Z = matrices.K + 1j * matrices.D + 1j * omega[:, None, None] * matrices.C - omega[:, None, None] ** 2 * M
    moving = np.flatnonzero(matrices.K.any(axis=0))
    where = np.searchsorted(moving, point)
    receptance = np.linalg.inv(Z[:, moving[:, None], moving])[:, where, where]
    real_omega = 2.0 * np.pi * plain.frequency
    expected = gain * np.exp(-1j * real_omega * delay) * -(omega**2) * receptance
    assert difference(assembly.frf(theta), expected) < 1e-9
    _, jacobian = assembly.frf_jacobian(theta)
    for column in range(4):
        assert difference(jacobian[:, column], by_differences(assembly, theta, column)) < 1e-6


@pytest.mark.parametrize("window", ["50 1/s", {"range": ["0 1/s", "100 1/s"]}])
def test_a_window_changes_no_natural_frequency_and_adds_none(window):
    free = copy.deepcopy(PLAIN)
    del free["substructures"]["wall"], free["joints"]["foot"]
    seen = dovetail.load({**free, "response": {**PLAIN["response"], "calibration": {"window": window}}})
    expected = dovetail.load(free).natural_frequencies(count=4)
    assert seen.natural_frequencies(count=4) == pytest.approx(expected, rel=1e-9)
    shapes = mode_shapes(seen, seen.vector(None), 2)
    assert [mode["frequency"] for mode in shapes] == pytest.approx(expected[:2], rel=1e-4)


def test_known_values_of_a_chain_and_a_sign_change_the_frf():
    known = {"gain": 1.1, "delay": "10 us", "sign": -1}
    response = {**PLAIN["response"], "calibration": known}
    assembly = dovetail.load({**PLAIN, "response": response})
    plain = dovetail.load(PLAIN)
    expected = -1.1 * np.exp(-2j * np.pi * plain.frequency * 1e-5) * plain.frf()
    assert assembly.parameters == ()
    assert difference(assembly.frf(), expected) < 1e-13


@pytest.mark.parametrize("force", ["node n2", "node n11"])
def test_a_transfer_frf_is_the_receptance_between_its_points(force):
    response = {"at": "arm", "position": "node n8", "force": {"position": force}, "quantity": "receptance"}
    assembly = dovetail.load({**PLAIN, "response": response})
    nodes = assembly.description.substructures["arm"].nodes
    output, there = (("arm", nodes[index].position, "x") for index in (7, int(force.split("n")[-1]) - 1))
    expected = assembly.receptance(None, [output], [there])[:, 0, 0]
    assert difference(assembly.frf(), expected) < 1e-9
    assert difference(assembly.receptance(None, [there], [output])[:, 0, 0], expected) < 1e-9


def test_responses_may_have_chains_of_their_own_and_tied_ones():
    responses = [
        {"at": "arm", "position": "node n8", "name": "near", "calibration": {"gain": {"about": 1, "sd": "5 %"}}},
        {
            "at": "arm",
            "position": "node n8",
            "force": {"position": "node n3"},
            "calibration": {"gain": {"same_as": "near.gain"}, "mass": {"value": "10 g"}},
        },
    ]
    several = {key: value for key, value in PLAIN.items() if key != "response"}
    assembly = dovetail.load({**several, "responses": responses})
    [gain] = assembly.parameters
    assert (gain.name, gain.prior) == ("near.gain", "normal")
    assert (gain.lower, gain.upper) == pytest.approx((0.8, 1.2))
    doubled, single = assembly.frfs([1.2]), assembly.frfs([0.6])
    assert difference(doubled, 2.0 * single) < 1e-13
    plain = [{key: value for key, value in response.items() if key != "calibration"} for response in responses]
    without = dovetail.load({**several, "responses": plain})
    assert difference(assembly.frfs([1.0])[0], without.frfs()[0]) < 1e-13
    assert difference(assembly.frfs([1.0])[1], without.frfs()[1]) > 1e-3


def in_common(chain: dict[str, object], **more: object) -> dovetail.Assembly:
    """The plain assembly with two responses, and a chain that they share."""
    responses = [
        {"at": "arm", "position": "node n8", "name": "near"},
        {"at": "arm", "position": "node n5", "force": {"position": "node n8"}},
    ]
    several = {key: value for key, value in PLAIN.items() if key != "response"}
    return dovetail.load({**several, "responses": responses, "calibration": chain, **more})


def test_sensors_shared_by_all_responses_are_present_together():
    assembly = in_common({"mass": {"range": ["0 g", "50 g"]}})
    lumped = copy.deepcopy(PLAIN)
    for number, node in enumerate(("n8", "n5")):
        lumped["substructures"][f"sensor{number}"] = {"model": "lumped", "masses": [{"mass": "20 g"}]}
        connect = {"a": {"to": "arm", "at": f"node {node}"}, "b": {"to": f"sensor{number}", "at": 0}}
        lumped["joints"][f"glue{number}"] = {"model": "rigid", "direction": "x", "connect": connect}
    lumped["responses"] = [dict(r.items()) for r in json.loads(assembly.description.text)["responses"]]
    del lumped["response"]
    expected = dovetail.load(lumped).frfs()
    assert [p.name for p in assembly.parameters] == ["calibration.mass"]
    assert difference(assembly.frfs([0.02]), expected) < 1e-8
    assert difference(assembly.frfs([0.0]), expected) > 1e-2
    first, second = assembly.each_response
    both = first.combined([second])
    assert difference(both.frfs(np.array([[0.02]]))[0], expected) < 1e-8
    jacobian = both.jacobian(np.array([[0.02]]))[1]
    for response in (0, 1):
        alone = assembly.each_response[response]
        assert difference(jacobian[0, response, 0], by_differences(alone, np.array([0.02]), 0)) < 1e-6
    again = dovetail.load(json.loads(second.description.text))
    assert difference(again.frf([0.02]), expected[1]) < 1e-8
    given = in_common({"mass": "20 g", "at": [{"at": "arm", "position": "node n8"}]})
    assert difference(given.frfs()[0], expected[0]) > 1e-3
    assert second.description.fingerprint != given.at(1).description.fingerprint


def test_a_shared_chain_equals_the_same_chain_at_each_response():
    shared = in_common({"window": {"range": ["0 1/s", "40 1/s"]}, "gain": {"value": 1.1}, "delay": "10 us", "sign": -1})
    own = {"window": {"range": ["0 1/s", "40 1/s"]}, "gain": 1.1, "delay": "10 us", "sign": -1}
    responses = json.loads(shared.description.text)["responses"]
    responses = [{**response, "calibration": own} for response in responses]
    responses[1]["calibration"] = {**own, "window": {"same_as": "near.window"}}
    separate = dovetail.load({**{k: v for k, v in PLAIN.items() if k != "response"}, "responses": responses})
    assert [p.name for p in shared.parameters] == ["calibration.window"]
    assert difference(shared.frfs([12.0]), separate.frfs([12.0])) < 1e-12
    first, second = shared.each_response
    jacobian = first.combined([second]).jacobian(np.array([[12.0]]))[1]
    assert difference(jacobian[0, 1, 0], by_differences(second, np.array([12.0]), 0)) < 1e-6
    responses[1]["calibration"] = own
    first_alone, second_alone = dovetail.load(
        {**{k: v for k, v in PLAIN.items() if k != "response"}, "responses": responses}
    ).each_response
    assert first_alone.combined([second_alone]) is None


@pytest.mark.parametrize(
    ("chain", "fault"),
    [
        ({"mas": "3 g"}, "'mas' is not a key of a calibration"),
        ({"gain": 1.0, "at": []}, "sensors have places and no 'mass'"),
        ({"mass": "3 g", "at": "n8"}, "is not a list of places"),
        ({"mass": "3 g", "at": [{"at": "leg", "position": 0}]}, "there is no substructure 'leg'"),
        ({"mass": "-3 g"}, "mass must be 0 or more"),
    ],
)
def test_a_faulty_shared_chain_is_refused(chain, fault):
    with pytest.raises(dovetail.DescriptionError, match=fault):
        in_common(chain)


def test_a_shared_parameter_cannot_be_repeated_by_a_response():
    response = {**PLAIN["response"], "calibration": {"gain": 1.1}}
    with pytest.raises(dovetail.DescriptionError, match="'calibration' has 'gain' for all responses"):
        dovetail.load({**PLAIN, "response": response, "calibration": {"gain": 1.2}})
    joints = {"calibration": PLAIN["joints"]["foot"], "weld": PLAIN["joints"]["weld"]}
    with pytest.raises(dovetail.DescriptionError, match="a joint has the name 'calibration' too"):
        dovetail.load({**PLAIN, "joints": joints, "calibration": {"gain": {"about": 1, "sd": "5 %"}}})


@pytest.mark.parametrize("chain", [{}, {"window": "0 1/s"}, {"mass": "0 g"}])
def test_a_joint_may_have_the_name_of_a_part_that_is_known(chain):
    """They are distinguished although the synthesis takes a part with unknowns for a joint."""
    named = copy.deepcopy(PLAIN)
    named["joints"] = {"wall": PLAIN["joints"]["foot"], "tip": PLAIN["joints"]["weld"]}
    named["response"] = {**PLAIN["response"], "calibration": chain}
    assembly, plain = dovetail.load(named), dovetail.load(PLAIN)
    assert difference(assembly.frf(), plain.frf()) < 1e-9
