"""Every check of the kit has a plugin with a single fault, which it and no other check finds."""

from __future__ import annotations

import importlib

import pytest
from broken import BROKEN

from dovetail.testing import check_component, check_names

KINDS = {"joint": "joints", "substructure": "substructures", "reducer": "reducers", "regressor": "regressors"}
PLUGINS = {kind: importlib.import_module(f"broken_{name}") for kind, name in KINDS.items()}
CASES = [(kind, check) for kind in PLUGINS for check in BROKEN[kind]]


@pytest.mark.parametrize(("kind", "check"), CASES)
def test_the_fault_is_found_by_the_check_that_is_there_for_it(kind, check):
    results = check_component(BROKEN[kind][check])
    assert [(result.name, result.problem) for result in results if result.outcome == "failed"] == [
        (check, results[[result.name for result in results].index(check)].problem)
    ]
    assert [result.name for result in results] == list(check_names(kind))


@pytest.mark.parametrize("kind", KINDS)
def test_the_sound_one_passes_every_check(kind):
    sound = getattr(PLUGINS[kind], f"Sound{kind.capitalize()}")
    assert [str(result) for result in check_component(sound) if not result.ok] == []


def test_no_check_is_without_its_broken_plugin():
    caught = {check for kind in PLUGINS for check in BROKEN[kind]}
    assert {check for kind in KINDS for check in check_names(kind)} == caught


@pytest.mark.parametrize("kind", KINDS)
def test_there_are_more_than_ten_checks_of_each_kind(kind):
    assert len(check_names(kind)) == len(set(check_names(kind))) >= 20


def test_a_pickle_hidden_in_an_array_is_found():
    (red,) = [result for result in check_component(PLUGINS["reducer"].Pickled) if result.outcome == "failed"]
    assert red.name == "a_fresh_process_gives_the_same_answers"
    assert "unpickles numpy" in red.problem


@pytest.mark.parametrize(
    ("name", "red"), [("HeldBeam", []), ("WithInnerDofs", []), ("HeldInNameOnly", ["rigid_body_modes"])]
)
def test_a_part_may_be_held_and_have_inner_dofs(name, red):
    results = check_component(getattr(PLUGINS["substructure"], name))
    assert [result.name for result in results if not result.ok] == red
