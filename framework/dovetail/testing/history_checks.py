"""Checks that results of joints and substructures depend only on the input, and have no side effects."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from dovetail.testing.another_process import report_of_another_process, written
from dovetail.testing.answers import answers, copied, declarations, difference, varied
from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.specimen import Specimen
from dovetail.testing.specimens import JointSpecimen, SubstructureSpecimen, specimen_of

_ROUNDING = 1e-9
"""Difference between two processes, relative to the largest entry, that the order of sums may cause."""


def check_earlier_results_are_kept(specimen: Specimen) -> None:
    """A returned array is not changed by later calls."""
    component = _new_instance(specimen).component
    first = answers(component)
    kept = copied(first)
    answers(component, question=1)
    answers(specimen.model(specimen.component.config), question=2)
    if changed := difference(first, kept):
        problem = f"{changed} that was returned changes with the next call."
        raise Nonconformity(problem, "Return new arrays from each call, not a shared buffer.")


def check_repeated_calls_agree(specimen: Specimen) -> None:
    """The same input gives the same output bit for bit, whatever was computed in between."""
    renewed = _new_instance(specimen)
    before = copied(answers(renewed.component))
    _compute_others(renewed)
    if changed := difference(copied(answers(renewed.component)), before):
        problem = f"{changed} is different after other calls."
        raise Nonconformity(problem, "Store nothing, and draw no random numbers.")


def check_declarations_do_not_change(specimen: Specimen) -> None:
    """The declarations of a component, and its options, are always the same, also after any computation."""
    renewed = _new_instance(specimen)
    before = declarations(renewed.component)
    repeated = declarations(renewed.component)
    _compute_others(renewed)
    after = declarations(renewed.component)
    for name, value in before.items():
        if not value == repeated[name] == after[name]:
            other = repeated[name] if repeated[name] != value else after[name]
            problem = f"{name} is {value:.60}, and later {other:.60}."
            raise Nonconformity(problem, "Compute it from the options only, and do not change these.")


def check_other_instances_change_nothing(specimen: Specimen) -> None:
    """Components with the same options give the same output, regardless of other components."""
    component = _new_instance(specimen).component
    before = copied(answers(component))
    if changed := difference(copied(answers(_new_instance(specimen).component)), before):
        raise Nonconformity(f"two components with the same options differ in {changed}.", _IN_THE_INSTANCE)
    for other in (varied(specimen.component), *(each.component for each in specimen.companions)):
        if other is not None:
            answers(type(other)(other.config))
    if changed := difference(copied(answers(component)), before):
        raise Nonconformity(f"{changed} changes when a component with other options is constructed.", _IN_THE_INSTANCE)


_IN_THE_INSTANCE = "Store values that depend on the options in the instance (self), not in the class or the module."


def check_a_fresh_process_gives_the_same_results(specimen: Specimen) -> None:
    """Another process, with another hash seed and folder, gives the same output, also after other options."""
    report = report_of_another_process(specimen)
    for component in _one_by_one(specimen):
        options = written(component.config)
        results, declared = report.answers[options], report.declarations[options]
        changed = [name for name, value in declarations(component).items() if declared[name] != value]
        changed.append(difference(results, copied(answers(component)), _ROUNDING))
        if changed[0]:
            problem = f"in a fresh process {changed[0]} differs."
            remedy = "Compute it from the options only, not from hashes, sets, files or earlier instances."
            raise Nonconformity(problem, remedy)


def check_global_state_is_left_unchanged(specimen: Specimen) -> None:
    """Global state is not changed: random numbers, settings of NumPy and torch, the working folder and its files."""
    for name in report_of_another_process(specimen).changed:
        remedy = (
            "Use objects with their own state, such as numpy.random.default_rng(seed) or 'with numpy.errstate(...)'."
        )
        raise Nonconformity(f"it changes {name} for all other code.", remedy)


def _new_instance(specimen: Specimen) -> Specimen:
    """Construct the component again, without any previous calls."""
    return specimen_of(specimen.model, specimen.options)


def _one_by_one(specimen: Specimen) -> Iterator[Any]:
    """Yield a newly constructed component, and then one with other options, constructed after use of the first."""
    yield _new_instance(specimen).component
    if (other := varied(specimen.component)) is not None:
        yield other


def _compute_others(specimen: Specimen) -> None:
    """Compute other results: a large batch, other lines."""
    if isinstance(specimen, JointSpecimen):
        specimen.component.matrices(specimen.theta.copy())
        specimen.component.dynamic_stiffness(specimen.lines.copy(), specimen.some(3).copy())
    elif isinstance(specimen, SubstructureSpecimen) and specimen.has_receptance:
        specimen.component.receptance(specimen.lines.copy(), specimen.dofs[:1])
    answers(specimen.component, question=3)
