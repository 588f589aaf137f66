"""The kit as pytest tests, one for each check."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from dovetail.interfaces import Component
from dovetail.testing.kit import check_component, check_names, components_named
from dovetail.testing.outcomes import CheckResult

if TYPE_CHECKING:
    import pytest


@dataclass(frozen=True)
class ConformanceCheck:
    """One check of one component, which is run by calling it.

    Parameters
    ----------
    model : component class
    name : str
        Of the check.
    """

    model: type[Component]
    name: str

    def __call__(self) -> None:
        """Run the check.

        Raises
        ------
        AssertionError
            The component does not pass; the text says what is wrong and what to do.
        """
        result = _results(self.model)[self.name]
        if not result.ok:
            raise AssertionError(f"{result.component}\n{result}")


def conformance(*components: type[Component] | str) -> pytest.MarkDecorator:
    """Return a pytest parametrisation: a test with the argument ``check`` for every check of the components.

    Parameters
    ----------
    *components : component classes or names of installed models

    Examples
    --------
    >>> from dovetail.testing import conformance
    >>> @conformance("collet")
    ... def test_conformance(check):
    ...     check()
    """
    import pytest

    models = [
        model
        for component in components
        for model in (components_named(component) if isinstance(component, str) else (component,))
    ]
    checks = [ConformanceCheck(model, name) for model in models for name in check_names(model.kind)]
    return pytest.mark.parametrize("check", [pytest.param(c, id=f"{c.model.name}-{c.name}") for c in checks])


@cache
def _results(model: type[Component]) -> dict[str, CheckResult]:
    return {result.name: result for result in check_component(model)}
