"""The kit itself: complete and structured reports, for everything that is registered."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

import dovetail.testing
from dovetail import InUnit
from dovetail.errors import PluginError
from dovetail.interfaces import KINDS, ComponentConfig, PartNode, StructuralMatrices, SubstructureModel
from dovetail.registry import Registry, installed_components
from dovetail.testing import CheckResult, check_component, check_names, conformance
from support.broken_plugins.joints import SoundJoint
from support.broken_plugins.lists import BROKEN
from support.syntax_trees import nodes

SLOW = ("flow", "umap")
"""Of which `mlp`, whose training `flow` shares, and the tests of reducers show most."""
REGISTERED = [
    (kind, name) for kind in KINDS if not kind.endswith("reader") for name in installed_components().names(kind)
]
"""All but the readers, which test_own_readers.py and test_own_matrix_readers.py test."""


@pytest.mark.parametrize(
    ("kind", "name"),
    [pytest.param(*one, marks=[pytest.mark.slow] if one[1] in SLOW else []) for one in REGISTERED],
)
def test_every_registered_component_conforms(kind, name):
    results = check_component(installed_components().find(kind, name).component)
    assert [str(result) for result in results if not result.ok] == []
    assert sum(result.passed for result in results) >= 10
    assert [result.name for result in results] == list(check_names(kind))


@conformance(SoundJoint)
def test_the_parametrisation_gives_a_test_for_each_check(check):
    check()
    assert check.name in check_names("joint")


def test_the_parametrisation_names_model_and_check_and_fails_with_the_reason():
    checks = conformance("none", BROKEN["joint"]["matrices_are_symmetric"]).args[1]
    assert len(checks) == len(check_names("reducer")) + len(check_names("joint"))
    assert checks[0].id == "none-name_summary_and_references_are_texts"
    (red,) = [c.values[0] for c in checks if c.id == "sound_joint-matrices_are_symmetric"]
    with pytest.raises(AssertionError, match=r"the stiffness matrix is not symmetric\.\n +Fill \[row, column\]"):
        red()


def test_checks_after_a_failed_prerequisite_are_listed_as_not_run():
    results = check_component(BROKEN["joint"]["matrices_have_the_shape_of_the_dofs"])
    names = list(check_names("joint"))
    after = names[names.index("matrices_have_the_shape_of_the_dofs") + 1 :]
    assert [result.name for result in results if result.outcome == "not run"] == after
    assert not any(result.ok or result.passed for result in results if result.outcome == "not run")


@pytest.mark.parametrize("switch", ["_skip_test", "skip", "checks", "_checks", "conformance"])
def test_nothing_in_a_class_switches_checks_off(switch):
    quiet = type("Quiet", (BROKEN["joint"]["matrices_are_symmetric"],), {"__doc__": "Quiet.", switch: True})
    (red,) = [result for result in check_component(quiet) if result.outcome == "failed"]
    assert red.name == "matrices_are_symmetric"


class Spring(SubstructureModel):
    """Two nodes, and a spring without mass between them."""

    name = "link"
    summary = "A spring without mass"

    class Config(ComponentConfig):
        """What it is made of.

        Attributes
        ----------
        stiffness : float
            Of the spring [N/m].
        """

        stiffness: Annotated[float, InUnit("N/m")] = 1e6

    @property
    def nodes(self) -> tuple[PartNode, ...]:
        """Both ends."""
        return PartNode("left", 0.0), PartNode("right", 0.1)

    def matrices(self) -> StructuralMatrices:
        """Return the (4, 4) matrices."""
        stiffness = self.config.stiffness * np.outer([1, 0, -1, 0], [1, 0, -1, 0])
        return StructuralMatrices(np.zeros((4, 4)), stiffness)


def test_a_part_without_mass_conforms_without_receptance():
    results = {result.name: result for result in check_component(Spring)}
    assert [result for result in results.values() if not result.ok] == []
    assert results["receptance_has_its_shape"].outcome == "not applicable"
    assert results["mass_is_symmetric_and_positive"].outcome == "warning"
    for name in ("rigid_body_modes", "stiffness_is_symmetric_and_positive", "a_fresh_process_gives_the_same_results"):
        assert results[name].outcome == "passed"


def test_a_component_without_examples_fails():
    empty = type("Empty", (SoundJoint,), {"__doc__": "Empty.", "examples": classmethod(lambda cls, folder: ())})
    outcomes = {result.name: result.outcome for result in check_component(empty)}
    assert outcomes["examples_make_components"] == "failed"
    assert outcomes["matrices_are_symmetric"] == "not run"


def test_no_check_knows_a_class_by_its_name():
    words = {name for _, name in REGISTERED}
    classes = {installed_components().find(kind, name).component.__name__ for kind, name in REGISTERED}
    files = list(Path(dovetail.testing.__file__).parent.glob("*.py"))
    assert files
    for file in files:
        texts = {node.value for node in nodes(file) if isinstance(node, ast.Constant)}
        names = {node.id for node in nodes(file) if isinstance(node, ast.Name)}
        assert not texts & (words | classes), file
        assert not names & classes, file


def test_an_exception_in_a_plugin_is_reported_with_its_line():
    class Raising(SoundJoint):
        """It raises."""

        def matrices(self, theta):
            """Divide by zero."""
            return 1 / 0

    (red,) = [result for result in check_component(Raising) if result.outcome == "failed"]
    assert red.name == "matrices_have_the_shape_of_the_dofs"
    assert "test_check_component.py:" in red.problem
    assert "ZeroDivisionError: division by zero" in red.problem


def test_an_unknown_name_reports_what_failed_to_load():
    registry = Registry()
    registry.add(_plugin(SoundJoint, dovetail.ComponentConfig), "pads 1.0")
    assert check_component("sound_joint", registry=registry)[0] == CheckResult(
        "joint 'sound_joint'", "name_summary_and_references_are_texts", "passed"
    )
    with pytest.raises(PluginError, match=r"there is no model 'pad'\.\n.*\(Not loaded: pads 1\.0: .*Accepted: sound"):
        check_component("pad", registry=registry)
    with pytest.raises(PluginError, match="is not a component class"):
        check_component(dovetail.ComponentConfig)


def _plugin(*components):
    class Plugin:
        @dovetail.hookimpl
        def dovetail_components(self):
            return list(components)

    return Plugin()
