"""What an engine prepares for its joints alone serves others of the same joints: on other lines, with other parts."""

import numpy as np
import pytest

import dovetail
from dovetail.problem.part_quantities import known_quantities
from dovetail.synthesis.codegen.layout import MATRICES
from dovetail.synthesis.joint_evaluation import probe_matrices

SHIPPED = ["bt40_er32_quick.yaml", "bolted_lap_beam.yaml", "shaft_hub.yaml", "spindle_bt40_er32.yaml"]


def on_every_third_line(assembly):
    return assembly.on(assembly.frequency[::3])


def with_another_part(assembly):
    _, _, apply = next(iter(known_quantities(assembly)))
    return apply(0.1)


@pytest.mark.parametrize("file", SHIPPED)
@pytest.mark.parametrize("changed", [on_every_third_line, with_another_part])
def test_frfs_with_shared_inputs_are_those_of_an_engine_that_prepares_its_own(assemblies, file, changed):
    assembly, alone = (dovetail.load(assemblies / file) for _ in range(2))
    theta = assembly.from_unit(np.random.default_rng(1).random((3, len(assembly.parameters))))
    assembly.frf_jacobian(theta)
    sharing, alone = changed(assembly), changed(alone)
    for shared, own in zip(sharing.frf_jacobian(theta), alone.frf_jacobian(theta), strict=True):
        np.testing.assert_array_equal(shared, own)
    assert sharing.engine.plan.inputs is assembly.engine.plan.inputs
    assert sharing.engine.plan.inputs is not alone.engine.plan.inputs


def test_joints_that_differ_do_not_share_inputs(assemblies):
    assembly, again = (dovetail.load(assemblies / "bt40_er32_quick.yaml") for _ in range(2))
    inputs = [each.engine.plan.inputs for each in (assembly, again, assembly.rigid())]
    assert len(set(map(id, inputs))) == 3


def test_entries_are_those_of_the_parameters_that_are_probed(sdof):
    undamped, damped = (sdof.by_joint([[2e6, c]]) for c in (0.0, 30.0))
    for theta, has_damping in ((undamped, False), (damped, True), (undamped, False)):
        (sparsity,) = probe_matrices(sdof.graph, sdof.frequency, theta).values()
        assert sparsity.matrices[MATRICES.index("K")].any()
        assert sparsity.matrices[MATRICES.index("C")].any() == has_damping
