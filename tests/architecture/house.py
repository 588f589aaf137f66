"""Metrics of the source code: circular imports, line counts, names. Run this file to print them."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.syntax_trees import nodes, parsed

ROOT = Path(__file__).parents[2]
PACKAGES = (
    ROOT / "framework" / "dovetail",
    ROOT / "plugins" / "dovetail_bench",
    ROOT / "plugins" / "dovetail_machining",
    ROOT / "plugins" / "dovetail_plugins",
)

EMPTY_NAMES = frozenset({"found", "one", "own", "given", "left", "places", "parts"})
"""Names that say nothing about their values."""
SHORT_LIFE = 5
"""Lines within which such a name may still be used."""

_FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
_SCOPES = _FUNCTIONS | ast.ClassDef


def source_files() -> list[Path]:
    """Return the files of framework and plugins."""
    return sorted(file for package in PACKAGES for file in package.rglob("*.py"))


def module_name(file: Path) -> str:
    """Return the name by which a file is imported."""
    package = next(package for package in PACKAGES if file.is_relative_to(package))
    return ".".join(file.relative_to(package.parent).with_suffix("").parts).removesuffix(".__init__")


def hidden_modules() -> Iterator[str]:
    """Yield the modules whose package has another thing of the same name, so that the module is hard to reach."""
    modules = {module_name(file): file for file in source_files()}
    for package in PACKAGES:
        for init in (*package.rglob("__init__.py"), *package.rglob("__init__.pyi")):
            name = module_name(init.with_suffix(".py"))
            for called, (source, original) in _handed_on(parsed(init)).items():
                is_module = source in ("", name) and called == original
                if f"{name}.{called}" in modules and not is_module:
                    yield f"{name}.{called}"


def imports() -> dict[str, set[str]]:
    """Return the modules that each module imports, deferred and type-checking imports included.

    A name taken from a package is followed to the module that defines it; of a package's own ``__init__`` that only
    hands names on, nothing else is counted.
    """
    trees = {module_name(file): parsed(file) for file in source_files()}
    handed_on = {module: _handed_on(tree) for module, tree in trees.items()}
    for stub in [stub for package in PACKAGES for stub in package.rglob("__init__.pyi")]:  # names that are loaded late
        package = module_name(stub.with_suffix(".py"))
        names = _handed_on(parsed(stub))
        handed_on[package] = {name: (f"{package}.{module}", called) for name, (module, called) in names.items()}
    modules = {module_name(file): nodes(file) for file in source_files()}
    return {module: set(_imported(inside, trees, handed_on)) - {module} for module, inside in modules.items()}


def _handed_on(tree: ast.Module) -> dict[str, tuple[str, str]]:
    """Return the names that a module imports at its top, with the module each comes from and its name there."""
    return {
        alias.asname or alias.name: (node.module or "", alias.name)
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def _imported(
    inside: list[ast.AST], trees: Mapping[str, ast.Module], handed_on: Mapping[str, Mapping[str, tuple[str, str]]]
) -> Iterator[str]:
    for node in inside:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in trees)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                module, name = node.module or "", alias.name
                while f"{module}.{name}" not in trees and name in handed_on.get(module, {}):
                    module, name = handed_on[module][name]
                home = f"{module}.{name}" if f"{module}.{name}" in trees else module
                if home in trees:
                    yield home


def circles() -> list[list[str]]:
    """Return the groups of modules that import each other, directly or indirectly."""
    graph = imports()
    reach = {module: _reached(module, graph) for module in graph}
    together = {module: frozenset(other for other in reach[module] if module in reach[other]) for module in graph}
    return sorted({tuple(sorted(group)) for group in together.values() if group}, key=len)  # type: ignore[arg-type]


def _reached(start: str, graph: Mapping[str, set[str]]) -> set[str]:
    reached: set[str] = set()
    waiting = list(graph[start])
    while waiting:
        module = waiting.pop()
        if module not in reached:
            reached.add(module)
            waiting.extend(graph[module])
    return reached


def code_lines(file: Path) -> int:
    """Count the lines of a file that are neither blank nor part of a docstring."""
    return len(_lines_of_code(file))


@cache
def _lines_of_code(file: Path) -> set[int]:
    source = file.read_text(encoding="utf-8")
    docstrings = {
        line
        for node in nodes(file)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    return {line for line, text in enumerate(source.splitlines(), 1) if text.strip() and line not in docstrings}


def function_lengths(file: Path) -> dict[str, int]:
    """Count the lines of code of each function of a file, docstrings left out; the keys are ``file:line name``."""
    coded = _lines_of_code(file)
    return {
        f"{file.relative_to(ROOT)}:{node.lineno} {node.name}": len(
            coded & set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        )
        for node in nodes(file)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }


def shares() -> dict[str, float]:
    """Return the share of all lines of code that each folder directly below a package holds."""
    lines: dict[str, int] = {}
    for file in source_files():
        package = ".".join(module_name(file).split(".")[:2])
        lines[package] = lines.get(package, 0) + code_lines(file)
    total = sum(lines.values())
    return {package: count / total for package, count in lines.items()}


def empty_names(file: Path) -> Iterator[str]:
    """Yield the uses of an empty name that live longer than `SHORT_LIFE` lines, as ``file:line name``."""
    for scope in (parsed(file), *(node for node in nodes(file) if isinstance(node, _SCOPES))):
        lines: dict[str, list[int]] = {}
        for name, line in _names(scope):
            if name in EMPTY_NAMES:
                lines.setdefault(name, []).append(line)
        for name, used in sorted(lines.items()):
            if max(used) - min(used) > SHORT_LIFE or not isinstance(scope, _FUNCTIONS):
                yield f"{file.relative_to(ROOT)}:{min(used)}-{max(used)} {name}"


def _names(scope: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield the names bound or used in a scope itself, and the lines where they stand."""
    waiting = list(ast.iter_child_nodes(scope))
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Name):
            yield node.id, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, node.lineno
        if not isinstance(node, _SCOPES):
            waiting.extend(ast.iter_child_nodes(node))


def names_defined_twice(file: Path) -> Iterator[str]:
    """Yield the names that a file defines or assigns more than once at its top."""
    seen: set[str] = set()
    for node in parsed(file).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            is_signature = any(getattr(decorator, "id", "") == "overload" for decorator in node.decorator_list)
            names = [] if is_signature else [node.name]
        else:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            names = [name.id for target in targets if target for name in ast.walk(target) if isinstance(name, ast.Name)]
        yield from (name for name in names if name in seen)
        seen.update(names)


if __name__ == "__main__":
    files = source_files()
    print(f"files {len(files)}, lines of code {sum(map(code_lines, files))}, circles {len(circles())}")
    for package, share in sorted(shares().items(), key=lambda row: -row[1])[:8]:
        print(f"{package}: {share:.0%}")
    for group in circles():
        print("circle:", *group)
    for file in files:
        if (length := len(file.read_text(encoding="utf-8").splitlines())) > 400:
            print(f"{file.relative_to(ROOT)}: {length} lines")
        for function, length in function_lengths(file).items():
            if length > 60:
                print(f"{function}: {length} lines of code")
        print(*empty_names(file), sep="\n", end="\n" if any(empty_names(file)) else "")
