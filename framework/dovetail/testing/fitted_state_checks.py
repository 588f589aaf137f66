"""Checks of the stored state of a fitted object, and of its use in a fresh process."""

from __future__ import annotations

import json

import numpy as np

from dovetail.interfaces import ComponentState
from dovetail.testing.agreement import require_agreement
from dovetail.testing.fitted_specimens import FittedSpecimen
from dovetail.testing.outcomes import Nonconformity, Reservation

_GROWTH = 1.5
"""Growth of the state with four times as many samples above which it contains something of each sample; a state whose
size is only limited by the number of samples grows less."""
_MANY = 40_000
"""Number of training FRFs of the collet assembly, for which a warning states the size of the state."""


def check_state_is_arrays_and_plain_values(specimen: FittedSpecimen) -> None:
    """The state has only arrays of numbers and plain values, stored as safetensors and JSON, and no code."""
    for name, value in specimen.fitted.state().items():
        numbers = isinstance(value, np.ndarray) and value.dtype.kind in "biuf"
        if not isinstance(name, str) or not (numbers or isinstance(value, (bool, int, float, str))):
            kind = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
            problem = f"state() contains '{name}', which is {kind}."
            raise Nonconformity(problem, "Give arrays of numbers, int, float, str and bool only.")


def check_state_survives_files(specimen: FittedSpecimen) -> None:
    """Each array and value of a state is unchanged after writing and reading safetensors and JSON."""
    from safetensors.numpy import load, save

    for name, value in specimen.fitted.state().items():
        try:
            if isinstance(value, np.ndarray):
                again = load(save({name: np.asarray(value, order="C")}))[name]
            else:
                again = json.loads(json.dumps(value, allow_nan=False).encode("utf-8"))
        except (KeyError, TypeError, ValueError) as error:
            problem = f"'{name}' of its state cannot be written: {error}."
            raise Nonconformity(problem, "Put numbers that are not finite into arrays, of at most 64 bits.") from None
        if not _identical({name: value}, {name: again}):
            raise Nonconformity(f"'{name}' of its state comes back from a file otherwise.", "Choose another form.")


def check_state_is_a_copy(specimen: FittedSpecimen) -> None:
    """Writing into a returned state does not change later output."""
    features = specimen.unseen.features
    fitted = specimen.component.restore(specimen.fitted.state())
    before = specimen.ask(fitted, features)
    for value in fitted.state().values():
        if isinstance(value, np.ndarray) and value.flags.writeable:
            value[...] = 0
    if not np.array_equal(before, specimen.ask(fitted, features)):
        raise Nonconformity("writing into its state changes its answers.", "Return copies from state().")


def check_restoring_gives_the_same_results(specimen: FittedSpecimen) -> None:
    """An object restored from its state gives the same output as the original."""
    features = specimen.unseen.features
    answers = specimen.ask(specimen.component.restore(specimen.fitted.state()), features)
    problem = "restored from its state it answers otherwise"
    require_agreement(
        answers, specimen.ask(specimen.fitted, features), problem, "Put all that was fitted into state()."
    )


def check_storing_twice_changes_nothing(specimen: FittedSpecimen) -> None:
    """A state that is restored and stored again is the same bit for bit."""
    first = specimen.component.restore(specimen.fitted.state()).state()
    again = specimen.component.restore(first).state()
    if not _identical(first, again):
        problem = "restored and stored again, its state is another."
        raise Nonconformity(problem, "Do not round in state().")


def check_state_does_not_grow_with_the_samples(specimen: FittedSpecimen) -> str | None:
    """The state does not contain the training set, which would make a model's folder as large as the dataset."""
    small, large = specimen.training.copy(), specimen.samples(4 * len(specimen.training.features), seed=11)
    few, many = (_bytes(specimen.fit(samples).state()) for samples in (small, large))
    if many > _GROWTH * few:
        each = (many - few) / (len(large.features) - len(small.features))
        problem = (
            f"its state grows with the training samples, by {each / 1000:.2g} kB for each: "
            f"{each * _MANY / 1e6:.3g} MB at {_MANY}, for {large.features.shape[1]} features."
        )
        raise Reservation(problem, "Nothing is wrong if its method needs the samples; say so in its documentation.")
    return f"{few / 1000:.3g} kB"


def check_a_fresh_process_gives_the_same_results(specimen: FittedSpecimen) -> None:
    """Restored from files in a fresh process, without unpickling, it gives the same output."""
    wanted = specimen.ask(specimen.fitted, specimen.unseen.features)
    problem = "in a fresh process it answers otherwise"
    answers = specimen.fresh.get("restored")
    require_agreement(answers, wanted, problem, "Compute restore from the state and the Config only.")


def check_a_fresh_process_fits_the_same(specimen: FittedSpecimen) -> None:
    """Fitted in a fresh process, without earlier fits and with another hash seed, it gives the same output."""
    problem = "fitted in a fresh process it answers otherwise"
    remedy = "Compute fit from its samples, the seed and the Config only, without a cache or the order of a set."
    require_agreement(specimen.fresh.get("fitted"), specimen.elsewhere.answers, problem, remedy)


def check_no_files_are_left(specimen: FittedSpecimen) -> None:
    """Fitting, predicting and restoring leave no files in the working folder."""
    if written := specimen.fresh.files:
        raise Nonconformity(f"it wrote '{written[0]}' into the working folder.", "Keep files out, or in tempfile's.")


def _bytes(state: ComponentState) -> int:
    return sum(value.nbytes if isinstance(value, np.ndarray) else len(str(value)) for value in state.values())


def _identical(state: ComponentState, other: ComponentState) -> bool:
    """Return whether two states are the same bit for bit, including NaN and -0."""
    return state.keys() == other.keys() and all(
        np.asarray(state[name]).tobytes() == np.asarray(other[name]).tobytes()
        and np.asarray(state[name]).dtype == np.asarray(other[name]).dtype
        and np.shape(state[name]) == np.shape(other[name])
        for name in state
    )
