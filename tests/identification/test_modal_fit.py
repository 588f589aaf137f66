"""Joints identified from natural frequencies and damping ratios: chains of masses drawn at random."""

from __future__ import annotations

import copy
import json
import pickle
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eig

import dovetail
from dovetail.synthesis import DampedModes, assembly_matrices, damped_modes

CHAIN: dict[str, Any] = {
    "dovetail": 1,
    "name": "chain",
    "frequency": {"start": "1 Hz", "stop": "400 Hz", "step": "1 Hz"},
    "substructures": {
        "wall": {"model": "ground"},
        "first": {"model": "lumped", "masses": [{"mass": "2 kg"}]},
        "second": {"model": "lumped", "masses": [{"mass": "1 kg"}]},
        "third": {"model": "lumped", "masses": [{"mass": "1.5 kg"}]},
    },
    "joints": {
        name: {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": one, "at": 0}, "b": {"to": other, "at": 0}},
            "parameters": {"k": k, "c": c},
        }
        for name, one, other, k, c in (
            ("a", "wall", "first", "8e5 N/m", "20 N s/m"),
            ("b", "first", "second", {"range": [2e5, 2e6], "scale": "log"}, {"range": [2, 50], "scale": "log"}),
            ("c", "second", "third", {"range": [2e5, 2e6], "scale": "log"}, {"range": [2, 50], "scale": "log"}),
        )
    },
    "response": {"at": "third", "position": 0},
}


@pytest.fixture(scope="module")
def chain() -> dovetail.Assembly:
    return dovetail.load(CHAIN)


def modes_of(assembly: dovetail.Assembly, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Natural frequencies and damping ratios from the state matrix, whose eigenvalues are the poles."""
    matrices = assembly_matrices(assembly.graph, assembly.by_joint(theta))
    moving = np.flatnonzero(matrices.M.diagonal())
    M, K, C = (getattr(matrices, name)[np.ix_(moving, moving)] for name in "MKC")
    state = np.block([[np.zeros_like(M), np.eye(len(M))], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    poles = np.linalg.eigvals(state)
    poles = np.sort_complex(1j * poles[poles.imag > 0])[::-1]  # by increasing imaginary part
    poles = poles[np.argsort(abs(poles))] / 1j
    return abs(poles) / (2 * np.pi), -poles.real / abs(poles)


def table_of(assembly, theta, random, *, sd=1e-3, damping_sd=0.03, given=True) -> dovetail.ModalParameters:
    frequency, damping = modes_of(assembly, theta)
    errors = sd * frequency, damping_sd * damping
    measured = frequency + errors[0] * random.standard_normal(3), damping + errors[1] * random.standard_normal(3)
    return dovetail.ModalParameters(*measured, *(errors if given else (None, None)), label="chain.csv")


def test_the_poles_are_those_of_the_dense_system_and_so_are_their_derivatives():
    beams = copy.deepcopy(CHAIN)
    beams["substructures"]["third"] = {
        "model": "timoshenko_beam",
        "material": {"young": "206 GPa", "density": "7850 kg/m^3", "loss_factor": 0.01},
        "sections": [{"length": "300 mm", "outer": "20 mm", "elements": 4}],
    }
    beams["joints"]["c"]["parameters"]["c"] = {"range": [2, 5000], "scale": "log"}  # up to heavy damping
    assembly = dovetail.load(beams)
    damped = DampedModes(assembly.graph)
    random = np.random.default_rng(3)
    for fraction in (*random.random((3, 4)), np.array([0.3, 0.5, 0.6, 0.99])):
        vector = assembly.from_unit(fraction)
        theta, matrices = (
            assembly.by_joint(vector[np.newaxis]),
            assembly_matrices(assembly.graph, assembly.by_joint(vector)),
        )
        active = np.flatnonzero(matrices.M.diagonal())
        M, K, C, D = (getattr(matrices, name)[np.ix_(active, active)] for name in "MKCD")
        one, zero = np.eye(len(M)), np.zeros_like(M)
        dense = eig(np.block([[zero, one], [-K - 1j * D, -C]]), np.block([[one, zero], [zero, M]]), right=False)
        (poles,) = damped.at(theta, 5)
        assert len(poles.values) >= 4
        for pole in poles.values:
            assert min(abs(dense - pole)) < 1e-6 * abs(pole)
        step = 1e-4 * theta["c"][0, 1]
        moved = theta["c"] + step * np.array([[1.0], [-1.0]]) * np.eye(theta["c"].shape[1])[1]
        both = {name: np.repeat(at, 2, axis=0) for name, at in theta.items()} | {"c": moved}
        ahead, behind = damped.at(both, 5)
        slope = (ahead.values - behind.values) / (2 * step)
        np.testing.assert_allclose(poles.derivatives["c"][:, 1], slope, atol=1e-5 * abs(slope).max())


def test_a_rigid_joint_has_no_parameters_and_the_derivatives_by_the_others_stay():
    welded, whole = copy.deepcopy(CHAIN), copy.deepcopy(CHAIN)
    welded["substructures"]["plate"] = {"model": "lumped", "masses": [{"mass": "0.5 kg"}]}
    ends = {"a": {"to": "third", "at": 0}, "b": {"to": "plate", "at": 0}}
    welded["joints"]["weld"] = {"model": "rigid", "connect": ends}
    whole["substructures"]["third"]["masses"][0]["mass"] = "2 kg"
    poles, expected = (
        next(DampedModes(assembly.graph).at(assembly.by_joint(assembly.from_unit(np.full((1, 4), 0.5))), 3))
        for assembly in map(dovetail.load, (welded, whole))
    )
    np.testing.assert_allclose(poles.values, expected.values, rtol=1e-9)
    np.testing.assert_allclose(poles.derivatives["c"], expected.derivatives["c"], rtol=1e-9)
    assert poles.derivatives["weld"].shape == (3, 0)


@pytest.mark.parametrize("form", ["laplace", "samples"])
def test_intervals_hold_the_truth_as_often_as_they_say(chain, form, capsys):
    random, inside = np.random.default_rng(1), []
    cases = 14 if form == "laplace" else 2
    for _ in range(cases):
        theta = chain.from_unit(0.1 + 0.8 * random.random(4))
        table = table_of(chain, theta, random)
        result = dovetail.identify(chain, table, form=form, samples=100, model_error=0.0)
        assert result.is_trustworthy
        rows = zip(result.interval.values(), theta, strict=True)
        inside += [low <= true <= high for (low, high), true in rows]
    with capsys.disabled():
        print(f"\n{sum(inside)} of {len(inside)} true values within 90 % intervals ({form})")
    assert np.mean(inside) >= 0.8
    assert form == "samples" or np.mean(inside) < 0.99


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("seed", range(3))
def test_every_structure_with_the_frequencies_of_the_table_is_found(seed):
    springs = {"range": [1e5, 1e7], "scale": "log"}
    masses = {f"m{i}": {"model": "lumped", "masses": [{"mass": "1 kg"}]} for i in range(1, 5)}
    joints = {
        f"s{i}": {
            **CHAIN["joints"]["b"],
            "connect": {"a": {"to": f"m{i - 1}" if i > 1 else "wall", "at": 0}, "b": {"to": f"m{i}", "at": 0}},
            "parameters": {"k": springs, "c": "10 N s/m"},
        }
        for i in range(1, 5)
    }
    substructures, response = {"wall": {"model": "ground"}, **masses}, {"at": "m4", "position": 0}
    row = dovetail.load({**CHAIN, "substructures": substructures, "joints": joints, "response": response})
    equal = np.array([[1e6, 1e6, 1e6, 1e6], [2e6, 1e6, 5e5, 1e6]])
    frequency, other = (modes_of(row, springs)[0] for springs in equal)
    np.testing.assert_allclose(frequency, other, rtol=1e-4)
    posterior = dovetail.identify(row, dovetail.ModalParameters(frequency, None, 1e-3 * frequency), seed=seed).posterior
    near = np.abs(np.log(posterior.theta[:, np.newaxis] / equal)).max(axis=2) < 0.1
    assert (posterior.weight @ near > 0.1).all()


def test_a_mode_may_be_missing_and_is_named(chain):
    theta, random = chain.from_unit(np.array([0.4, 0.5, 0.6, 0.5])), np.random.default_rng(2)
    whole = table_of(chain, theta, random)
    kept = [0, 2]
    columns = (whole.frequency, whole.damping_ratio, whole.frequency_sd, whole.damping_sd)
    table = dovetail.ModalParameters(*(column[kept] for column in columns))
    result = dovetail.identify(chain, table, form="laplace")
    assert [mode.measured_frequency is None for mode in result.modes] == [False, True, False]
    lacking = result.modes[1].natural_frequency
    assert lacking == pytest.approx(modes_of(chain, theta)[0][1], rel=0.02)
    assert result.warnings[0] == f"The table lacks modes that the model has: {lacking:.6g} Hz."
    assert all(low <= true <= high for (low, high), true in zip(result.interval.values(), theta, strict=True))


def test_modes_count_wherever_they_are_in_the_middle_of_the_ranges():
    """There, at 20 MN/m, only one mode of three is within the reach of the table."""
    wide = copy.deepcopy(CHAIN)
    for joint in ("b", "c"):
        wide["joints"][joint]["parameters"]["k"] = {"range": [2e5, 2e9], "scale": "log"}
    assembly = dovetail.load(wide)
    theta = np.array([5e5, 10.0, 6e5, 10.0])
    table = table_of(assembly, theta, np.random.default_rng(0))
    row = {row.name: row for row in dovetail.identify(assembly, table, form="laplace").table}["b.k"]
    assert row.interval_low < 5e5 < row.interval_high


def test_frequencies_in_the_wrong_unit_are_not_trustworthy(chain):
    theta = chain.from_unit(np.full(4, 0.5))
    frequency, damping = modes_of(chain, theta)
    result = dovetail.identify(chain, dovetail.ModalParameters(2 * np.pi * frequency, damping), form="laplace")
    assert not result.is_trustworthy
    assert {row.verdict for row in result.table} == {"not trustworthy"}
    assert repr(result).startswith(
        "<Identification: chain, modal parameters, posterior: The model does not fit the measurement"
    )


def test_errors_that_the_table_does_not_give_are_estimated_from_the_residuals_and_reported(chain):
    theta, random = chain.from_unit(np.array([0.5, 0.5, 0.5, 0.5])), np.random.default_rng(5)
    table = table_of(chain, theta, random, sd=5e-3, damping_sd=0.1, given=False)
    result = dovetail.identify(chain, table, form="laplace")
    assert 5e-4 <= result.posterior.model_error.natural_frequency <= 0.02
    assert "The table does not give all its errors: " in result.warnings[0]
    alone = dovetail.identify(chain, dovetail.ModalParameters(table.frequency[:1]), form="laplace")
    assert "0.5 % of a natural frequency were assumed" in alone.warnings[0]
    words = {row.name: (row.verdict, row.why) for row in alone.table}
    assert words["b.c"] == ("not identifiable", "The measurement hardly depends on it.")


@pytest.mark.parametrize("given", [True, False])
def test_a_table_of_no_more_values_than_unknowns_cannot_judge_but_a_wrong_unit_shows(chain, given):
    """Two modes of four unknowns: some joint has exactly these, whatever the structure is."""
    whole = table_of(chain, chain.from_unit(np.full(4, 0.5)), np.random.default_rng(3), given=given)
    columns = (whole.frequency, whole.damping_ratio, whole.frequency_sd, whole.damping_sd)
    two = [None if column is None else column[:2] for column in columns]
    result = dovetail.identify(chain, dovetail.ModalParameters(*two), form="laplace")
    assert (result.adequacy.word, result.adequacy.sentence) == ("not judged", "")
    assert "the fit cannot be judged" in result.adequacy.reasons[0]
    wrong = dovetail.ModalParameters(1e3 * two[0], *two[1:])
    assert not dovetail.identify(chain, wrong, form="laplace").is_trustworthy


def test_what_modal_parameters_cannot_have_is_one_error(chain, tmp_path):
    table = dovetail.ModalParameters([100.0, 150.0, 200.0, 250.0], label="four.csv")
    with pytest.raises(dovetail.MeasurementError, match=r"four.csv\n  the table has 4 modes, .* 'chain' has 3"):
        dovetail.identify(chain, table)
    two = dovetail.ModalParameters(table.frequency[:2])
    for options, problem in (
        ({"method": "network"}, "the method 'network' takes FRFs only"),
        ({"phase": False}, "take no network, no weights and no phase"),
        ({"weights": "amplitude"}, "take no network, no weights and no phase"),
        ({"cause_seconds": 1.0}, "has no option 'cause_seconds'"),
        ({"form": "laplac"}, "form"),
        ({"model_error": -1.0}, "not a relative error"),
    ):
        with pytest.raises(dovetail.ParameterError, match=problem):
            dovetail.identify(chain, two, **options)
    (tmp_path / "modes.csv").write_text("frequency_Hz,damping_percent\n100,1\n150,1\n")
    with pytest.raises(dovetail.MeasurementError, match="a table of modal parameters, not an FRF"):
        dovetail.identify(chain, [tmp_path / "modes.csv"])


@pytest.mark.parametrize("method", ["refined", "multistart", "posterior"])
def test_a_table_goes_the_way_of_an_frf_by_each_method_that_fits(chain, method, tmp_path):
    theta = chain.from_unit(np.full(4, 0.5))
    table = table_of(chain, theta, np.random.default_rng(4))
    header = "frequency_Hz,damping_ratio,frequency_sd_Hz,damping_ratio_sd"
    columns = np.transpose([table.frequency, table.damping_ratio, table.frequency_sd, table.damping_sd])
    np.savetxt(tmp_path / "modes.csv", columns, delimiter=",", header=header, comments="")
    options = {"multistart": {"starts": 4}, "posterior": {"samples": 100}}.get(method, {})
    result = dovetail.identify(chain, tmp_path / "modes.csv", method, **options)
    assert type(result) is dovetail.Identification
    assert (result.method, result.frf, result.responses) == (method, None, ())
    assert result.theta[0::2] == pytest.approx(theta[0::2], rel=0.02)  # stiffnesses; dampings vary by 30 %
    assert result.theta[1::2] == pytest.approx(theta[1::2], rel=0.5)
    assert (result.is_trustworthy, result.fit.variance_known) == (True, True)
    assert 0.0 < result.fit.degrees_of_freedom < 3.0
    assert (result.posterior is not None) == (method == "posterior")
    report = dovetail.write_report(result, tmp_path / "report.html", assembly=chain).read_text()
    assert "identified from a table of natural frequencies" in report
    assert f"dovetail.identify(assembly, {str(tmp_path / 'modes.csv')!r}".replace("'", "&#39;") in report


def test_a_start_of_the_user_is_one_of_the_searches(chain):
    table = table_of(chain, chain.from_unit(np.full(4, 0.5)), np.random.default_rng(4))
    start = dict(zip([parameter.name for parameter in chain.parameters], [4e5, 10.0, 6e5, 10.0], strict=True))
    fits = [dovetail.identify(chain, table, "refined", **options).fit for options in ({}, {"start": start})]
    assert fits[1].starts == fits[0].starts + 1
    assert fits[1].theta == pytest.approx(fits[0].theta, rel=1e-3)


def test_the_written_result_of_a_table_is_that_of_an_frf_without_the_frf(chain, tmp_path):
    table = table_of(chain, chain.from_unit(np.full(4, 0.5)), np.random.default_rng(4))
    frf = chain.description.response.frf(chain.frequency, chain.frf(chain.from_unit(np.full(4, 0.5))))
    result, of_frf = (dovetail.identify(chain, each, form="laplace", seed=1) for each in (table, frf))
    assert result.to_dict().keys() == of_frf.to_dict().keys()
    assert result.to_dict()["posterior"].keys() == of_frf.to_dict()["posterior"].keys()
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict(), allow_nan=False))
    read = dovetail.load_result(tmp_path)
    assert read.measured.frequency.tolist() == table.frequency.tolist()
    assert [row.estimate for row in read.table] == pytest.approx([row.estimate for row in result.table])
    again = pickle.loads(pickle.dumps(result))
    assert again.to_dict() == result.to_dict()
    assert again.parameters == result.parameters


def test_samples_of_a_table_can_be_passed_to_arviz(chain):
    pytest.importorskip("arviz")
    table = table_of(chain, chain.from_unit(np.full(4, 0.5)), np.random.default_rng(4))
    data = dovetail.identify(chain, table, samples=50).to_inferencedata(draws=20)
    assert data["log_likelihood"].sizes["draw"] == 20


@pytest.mark.parametrize("few", [0, 100])
def test_rigid_bodies_have_no_poles(few, monkeypatch):
    """Two masses on a spring and a damper in the air, by iteration and from all poles."""
    monkeypatch.setattr(damped_modes, "_FEW_DOFS", few)
    floating = copy.deepcopy(CHAIN)
    del floating["joints"]["a"], floating["joints"]["b"], floating["substructures"]["wall"]
    del floating["substructures"]["first"]
    assembly = dovetail.load(floating)
    theta = assembly.from_unit(np.random.default_rng(0).random((5, 2)))
    mass = 1.0 / (1.0 / 1.0 + 1.0 / 1.5)
    for (k, c), poles in zip(theta, DampedModes(assembly.graph).at(assembly.by_joint(theta), 2), strict=True):
        decay = c / 2.0 / mass
        assert poles.values == pytest.approx([-decay + 1j * np.sqrt(k / mass - decay**2)], rel=1e-9)


def test_iteration_finds_the_poles_that_are_found_all_at_once(assemblies, monkeypatch):
    assembly = dovetail.load(assemblies / "bolted_lap_beam.yaml")
    theta = assembly.by_joint(assembly.from_unit(np.random.default_rng(0).random((4, len(assembly.parameters)))))
    iterated = [poles.values[:5] for poles in DampedModes(assembly.graph).at(theta, 10)]
    monkeypatch.setattr(damped_modes, "_FEW_DOFS", 1000)
    at_once = [poles.values[:5] for poles in DampedModes(assembly.graph).at(theta, 10)]
    np.testing.assert_allclose(iterated, at_once, rtol=1e-8)
