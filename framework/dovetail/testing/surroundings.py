"""Global state of a process, which a component must not change."""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import random
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

_OPENMP = "KMP_"
"""Prefix of the environment variables that OpenMP's libraries set when they are first imported."""
_OTHER_SEED = 20_011
"""Seed of the global generators while a call is observed, which no component has a reason to use."""
_BLANKET = (None, Warning, None)
"""Message, category and module of a filter for all warnings; libraries set narrower ones when they are imported."""


@dataclass(frozen=True)
class Observation:
    """The result of a call and its side effects.

    Parameters
    ----------
    answer : object
    settings, generators : list of str
        Global settings that it changed, and global random generators that it drew from or seeded.
    printed : str
        Its standard output.
    """

    answer: Any
    settings: list[str]
    generators: list[str]
    printed: str


@dataclass(frozen=True)
class _Shared:
    """A global state: how it is read and written, and its value while a call is observed."""

    name: str
    read: Callable[[], Any]
    write: Callable[[Any], object]
    meanwhile: Callable[[Any], Any] = lambda value: value


def surroundings() -> dict[str, bytes]:
    """Return the global state of this process by name."""
    return _state([*_settings(), *_generators()])


def changes(before: Mapping[str, bytes], after: Mapping[str, bytes]) -> list[str]:
    """Return the names of states that exist before and after, and differ."""
    return [name for name, value in before.items() if after.get(name, value) != value]


def with_other_random_numbers(call: Callable[[], Any]) -> Any:
    """Call a function with another seed of the global generators, and restore them afterwards."""
    with _watched(_generators()):
        return call()


def observe(call: Callable[[], Any], *, environment: Mapping[str, str] | None = None) -> Observation:
    """Call a function with other global settings and random numbers than it may have left; restore them afterwards.

    The number of torch's threads is different too, and with it perhaps the last bits of the result.

    Parameters
    ----------
    call : callable
    environment : mapping, optional
        Environment variables before the first such call; others are removed, so that setting them is detected again.

    Notes
    -----
    Packages may draw random numbers when they are imported, as `sklearn.gaussian_process` does. A call that imports
    something is repeated, and the second call says which generators were used.
    """
    loaded = set(sys.modules)
    seen = _observed(call, environment)
    if seen.generators and set(sys.modules) - loaded:
        return replace(seen, generators=_observed(call, environment).generators)
    return seen


def _observed(call: Callable[[], Any], environment: Mapping[str, str] | None) -> Observation:
    printed = io.StringIO()
    with (
        _watched(_settings(environment)) as settings,
        _watched(_generators()) as generators,
        contextlib.redirect_stdout(printed),
    ):
        answer = call()
    return Observation(answer, settings, generators, printed.getvalue())


@contextlib.contextmanager
def _watched(shared: list[_Shared]) -> Iterator[list[str]]:
    """Yield a list that contains the names of changed states once the block has ended."""
    callers = [entry.read() for entry in shared]
    changed: list[str] = []
    try:
        for entry, value in zip(shared, callers, strict=True):
            entry.write(entry.meanwhile(value))
        before = _state(shared)
        yield changed
        changed += changes(before, _state(shared))
    finally:
        for entry, value in zip(shared, callers, strict=True):
            entry.write(value)


def _state(shared: list[_Shared]) -> dict[str, bytes]:
    return {entry.name: pickle.dumps(entry.read()) for entry in shared}


def _settings(environment: Mapping[str, str] | None = None) -> list[_Shared]:
    numpy_errors = {"divide": "warn", "over": "warn", "under": "ignore", "invalid": "warn"}
    settings = [
        _Shared("numpy.seterr", np.geterr, lambda handling: np.seterr(**handling), lambda _: numpy_errors),
        _Shared(
            "numpy.set_printoptions",
            np.get_printoptions,
            lambda options: np.set_printoptions(**options),
            lambda options: {**options, "precision": 5},
        ),
        _Shared("the working directory", os.getcwd, os.chdir, lambda _: tempfile.gettempdir()),
        _Shared("the recursion limit", sys.getrecursionlimit, sys.setrecursionlimit),
        _Shared(
            "the environment variables",
            lambda: sorted(item for item in os.environ.items() if not item[0].startswith(_OPENMP)),
            _set_environment,
            lambda items: [item for item in items if environment is None or item[0] in environment],
        ),
        _Shared(
            "the warning filters",
            lambda: [entry[0] for entry in warnings.filters if entry[1:4] == _BLANKET],
            _set_blanket_filters,
            lambda _: ["default"],
        ),
    ]
    if "torch" in sys.modules:
        import torch

        settings += [
            _Shared("torch's number of threads", torch.get_num_threads, torch.set_num_threads, lambda count: count + 1),
            _Shared("torch's default dtype", torch.get_default_dtype, torch.set_default_dtype, lambda _: torch.float32),
            _Shared("torch's gradients", torch.is_grad_enabled, torch.set_grad_enabled, lambda _: True),
        ]
    return settings


def _generators() -> list[_Shared]:
    seeded = np.random.RandomState(_OTHER_SEED)
    generators = [
        _Shared(
            "NumPy's global random numbers",
            np.random.get_state,
            np.random.set_state,
            lambda _: seeded.get_state(),
        ),
        _Shared(
            "the random numbers of the module random",
            random.getstate,
            random.setstate,
            lambda _: random.Random(_OTHER_SEED).getstate(),
        ),
    ]
    if "torch" in sys.modules:
        import torch

        other = torch.Generator().manual_seed(_OTHER_SEED)
        generators.append(
            _Shared(
                "torch's random numbers",
                lambda: torch.get_rng_state().numpy(),
                lambda state: torch.set_rng_state(torch.from_numpy(state)),
                lambda _: other.get_state().numpy(),
            )
        )
    return generators


def _set_environment(items: list[tuple[str, str]]) -> None:
    variables = dict(items)
    for name in {name for name in os.environ if not name.startswith(_OPENMP)} - set(variables):
        del os.environ[name]
    os.environ.update({name: value for name, value in variables.items() if os.environ.get(name) != value})


def _set_blanket_filters(actions: list[str]) -> None:
    narrow = [entry for entry in warnings.filters if entry[1:4] != _BLANKET]
    warnings.filters[:] = [*narrow, *((action, *_BLANKET, 0) for action in actions)]  # type: ignore[index]
