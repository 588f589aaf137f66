"""Whether the tests of a series have what the roles of the parameters need, and measurements of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from dovetail.documents.fault_list import FaultList
from dovetail.errors import listing
from dovetail.interfaces import Parameter
from dovetail.series.description import Role, SeriesTest


def check_roles(tests: Sequence[SeriesTest], roles: Mapping[str, Role], other: Role, faults: FaultList) -> None:
    """Report parameters whose ranges differ between the tests that share them, and laws without covariates."""
    by_name: dict[str, list[tuple[SeriesTest, Parameter]]] = {}
    for test in tests:
        for parameter in test.assembly.parameters:
            by_name.setdefault(parameter.name, []).append((test, parameter))
    for name, uses in by_name.items():
        role = roles.get(name, other)
        if role.name == "free":
            continue
        _check_ranges(name, uses, faults)
        if role.law is not None:
            _check_covariates(name, role, [test for test, _ in uses], faults)
    _check_units(by_name, faults)


def check_files(tests: Sequence[SeriesTest], faults: FaultList) -> None:
    """Report measurements that stand for two tests: they would count as two."""
    first: dict[tuple[object, ...], str] = {}
    for test in tests:
        for path, options in test.measured:
            measured = path.resolve(), *(options.get(name) for name in ("index", "response", "force"))
            other = first.setdefault(measured, test.name)
            if other != test.name:
                problem = f"'{path.name}' is the measurement of '{other}' too."
                remedy = "Give each test its own: a measurement that is used twice makes the intervals too narrow."
                faults.add(("tests", test.name, "measured"), problem, remedy=remedy)


def _check_units(by_name: Mapping[str, Sequence[tuple[SeriesTest, Parameter]]], faults: FaultList) -> None:
    for name, places in by_name.items():
        units = {parameter.unit for _, parameter in places}
        if len(units) > 1:
            faults.add(("parameters", name), f"'{name}' has the units {listing(sorted(units))} in different tests.")


def _check_ranges(name: str, places: Sequence[tuple[SeriesTest, Parameter]], faults: FaultList) -> None:
    (first, known), *others = places
    for test, parameter in others:
        if (parameter.lower, parameter.upper, parameter.scale, parameter.prior) != (
            known.lower,
            known.upper,
            known.scale,
            known.prior,
        ):
            problem = f"its range in '{test.name}' is not that in '{first.name}', and the tests have it in common."
            accepted = f"{known.lower:g} to {known.upper:g} {known.unit}, {known.scale}, {known.prior}"
            remedy = "Give both assemblies the same range, scale and prior, or make the parameter 'free'."
            faults.add(("parameters", name), problem, accepted, remedy, key=True)
            return


def _check_covariates(name: str, role: Role, tests: Sequence[SeriesTest], faults: FaultList) -> None:
    missing = [test.name for test in tests if role.over not in test.covariates]
    if missing:
        problem = f"its law runs over '{role.over}', which {listing(missing)} does not give."
        remedy = f"Give it there: 'at: {{{role.over}: ...}}'."
        faults.add(("parameters", name), problem, remedy=remedy, key=True)
        return
    values = np.array([test.covariates[role.over] for test in tests])
    assert role.law is not None
    if len(np.unique(values)) < 2 and role.law.name != "constant":
        problem = f"all tests have the same '{role.over}', so that it shows no law."
        faults.add(("parameters", name), problem, "two or more values", "Use 'shared'.", key=True)
        return
    if objection := role.law.objection(values):
        faults.add(("parameters", name), f"'{role.law.name}' over '{role.over}': {objection}", key=True)
