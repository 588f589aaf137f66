"""Fits that end after the first batch of searches, which is enough where a test needs no better one."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any
from unittest import mock

from dovetail.inference.fitting import refinement


def one_batch() -> AbstractContextManager[Any]:
    """Return a context in which no further batches of searches follow."""
    refine_once = refinement._Refinement

    def without_batches(problem: Any, options: Any, *others: Any) -> Any:
        return refine_once(problem, options.with_options({"batches": 0}), *others)

    return mock.patch.object(refinement, "_Refinement", without_batches)
