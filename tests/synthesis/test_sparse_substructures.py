"""Large sparse substructures: condensed by factorisation and on a reduced basis, against solves of the whole."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

import dovetail
from dovetail.assembly import Assembly
from dovetail.description import read_description
from dovetail.errors import PluginError
from dovetail.registry import Registry
from dovetail.synthesis import condensation, direct_receptance, sparse_condensation
from dovetail.synthesis.sparse_condensation import PartitionedMatrices
from support.solid_bar import solid_bar, with_rigid_sections

LENGTH, SIDE, LOSS = 0.3, 0.03, 0.003


class Solid(dovetail.SubstructureModel):
    """A square bar of hexahedra with a rigid cross-section at its tip and two near its end; bending in one plane."""

    name = "solid"
    summary = "A solid bar"

    class Config(dovetail.ComponentConfig):
        """The mesh; whether matrices are dense; the tolerance; which fault the matrices have."""

        along: int = 20
        across: int = 2
        dense: bool = False
        tolerance: float = 0.0
        fault: str = ""

    @property
    def nodes(self):
        steps = (0, round(0.9 * self.config.along), self.config.along)
        return tuple(dovetail.PartNode(f"s{step}", LENGTH * step / self.config.along) for step in steps)

    @property
    def condensation_tolerance(self):
        return self.config.tolerance

    def matrices(self):
        mesh = solid_bar(LENGTH, SIDE, self.config.along, self.config.across)
        M, K = with_rigid_sections(*mesh, [node.position for node in self.nodes])
        reached = [6 * section + dof for section in range(3) for dof in (1, 5)]
        order = np.concatenate([reached, np.setdiff1d(np.arange(K.shape[0]), reached)])
        M, K = M[order][:, order], K[order][:, order]
        if self.config.fault == "small":
            M, K = M[:5, :5], K[:5, :5]
        if self.config.fault == "nan":
            K.data[3] = np.nan
        if self.config.fault == "skew":
            K = K + sp.coo_array(([1e9], ([0], [7])), shape=K.shape)
        if self.config.dense:
            return dovetail.StructuralMatrices(M.toarray(), K.toarray(), D=LOSS * K.toarray())
        return dovetail.SparseMatrices(M, K, D=LOSS * K)


class Plugin:
    @dovetail.hookimpl
    def dovetail_components(self):
        return [Solid]


def on_springs(step=150, **options):
    """The solid bar next to a beam, held together by springs at two sections; free otherwise."""
    registry = Registry()
    registry.load_entry_points()
    registry.add(Plugin(), "here")
    solid = Solid(Solid.Config(**options))
    second = {"length": solid.nodes[2].position - solid.nodes[1].position, "outer": 0.04}
    sections = [second, {"length": 0.1, "outer": 0.04, "elements": 4}]
    description = {
        "dovetail": 1,
        "name": "solid",
        "frequency": {"start": 100, "stop": 9100, "step": step},
        "substructures": {
            "bar": {"model": "solid", **options},
            "holder": {"model": "timoshenko_beam", "material": {"young": 2e11, "density": 7800, "loss_factor": 0.003},
                       "sections": sections},
        },
        "joints": {
            "layer": {
                "model": "spring_damper",
                "nodes": 2,
                "connect": {
                    "a": {"to": "bar", "at": [node.position for node in solid.nodes[1:]]},
                    "b": {"to": "holder", "at": [0.0, second["length"]]},
                },
            }
        },
        "response": {"at": "bar", "position": 0.0},
    }  # fmt: skip
    return Assembly(read_description(description, registry))


def middle(assembly):
    return assembly.from_unit(np.full(len(assembly.parameters), 0.5))


def direct(assembly, theta, lines=slice(None)):
    by_joint = assembly.by_joint(theta)
    name, dof = assembly.description.response.point
    number = int(assembly.graph.substructure_dofs(name)[dof])
    return direct_receptance(assembly.graph, assembly.frequency[lines], by_joint, [number], [number])[:, 0, 0]


def relative(found, truth):
    return np.max(np.abs(found - truth) / np.abs(truth))


def receptance(assembly, theta):
    return assembly.engine.frfs(assembly.by_joint(theta[None, :]))[0, 0]


@pytest.mark.parametrize("tolerance", [0.0, 1e-9])
def test_sparse_matrices_give_the_frf_of_the_direct_solve(tolerance):
    assembly = on_springs(tolerance=tolerance)
    theta = middle(assembly)
    assert relative(receptance(assembly, theta), direct(assembly, theta)) < 1e-8


def test_chosen_lines_of_a_reduced_part_are_those_of_all_lines():
    """Alone they would be condensed on another basis, and give other last digits."""
    assembly = on_springs(step=10)
    few = assembly.on(assembly.frequency[4::30], chosen=True)
    np.testing.assert_array_equal(few.frf(), assembly.frf()[4::30])


def test_sparse_and_dense_matrices_are_the_same_part():
    sparse, dense = on_springs(), on_springs(dense=True)
    theta = middle(sparse)
    assert sparse.graph.size == dense.graph.size == 18
    np.testing.assert_allclose(receptance(sparse, theta), receptance(dense, theta), rtol=1e-9)
    np.testing.assert_allclose(direct(sparse, theta), direct(dense, theta), rtol=1e-7)
    np.testing.assert_allclose(sparse.natural_frequencies(theta, 4), dense.natural_frequencies(theta, 4), rtol=1e-7)


def test_receptance_of_a_sparse_part_is_that_of_a_dense_one():
    frequency = np.array([200.0, 3000.0])
    parts = [Solid(Solid.Config(dense=dense)).receptance(frequency, [0, 1, 4]) for dense in (False, True)]
    np.testing.assert_allclose(*parts, rtol=1e-7)


def _no_modes(partition, highest):
    return np.empty((partition.inner.size, 0))


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("with_modes", [True, False])
def test_the_reduced_basis_states_an_error_that_holds_at_every_line(with_modes, monkeypatch):
    """At a mode of the held bar the stiffness grows without bound; the error holds there too.

    Without its modes the basis meets the first exact lines by chance only, and has to ask for more of them.
    """
    if not with_modes:
        monkeypatch.setattr(sparse_condensation, "_fixed_boundary_modes", _no_modes)
    partition = PartitionedMatrices(Solid(Solid.Config()).matrices(), range(6))
    frequency = np.arange(100.0, 20001.0, 50.0)
    exact = partition.condense(frequency)
    for tolerance in (1e-3, 1e-6, 1e-9):
        reduced = sparse_condensation.condense_on_basis(partition, frequency, tolerance)
        assert reduced.error <= tolerance
        assert sparse_condensation.relative_difference(reduced.stiffness, exact).max() <= tolerance
        assert reduced.exact_lines < 12


def test_two_exact_lines_in_a_row_must_agree_however_coarse_the_tolerance():
    springs = 1e6 * (2 * np.eye(40) - np.eye(40, k=1) - np.eye(40, k=-1))
    partition = PartitionedMatrices(dovetail.SparseMatrices(sp.eye_array(40), sp.csc_array(springs)), [0])
    reduced = sparse_condensation.condense_on_basis(partition, np.linspace(1.0, 100.0, 30), 1e9)
    assert reduced.exact_lines == 2


def test_a_part_states_how_exactly_it_is_condensed(monkeypatch):
    monkeypatch.setattr(sparse_condensation, "_fixed_boundary_modes", _no_modes)
    frequency = np.arange(100.0, 20001.0, 50.0)
    exact, fine, coarse = (
        condensation.boundary_stiffness(Solid(Solid.Config(tolerance=tolerance)), range(6), frequency).dense(
            slice(None)
        )
        for tolerance in (0.0, 1e-9, 1e12)
    )
    assert sparse_condensation.relative_difference(fine, exact).max() < 1e-9
    assert sparse_condensation.relative_difference(coarse, exact).max() > 1e-9


def test_a_dense_part_of_many_dofs_is_condensed_as_a_sparse_one(monkeypatch):
    registry = Registry()
    registry.load_entry_points()
    beam = registry.find("substructure", "timoshenko_beam").component
    material = {"young": 2e11, "density": 7800, "loss_factor": 0.003}
    rod = beam(beam.Config(material=material, sections=[{"length": 0.2, "outer": 0.02, "elements": 150}]))
    frequency, dofs = np.array([50.0, 500.0, 5000.0]), [0, 1, 300, 301]
    eliminated = condensation.boundary_stiffness(rod, dofs, frequency).dense(slice(None))
    monkeypatch.setattr(condensation, "SETTINGS", condensation.Settings(many_dofs=200))
    sparse = condensation.boundary_stiffness(rod, dofs, frequency).dense(slice(None))
    assert not np.array_equal(sparse, eliminated)
    np.testing.assert_allclose(sparse, eliminated, rtol=1e-6)


def test_full_matrices_of_some_hundred_dofs_are_not_eliminated_symbolically(monkeypatch):
    monkeypatch.setattr(condensation, "plan_elimination", lambda pattern, keep: pytest.fail("this would take minutes"))
    solid = Solid(Solid.Config(dense=True))
    assert np.isfinite(condensation.boundary_stiffness(solid, range(6), np.array([200.0])).dense(slice(None))).all()


FAULTS = {
    "small": "its matrices have the shape (5, 5), but its 3 nodes need 6 DOFs.",
    "nan": "its matrix K has values that are not finite.",
    "skew": "its matrix K is not symmetric.",
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("dense", [False, True])
def test_faulty_matrices_are_refused_with_one_message(fault, dense):
    assembly = on_springs(fault=fault, dense=dense)
    for use in (assembly.frf, assembly.natural_frequencies):
        with pytest.raises(PluginError) as caught:
            use()
        assert str(caught.value) == f"{__file__}  substructure model 'solid'\n  {FAULTS[fault]}"


def test_an_undamped_resonance_of_the_held_part_is_one_clear_error():
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    mass, stiffness = np.diag([1.0, 1.0]), (2 * np.pi) ** 2 * spring
    partition = PartitionedMatrices(dovetail.SparseMatrices(mass, stiffness), [0])
    with pytest.raises(dovetail.DovetailError, match=r"at 1 Hz, where it resonates without damping"):
        partition.solve(1.0)
    Z, _ = partition.solve(2.0)
    w = 4 * np.pi
    expected = stiffness[0, 0] - w**2 - stiffness[0, 1] ** 2 / (stiffness[1, 1] - w**2)
    np.testing.assert_allclose(Z, [[expected]])
