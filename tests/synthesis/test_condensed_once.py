"""A part that does not change between two assemblies is condensed once."""

from __future__ import annotations

import gc

import numpy as np
import pytest

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
    kept = dict(coupled_system._LATEST)
    monkeypatch.setattr(coupled_system, "_MOST_KEPT", 0.0)
    collet.on(collet.frequency[::54]).frf()
    assert len(condensed) == 3 * first
    assert all(coupled_system._LATEST[part] is stiffness for part, stiffness in kept.items())


def test_a_condensed_stiffness_goes_with_its_part(collet):
    _, _, apply = next(known_quantities(collet))
    changed = apply(0.02).on(collet.frequency[::55])
    changed.frf()
    kept = len(coupled_system._LATEST)
    del changed
    gc.collect()
    assert len(coupled_system._LATEST) < kept
