"""Natural frequencies, damping ratios and shapes of damped assemblies against closed forms and other algorithms."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import dovetail
from dovetail.errors import DovetailError
from dovetail.synthesis import DampedModes, natural_frequencies
from dovetail.synthesis.frequency_laws import ContinuedStiffness
from dovetail.synthesis.pole_search import Pencil, Wanted, all_poles, few_poles
from support import unusual_joints
from support.masses_in_a_row import Viscoelastic, chain

K, C, MASS = 1e6, 50.0, 2.0
ONE = {
    "dovetail": 1,
    "name": "one mass",
    "frequency": {"start": 1.0, "stop": 1000.0, "lines": 100},
    "substructures": {
        "mass": {"model": "lumped", "masses": [{"mass": MASS}]},
        "base": {"model": "ground"},
    },
    "joints": {
        "mount": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "mass", "at": 0.0}, "b": {"to": "base", "at": 0.0}},
            "parameters": {"k": {"range": [1e3, 1e9], "scale": "log"}, "c": {"range": [0.0, 1e6], "scale": "linear"}},
        }
    },
    "response": {"at": "mass", "position": 0.0, "quantity": "receptance"},
}


@pytest.mark.parametrize("damping", [0.0, 1e-4, 0.02, 0.3, 0.7, 0.95, 0.999])
def test_a_damper_changes_the_damping_ratio_and_not_the_natural_frequency(damping):
    (mode,) = dovetail.load(ONE).modes([K, 2.0 * damping * np.sqrt(K * MASS)])
    assert mode.natural_frequency == pytest.approx(np.sqrt(K / MASS) / (2 * np.pi), rel=1e-12)
    assert mode.damping_ratio == pytest.approx(damping, abs=1e-12, rel=1e-9)


@pytest.mark.parametrize("damping", [1.0, 1.001, 2.0, 100.0])
def test_overdamped_motion_has_no_natural_frequency(damping):
    theta = [K, 2.0 * damping * np.sqrt(K * MASS)]
    assert dovetail.load(ONE).modes(theta) == ()
    assert np.isnan(dovetail.load(ONE).natural_frequencies(theta)).all()


@pytest.mark.parametrize("at", [10.0, 112.0, 1000.0])
def test_structural_damping_is_a_complex_stiffness(at):
    """s^2 = -k (1 + i eta) / m with eta = 2 pi f c / k at the described frequency."""
    description = copy.deepcopy(ONE)
    description["joints"]["mount"]["structural_damping"] = at
    eta = 2 * np.pi * at * C / K
    (mode,) = dovetail.load(description).modes([K, C])
    s = 1j * np.sqrt(K * (1 + 1j * eta) / MASS)
    assert mode.natural_frequency == pytest.approx(abs(s) / (2 * np.pi), rel=1e-12)
    assert mode.damping_ratio == pytest.approx(-s.real / abs(s), rel=1e-9)


def test_a_batch_has_a_row_for_each_vector():
    theta = np.array([[K, C], [4 * K, C], [K, 1e6]])
    expected = np.sqrt([K / MASS, 4 * K / MASS, np.nan]) / (2 * np.pi)
    np.testing.assert_allclose(dovetail.load(ONE).natural_frequencies(theta, 1)[:, 0], expected, rtol=1e-12)


@pytest.mark.parametrize("theta", [(1e6, 1e3, 0.5), (3e6, 5e2, 0.3), (2e5, 8e3, 0.7), (1e5, 1e5, 0.5), (1e3, 2e5, 0.4)])
def test_a_fractional_derivative_has_the_pole_that_newtons_method_finds(theta):
    """Two masses of 1 kg on k + c s^alpha: m s^2 / 2 + k + c s^alpha = 0, up to damping ratios of 0.4."""
    k, c, alpha = theta
    graph, _ = chain(Viscoelastic())
    (poles,) = DampedModes(graph).at({"j0": np.array([theta])}, 3, differentiate=True)
    s = 1.02 * poles.values[0]
    for _ in range(20):
        s -= (s**2 / 2 + k + c * s**alpha) / (s + c * alpha * s ** (alpha - 1))
    assert poles.values == pytest.approx([s], rel=1e-10)
    by_c = -(s**alpha) / (s + c * alpha * s ** (alpha - 1))
    assert poles.derivatives["j0"][0, 1] == pytest.approx(by_c, rel=1e-6)


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize("light", [1e-3, 1e-2, 1.0])
@pytest.mark.parametrize("damping", [3e3, 1e4, 1e6])
def test_a_light_mass_that_a_damper_locks_leaves_the_low_pole_of_the_heavy_one(light, damping):
    """A mass of 100 kg on rubber, which ends at a light mass on a damper to the ground.

    Without the damper the only elastic mode is that of the light mass, up to 300 times as high.
    """
    heavy, values = 100.0, {"k": 1e5, "g": 0.02, "alpha": 0.5, "m": 1e-3}
    ends = {"a": {"to": "light", "at": 0.0}, "b": {"to": "base", "at": 0.0}}
    damper = {"model": "spring_damper", "direction": "x", "connect": ends}
    damper["parameters"] = {"k": {"value": 0.0}, "c": {"value": damping}}
    mount = {"model": "rubber", "connect": {"a": {"to": "light", "at": 0.0}, "b": {"to": "heavy", "at": 0.0}}}
    mount["parameters"] = {name: {"value": value} for name, value in values.items()}
    description = copy.deepcopy(ONE)
    masses = {"light": {"mass": light, "inertia": 1e-9}, "heavy": {"mass": heavy, "inertia": 1.0}}
    parts = {name: {"model": "lumped", "masses": [mass]} for name, mass in masses.items()}
    description |= {
        "substructures": {"base": {"model": "ground"}, **parts},
        "joints": {"damper": damper, "mount": mount},
    }
    description["response"]["at"] = "heavy"
    (mode, *_) = dovetail.load(description, plugins=[unusual_joints.__file__]).modes([], count=2)

    def determinant(s):
        half = 2.0 * values["k"] * (1.0 + values["g"] * (s / (200.0 * np.pi)) ** values["alpha"])
        inner = values["m"] * s**2 + 2.0 * half
        ends = (light * s**2 + damping * s + half, heavy * s**2 + half)
        return ends[0] * ends[1] * inner - half**2 * sum(ends)

    s = 1j * np.sqrt(values["k"] / heavy)
    for _ in range(50):
        h = 1e-5 * s
        s -= determinant(s) * 2 * h / (determinant(s + h) - determinant(s - h))
    assert mode.natural_frequency == pytest.approx(abs(s) / (2 * np.pi), rel=1e-8)
    assert mode.damping_ratio == pytest.approx(-s.real / abs(s), rel=1e-6)


def test_a_joint_whose_law_has_a_kink_has_no_poles():
    kinked = ContinuedStiffness(lambda f: (1e6 * (1 + 0.1j * np.minimum(f, 100.0) / 100.0))[:, None, None], "a law")
    with pytest.raises(DovetailError, match="is not a smooth function of frequency"):
        kinked.at(2j * np.pi * 100.0)


@pytest.mark.parametrize("zeta", [0.0, 0.01, 0.1, 0.5, 0.8])
@pytest.mark.parametrize(
    "law",
    [
        lambda f: 1e6 * (1 + 0.7 * (1j * f / 100) ** 0.43),
        lambda f: 1e6 * (1 + 3j * f / (50 + 1j * f)),
        lambda f: 1e6 - 0.3 * (2 * np.pi * f) ** 2 + 0j,
        lambda f: 1e6 * (1 + 0.1j) + 0.0 * f,
    ],
)
def test_a_law_at_real_frequencies_is_continued_to_complex_ones(law, zeta):
    continued = ContinuedStiffness(lambda f: np.stack([law(f), -2 * law(f), 0.0 * law(f), f**2 + 0j], axis=1), "a law")
    s = 2 * np.pi * 137.0 * (-zeta + 1j * np.sqrt(1 - zeta**2))
    f = s / (2j * np.pi)
    value, slope = continued.at(s)
    np.testing.assert_allclose(value, [law(f), -2 * law(f), 0.0, f**2], rtol=3e-9)
    h = 1e-4 * f
    expected = (law(f + h) - law(f - h)) / (2 * h) / (2j * np.pi)
    assert slope[0] == pytest.approx(expected, rel=1e-6, abs=1e-9 * abs(law(f)) / abs(s))


def random_chain(seed: int, size: int) -> Pencil:
    """Masses and springs in a row, free or held at an end, with structural damping and some dampers."""
    random = np.random.default_rng(seed)
    stiffness, damping = np.zeros((2, size, size))
    difference = np.array([[1.0, -1.0], [-1.0, 1.0]])
    for dof in range(size - 1):
        stiffness[dof : dof + 2, dof : dof + 2] += 10 ** random.uniform(5, 7) * difference
    stiffness[0, 0] += 1e6 * (seed % 2)
    for dof in random.choice(size - 1, 4):
        damping[dof : dof + 2, dof : dof + 2] += 10 ** random.uniform(1, 5) * difference
    return Pencil(stiffness * (1 + 0.01j), damping, np.diag(10 ** random.uniform(-1, 0.5, size)))


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_a_growing_basis_finds_the_poles_that_are_found_all_at_once(seed, sparse, monkeypatch):
    dense = random_chain(seed, 100)
    monkeypatch.setattr(natural_frequencies, "_BASIS_DOFS", 10)
    pencil = Pencil(*map(sp.csc_array, (dense.A, dense.C, dense.M))) if sparse else dense
    poles, shapes = natural_frequencies.searched_poles(pencil, Wanted(8))
    np.testing.assert_allclose(poles, few_poles(dense, Wanted(8))[0], rtol=1e-9)
    assert shapes.shape == (8, 100)


@pytest.mark.parametrize("inertia", [1e-6, 1.0, 1e4])
@pytest.mark.parametrize("seed", range(6))
def test_a_mass_that_nothing_holds_has_no_pole(seed, inertia):
    """Its shape has nothing but the strain of rounding errors, which relative to itself is as large as any other."""
    chained = random_chain(seed, 8)
    kept = np.delete(np.arange(9), 4)
    matrices = np.zeros((3, 1, 9, 9), dtype=np.complex128)
    matrices[:, 0, kept[:, np.newaxis], kept] = chained.A, chained.C, chained.M
    matrices[2, 0, 4, 4] = inertia
    A, C, M = matrices[0], matrices[1].real, matrices[2].real
    ((poles, shapes),) = all_poles(A, C, M, Wanted(20))
    np.testing.assert_allclose(poles, few_poles(chained, Wanted(20))[0], rtol=1e-9)
    np.testing.assert_allclose(shapes[:, 4], 0.0, atol=1e-9)


@pytest.mark.parametrize("moving", [True, False])
def test_a_mass_inside_a_joint_between_fixed_ends_has_a_pole(moving):
    """4 k (1 + g (s / 200 pi)^alpha) + m s^2 = 0, with or without another mass somewhere."""
    k, g, alpha, m = 1e6, 0.05, 0.5, 0.01
    description = copy.deepcopy(ONE)
    masses = [{"position": 0.0, "mass": MASS if moving else 0.0}, {"position": 0.1, "mass": 1.0}]
    description["substructures"]["mass"]["masses"] = masses
    ends = {"a": {"to": "mass", "at": 0.1}, "b": {"to": "base", "at": 0.0}}
    description["joints"]["held"] = {"model": "rigid", "direction": "both", "connect": ends}
    description["joints"]["rubber"] = {
        "model": "rubber",
        "connect": ends,
        "parameters": {
            name: {"value": value} for name, value in zip(["k", "g", "alpha", "m"], (k, g, alpha, m), strict=True)
        },
    }
    assembly = dovetail.load(description, plugins=str(Path(unusual_joints.__file__)))
    s = 1j * np.sqrt(4 * k / m)
    for _ in range(30):
        power = g * (s / (200 * np.pi)) ** alpha
        s -= (4 * k * (1 + power) + m * s**2) / (4 * k * alpha * power / s + 2 * m * s)
    modes = assembly.modes([K, 0.0])
    assert len(modes) == 1 + moving
    assert modes[-1].pole == pytest.approx(s, rel=1e-9)


def test_shapes_give_the_residues_of_the_receptance(assemblies):
    """The sum over all poles and their conjugates is the FRF of a viscously damped structure."""
    assembly = dovetail.load(ONE)
    (mode,) = assembly.modes([K, 2000.0])
    omega = 2j * np.pi * assembly.frequency
    residue = mode.shapes["mass"][0, 0] ** 2
    summed = residue / (omega - mode.pole) + np.conj(residue) / (omega - np.conj(mode.pole))
    np.testing.assert_allclose(summed, assembly.frf([K, 2000.0]), rtol=1e-10)
    assert mode.contribution([(1.0, ("mass", 0))], [(1.0, ("mass", 0))], 100.0) == pytest.approx(
        abs(residue / (200j * np.pi - mode.pole)), rel=1e-9
    )
    assert (mode.shapes["base"] == 0.0).all()


def test_a_dof_that_nothing_resists_changes_no_pole():
    """Such as the rotation of parts without any, which a joint that depends on frequency attaches to others."""
    M, C, K = np.diag([2.0, 1.0]), np.diag([3.0, 1.0]), np.array([[3e5, -1e5], [-1e5, 2e5]])
    wider = [np.zeros((1, 3, 3), dtype=complex) for _ in "KCM"]
    for whole, part in zip(wider, (K, C, M), strict=True):
        whole[np.ix_([0], [0, 2], [0, 2])] = part
    expected, _ = next(all_poles(K[np.newaxis], C[np.newaxis], M[np.newaxis], Wanted(3)))
    poles, shapes = next(all_poles(*wider, Wanted(3)))
    assert len(expected) == 2
    np.testing.assert_allclose(poles, expected, rtol=1e-9)
    assert not shapes[:, 1].any()


@pytest.mark.parametrize("seed", [57, 127, 150, 207])
def test_a_free_chain_that_a_damper_holds_has_its_low_modes(seed):
    """Iteration from its undamped modes, of which four of 400 such chains have fewer, would miss one."""
    random, count = np.random.default_rng(seed), 18
    K = np.zeros((count, count))
    for index, stiffness in enumerate(10 ** random.uniform(5, 9, count - 1)):
        K[index : index + 2, index : index + 2] += stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    M, C = np.diag(10 ** random.uniform(-2, 1, count)), np.zeros((count, count))
    held = random.integers(count)
    C[held, held] = 10 ** random.uniform(1, 5)
    stacks = K[np.newaxis] + 0j, C[np.newaxis], M[np.newaxis]
    poles, _ = next(natural_frequencies.lowest_poles(*stacks, Wanted(4)))
    np.testing.assert_allclose(poles, next(all_poles(*stacks, Wanted(4)))[0], rtol=1e-9)


def test_a_joint_whose_ends_move_together_leaves_the_modes_of_the_rest():
    """Its terms for their relative rotation cancel to rounding, which is neither stiffness nor inertia."""
    description = copy.deepcopy(ONE)
    description["substructures"]["bar"] = {"model": "lumped", "masses": [{"mass": 1.0, "position": "0 mm"}]}
    description["joints"]["rubber"] = {
        "model": "rubber",
        "connect": {"a": {"to": "bar", "at": 0.0}, "b": {"to": "mass", "at": 0.0}},
        "parameters": {"g": {"value": 0.1}, "alpha": {"value": 0.5}, "m": {"value": 0.1}},
    }
    description["joints"]["mount"]["parameters"] = {"k": {"value": K}, "c": {"value": 0.0}}
    assembly = dovetail.load(description, plugins=unusual_joints.__file__).rigid()
    mode, within = assembly.modes([1e7])
    assert mode.natural_frequency == pytest.approx(np.sqrt(K / (MASS + 1.0 + 0.1)) / (2 * np.pi), rel=1e-3)
    assert within.natural_frequency > 1000.0
