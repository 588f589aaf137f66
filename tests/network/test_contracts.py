"""Reducers and regressors that return wrong shapes or values: refused by name, never broadcast over the parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.errors import PluginError

ANSWERS = {
    "sound": lambda rows, width: np.full((rows, width), 0.5),
    "column": lambda rows, width: np.full((rows, 1), 0.5),
    "vector": lambda rows, width: np.full(rows, 0.5),
    "one_row": lambda rows, width: np.full((1, width), 0.5),
    "scalar": lambda rows, width: np.array(0.5),
    "wide": lambda rows, width: np.full((rows, width + 1), 0.5),
    "empty": lambda rows, width: np.empty((rows, 0)),
    "list": lambda rows, width: [[0.5] * width] * rows,
    "complex": lambda rows, width: np.full((rows, width), 0.5j),
    "nan": lambda rows, width: np.full((rows, width), np.nan),
}


class Constant(dovetail.FittedReducer, dovetail.FittedRegressor):
    """Answers are always equal."""

    def __init__(self, answer: str, width: int) -> None:
        self.answer, self.width = answer, width

    def transform(self, features):
        if self.answer == "raises":
            raise ZeroDivisionError("no pivot")
        return ANSWERS[self.answer](len(features), self.width)

    predict = transform

    def state(self):
        return {}


class Config(dovetail.ComponentConfig):
    """What it answers."""

    answer: str = "sound"


class OddReducer(dovetail.Reducer):
    name = "odd_reducer"
    summary = "A reducer of three features"
    Config = Config

    def fit(self, features, *, seed):
        if self.config.answer == "fit":
            raise KeyError("seed")
        return None if self.config.answer == "nothing" else Constant(self.config.answer, 3)

    def restore(self, state):
        return Constant(self.config.answer, 3)


class OddRegressor(dovetail.Regressor):
    name = "odd_regressor"
    summary = "A regressor of two targets"
    Config = Config

    def fit(self, features, targets, *, seed, progress=dovetail.silent):
        if self.config.answer == "fit":
            raise KeyError("seed")
        return None if self.config.answer == "nothing" else Constant(self.config.answer, 2)

    def restore(self, state):
        return Constant(self.config.answer, 2)


@pytest.fixture
def train(small, dataset):
    def trained(reducer: str = "sound", regressor: str = "sound"):
        settings = replace(
            small.description.identification,
            reducer=OddReducer(Config(answer=reducer)),
            regressor=OddRegressor(Config(answer=regressor)),
        )
        return dovetail.train(dovetail.Assembly(replace(small.description, identification=settings)), dataset)

    return trained


def test_sound_components_are_trained(train):
    assert train().predict_parameters(np.ones((2, 600))).shape == (2, 2)


SHAPES = {"vector": "(1200,)", "one_row": "(1, 3)", "scalar": "()", "empty": "(1200, 0)"}


@pytest.mark.parametrize("answer", SHAPES)
def test_a_reducer_that_returns_another_shape_is_an_error(train, answer):
    with pytest.raises(PluginError) as error:
        train(reducer=answer)
    assert str(error.value) == (
        f"{__file__}  reducer 'odd_reducer'\n  it returned the shape {SHAPES[answer]} for 1200 FRFs.\n"
        "  Accepted: (1200, n_components)"
    )


@pytest.mark.parametrize("answer", ["column", "wide"])
def test_a_reducer_that_changes_its_width_is_an_error(train, answer):
    model = train()
    object.__setattr__(model.network, "reducer", Constant(answer, 3))
    with pytest.raises(
        PluginError, match=r"reducer 'odd_reducer'\n.*shape \(2, \d\) for 2 FRFs.\n  Accepted: \(2, 3\)"
    ):
        model.predict_parameters(np.ones((2, 600)))


SHAPES_OF_TARGETS = {"column": "(300, 1)", "vector": "(300,)", "one_row": "(1, 2)", "wide": "(300, 3)", "scalar": "()"}


@pytest.mark.parametrize("answer", SHAPES_OF_TARGETS)
def test_a_regressor_that_returns_another_shape_is_an_error(train, answer):
    with pytest.raises(PluginError) as error:
        train(regressor=answer)
    assert str(error.value) == (
        f"{__file__}  regressor 'odd_regressor'\n  it returned the shape {SHAPES_OF_TARGETS[answer]} for 300 FRFs.\n"
        "  Accepted: (300, 2)"
    )


@pytest.mark.parametrize(
    ("answer", "of_reducer", "of_regressor"),
    [
        ("list", "it returned list.", "it returned list."),
        ("complex", "it returned an array of complex128.", "it returned an array of complex128."),
        ("nothing", "its fit returned NoneType.", "its fit returned NoneType."),
        ("nan", "it returned features that are not finite.", "its predictions for the test FRFs are not finite."),
    ],
)
def test_components_that_return_no_finite_numbers_are_errors(train, answer, of_reducer, of_regressor):
    for said, which in ((of_reducer, "reducer"), (of_regressor, "regressor")):
        with pytest.raises(PluginError) as error:
            train(**{which: answer})
        assert error.value.faults[0].where == f"{__file__}  {which} 'odd_{which}'"
        assert error.value.faults[0].problem == said


@pytest.mark.parametrize(("answer", "said"), [("fit", "KeyError: 'seed'"), ("raises", "ZeroDivisionError: no pivot")])
@pytest.mark.parametrize("which", ["reducer", "regressor"])
def test_one_that_fails_at_work_is_named_with_its_line(train, which, answer, said):
    with pytest.raises(PluginError) as error:
        train(**{which: answer})
    assert error.value.faults[0].where.startswith(f"{Path(__file__)}:")
    assert error.value.faults[0].problem == f"{which} 'odd_{which}' failed: {said}"


def test_the_file_of_a_component_without_code_is_that_of_its_module():
    from dovetail.interfaces import source_file

    bare = type("Bare", (OddReducer,), {"__module__": "dovetail.errors"})
    assert source_file(bare).endswith("errors.py")
    assert source_file(type("Nowhere", (OddReducer,), {"__module__": "gone"})) == ""
    assert source_file(OddReducer) == __file__
