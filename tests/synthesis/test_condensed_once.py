"""A part that does not change between two assemblies is condensed once."""

from __future__ import annotations

import copy
import gc
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.problem.part_quantities import known_quantities
from dovetail.synthesis import coupled_system


@pytest.fixture
def condensed(monkeypatch):
    """The substructures that are condensed, in order."""
    calls, condense = [], coupled_system.boundary_stiffness

    def noted(substructure, *arguments):
        calls.append(substructure)
        return condense(substructure, *arguments)

    monkeypatch.setattr(coupled_system, "boundary_stiffness", noted)
    return calls


def test_an_assembly_with_one_changed_part_condenses_that_part_only(collet, condensed):
    collet.on(collet.frequency[::50]).frf()
    coarse = collet.on(collet.frequency[::51])
    before = coarse.frf()
    names, parts = len(condensed), coarse.description.known_parts
    changed = [apply(0.01) for _, _, apply in known_quantities(coarse)]
    condensed.clear()
    values = [each.frf() for each in changed]
    assert names >= len(parts)
    assert not set(map(id, condensed)) & set(map(id, parts.values()))
    assert all(np.abs(value - before).max() > 0.0 for value in values)


def test_other_lines_and_large_stiffnesses_are_condensed_again(collet, condensed, monkeypatch):
    collet.on(collet.frequency[::52]).frf()
    first = len(condensed)
    assert first > 0
    collet.on(collet.frequency[::53]).frf()
    assert len(condensed) == 2 * first
    kept = {part: dict(stiffnesses) for part, stiffnesses in coupled_system._LATEST.items()}
    monkeypatch.setattr(coupled_system, "_MOST_KEPT", 0.0)
    collet.on(collet.frequency[::54]).frf()
    assert len(condensed) == 3 * first
    assert {part: coupled_system._LATEST[part] for part in kept} == kept


def test_the_latest_stiffnesses_are_kept_as_far_as_they_fit_into_memory(collet, condensed, monkeypatch):
    """Responses with lines of their own are computed in turn."""
    first, second, third = (
        replace(collet.description, frequency=collet.frequency[::60] + step) for step in (1.0, 2.0, 3.0)
    )
    collet.with_description(first).frf()
    parts, kept = len(condensed), [coupled_system._LATEST[part] for part in set(condensed)]
    largest = max(list(stiffnesses.values())[-1].values.nbytes for stiffnesses in kept)
    monkeypatch.setattr(coupled_system, "_MOST_KEPT", 2.5 * largest)
    for description in (second, first, second, first):
        collet.with_description(description).frf()
    assert len(condensed) == 2 * parts
    for description in (third, first, second):  # there is no room for the second any more
        collet.with_description(description).frf()
    assert len(condensed) == 4 * parts


def test_threads_may_condense_the_same_part(collet, monkeypatch):
    part, axes = next(iter(collet.graph.substructures.values())), np.linspace(100.0, 900.0, 64).reshape(16, 4)
    coupled_system._LATEST.pop(part, None)
    expected = [coupled_system._latest_stiffness(part, [0, 1], axis, None).values for axis in axes]
    monkeypatch.setattr(coupled_system, "_MOST_KEPT", 3.5 * expected[0].nbytes)

    def condense(number):
        return coupled_system._latest_stiffness(part, [0, 1], axes[number % 16], None).values

    with ThreadPoolExecutor(8) as pool:
        values = list(pool.map(condense, range(400)))
    assert all(np.array_equal(value, expected[number % 16]) for number, value in enumerate(values))
    assert len(coupled_system._LATEST[part]) <= 3


def test_a_condensed_stiffness_goes_with_its_part(collet):
    _, _, apply = next(known_quantities(collet))
    changed = apply(0.02).on(collet.frequency[::55])
    changed.frf()
    kept = len(coupled_system._LATEST)
    del changed
    gc.collect()
    assert len(coupled_system._LATEST) < kept


def test_chosen_lines_are_condensed_with_all_others_once(collet, condensed):
    all_lines = collet.on(collet.frequency[::20] + 1.0)
    few = all_lines.on(all_lines.frequency[3::7], chosen=True)
    fewer = few.on(few.frequency[::2], chosen=True)
    values, parts = fewer.frf(), len(condensed)
    assert parts > 0
    np.testing.assert_array_equal(few.frf()[::2], values)
    np.testing.assert_array_equal(all_lines.frf()[3::14], values)
    assert len(condensed) == parts
    np.testing.assert_array_equal(collet.on(fewer.frequency).frf(), values)
    assert len(condensed) == 2 * parts


def test_chosen_lines_are_condensed_alone_where_all_take_too_much_memory(collet, condensed, monkeypatch):
    all_lines = collet.on(collet.frequency[::20] + 2.0)
    few = all_lines.on(all_lines.frequency[::50], chosen=True)
    expected = all_lines.frf()[::50]
    parts = len(condensed)
    monkeypatch.setattr(coupled_system, "_MOST_KEPT", 0.0)
    np.testing.assert_array_equal(few.frf(), expected)
    assert len(condensed) == 2 * parts


def test_each_response_has_its_own_lines_to_choose_from(assemblies, condensed):
    two_points = dovetail.load(assemblies / "bt40_er32_two_points.yaml")
    first, second = two_points.frequency[::20] + 1.0, two_points.frequency[5::30] + 2.0
    both = two_points.on(first, second)
    chosen = copy.copy(both.on(first[::3], second[1::4], chosen=True))
    for index, lines in enumerate((slice(0, None, 3), slice(1, None, 4))):
        values, parts = chosen.each_response[index].frf(), len(condensed)
        assert parts > 0
        np.testing.assert_array_equal(both.each_response[index].frf()[lines], values)
        assert len(condensed) == parts


def test_lines_that_are_not_among_those_to_choose_from_are_condensed_alone(collet):
    few = collet.on(collet.frequency[::300], chosen=True)
    between = few.with_description(replace(few.description, frequency=few.frequency + 0.5))
    np.testing.assert_array_equal(between.frf(), collet.on(few.frequency + 0.5).frf())


def test_a_changed_part_is_condensed_at_the_chosen_lines_only(collet, monkeypatch):
    lines, condense = [], coupled_system.boundary_stiffness

    def noted(substructure, dofs, frequency, draw):
        lines.append(len(frequency))
        return condense(substructure, dofs, frequency, draw)

    all_lines = collet.on(collet.frequency[::20] + 3.0)
    few = all_lines.on(all_lines.frequency[::4], chosen=True)
    few.frf()
    monkeypatch.setattr(coupled_system, "boundary_stiffness", noted)
    for _, _, apply in known_quantities(few):
        apply(0.01).frf()
    assert set(lines) == {len(few.frequency)}
