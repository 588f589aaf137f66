"""For every check of the kit there is a plugin with a single fault that only this check finds; others have several."""

from __future__ import annotations

import importlib
import os
import random
import sys
import warnings

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from dovetail.interfaces import KINDS as KIND_NAMES
from dovetail.testing import check_component, check_names
from dovetail.testing.kit import each_check
from support.broken_plugins import load_broken_plugins
from support.broken_plugins.lists import BROKEN, FURTHER

KINDS = {kind: f"{kind}s" for kind in KIND_NAMES}
PLUGINS = {kind: importlib.import_module(f"support.broken_plugins.{name}") for kind, name in KINDS.items()}
load_broken_plugins()
CASES = [(kind, check) for kind in PLUGINS for check in BROKEN[kind]]


@pytest.fixture(autouse=True)
def surroundings(monkeypatch, tmp_path):
    """Put back what plugins leave otherwise than it was."""
    monkeypatch.chdir(tmp_path)
    environment, limit = dict(os.environ), sys.getrecursionlimit()
    numbers, more_numbers = random.getstate(), np.random.get_state()  # noqa: NPY002
    np.random.seed()  # noqa: NPY002  # as in a fresh process, whatever an earlier test seeded it with
    with warnings.catch_warnings(), np.errstate(), np.printoptions():
        yield
    os.environ.clear()
    os.environ.update(environment)
    sys.setrecursionlimit(limit)
    random.setstate(numbers)
    np.random.set_state(more_numbers)  # noqa: NPY002
    if torch := sys.modules.get("torch"):
        torch.set_default_dtype(torch.float32)
        torch.set_num_threads(1)
        torch.set_grad_enabled(True)


def red(results):
    """Return the names of the checks that fail or warn."""
    return {result.name for result in results if result.outcome in ("failed", "warning")}


@pytest.mark.parametrize(("kind", "check"), CASES)
def test_each_fault_is_found_by_its_check(kind, check):
    assert red(each_check(BROKEN[kind][check], {check})) == {check}


@pytest.mark.parametrize(
    ("kind", "check"), [pytest.param(*case, marks=[pytest.mark.slow] * (at % 16 > 0)) for at, case in enumerate(CASES)]
)
def test_no_other_check_finds_the_fault(kind, check):
    results = check_component(BROKEN[kind][check])
    assert [str(result) for result in results if result.name != check and result.name in red(results)] == []
    assert red(results) == {check}
    assert [result.name for result in results] == list(check_names(kind))


@pytest.mark.sweep(keep=54)
@pytest.mark.parametrize(("model", "checks"), FURTHER, ids=[f"{m.kind}-{m.__qualname__}" for m, _ in FURTHER])
def test_a_further_fault_is_found(model, checks):
    results = []
    with threadpool_limits():  # what a plugin leaves of its own is not left to other tests
        for result in each_check(model, checks):
            results.append(result)
            if checks <= red(results):
                return
    pytest.fail("\n".join(str(result) for result in results if result.name in red(results)))


@pytest.mark.parametrize("model", [PLUGINS["joint"].StopJoint, PLUGINS["joint"].LossySpring], ids=lambda m: m.__name__)
def test_a_stop_and_a_law_of_its_own_are_sound(model):
    """An entry that is filled above 97 % of a range only, and a kink, are no faults."""
    assert [
        str(result) for result in check_component(model) if result.outcome not in ("passed", "not applicable")
    ] == []


def test_there_are_more_than_a_hundred_broken_plugins():
    models = [*(model for of_kind in BROKEN.values() for model in of_kind.values()), *(model for model, _ in FURTHER)]
    assert len(models) == len(set(models)) >= 100
    assert all(checks <= set(check_names(model.kind)) for model, checks in FURTHER)


@pytest.mark.parametrize("kind", KINDS)
def test_the_sound_one_passes_every_check(kind):
    sound = getattr(PLUGINS[kind], f"Sound{kind.title().replace('_', '')}")
    results = check_component(sound)
    assert [str(result) for result in results if result.outcome not in ("passed", "not applicable")] == []


def test_no_check_is_without_its_broken_plugin():
    caught = {check for kind in PLUGINS for check in BROKEN[kind]}
    assert {check for kind in KINDS for check in check_names(kind)} == caught


@pytest.mark.parametrize("kind", KINDS)
def test_there_are_more_than_ten_checks_of_each_kind(kind):
    assert (
        len(check_names(kind))
        == len(set(check_names(kind)))
        >= {"reader": 15, "matrix_reader": 14, "method": 15, "law": 11}.get(kind, 20)
    )


def test_a_pickle_hidden_in_an_array_is_found():
    (found,) = [result for result in check_component(PLUGINS["reducer"].Pickled) if result.outcome == "failed"]
    assert found.name == "a_fresh_process_gives_the_same_results"
    assert "unpickles numpy" in found.problem


@pytest.mark.parametrize(
    ("name", "red"), [("HeldBeam", []), ("WithInnerDofs", []), ("HeldInNameOnly", ["rigid_body_modes"])]
)
def test_a_part_may_be_held_and_have_inner_dofs(name, red):
    results = check_component(getattr(PLUGINS["substructure"], name))
    assert [result.name for result in results if not result.ok] == red
