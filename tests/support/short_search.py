"""Fits that end after the first batch of searches, which is enough where a test needs no better one."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any
from unittest import mock

from dovetail.inference.fitting import refinement

_refinement = refinement._Refinement


def of_one_batch(problem: Any, options: Any, *others: Any) -> Any:
    """Return a refinement without further batches."""
    return _refinement(problem, options.with_options({"batches": 0}), *others)


def one_batch() -> AbstractContextManager[Any]:
    """Return a context in which no further batches of searches follow."""
    return mock.patch.object(refinement, "_Refinement", of_one_batch)
