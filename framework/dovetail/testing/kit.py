"""The conformance kit: every check of a kind, run over a component."""

from __future__ import annotations

import inspect
import tempfile
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from dovetail.errors import DovetailError, PluginError
from dovetail.interfaces import KINDS, Component, Kind, Progress, plugin_errors, progress_reporter
from dovetail.registry import Registry, installed_components
from dovetail.testing import (
    declared_checks,
    declared_part_checks,
    file_reader_checks,
    fitted_checks,
    fitted_shape_checks,
    fitted_state_checks,
    general_checks,
    history_checks,
    joint_checks,
    joint_derivative_checks,
    joint_law_checks,
    joint_range_checks,
    law_checks,
    matrix_reader_checks,
    method_checks,
    reader_checks,
    reducer_checks,
    refinement_checks,
    regressor_checks,
    substructure_checks,
    training_checks,
    unit_checks,
)
from dovetail.testing.outcomes import CheckResult, Nonconformity, NotApplicable, Reservation
from dovetail.testing.specimen import Specimen
from dovetail.testing.specimens import specimen_of

_Check = Callable[[Any], str | None]
"""A check raises an exception if something is wrong, and may return a text with what it measured."""

_MODULES: Mapping[Kind, tuple[ModuleType, ...]] = {
    "substructure": (
        substructure_checks,
        refinement_checks,
        declared_part_checks,
        history_checks,
        unit_checks,
        general_checks,
    ),
    "joint": (
        joint_checks,
        joint_derivative_checks,
        joint_law_checks,
        joint_range_checks,
        history_checks,
        unit_checks,
        general_checks,
    ),
    "reducer": (fitted_checks, fitted_state_checks, fitted_shape_checks, reducer_checks, general_checks),
    "regressor": (
        fitted_checks,
        fitted_state_checks,
        fitted_shape_checks,
        regressor_checks,
        training_checks,
        general_checks,
    ),
    "reader": (file_reader_checks, reader_checks, general_checks),
    "matrix_reader": (file_reader_checks, matrix_reader_checks, general_checks),
    "method": (method_checks, general_checks),
    "law": (law_checks, general_checks),
}

_MAKING = "examples_make_components"
_PREREQUISITES = frozenset(
    {
        _MAKING,
        "ports_parameters_and_dofs_are_declared",
        "matrices_have_the_shape_of_the_dofs",
        "matrices_are_finite",
        "every_port_and_dof_is_used",
        "dynamic_stiffness_has_its_shape",
        "nodes_are_distinct",
        "matrices_have_the_shape_of_the_nodes",
        "receptance_has_its_shape",
        "fit_returns_what_the_contract_says",
        "results_have_a_row_for_each_sample",
        "results_are_finite",
        "state_is_arrays_and_plain_values",
        "sample_files_have_a_suffix_of_it",
        "sample_files_are_read",
        "the_estimate_is_within_the_ranges",
        "the_posterior_has_samples_of_the_parameters",
        "unknowns_are_declared",
        "values_and_derivatives_have_their_shapes",
    }
)
"""Checks that must pass for the following ones to be meaningful."""


def check_component(
    component: type[Component] | str,
    *,
    registry: Registry | None = None,
    progress: Progress | bool | None = None,
) -> tuple[CheckResult, ...]:
    """Run every check of its kind over a component.

    Parameters
    ----------
    component : component class or str
        A class, or the name of a model; if models of several kinds have this name, all of them are checked.
    registry : Registry, optional
        In which the name is looked up; by default that of the installed components.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as a `Progress`.

    Returns
    -------
    tuple of CheckResult
        One for each check of the component's kind, in order, whatever their outcomes.

    Raises
    ------
    PluginError
        There is no such model, or this is not a component class.
    """
    models = components_named(component, registry) if isinstance(component, str) else (component,)
    results: list[CheckResult] = []
    with progress_reporter(progress) as report:
        for model in models:
            before = len(results)
            for result in each_check(model):
                results.append(result)
                report("checks", len(results), before + len(check_names(model.kind)))
    return tuple(results)


def check_names(kind: Kind) -> tuple[str, ...]:
    """Return the names of the checks of a kind, in the order in which they are run."""
    return (*_named(declared_checks), _MAKING, *(name for module in _MODULES[kind] for name in _named(module)))


def check_descriptions(kind: Kind) -> dict[str, str]:
    """Return the requirement of each check of a kind, in the order in which they are run."""
    modules = (declared_checks, *_MODULES[kind])
    checks = {name: check for module in modules for name, check in _named(module).items()}
    docstrings = {name: inspect.getdoc(check) or "" for name, check in checks.items()}
    docstrings[_MAKING] = inspect.getdoc(_specimens) or ""
    return {name: docstrings[name].split("\n")[0] for name in check_names(kind)}


def components_named(name: str, registry: Registry | None = None) -> tuple[type[Component], ...]:
    """Return the component classes of this name, of any kind.

    Raises
    ------
    PluginError
        There are none, or several of the same kind.
    """
    return tuple(offer.component for offer in (registry or installed_components()).named(name))


def _named(module: ModuleType) -> dict[str, _Check]:
    prefix = "check_"
    return {
        name.removeprefix(prefix): function
        for name, function in vars(module).items()
        if name.startswith(prefix) and getattr(function, "__module__", "") == module.__name__
    }


def each_check(model: type[Component], names: Collection[str] | None = None) -> Iterator[CheckResult]:
    """Run the checks of a component class one after another.

    Parameters
    ----------
    model : component class
    names : collection of str, optional
        Of the checks that are run, in addition to prerequisites; by default all.

    Raises
    ------
    PluginError
        This is not a component class.
    """
    if not isinstance(model, type) or not issubclass(model, Component) or getattr(model, "kind", None) not in KINDS:
        raise PluginError(f"{model!r} is not a component class.")
    label = f"{model.kind} '{getattr(model, 'name', model.__qualname__)}'"
    for name, check in _named(declared_checks).items():
        yield _outcome(label, name, check, [(model, model, "")])
    with tempfile.TemporaryDirectory(prefix="dovetail-examples-") as folder:
        specimens: list[Specimen] = []
        making = _outcome(
            label, _MAKING, lambda _: specimens.extend(_specimens(model, Path(folder))), [(model, model, "")]
        )
        yield making
        missing = "" if making.passed else making.name
        subjects = [(each, each.component, _example_label(each, specimens)) for each in specimens]
        for module in _MODULES[model.kind]:
            for name, check in _named(module).items():
                if names is not None and name not in _PREREQUISITES.union(names):
                    continue
                if missing:
                    reason = f"it requires '{missing.replace('_', ' ')}', which failed."
                    yield CheckResult(label, name, "not run", reason)
                    continue
                result = _outcome(label, name, check, subjects)
                yield result
                if result.outcome == "failed" and name in _PREREQUISITES:
                    missing = name


def _specimens(model: type[Component], folder: Path) -> list[Specimen]:
    """`examples` returns sets of options, by default one without options, and each constructs a component."""
    examples = model.examples(folder)
    remedy = "Override the class method `examples`: it returns sets of options as in a description."
    if isinstance(examples, (str, Mapping)) or not isinstance(examples, Sequence) or not examples:
        raise Nonconformity(f"examples returned {examples!r:.60}.", remedy)
    specimens = []
    for options in examples:
        try:
            specimens.append(specimen_of(model, options))
        except Exception as error:  # a plugin's constructor may raise anything
            text = " ".join(str(error).split())
            problem = f"it cannot be constructed with {dict(options)!r:.100}: {type(error).__name__}: {text:.200}"
            raise Nonconformity(problem, remedy) from error
    return [
        replace(specimen, companions=tuple(other for other in specimens if other is not specimen))
        for specimen in specimens
    ]


def _example_label(specimen: Specimen, specimens: list[Specimen]) -> str:
    """Return words that say which of several examples has a fault."""
    return f"with {dict(specimen.options)!r:.120}: " if len(specimens) > 1 else ""


def _outcome(label: str, name: str, check: _Check, subjects: Sequence[tuple[Any, Any, str]]) -> CheckResult:
    """Run one check over all subjects: (its argument, the component whose code it runs, words for the example)."""
    reasons: list[str] = []
    remarks: list[str] = []
    reservations: list[CheckResult] = []
    for subject, component, example in subjects:
        try:
            with plugin_errors(component, label), warnings.catch_warnings():
                warnings.simplefilter("error", np.exceptions.ComplexWarning)  # damping that would be dropped
                if measured := check(subject):
                    remarks.append(f"{example}{measured}")
        except NotApplicable as reason:
            reasons.append(str(reason))
        except Reservation as reservation:
            reservations.append(
                CheckResult(label, name, "warning", f"{example}{reservation.problem}", reservation.remedy)
            )
        except Nonconformity as fault:
            return CheckResult(label, name, "failed", f"{example}{fault.problem}", fault.remedy)
        except Exception as error:  # a plugin may raise or return anything
            return CheckResult(label, name, "failed", f"{example}{_failure_text(error)}", _REMEDY)
    if reservations:
        return reservations[0]
    if len(reasons) == len(subjects):
        return CheckResult(label, name, "not applicable", reasons[0])
    return CheckResult(label, name, "passed", "; ".join(remarks))


_REMEDY = "The check could not be completed."


def _failure_text(error: Exception) -> str:
    if not isinstance(error, DovetailError):
        return f"{type(error).__name__}: {error}"
    fault = error.faults[0]
    return f"{fault.where}: {fault.problem}".removeprefix(": ")
