"""Reduction of imported parts: FRFs, the bound of what it changes, and parts that cannot be reduced."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_array, diags_array, eye_array

import dovetail
from dovetail_plugins.craig_bampton import reduce_part
from support.fe_files import STEEL, assembly, frame, imported

ENDS = ["101", "200"]


def part_in_si():
    """M and K of the frame with the DOFs of its two ends first."""
    model = frame()
    unit = np.where([one in (0, 1, 2, 3) for _, one in model.dofs], 1e3, 1.0)
    M, K = (1e-3 * np.outer(unit, unit) * matrix for matrix in (model.M, model.K))
    order = sorted(range(len(model.dofs)), key=lambda row: model.dofs[row][0] not in (101, 200))
    return M[np.ix_(order, order)], K[np.ix_(order, order)]


def reduced(M, K, **measure):
    return reduce_part({"M": csc_array(M), "K": csc_array(K)}, 12, "part", **{"modes": None, "up_to": None} | measure)


@pytest.mark.parametrize("seed", range(6))
def test_natural_frequencies_of_assemblies_change_by_less_than_the_bound(seed):
    """With random springs and masses at the interface, from soft to stiff."""
    random = np.random.default_rng(seed)
    M, K = part_in_si()
    part = reduced(M, K, modes=int(random.integers(4, 20)))
    root = random.normal(size=(12, 12)) * 10.0 ** random.uniform(1, 4)
    masses = np.diag(10.0 ** random.uniform(-6, 0, 12))
    found = []
    for mass, stiffness in ((M, K), (part.matrices["M"], part.matrices["K"])):
        mass, stiffness = mass.copy(), stiffness.copy()
        mass[:12, :12] += masses
        stiffness[:12, :12] += root @ root.T
        found.append(np.sqrt(np.maximum(eigh(stiffness, mass, eigvals_only=True), 0.0)) / (2.0 * np.pi))
    for full, kept in zip(*found, strict=False):
        if 1.0 < full < 0.7 * part.next_frequency:
            assert -1e-7 < kept / full - 1.0 <= 1.05 * part.largest_shift(kept) + 1e-7


def test_the_bound_falls_with_the_number_of_modes_and_is_near_the_worst_assembly():
    M, K = part_in_si()
    bounds = [reduced(M, K, modes=count).largest_shift(1000.0) for count in (2, 4, 8, 16, 32)]
    assert all(later < earlier for earlier, later in pairwise(bounds))
    assert bounds[-1] < 1e-4


def test_modes_up_to_a_frequency_are_those_below_it():
    M, K = part_in_si()
    part, many = reduced(M, K, up_to=6000.0), reduced(M, K, modes=40)
    below = many.natural_frequencies[many.natural_frequencies < 6000.0]
    np.testing.assert_allclose(part.natural_frequencies, below, rtol=1e-9)
    assert part.next_frequency == pytest.approx(many.natural_frequencies[len(below)])
    held = np.sqrt(eigh(K[12:, 12:], M[12:, 12:], eigvals_only=True)) / (2.0 * np.pi)
    np.testing.assert_allclose(part.natural_frequencies, held[: len(below)], rtol=1e-6)


def test_all_modes_reproduce_the_part_exactly():
    M, K = part_in_si()
    part = reduced(M, K, modes=len(M))
    assert part.next_frequency == np.inf
    assert part.largest_shift(5000.0) < 1e-9


def load(tmp_path, monkeypatch, **options):
    monkeypatch.chdir(tmp_path)
    return dovetail.load(assembly(imported(tmp_path, "op4", **options)))


def test_a_reduced_part_has_nearly_the_frf_of_the_whole_one(tmp_path, monkeypatch):
    whole = load(tmp_path, monkeypatch).frf()
    errors = []
    for modes in (6, 20, 40):
        part = load(tmp_path, monkeypatch, reduce={"interface": ENDS, "modes": modes})
        assert part.description.substructures["part"].matrices().size == 12 + modes
        errors.append(np.abs(part.frf() - whole).max() / np.abs(whole).max())
    assert errors[0] < 1e-2
    assert errors[1] < 1e-3
    assert errors[2] < 2e-5


def test_too_few_modes_are_reported(tmp_path, monkeypatch):
    few = load(tmp_path, monkeypatch, reduce={"interface": ENDS, "modes": 2})
    (warning,) = [text for text in dovetail.find_warnings(few) if "reduced" in text]
    assert "reduced to 2 modes, and the next one, with the interface held, is at" in warning
    some = load(tmp_path, monkeypatch, reduce={"interface": ENDS, "up_to": "6 kHz"})
    assert any("natural frequencies up to 3000 Hz may change by" in text for text in dovetail.find_warnings(some))
    many = load(tmp_path, monkeypatch, reduce={"interface": ENDS, "up_to": "40 kHz"})
    assert not any("reduced" in text for text in dovetail.find_warnings(many))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"reduce": {"interface": ["101"]}}, "give either 'modes' or 'up_to'"),
        ({"reduce": {"interface": ["101"], "modes": 3, "up_to": 100.0}}, "give either 'modes' or 'up_to'"),
        ({"reduce": {"interface": ["5"], "modes": 3}}, "there is no node '5'"),
        ({"reduce": {"interface": ENDS, "modes": 3}, "nodes": ENDS}, "so leave out 'nodes'"),
        ({"reduce": {"interface": ["101"], "modes": 3}, "axes": {"x": "1", "y": "2"}}, "still moves without"),
        ({"reduce": {"interface": ["101"], "modes": 3}, "displacement": "1"}, "still moves without"),
    ],
)
def test_a_reduction_that_is_not_possible_is_one_clear_error(options, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    description = assembly({**imported(tmp_path, "op4"), **options})
    with pytest.raises(dovetail.DovetailError) as caught:
        dovetail.load(description)
    assert said in str(caught.value)


def test_structural_damping_is_reduced_with_the_stiffness(tmp_path, monkeypatch):
    part = load(tmp_path, monkeypatch, reduce={"interface": ENDS, "modes": 5}).description.substructures["part"]
    np.testing.assert_allclose(part.matrices().D, STEEL["loss_factor"] * part.matrices().K)


@pytest.mark.parametrize("measure", [{"modes": 12}, {"up_to": 0.9}, {"modes": 0}])
def test_a_long_chain_is_reduced_with_its_known_modes(measure):
    """900 masses of 1 kg between springs of 1e5 N/m, held at both ends: frequencies by a formula."""
    count, stiffness = 900, 1e5
    ones = np.ones(count + 2)
    K = diags_array([2.0 * ones, -ones[1:], -ones[1:]], offsets=[0, 1, -1]).tolil() * stiffness
    K[0, 0] = K[-1, -1] = stiffness
    order = [0, count + 1, *range(1, count + 1)]
    K = K.tocsc()[order][:, order]
    part = reduce_part(
        {"K": K, "M": csc_array(eye_array(count + 2))}, 2, "chain", **{"modes": None, "up_to": None} | measure
    )
    known = np.sqrt(stiffness) / np.pi * np.sin(np.pi * np.arange(1, 40) / (2.0 * (count + 1)))
    kept = len(part.natural_frequencies)
    assert kept == measure.get("modes", np.count_nonzero(known < 0.9))
    np.testing.assert_allclose(part.natural_frequencies, known[:kept], rtol=1e-8)
    assert part.next_frequency == pytest.approx(known[kept], rel=1e-8)
    np.testing.assert_allclose(
        part.matrices["K"][:2, :2], stiffness / (count + 1) * np.array([[1, -1], [-1, 1]]), rtol=1e-6
    )
    assert np.linalg.eigvalsh(part.residual)[0] > -1e-9 * np.abs(part.residual).max()


def test_a_long_chain_that_is_held_nowhere_is_refused():
    count = 900
    K = diags_array([2.0 * np.ones(count), -np.ones(count - 1), -np.ones(count - 1)], offsets=[0, 1, -1]).tolil()
    K[0, 0] = K[-1, -1] = 1.0
    M = csc_array(eye_array(count)).tolil()
    M[0, 1] = M[1, 0] = 0.1
    K[0, :] = K[:, 0] = 0.0
    K[1, 1] = 1.0
    with pytest.raises(dovetail.DovetailError, match="still moves without deformation"):
        reduce_part({"K": K.tocsc(), "M": M.tocsc()}, 1, "chain", modes=4, up_to=None)
