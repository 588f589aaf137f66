"""Checks of reducers and regressors: the result of fitting, and the independence of predictions from anything else."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import FittedReducer, FittedRegressor
from dovetail.testing.agreement import require_agreement
from dovetail.testing.fitted_specimens import FittedSpecimen, ReducerSpecimen, RegressorSpecimen
from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.surroundings import with_other_random_numbers
from dovetail.testing.training_sets import TrainingSet

_FEW = 12
"""Rows that are compared one by one."""
_BATCH = 500
"""Larger than a block of 256 rows, and not a multiple of it."""
_GREATEST_SEED = 2**32 - 1
"""Largest seed in a description."""


def check_fit_returns_what_the_contract_says(specimen: FittedSpecimen) -> None:
    """`fit` returns a new fitted object, and stores nothing in the component."""
    contract = FittedReducer if isinstance(specimen, ReducerSpecimen) else FittedRegressor
    if not isinstance(specimen.fitted, contract):
        problem = f"fit returned {type(specimen.fitted).__name__}."
        raise Nonconformity(problem, f"Return an object of a class derived from dovetail.{contract.__name__}.")
    new = specimen.model(specimen.component.config)
    kept = sorted(set(vars(specimen.component)) - set(vars(new)))
    if kept:
        raise Nonconformity(f"fit stores '{kept[0]}' in the component.", "Store it in the fitted object instead.")


def check_results_have_a_row_for_each_sample(specimen: FittedSpecimen) -> None:
    """The output has a row for each input row, always of the same width, in single or double precision."""
    features = specimen.training.features
    whole = specimen.answer(specimen.fitted, features.copy())
    width = whole.shape[1] if isinstance(whole, np.ndarray) and whole.ndim == 2 else 0
    if isinstance(specimen, RegressorSpecimen) and width not in (0, specimen.training.targets.shape[1]):
        raise Nonconformity(f"for 2 targets it predicts {width}.", "Return a column for each target.")
    for count in (len(features), 1, 3):
        answer = specimen.answer(specimen.fitted, features[:count].copy())
        kind = getattr(answer, "dtype", None)
        if (
            not isinstance(answer, np.ndarray)
            or kind not in (np.float32, np.float64)
            or answer.shape != (count, width or 1)
        ):
            shape = getattr(answer, "shape", type(answer).__name__)
            problem = f"for {count} rows it returned {shape}, {kind}."
            shape = f"({count}, {width or 'n_columns'})"
            raise Nonconformity(problem, f"Return an array of shape {shape}, float32 or float64.")


def check_results_are_finite(specimen: FittedSpecimen) -> None:
    """Finite features give finite output, also for samples that were not used for fitting."""
    for samples in (specimen.training, specimen.unseen):
        if not np.isfinite(specimen.ask(specimen.fitted, samples.features)).all():
            raise Nonconformity(
                "it returned values that are not finite.", "Guard divisions, and operations that may overflow."
            )


def check_the_same_seed_gives_the_same_fit(specimen: FittedSpecimen) -> str:
    """Two fits with the same seed give the same output bit for bit, for any state of the global random numbers."""
    features = specimen.unseen.features
    start = time.perf_counter()
    again = with_other_random_numbers(specimen.fit)
    seconds = time.perf_counter() - start
    if not np.array_equal(specimen.ask(again, features), specimen.ask(specimen.fitted, features)):
        raise Nonconformity("two fits with the same seed differ.", "Draw all random numbers from default_rng(seed).")
    return f"a fit to {len(features)} samples takes {1000 * seconds:.3g} ms"


def check_every_seed_is_accepted(specimen: FittedSpecimen) -> None:
    """Every seed from 0 to 2^32 - 1 is accepted, and 0 is a seed like any other."""
    first, again = (specimen.fit(seed=0) for _ in range(2))
    features = specimen.unseen.features[:_FEW]
    if not np.array_equal(specimen.ask(first, features), specimen.ask(again, features)):
        raise Nonconformity("two fits with the seed 0 differ.", "Use the seed unchanged, not `seed or ...`.")
    try:
        specimen.fit(seed=_GREATEST_SEED)
    except (DovetailError, ValueError, OverflowError, TypeError) as error:
        problem = f"it cannot be fitted with the seed {_GREATEST_SEED}: {error}."
        raise Nonconformity(problem, "Accept seeds up to 2^32 - 1.") from None


def check_global_random_numbers_are_left_unchanged(specimen: FittedSpecimen) -> None:
    """Neither fitting nor predicting draws from global generators (NumPy, random, torch) or seeds them."""
    if specimen.observed.observation.generators:
        drawn = ", ".join(specimen.observed.observation.generators)
        remedy = "Use numpy.random.default_rng(seed), or restore the generator (torch.random.fork_rng)."
        raise Nonconformity(f"it changes the global random numbers of {drawn}.", remedy)


def check_global_settings_are_left_unchanged(specimen: FittedSpecimen) -> None:
    """NumPy's error handling, torch's threads and dtype, the environment and so on are the same after a call."""
    if specimen.observed.observation.settings:
        changed = ", ".join(specimen.observed.observation.settings)
        raise Nonconformity(f"it changes {changed}.", "Restore settings in a `finally`, or use a context manager.")


def check_nothing_is_printed(specimen: FittedSpecimen) -> None:
    """Nothing is written to the standard output, where the caller may write a table or JSON."""
    if text := specimen.observed.observation.printed.strip():
        raise Nonconformity(f"it prints {text.splitlines()[0]!r:.60}.", "Report through `progress`, or use logging.")


def check_single_rows_agree_with_batches(specimen: FittedSpecimen) -> str:
    """An FRF has the same output in a batch of 1, 2 and 500, since a measurement is a batch of one."""
    features = specimen.samples(_BATCH, seed=3).features
    start = time.perf_counter()
    batch = specimen.ask(specimen.fitted, features)
    times = [time.perf_counter() - start]
    rows = np.linspace(0, _BATCH - 1, _FEW).astype(int)
    for size in (2, 1):
        start = time.perf_counter()
        small = [specimen.ask(specimen.fitted, features[rows[i : i + size]]) for i in range(0, _FEW, size)]
        times.append((time.perf_counter() - start) / len(small))
        problem = f"a row in a batch of {size} has another result than in a batch of {_BATCH}"
        require_agreement(np.concatenate(small), batch[rows], problem, "Compute each row from this row only.")
    return f"{_BATCH} take {1000 * times[0]:.3g} ms, one {1000 * times[-1]:.3g} ms"


def check_the_order_of_rows_does_not_matter(specimen: FittedSpecimen) -> None:
    """Rows in another order have the same output in that order."""
    features = specimen.training.features
    turned = specimen.ask(specimen.fitted, features[::-1])[::-1]
    batch = specimen.ask(specimen.fitted, features)
    require_agreement(
        turned, batch, "rows in another order give other results", "Compute each row independently of its position."
    )


def check_repeated_calls_agree(specimen: FittedSpecimen) -> None:
    """The same input gives the same output, whatever was computed in between, and the state does not change."""
    features = specimen.training.features
    state = specimen.fitted.state()
    first = specimen.ask(specimen.fitted, features[:_FEW])
    specimen.ask(specimen.fitted, 2.0 * features[_FEW:])
    again = specimen.ask(specimen.fitted, features[:_FEW])
    if not np.array_equal(first, again):
        raise Nonconformity("the same features gave two results.", "Store nothing when predicting.")
    later = specimen.fitted.state()
    if state.keys() != later.keys() or not all(np.array_equal(state[name], later[name]) for name in state):
        raise Nonconformity("predicting changes its state.", "Store nothing when predicting.")


def check_results_are_new_arrays(specimen: FittedSpecimen) -> None:
    """A returned array is never changed later, and may be overwritten, since features are standardised in place."""
    features = specimen.training.features[:_FEW]
    passed = features.copy()
    first = specimen.answer(specimen.fitted, passed)
    kept = first.copy()
    specimen.ask(specimen.fitted, specimen.unseen.features[:_FEW])
    if not np.array_equal(first, kept):
        raise Nonconformity("a later call changes an earlier result.", "Return a new array from each call.")
    if np.shares_memory(first, passed):
        raise Nonconformity("its result is a view of the features.", "Return a copy.")
    if first.flags.writeable:
        first[...] = 0.0
    if not np.array_equal(specimen.ask(specimen.fitted, features), kept):
        raise Nonconformity("overwriting a result changes the next one.", "Return a new array from each call.")


def check_inputs_are_left_unchanged(specimen: FittedSpecimen) -> None:
    """Arrays given to `fit`, `transform` and `predict` are not changed."""
    changed = [name for name in specimen.observed.changed if name == "features"]
    passed = specimen.training.features.copy()
    specimen.answer(specimen.fitted, passed)
    if changed or not np.array_equal(passed, specimen.training.features):
        raise Nonconformity("it changed the caller's features.", "Compute with copies.")


def check_read_only_arrays_are_accepted(specimen: FittedSpecimen) -> None:
    """Read-only arrays, such as those of a memory map, are accepted."""
    samples = specimen.training.copy()
    for array in vars(samples).values():
        array.flags.writeable = False
    try:
        specimen.fit(samples)
        specimen.answer(specimen.fitted, samples.features)
    except (ValueError, TypeError, BufferError) as error:
        raise Nonconformity(f"it fails for read-only arrays: {error}.", "Compute with copies.") from None


def check_its_samples_may_be_overwritten(specimen: FittedSpecimen) -> None:
    """After `fit`, the caller may overwrite the training samples."""
    if not np.array_equal(specimen.observed.answers, specimen.observed.overwritten):
        problem = "overwriting the training samples after fit changes its results."
        raise Nonconformity(problem, "Copy the samples that it keeps.")


def check_layout_and_precision_do_not_matter(specimen: FittedSpecimen) -> None:
    """The same numbers give the same fit and output, in Fortran order, strided, or in double precision."""
    remedy = "Begin with numpy.ascontiguousarray(features, dtype=...)."
    features = specimen.unseen.features
    wanted = specimen.ask(specimen.fitted, features)
    layouts: dict[str, NDArray[Any]] = {
        "in Fortran order": np.array(features, order="F"),
        "in double precision": features.astype(np.float64),
        "of every other row of an array": np.repeat(features, 2, axis=0)[::2],
        "in reversed memory": features[::-1, ::-1].copy()[::-1, ::-1],
    }
    for name, array in layouts.items():
        answers = np.array(specimen.answer(specimen.fitted, array))
        require_agreement(answers, wanted, f"features {name} give other results", remedy)
    double: Any = np.asfortranarray(specimen.training.features, dtype=np.float64)
    turned = TrainingSet(double, np.array(specimen.training.targets, order="F"))
    answers = specimen.ask(specimen.fit(turned), features)
    require_agreement(answers, wanted, "a fit to arrays in Fortran order and double precision differs", remedy)


def check_other_fits_have_no_influence(specimen: FittedSpecimen) -> None:
    """Earlier fits, by this or another instance, with the same or other options, have no influence."""
    features = specimen.unseen.features
    before = specimen.ask(specimen.fitted, features)
    remedy = "Store nothing in the class, the module or the component."
    elsewhere = specimen.elsewhere
    require_agreement(elsewhere.meanwhile, before, "other fits change the results of an earlier one", remedy)
    require_agreement(elsewhere.again, before, "an earlier fit to other samples changes its results", remedy)


def check_values_that_are_not_finite_are_refused(specimen: FittedSpecimen) -> None:
    """A NaN or an infinite number among the features raises an error."""
    for value in (np.nan, np.inf):
        samples = specimen.training.copy()
        samples.features[3, -1] = value
        calls: dict[str, Callable[[], Any]] = {
            "fitting to": partial(specimen.fit, samples),
            "predicting from": partial(specimen.answer, specimen.fitted, samples.features),
        }
        for verb, call in calls.items():
            try:
                call()
            except (DovetailError, ValueError):
                continue
            raise Nonconformity(
                f"{verb} {value} raises no error.", "Raise a dovetail.DovetailError that names the row."
            )


def check_another_width_is_refused(specimen: FittedSpecimen) -> None:
    """Features with another number of columns than the training features raise an error."""
    features = specimen.training.features[:_FEW]
    for other in (features[:, :-1], np.repeat(features, 2, axis=1)):
        try:
            specimen.ask(specimen.fitted, other)
        except (DovetailError, ValueError):
            continue
        problem = "it accepts features of another width than those of the fit."
        raise Nonconformity(problem, "Compare features.shape[1] with that of the training features.")
