"""Drive-point and transfer FRFs of one elimination: against the dense solve, closed forms, and one FRF at a time."""

from __future__ import annotations

import tempfile
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import Phase, given, seed, settings
from hypothesis import strategies as st

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import Engine, InterpolatedFrfs
from dovetail.synthesis import plan as plan_module
from dovetail.synthesis.plan import Settings
from support.dense_comparison import EPS, QUICK, SETTINGS, UNUSUAL_JOINTS, Tally, check_shares
from support.dense_solve import DenseAssembly
from support.joint_formulas import joint_parameters
from support.masses_in_a_row import Viscoelastic, chain, spring
from support.random_assemblies import Drawn, drawn_assemblies

FREQUENCY = np.linspace(20.0, 900.0, 61)
OMEGA = 2.0 * np.pi * FREQUENCY
PAIRS = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=5)
"""Output and input, counted round the points there are."""
FEW = settings(QUICK, max_examples=8)
LIMITS = {"straight-line code": Settings().straight_line, "loops": 0}


@pytest.fixture(params=list(LIMITS))
def kernel(request, monkeypatch) -> str:
    """Compile every elimination in one of the two ways."""
    monkeypatch.setattr(plan_module, "SETTINGS", Settings(straight_line=LIMITS[request.param]))
    return request.param


# -- random assemblies -------------------------------------------------------------------------------------------------


def compare(drawn: Drawn, draws: list[tuple[int, int]], tally: Tally) -> None:
    """Hold FRFs between the drawn points, one of which is there twice, and their Jacobian, by both kernels."""
    dense = DenseAssembly(drawn.description, drawn.archives)
    tally.assemblies += 1
    points = [drawn.response, *drawn.outputs, *drawn.inputs, drawn.response]
    if any(dense.objection(points, theta) for theta in drawn.theta):
        points = [point for point in points if not any(dense.objection([point], theta) for theta in drawn.theta)]
        if not points or any(dense.objection(points, theta) for theta in drawn.theta):
            tally.ill_posed += 1
            return
    position = {
        (part, label): dense.parts[part].positions[label] for part in drawn.nodes for label in drawn.nodes[part]
    }
    with tempfile.TemporaryDirectory() as folder:
        description = drawn.written(Path(folder), dense.frequency, position)
        with mock.patch("dovetail.description.reader.check_facing"):  # nets of DOFs, whose nodes lie anywhere
            assembly = dovetail.load(description, plugins=UNUSUAL_JOINTS)
    pairs = [(output % len(points), force % len(points)) for output, force in draws]
    numbers = [assembly.point(part, position[part, label], direction) for part, label, direction in points]
    factors = (2j * np.pi * dense.frequency) ** (np.arange(len(pairs))[:, np.newaxis] % 3)
    theta, columns = assembly.by_joint(drawn.theta), unknown_columns(drawn.description)
    first = {name: values[:1] for name, values in theta.items()}
    frfs, jacobians = [], []
    for limit in LIMITS.values():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(plan_module, "SETTINGS", Settings(straight_line=limit))
            engine = Engine(assembly.graph, assembly.frequency, numbers, first, columns, pairs=pairs)
            with_jacobian, jacobian = engine.frfs_jacobian(theta, factors)
            frfs += [engine.frfs(theta, factors), with_jacobian]
            jacobians.append(jacobian)
            np.testing.assert_allclose(engine.amplitudes(theta, factors), abs(frfs[-2]), rtol=1e-6)
    hold_all(drawn, dense, points, pairs, factors, assembly.parameters, frfs, jacobians, tally)


def hold_all(drawn, dense: DenseAssembly, points, pairs, factors, parameters, frfs, jacobians, tally: Tally) -> None:
    """Every FRF and every derivative; a transfer FRF is small against the geometric mean of both drive points."""
    reduced = dense.numbering()
    dofs = [int(reduced[dense.dof(point)]) for point in points]
    for sample, vector in enumerate(drawn.theta[: len(frfs[0])]):  # without joints there is nothing to tell of a batch
        system = dense.system(vector, points)
        slopes = dense.slopes(vector, system)
        drive_points = {dof: abs(system.receptance(dof, dof)[0]) for dof in dofs}
        for pair, (output, force) in enumerate(pairs):
            ends, factor = (dofs[output], dofs[force]), factors[pair]
            what, size = f"{points[output]} {points[force]}", np.sqrt(drive_points[ends[0]] * drive_points[ends[1]])
            H, moved = system.receptance(*ends)
            for computed in frfs:
                allowed = SETTINGS.rounding * EPS * moved * abs(factor)
                tally.hold(what, computed[sample, pair], H * factor, allowed, size * abs(factor))
            for column, derivative in enumerate(system.derivatives(*ends, slopes)):
                parameter = parameters[column]
                step = max(abs(vector[column]), 1e-3 * (parameter.upper - parameter.lower))
                for jacobian in jacobians:
                    computed = jacobian[sample, pair, :, column]
                    hold_slope(tally, dense, column, computed, derivative, factor, size / step, step)


def unknown_columns(description: dict) -> dict[str, list[int]]:
    """Columns of each joint's parameters that have no value in the description."""
    joints = description.get("joints", {})
    return {
        name: [i for i, p in enumerate(joint_parameters(joint)) if "value" not in joint["parameters"].get(p, {})]
        for name, joint in joints.items()
    }


def hold_slope(
    tally: Tally, dense: DenseAssembly, column: int, computed, derivative, factor, size, step: float
) -> None:
    """As the drive point's derivatives are held; differences that stand in for a joint's own are allowed for."""
    slope, moved, by_difference = derivative
    moved = SETTINGS.rounding * EPS * moved + SETTINGS.difference * by_difference[1] / step
    if dense.gives_its_own_law(column):
        moved += SETTINGS.law_difference * by_difference[0]
    tally.hold(f"derivative {column}", computed, slope * factor, moved * abs(factor), size * abs(factor))


def test_several_frfs_of_random_assemblies_equal_the_dense_solve():
    tally = Tally()

    @FEW
    @given(drawn_assemblies(), PAIRS)
    def hold(drawn, draws):
        compare(drawn, draws, tally)
        assert tally.differences == []

    hold()
    assert tally.assemblies >= FEW.max_examples
    check_shares(tally)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(5))
def test_several_frfs_of_five_hundred_random_assemblies_equal_the_dense_solve(part):
    """Five times a hundred others; all of a hundred are compared before one of them fails."""
    tally, failing = Tally(), []

    @seed(1000 + part)
    @settings(QUICK, derandomize=False, phases=[Phase.generate])
    @given(drawn_assemblies(), PAIRS)
    def hold(drawn, draws):
        before = len(tally.differences)
        try:
            compare(drawn, draws, tally)
        except Exception as error:  # a crash is a difference too
            tally.differences.append(repr(error))
        if len(tally.differences) > before:
            failing.append((tally.differences[before:], drawn.description, drawn.theta, draws))

    hold()
    print(f"{tally.assemblies} assemblies, {tally.ill_posed} without a receptance; ", end="")
    print(f"{tally.entries} entries, {tally.loose} loose, {tally.blind} blind")
    for differences, description, theta, draws in failing:
        print(*differences, description, theta.tolist(), draws, sep="\n", end="\n\n")
    assert len(failing) == 0
    check_shares(tally)


# -- closed forms ------------------------------------------------------------------------------------------------------


def two_masses(s: np.ndarray, omega: np.ndarray = OMEGA) -> np.ndarray:
    """Receptances (2, 2, n_freq) of two free masses of 1 kg with a spring of this complex stiffness between them."""
    own = s - omega**2
    return np.array([[own, s], [s, own]]) / (own**2 - s**2)


def test_transfer_frfs_over_a_joint_that_depends_on_frequency_equal_the_closed_form(kernel):
    graph, _ = chain(Viscoelastic())
    theta = np.array([[1e6, 1e3, 0.5], [3e6, 5e2, 0.3]])
    pairs = [(1, 0), (0, 0), (0, 1), (1, 0)]
    engine = Engine(graph, FREQUENCY, [("m0", 0), ("m1", 0)], {"j0": theta}, pairs=pairs)
    factors = np.array([1.0, 1j, -2.0, 3.0])[:, np.newaxis] * OMEGA
    frfs, jacobian = engine.frfs_jacobian({"j0": theta}, factors)
    assert (frfs.shape, jacobian.shape) == ((2, 4, 61), (2, 4, 61, 3))
    for sample, (k, c, alpha) in enumerate(theta):
        power = (1j * OMEGA) ** alpha
        H = two_masses(k + c * power)
        stretch = H[0] - H[1]  # of the spring, by a force at either mass
        slopes = np.array([np.ones_like(power), power, c * power * np.log(1j * OMEGA)])
        for pair, (output, force) in enumerate(pairs):
            np.testing.assert_allclose(frfs[sample, pair], H[output, force] * factors[pair], rtol=1e-9)
            expected = -stretch[output] * stretch[force] * slopes * factors[pair]
            np.testing.assert_allclose(jacobian[sample, pair].T, expected, rtol=1e-6)


@pytest.mark.parametrize("pairs", [[(0, 1)], [(1, 0)], [(0, 0), (1, 1), (0, 1)]])
def test_a_pivot_that_vanishes_at_a_point_is_solved_with_pivoting(kernel, pairs):
    """With the other mass held, either resonates on the spring at 1000 rad/s, where both points are kept last."""
    graph, _ = chain(spring())
    omega = np.sort(np.append(OMEGA, 1000.0 * (1.0 + 1e-13)))
    theta = {"j0": np.array([[1e6, 0.0]])}
    frequency = omega / (2 * np.pi)
    engine = Engine(graph, frequency, [("m0", 0), ("m1", 0)], {"j0": np.array([[2e6, 10.0]])}, pairs=pairs)
    factors = np.array([2.0, -1j, 3.0])[: len(pairs), np.newaxis] * omega
    frfs, jacobian = engine.frfs_jacobian(theta, factors)
    assert engine.pivoted_lines == 1
    H = two_masses(np.full_like(omega, 1e6), omega)
    stretch = H[0] - H[1]
    amplitudes = engine.amplitudes(theta, factors)
    for pair, (output, force) in enumerate(pairs):
        largest = 1e-8 * np.abs(H[0, 1] * factors[pair])
        assert np.all(np.abs(frfs[0, pair] - H[output, force] * factors[pair]) <= largest)
        assert np.all(np.abs(amplitudes[0, pair] - np.abs(H[output, force] * factors[pair])) <= 100 * largest)
        slope = -stretch[output] * stretch[force] * factors[pair]
        np.testing.assert_allclose(jacobian[0, pair, :, 0], slope, rtol=1e-6)
        np.testing.assert_allclose(jacobian[0, pair, :, 1], 1j * omega * slope, rtol=1e-6)
    assert engine.pivoted_lines == 2


# -- the collet assembly -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def places(collet) -> list[tuple[str, int]]:
    """Displacements and rotations of both parts, the described drive point first."""
    others = [("tool", 0.0, "x"), ("tool", 0.05, "rz"), ("holder", 0.1454, "x"), ("holder", 0.0, "rz")]
    return [collet.description.response.point, *(collet.point(*place) for place in others)]


def engine_between(collet, places, pairs, samples: int = 6) -> tuple[Engine, dict[str, np.ndarray]]:
    theta = collet.by_joint(latin_hypercube(collet, samples, seed=12))
    return Engine(collet.graph, collet.frequency[::5], places, theta, pairs=pairs), theta


def test_output_and_input_may_change_places_and_the_frf_is_the_same_bit_for_bit(collet, places, kernel):
    pairs = [(output, force) for output in range(5) for force in range(5)]
    engine, theta = engine_between(collet, places, pairs)
    factors = (1.0 + 2.0j) * np.arange(1, 1 + len(engine.frequency))
    frfs, jacobian = engine.frfs_jacobian(theta, factors)
    by_place = frfs.reshape(6, 5, 5, -1)
    np.testing.assert_array_equal(by_place, by_place.swapaxes(1, 2))
    slopes = jacobian.reshape(6, 5, 5, -1, 12)
    largest = np.abs(slopes).max(axis=3, keepdims=True)
    assert np.max(np.abs(slopes - slopes.swapaxes(1, 2)) / largest) < 1e-9  # sums of the same products, rounded anew


def test_one_pair_is_the_drive_point_bit_for_bit_and_among_others_to_twelve_digits(collet, places, kernel):
    alone, theta = engine_between(collet, places, [(0, 0)])
    single = Engine(collet.graph, alone.frequency, places, theta)
    factor = (1.0 + 2.0j) * np.arange(1, 1 + len(single.frequency))
    frf, amplitude = single.frfs(theta, factor)[:, 0], single.amplitudes(theta, factor)[:, 0]
    again, jacobian = (values[:, 0] for values in single.frfs_jacobian(theta, factor))
    for pairs in ([(0, 0)], [(0, 0)] * 3):
        engine, _ = engine_between(collet, places, pairs)
        frfs, jacobians = engine.frfs_jacobian(theta, np.array([factor] * len(pairs)))
        for pair in range(len(pairs)):
            np.testing.assert_array_equal(engine.frfs(theta, factor)[:, pair], frf)
            np.testing.assert_array_equal(frfs[:, pair], again)
            np.testing.assert_array_equal(jacobians[:, pair], jacobian)
            np.testing.assert_array_equal(engine.amplitudes(theta, factor)[:, pair], amplitude)
    engine, _ = engine_between(collet, places, [(0, 0), (3, 1), (2, 4)])
    close = np.abs(engine.frfs(theta, factor)[:, 0] - frf) / np.abs(frf)
    assert close.max() < 1e-8
    assert np.median(close) < 1e-12
    assert engine.frfs_jacobian(theta, factor)[1][:, 0].shape == jacobian.shape
    np.testing.assert_array_equal(engine.frfs_jacobian(theta, factor)[0][:, 0], engine.frfs(theta, factor)[:, 0])


def test_each_pair_has_its_own_factor(collet, places, kernel):
    engine, theta = engine_between(collet, places, [(0, 0), (3, 1), (1, 3)])
    plain, slopes = engine.frfs_jacobian(theta)
    factors = np.array([[2.0], [-0.5j], [1j]]) * np.ones(len(engine.frequency))
    frfs, jacobian = engine.frfs_jacobian(theta, factors)
    np.testing.assert_allclose(frfs, plain * factors, rtol=1e-14)
    np.testing.assert_allclose(jacobian, slopes * factors[..., np.newaxis], rtol=1e-14)
    np.testing.assert_allclose(engine.amplitudes(theta, factors), np.abs(plain * factors), rtol=1e-6)


def test_threads_change_nothing_of_several_frfs(collet, places):
    engine, theta = engine_between(collet, places, [(0, 0), (3, 1)], 40)
    computed = []
    for threads in (1, 3):
        engine.threads = threads
        computed.append((engine.frfs(theta), *engine.frfs_jacobian(theta)))
    for one, other in zip(*computed, strict=True):
        np.testing.assert_array_equal(one, other)


def test_several_frfs_are_interpolated_too(collet, places):
    pairs, trial = [(0, 0), (3, 1), (2, 0)], collet.by_joint(latin_hypercube(collet, 64, seed=1))
    theta = collet.by_joint(latin_hypercube(collet, 40, seed=2))
    exact = Engine(collet.graph, collet.frequency, places, trial, pairs=pairs)
    engine = InterpolatedFrfs(exact, 1e-8, trial)
    factors = np.array([[1.0], [2j], [-3.0]]) * collet.frequency
    expected = exact.frfs(theta, factors)
    frfs = engine.frfs(theta, factors)
    assert engine.interpolant is not None
    assert 0 < np.max(np.abs(frfs - expected) / np.abs(expected)) < 1e-7
    np.testing.assert_allclose(engine.amplitudes(theta, factors), np.abs(expected), rtol=1e-6)
    np.testing.assert_allclose(engine.frfs(theta, factors[0])[:, 0], frfs[:, 0], rtol=1e-7)


@pytest.mark.parametrize("pairs", [[], [(0, 2)], [(0, 0), (-1, 0)]])
def test_pairs_of_points_that_do_not_exist_are_refused(collet, places, pairs):
    with pytest.raises(ValueError, match=r"one or more \(output, input\) below 2 are expected"):
        engine_between(collet, places[:2], pairs)
