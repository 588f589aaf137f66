"""The mutants that mutmut makes of a file, without those that cannot change behaviour."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import libcst as cst
from libcst import matchers
from libcst.helpers import get_full_name_for_node
from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.mutation.file_mutation import Mutation, create_mutations, group_by_top_level_node
from mutmut.mutation.trampoline_templates import mangle_function_name
from mutmut.utils.format_utils import get_mutant_name

WORDS = {"problem", "remedy", "where", "message"}
"""Variables that hold the text of an error."""


@dataclass(frozen=True)
class Mutant:
    """A change of one function, by the name that mutmut gives it."""

    name: str
    file: Path


def mutants_of(file: Path) -> Iterator[Mutant]:
    """Yield the mutants of a source file that are tested; mutmut finds its configuration in the current folder.

    The text of errors is left out (`raise` statements, `Fault`, and the variables in `WORDS`), because no test should
    hold a sentence word by word, and so is `strict=True` of `zip`, a guard that no input reaches. mutmut leaves out
    annotations, docstrings, decorators and whatever is outside of functions.
    """
    module, mutations, _, _ = create_mutations(str(file), file.read_text(encoding="utf-8"))
    left_out = {*_text_of_errors(module), *_values_of_strict(module)}
    grouped = group_by_top_level_node(mutations)
    for function, class_name in _functions(module):
        mangled = mangle_function_name(name=function.name.value, class_name=class_name) + "__mutmut"
        for number, mutation in enumerate(grouped.get(function, ()), start=1):
            if id(mutation.original_node) not in left_out and not _changes_only_strict(module, mutation):
                yield Mutant(get_mutant_name(file, f"{mangled}_{number}"), file)


def _functions(module: cst.Module) -> Iterator[tuple[cst.FunctionDef, str | None]]:
    for statement in module.body:
        if isinstance(statement, cst.FunctionDef):
            yield statement, None
        if isinstance(statement, cst.ClassDef):
            for method in statement.body.body:
                if isinstance(method, cst.FunctionDef):
                    yield method, statement.name.value


def _text_of_errors(node: cst.CSTNode, inside: bool = False) -> Iterator[int]:
    """Yield the identity of each node within the text of an error."""
    if isinstance(node, cst.Assign | cst.AugAssign):
        targets = [node.target] if isinstance(node, cst.AugAssign) else [target.target for target in node.targets]
        inside = inside or any(isinstance(target, cst.Name) and target.value in WORDS for target in targets)
    inside = inside or isinstance(node, cst.Raise)
    inside = inside or (isinstance(node, cst.Call) and get_full_name_for_node(node) == "Fault")
    if inside:
        yield id(node)
    for child in node.children:
        yield from _text_of_errors(child, inside)


def _values_of_strict(module: cst.Module) -> Iterator[int]:
    for argument in matchers.findall(module, matchers.Arg(keyword=matchers.Name("strict"))):
        yield id(cst.ensure_type(argument, cst.Arg).value)


def _changes_only_strict(module: cst.Module, mutation: Mutation) -> bool:
    """Tell whether a call of zip differs in its argument `strict` alone."""
    before, after = mutation.original_node, mutation.mutated_node
    if not isinstance(before, cst.Call) or get_full_name_for_node(before) != "zip" or not isinstance(after, cst.Call):
        return False
    return _arguments_but_strict(module, before) == _arguments_but_strict(module, after)


def _arguments_but_strict(module: cst.Module, call: cst.Call) -> list[str]:
    kept = (argument for argument in call.args if argument.keyword is None or argument.keyword.value != "strict")
    return [module.code_for_node(argument.value) for argument in kept]


def changed_lines(mutant: Mutant) -> list[str]:
    """Return the lines that a mutant takes away and adds."""
    lines = get_diff_for_mutant(mutant.name, path=mutant.file).splitlines()
    return [" ".join(line.split()) for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---")]


class _PlainProperties(cst.CSTTransformer):
    """Writes `@property def f` as `def f` and `f = property(f)`; mutmut passes over decorated functions."""

    def leave_FunctionDef(
        self, original_node: cst.FunctionDef, updated_node: cst.FunctionDef
    ) -> cst.FunctionDef | cst.FlattenSentinel[cst.BaseStatement]:
        names = [get_full_name_for_node(decorator.decorator) for decorator in updated_node.decorators]
        if names not in (["property"], ["cached_property"]):
            return updated_node
        name = updated_node.name.value
        assignment = cst.parse_statement(f"{name} = {names[0]}({name})")
        return cst.FlattenSentinel([updated_node.with_changes(decorators=[]), assignment])


def with_plain_properties(source: str) -> str:
    """Return the source with the same properties, which mutmut mutates as well."""
    return cst.parse_module(source).visit(_PlainProperties()).code
