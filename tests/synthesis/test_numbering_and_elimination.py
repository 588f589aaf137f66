"""Global numbers of the DOFs that joints merge and the ground holds, and small eliminations, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.registry import components
from dovetail.synthesis import Attachment, Connection, Graph
from dovetail.synthesis.elimination import plan_elimination, run_elimination


def component(kind, model, **options):
    made = components().find(kind, model).component
    return made(made.Config(**options))


def mass(count=1):
    return component("substructure", "lumped", masses=[{"mass": 1.0, "position": 0.1 * i} for i in range(count)])


def joined(parts, **joints):
    """A graph; each joint is its model and the (part, node) of its two ports, and perhaps that it is rigid."""
    connections = {}
    for name, (model, first, second, *rigid) in joints.items():
        ends = tuple(Attachment(part, (node,)) for part, node in (first, second))
        connections[name] = Connection(model, ends, *rigid)
    return Graph(parts, connections)


def numbers(graph):
    return {name: graph.substructure_dofs(name).tolist() for name in graph.substructures}


WELD, HINGE = component("joint", "rigid"), component("joint", "rigid", direction="x")
SPRING = component("joint", "spring_damper", direction="x")


def test_without_joints_that_merge_the_numbers_follow_the_parts():
    graph = joined({"a": mass(2), "b": mass()}, s=(SPRING, ("a", 1), ("b", 0)))
    assert numbers(graph) == {"a": [0, 1, 2, 3], "b": [4, 5]}
    assert graph.joint_dofs("s").tolist() == [2, 3, 4, 5]
    assert graph.size == 6


def test_merged_dofs_share_the_number_of_the_first():
    graph = joined({"a": mass(2), "b": mass()}, h=(HINGE, ("b", 0), ("a", 1)))
    assert numbers(graph) == {"a": [0, 1, 2, 3], "b": [2, 4]}
    assert graph.joint_dofs("h").tolist() == [2, 4, 2, 3]
    assert graph.size == 5


def test_merging_goes_on_through_several_joints_in_any_order():
    """b to c, d to c, a to b: all four displacements are one, the rotations of b and c another."""
    parts = {name: mass() for name in "abcd"}
    graph = joined(
        parts, one=(WELD, ("b", 0), ("c", 0)), two=(HINGE, ("d", 0), ("c", 0)), three=(HINGE, ("a", 0), ("b", 0))
    )
    assert numbers(graph) == {"a": [0, 1], "b": [0, 2], "c": [0, 2], "d": [0, 3]}
    assert graph.size == 4


def test_dofs_merged_with_the_ground_are_fixed_on_both_sides():
    for ends in ((("wall", 1), ("b", 0)), (("b", 0), ("wall", 1))):
        parts = {"a": mass(), "wall": component("substructure", "ground", positions=[0.0, 1.0]), "b": mass()}
        graph = joined(parts, weld=(WELD, *ends), hinge=(HINGE, ("a", 0), ("b", 0)))
        assert numbers(graph) == {"a": [-1, 0], "wall": [-1] * 12, "b": [-1, -1]}
        assert graph.size == 1


def test_a_joint_taken_as_rigid_merges_its_contacts():
    parts = {"a": mass(), "b": mass()}
    assert numbers(joined(parts, s=(SPRING, ("a", 0), ("b", 0), True))) == {"a": [0, 1], "b": [0, 2]}
    assert numbers(joined(parts, s=(SPRING, ("a", 0), ("b", 0), False))) == {"a": [0, 1], "b": [2, 3]}


def test_a_joints_own_dofs_come_after_those_of_the_parts():
    steel = {"young": 2e11, "density": 7850.0}
    collet = component("joint", "collet", material=steel)
    graph = Graph(
        {"tool": mass(3), "holder": mass(3)},
        {"c": Connection(collet, (Attachment("tool", (0, 1, 2)), Attachment("holder", (2, 1, 0))))},
    )
    assert graph.joint_dofs("c").tolist() == [0, 1, 2, 3, 4, 5, 10, 11, 8, 9, 6, 7, *range(12, 22)]
    assert graph.size == 22


def pattern(size, *edges):
    filled = np.eye(size, dtype=bool)
    for row, column in edges:
        filled[row, column] = filled[column, row] = True
    return filled


def test_leaves_are_eliminated_before_the_centre_of_a_star():
    """So nothing fills: five diagonal entries and four others; a division and an update for each of four pivots."""
    program = plan_elimination(pattern(5, (0, 1), (0, 2), (0, 3), (0, 4)), [4])
    assert program.order.tolist() == [1, 2, 3, 0, 4]
    assert program.slots == 9
    assert program.multiplications == 4 + 4 + 4 + 1


def test_a_ring_fills_one_entry():
    program = plan_elimination(pattern(4, (0, 1), (1, 2), (2, 3), (3, 0)), [3])
    assert program.order.tolist() == [0, 1, 2, 3]
    assert program.slots == 4 + 4 + 1
    entries = set(zip(program.rows.tolist(), program.columns.tolist(), strict=True))
    assert (3, 1) in entries


def test_of_equal_degrees_the_one_that_fills_least_goes_first():
    """0 has two neighbours that are not connected, 1 has two that are: 1 first."""
    program = plan_elimination(pattern(6, (0, 2), (0, 3), (1, 4), (1, 5), (4, 5), (2, 4), (3, 5), (2, 5), (3, 4)), [5])
    assert program.order[0] == 1


@pytest.mark.parametrize("kept", [[2], [2, 0], [0, 1, 2]])
def test_kept_dofs_keep_their_order_and_the_schur_complement(kept):
    """Springs of 2, 3 and 5 N/m in a row from a wall; with the third kept alone: 1 / (1/2 + 1/3 + 1/5)."""
    K = np.array([[5.0, -3.0, 0.0], [-3.0, 8.0, -5.0], [0.0, -5.0, 5.0]])
    program = plan_elimination(K != 0, kept)
    assert program.order[-len(kept) :].tolist() == kept
    slots = np.stack([K[program.rows, program.columns], 2.0 * K[program.rows, program.columns]], axis=1).astype(complex)
    run_elimination(program, slots)
    last = slots[program.diagonal[-1]]
    if kept == [2]:
        np.testing.assert_allclose(last, [1 / (1 / 2 + 1 / 3 + 1 / 5), 2 / (1 / 2 + 1 / 3 + 1 / 5)])
    if kept == [0, 1, 2]:
        np.testing.assert_array_equal(slots[:, 0], K[program.rows, program.columns])
