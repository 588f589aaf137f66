"""Components whose code fails while FRFs are computed are named in the error, with file and line."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.assembly import find_warnings
from dovetail.errors import PluginError
from dovetail.registry import Registry

HERE = re.escape(str(Path(__file__)))


class Frail(dovetail.JointModel):
    """A spring that fails where it is asked to."""

    name = "frail"
    summary = "A spring"
    parameters = (dovetail.Parameter("k", "N/m", 1e5, 1e7),)
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))

    class Config(dovetail.ComponentConfig):
        """Where it fails."""

        fails: str = ""

    def matrices(self, theta):
        if self.config.fails == "matrices":
            raise RuntimeError("no such spring")
        joint = dovetail.StructuralMatrices.zeros(len(theta), 4)
        joint.K[:] = theta[:, 0, None, None] * np.outer([1, 0, -1, 0], [1, 0, -1, 0])
        return joint

    def matrices_jacobian(self, theta):
        if self.config.fails == "jacobian":
            return [][0]
        return super().matrices_jacobian(theta) if self.config.fails != "short" else []


class Dependent(Frail):
    """The same, as a function of frequency."""

    name = "dependent"

    def dynamic_stiffness(self, frequency, theta):
        if self.config.fails == "stiffness":
            raise KeyError("frequency")
        stiffness = super().dynamic_stiffness(frequency, theta)
        if self.config.fails == "nan":
            stiffness[0, -1, 0, 0] = np.nan
        return stiffness[0] if self.config.fails == "shape" else stiffness

    def dynamic_stiffness_jacobian(self, frequency, theta):
        if self.config.fails == "derivatives":
            raise LookupError("no such derivative")
        if self.config.fails == "later":
            return (self.no_such_stiffness for _ in self.parameters)
        return super().dynamic_stiffness_jacobian(frequency, theta) if self.config.fails != "few" else []


class WithoutFrequency(Frail):
    """The same with a law that takes the parameters alone."""

    name = "without_frequency"

    def dynamic_stiffness(self, theta):
        return super().dynamic_stiffness(np.ones(1), theta)


class Wordy(Frail):
    """The same with a law that returns a text."""

    name = "wordy"

    def dynamic_stiffness(self, frequency, theta):
        return "soft"


class Hollow(dovetail.SubstructureModel):
    """A part without anything in it."""

    name = "hollow"
    summary = "A part"
    nodes = (dovetail.PartNode("n", 0.0),)

    def matrices(self):
        raise OSError("no such mesh")


class Table(dovetail.SubstructureModel):
    """A part known by its FRFs, whose receptance takes the lines alone."""

    name = "table"
    summary = "A part"
    nodes = (dovetail.PartNode("n", 0.0),)

    def matrices(self):
        return None

    def receptance(self, frequency):
        return np.zeros((len(frequency), 2, 2))


ANSWERS = {
    "text": "soft",
    "none": None,
    "list": [1.0],
    "objects": np.array([None, "a"], dtype=object),
    "ragged": [[1.0], [1.0, 2.0]],
    "dict": {"K": 1.0},
}
OF_JOINT = ("matrices", "matrices_jacobian", "dynamic_stiffness", "dynamic_stiffness_jacobian")
OF_PART = ("matrices", "receptance", "absent_dofs", "constraints", "outline", "warnings")
SOUND = {("absent_dofs", "list"), ("absent_dofs", "objects"), ("absent_dofs", "ragged")}
"""Can be taken for what they should be."""


def odd(base: type, method: str, answer: str) -> type:
    """A component one of whose methods or properties answers with something of another type."""
    value = ANSWERS[answer]
    a_property = isinstance(getattr(base, method), property)
    own = property(lambda self: value) if a_property else lambda self, *args: value
    return type("Odd", (base,), {"name": "odd", method: own, "__module__": __name__})


class Sprung(Frail):
    """The same with nothing wrong."""

    name = "sprung"


class Shifted(Dependent):
    """The same as a function of frequency, with nothing wrong."""

    name = "shifted"


class Block(dovetail.SubstructureModel):
    """A rigid mass."""

    name = "block"
    summary = "A part"
    nodes = (dovetail.PartNode("n", 0.0),)

    def matrices(self):
        return dovetail.StructuralMatrices(np.eye(2), np.zeros((2, 2)))


class Measured(dovetail.SubstructureModel):
    """A mass known by its FRFs."""

    name = "measured"
    summary = "A part"
    nodes = (dovetail.PartNode("n", 0.0),)

    def matrices(self):
        return None

    def receptance(self, frequency, dofs):
        return -np.eye(len(dofs)) / (2.0 * np.pi * frequency[:, None, None]) ** 2


class Plugin:
    def __init__(self, *more):
        self.more = more

    @dovetail.hookimpl
    def dovetail_components(self):
        return [Frail, Sprung, Dependent, WithoutFrequency, Wordy, Hollow, Table, *self.more]


def assembly(model: str, fails: str = "", part: str = "lumped", more: type | None = None):
    from dovetail.assembly import Assembly
    from dovetail.description import read_description

    registry = Registry()
    registry.load_entry_points()
    registry.add(Plugin() if more is None else Plugin(more), "here")
    mass = {"model": "lumped", "masses": [{"mass": 1}]} if part == "lumped" else {"model": part}
    description = {
        "dovetail": 1,
        "name": "frail",
        "frequency": {"start": 1, "stop": 100, "step": 1},
        "substructures": {"mass": mass, "base": {"model": "ground"}},
        "joints": {
            "spring": {
                "model": model,
                "fails": fails,
                "connect": {"a": {"to": "mass", "at": 0}, "b": {"to": "base", "at": 0}},
            }
        },
        "response": {"at": "mass", "position": 0},
    }
    return Assembly(read_description(description, registry))


def test_sound_components_give_frfs_and_derivatives():
    assert np.isfinite(assembly("frail").frf_jacobian()[1]).all()
    assert np.isfinite(assembly("dependent").frf()).all()


@pytest.mark.parametrize(
    ("model", "fails", "said"),
    [
        ("frail", "matrices", rf"^{HERE}:\d+\n  joint 'spring' \(frail\) failed: RuntimeError: no such spring\n"),
        ("frail", "jacobian", rf"^{HERE}:\d+\n  joint 'spring' \(frail\) failed: IndexError: list index"),
        (
            "without_frequency",
            "",
            rf"^{HERE}\n  joint 'spring' \(without_frequency\) failed: TypeError: .*takes 2 positional",
        ),
        ("wordy", "", rf"^{HERE}\n  joint 'spring' \(wordy\) failed: ValueError: "),
        (
            "frail",
            "short",
            r"joint 'spring' \(frail\) returns 0 derivatives of its matrices, not one for each of its 1",
        ),
        ("dependent", "stiffness", rf"^{HERE}:\d+\n  joint 'spring' \(dependent\) failed: KeyError: 'frequency'"),
        ("dependent", "nan", r"joint 'spring' \(dependent\) returns a dynamic stiffness that is not finite"),
        (
            "dependent",
            "shape",
            r"a dynamic stiffness of shape \(3, 4, 4\), not \(5, 3, 4, 4\)|of shape \(\d+, 4, 4\), not",
        ),
    ],
)
def test_a_failing_joint_is_named(model, fails, said):
    broken = assembly(model, fails)
    compute = broken.frf_jacobian if model == "frail" else broken.frf
    with pytest.raises(PluginError, match=said):
        compute()


@pytest.mark.parametrize(
    ("fails", "said"),
    [
        ("derivatives", rf"^{HERE}:\d+\n  joint 'spring' \(dependent\) failed: LookupError: no such derivative\n"),
        ("later", rf"^{HERE}:\d+\n  joint 'spring' \(dependent\) failed: AttributeError: .* 'no_such_stiffness'"),
        ("few", r"joint 'spring' \(dependent\) returns 0 derivatives of its dynamic stiffness, not one for each of "),
    ],
)
def test_a_joint_whose_derivatives_fail_is_named(fails, said):
    with pytest.raises(PluginError, match=said):
        assembly("dependent", fails).frf_jacobian()


def test_a_failing_substructure_is_named():
    broken = assembly("frail", part="hollow")
    said = rf"^{HERE}:\d+\n  substructure 'mass' \(hollow\) failed: OSError: no such mesh"
    for compute in (broken.frf, broken.natural_frequencies):
        with pytest.raises(PluginError, match=said):
            compute()


def test_a_substructure_that_takes_other_arguments_is_named():
    said = rf"^{HERE}\n  substructure 'mass' \(table\) failed: TypeError: Table.receptance\(\) takes 2 positional"
    with pytest.raises(PluginError, match=said):
        assembly("frail", part="table").frf()


@pytest.mark.parametrize("answer", ANSWERS)
@pytest.mark.parametrize("method", OF_JOINT)
def test_wrong_results_of_a_joint_are_errors(method, answer):
    base = Shifted if method.startswith("dynamic") else Sprung
    with pytest.raises(PluginError, match=rf"^{HERE}(:\d+)?\n?  ") as error:
        assembly("odd", more=odd(base, method, answer)).frf_jacobian()
    assert len(error.value.faults) == 1


@pytest.mark.parametrize(("method", "answer"), sorted({*product(OF_PART, ANSWERS)} - SOUND))
def test_wrong_results_of_a_substructure_are_errors(method, answer):
    base = Measured if method in ("receptance", "absent_dofs", "constraints") else Block
    with pytest.raises(PluginError, match=rf"^{HERE}(:\d+)?\n?  ") as error:
        use(assembly("sprung", part="odd", more=odd(base, method, answer)))
    assert len(error.value.faults) == 1


def use(there: dovetail.Assembly) -> None:
    there.frf()
    list(find_warnings(there))
    dovetail.plot_assembly(there)
