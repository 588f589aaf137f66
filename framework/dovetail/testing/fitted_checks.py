"""Checks that reducers and regressors share: what fitting gives, and what a file keeps of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import FittedReducer, FittedRegressor
from dovetail.testing.fresh_process import answer_of_a_fresh_process
from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.specimens import ReducerSpecimen, RegressorSpecimen

__all__: list[str] = []

FittedSpecimen = ReducerSpecimen | RegressorSpecimen
_FEW = 12
_ALIKE = 1e-4
"""Of the greatest value: single precision, with room for the order of a sum."""


def check_fit_returns_what_the_contract_says(specimen: FittedSpecimen) -> None:
    """`fit` returns a new fitted object, and leaves the recipe a recipe."""
    contract = FittedReducer if isinstance(specimen, ReducerSpecimen) else FittedRegressor
    if not isinstance(specimen.fitted, contract):
        problem = f"fit returned {type(specimen.fitted).__name__}."
        raise Nonconformity(problem, f"Return an object of a class derived from dovetail.{contract.__name__}.")


def check_answers_have_a_row_for_each_sample(specimen: FittedSpecimen) -> None:
    """Any number of rows gives as many, always of the same width."""
    whole = specimen.answer(specimen.fitted, specimen.features.copy())
    width = whole.shape[1] if isinstance(whole, np.ndarray) and whole.ndim == 2 else 0
    if isinstance(specimen, RegressorSpecimen) and width not in (0, specimen.targets.shape[1]):
        raise Nonconformity(f"for 2 targets it predicts {width}.", "Return a column for each target.")
    for count in (len(specimen.features), 1, 3):
        answer = specimen.answer(specimen.fitted, specimen.features[:count].copy())
        if not isinstance(answer, np.ndarray) or answer.dtype.kind not in "f" or answer.shape != (count, width or 1):
            shape = getattr(answer, "shape", type(answer).__name__)
            problem = f"for {count} rows it returned {shape}, {getattr(answer, 'dtype', '')}."
            raise Nonconformity(problem, f"Return a floating-point array of shape ({count}, {width or 'n_columns'}).")


def check_answers_are_finite(specimen: FittedSpecimen) -> None:
    """Finite features give finite answers."""
    if not np.isfinite(specimen.answer(specimen.fitted, specimen.features.copy())).all():
        raise Nonconformity("it returned values that are not finite.", "Guard divisions: a column may be constant.")


def check_the_same_seed_gives_the_same_fit(specimen: FittedSpecimen) -> None:
    """Fitted twice with one seed, it answers alike to the last bit."""
    again = specimen.answer(specimen.fit(), specimen.features[:_FEW].copy())
    if not np.array_equal(again, specimen.answer(specimen.fitted, specimen.features[:_FEW].copy())):
        raise Nonconformity("two fits with the same seed differ.", "Draw all random numbers from default_rng(seed).")


def check_global_random_numbers_are_left_alone(specimen: FittedSpecimen) -> None:
    """Fitting neither draws from NumPy's global generator nor seeds it."""
    np.random.seed(3)  # noqa: NPY002  the generator that must be left alone
    expected = np.random.random()  # noqa: NPY002
    np.random.seed(3)  # noqa: NPY002
    specimen.fit()
    if np.random.random() != expected:  # noqa: NPY002
        raise Nonconformity("fitting changed NumPy's global random numbers.", "Use numpy.random.default_rng(seed).")


def check_one_alone_is_as_in_a_batch(specimen: FittedSpecimen) -> None:
    """One FRF gives the same answer by itself and among others: a measurement comes alone."""
    batch = specimen.answer(specimen.fitted, specimen.features[:_FEW].copy())
    alone = [specimen.answer(specimen.fitted, specimen.features[row : row + 1].copy())[0] for row in range(_FEW)]
    _compare(
        np.stack(alone), batch, "a row alone gives another answer than in a batch", "Let each row depend on itself."
    )


def check_the_order_of_rows_does_not_matter(specimen: FittedSpecimen) -> None:
    """Rows in another order give the same answers in that order."""
    batch = specimen.answer(specimen.fitted, specimen.features.copy())
    turned = specimen.answer(specimen.fitted, specimen.features[::-1].copy())[::-1]
    _compare(turned, batch, "rows in another order give other answers", "Let each row depend on itself, not its place.")


def check_asking_changes_nothing(specimen: FittedSpecimen) -> None:
    """The same question gets the same answer, whatever was asked between."""
    first = specimen.answer(specimen.fitted, specimen.features[:_FEW].copy())
    specimen.answer(specimen.fitted, 2.0 * specimen.features[_FEW:].copy())
    again = specimen.answer(specimen.fitted, specimen.features[:_FEW].copy())
    if not np.array_equal(first, again):
        raise Nonconformity("a question asked twice got two answers.", "Keep nothing of what is asked.")


def check_inputs_are_left_unchanged(specimen: FittedSpecimen) -> None:
    """Arrays given to `fit`, `transform` and `predict` belong to the caller, who may have made them read-only."""
    features = specimen.features.copy()
    fitted = specimen.fit(features)
    specimen.answer(fitted, features)
    if not np.array_equal(features, specimen.features):
        raise Nonconformity("it changed the features that it was given.", "Compute with copies.")


def check_state_is_arrays_and_plain_values(specimen: FittedSpecimen) -> None:
    """A model's folder holds safetensors and JSON, nothing that could be code."""
    for name, value in specimen.fitted.state().items():
        numbers = isinstance(value, np.ndarray) and value.dtype.kind in "biuf"
        if not isinstance(name, str) or not (numbers or isinstance(value, (bool, int, float, str))):
            kind = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
            problem = f"state() holds '{name}', which is {kind}."
            raise Nonconformity(problem, "Give arrays of numbers, int, float, str and bool only.")


def check_state_is_a_copy(specimen: FittedSpecimen) -> None:
    """Who writes into the state that was returned does not change later answers."""
    fitted = specimen.component.restore(specimen.fitted.state())
    before = specimen.answer(fitted, specimen.features[:_FEW].copy())
    for value in fitted.state().values():
        if isinstance(value, np.ndarray) and value.flags.writeable:
            value[...] = 0
    if not np.array_equal(before, specimen.answer(fitted, specimen.features[:_FEW].copy())):
        raise Nonconformity("writing into its state changes its answers.", "Return copies from state().")


def check_restoring_brings_back_the_answers(specimen: FittedSpecimen) -> None:
    """`restore` of `state` answers as the original does."""
    again = specimen.component.restore(specimen.fitted.state())
    answer = specimen.answer(again, specimen.features[:_FEW].copy())
    fitted = specimen.answer(specimen.fitted, specimen.features[:_FEW].copy())
    _compare(answer, fitted, "restored from its state it answers otherwise", "Put all that was fitted into state().")


def check_a_fresh_process_gives_the_same_answers(specimen: FittedSpecimen) -> None:
    """Stored in files and restored in a fresh process, without unpickling anything, it answers as before."""
    answer = answer_of_a_fresh_process(specimen, specimen.features[:_FEW])
    fitted = specimen.answer(specimen.fitted, specimen.features[:_FEW].copy())
    problem = "in a fresh process it answers otherwise"
    _compare(answer, fitted, problem, "Let restore depend on the state and the Config alone.")


def check_values_that_are_not_finite_are_refused(specimen: FittedSpecimen) -> None:
    """A NaN among the features is an error that names it, not an answer."""
    features = specimen.features.copy()
    features[3, 1] = np.nan
    for verb, call in (
        ("fitting to", lambda: specimen.fit(features)),
        ("answering to", lambda: specimen.answer(specimen.fitted, features)),
    ):
        try:
            call()
        except (DovetailError, ValueError):
            continue
        raise Nonconformity(f"{verb} a NaN it raises nothing.", "Raise a dovetail.DovetailError that names the row.")


def check_another_width_is_refused(specimen: FittedSpecimen) -> None:
    """Features of another number of columns than it was fitted to are an error."""
    try:
        specimen.answer(specimen.fitted, specimen.features[:_FEW, :-1].copy())
    except (DovetailError, ValueError):
        return
    problem = "it takes features of another width than it was fitted to."
    raise Nonconformity(problem, "Compare features.shape[1] with that of the training features.")


def _compare(answer: NDArray[Any], wanted: NDArray[Any], problem: str, remedy: str) -> None:
    greatest = float(np.abs(wanted).max(initial=0.0)) or 1.0
    if answer.shape != wanted.shape or not float(np.abs(answer - wanted).max()) <= _ALIKE * greatest:
        raise Nonconformity(f"{problem}.", remedy)
