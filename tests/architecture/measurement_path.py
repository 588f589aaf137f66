"""The way of a measurement through the code of an identification, counted in the source.

    python tests/architecture/measurement_path.py [ROOT]

ROOT is a checkout, by default this one. The walk starts at the posterior method and follows each call that passes
a measurement: an argument for a parameter whose annotation names one of `MEASUREMENTS`. It enters each function once,
in the order of the calls, and the methods of an object that was made from a measurement. It prints

- the functions that receive a measurement, the modules that they are in (stops), and how often the walk enters a module
  that it had left (returns);
- functions that take an assembly and a measurement as separate parameters;
- the calls that make observations and model FRFs from an assembly, or sort FRFs by response.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from house import parsed

MEASUREMENTS = frozenset({"Frf", "MeasuredLines", "Observations", "Problem"})
"""Classes that hold measured FRFs."""
ASSEMBLY = "Assembly"
STARTS = (
    ("dovetail.identification.application", "Application", "to"),
    ("dovetail.identification.methods", "", "by_posterior"),
)
"""Where the posterior method is applied: module, class and function, the first that there is."""
METHOD = {
    "identify": ("dovetail_plugins.methods.refined", "Refined"),
    "sample": ("dovetail_plugins.methods.posterior", "PosteriorMethod"),
}
"""The classes that define the functions of the posterior method, which `Application` calls by the contract."""
MAKERS = ("Observations.of", "ModelFrfs.of", "one_per_response")

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class Module:
    """A module's functions, classes and imports by the names they have in it."""

    name: str
    tree: ast.Module
    functions: dict[str, Function] = field(default_factory=dict)
    classes: dict[str, ast.ClassDef] = field(default_factory=dict)
    imported: dict[str, tuple[str, str]] = field(default_factory=dict)
    dispatch: dict[str, list[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Place:
    """A function, the module it is in, and the class whose method it is."""

    module: str
    owner: str
    name: str

    def __str__(self) -> str:
        return ".".join(part for part in (self.module, self.owner, self.name) if part)


class Code:
    """All modules of the framework and of the plugins in a checkout."""

    def __init__(self, root: Path) -> None:
        self.modules: dict[str, Module] = {}
        for folder in (root / "framework", root / "plugins"):
            for file in sorted([*folder.glob("dovetail*/**/*.py"), *folder.glob("dovetail/__init__.pyi")]):
                name = ".".join(file.relative_to(folder).with_suffix("").parts).removesuffix(".__init__")
                self.modules[name] = _module(name, parsed(file))

    def find(self, module: str, name: str) -> tuple[Module, ast.AST] | None:
        """Return the definition of a name in a module, wherever it was imported from."""
        seen: set[tuple[str, str]] = set()
        while (module, name) not in seen and module in self.modules:
            seen.add((module, name))
            there = self.modules[module]
            if definition := there.functions.get(name) or there.classes.get(name):
                return there, definition
            if name not in there.imported:
                return None
            module, name = there.imported[name]
        return None

    def function(self, place: Place) -> Function | None:
        """Return the definition of a function or method."""
        module = self.modules[place.module]
        if not place.owner:
            return module.functions.get(place.name)
        methods = (node for node in module.classes[place.owner].body if isinstance(node, Function))
        return next((method for method in methods if method.name == place.name), None)

    def functions(self) -> Iterator[tuple[Place, Function]]:
        """Yield all functions and methods."""
        for module in self.modules.values():
            yield from ((Place(module.name, "", name), node) for name, node in module.functions.items())
            for owner, definition in module.classes.items():
                for node in definition.body:
                    if isinstance(node, Function):
                        yield Place(module.name, owner, node.name), node


def _module(name: str, tree: ast.Module) -> Module:
    module = Module(name, tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                source = f"{name}.{node.module}" if node.level else node.module
                module.imported.setdefault(alias.asname or alias.name, (source, alias.name))
    for node in tree.body:
        if isinstance(node, Function):
            module.functions[node.name] = node
        elif isinstance(node, ast.ClassDef):
            module.classes[node.name] = node
        elif isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(node.value, ast.Dict):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            if isinstance(target, ast.Name):
                module.dispatch[target.id] = [value.id for value in node.value.values if isinstance(value, ast.Name)]
    return module


def parameters(function: Function) -> list[ast.arg]:
    """Return the parameters of a function, without the object itself."""
    arguments = function.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    return [argument for argument in named if argument.arg not in ("self", "cls")]


def names_of(annotation: ast.AST | None) -> set[str]:
    """Return the names in an annotation."""
    if annotation is None:
        return set()
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        annotation = ast.parse(annotation.value, mode="eval")
    return {node.id for node in ast.walk(annotation) if isinstance(node, ast.Name)}


def takes(function: Function, classes: frozenset[str]) -> bool:
    """Return whether a parameter is annotated with one of the classes."""
    return any(names_of(parameter.annotation) & classes for parameter in parameters(function))


class Walk:
    """The functions that a measurement reaches, in the order of the calls."""

    def __init__(self, code: Code, start: Place) -> None:
        self.code = code
        self.places: list[Place] = []
        self.modules: list[str] = []
        self.returns: list[tuple[str, str]] = []
        self._enter(start)

    def _enter(self, place: Place, came_from: str = "") -> None:
        function = self.code.function(place)
        if function is None or place in self.places:
            return
        if place.module != came_from and place.module in self.modules:
            self.returns.append((came_from, place.module))
        elif place.module not in self.modules:
            self.modules.append(place.module)
        self.places.append(place)
        for call in _calls_in_order(function):
            for called in self._called(call, place, function):
                self._enter(called, place.module)

    def _called(self, call: ast.Call, place: Place, function: Function) -> Iterator[Place]:
        """Yield the functions that a call hands a measurement to."""
        module = self.code.modules[place.module]
        callee = call.func
        if isinstance(callee, ast.Subscript) and isinstance(callee.value, ast.Name):
            names = module.dispatch.get(callee.value.id, [])
        else:
            names = [callee.id] if isinstance(callee, ast.Name) else []
        for name in names:
            if (known := self.code.find(place.module, name)) is not None:
                yield from self._receivers(known, call)
        if isinstance(callee, ast.Attribute) and ast.unparse(callee.value) == "dovetail":  # a public name, in a plugin
            if (public := self.code.find("dovetail", callee.attr)) is not None:
                yield from self._receivers(public, call)
        elif isinstance(callee, ast.Attribute) and ast.unparse(callee.value) == "self.method":
            if callee.attr in METHOD:
                yield Place(*METHOD[callee.attr], callee.attr)
        elif isinstance(callee, ast.Attribute):
            yield from self._methods(callee, call, place, function)

    def _receivers(self, known: tuple[Module, ast.AST], call: ast.Call) -> Iterator[Place]:
        home, definition = known
        if isinstance(definition, ast.ClassDef):
            if _holds_measurement(definition) and (call.args or call.keywords):
                yield Place(home.name, definition.name, "__init__")
                yield Place(home.name, definition.name, "__post_init__")
        elif isinstance(definition, Function) and takes(definition, MEASUREMENTS):
            yield Place(home.name, "", definition.name)

    def _methods(self, callee: ast.Attribute, call: ast.Call, place: Place, function: Function) -> Iterator[Place]:
        owner = self._owner(callee.value, place, function)
        if owner is None:
            return
        home, definition = owner
        method = self.code.function(Place(home.name, definition.name, callee.attr))
        if definition.name in MEASUREMENTS and not isinstance(callee.value, ast.Name):
            return
        is_own = isinstance(callee.value, ast.Name) and callee.value.id == "self"
        made_here = isinstance(callee.value, ast.Call) or is_own
        if method is not None and (takes(method, MEASUREMENTS) or (made_here and _holds_measurement(definition))):
            yield Place(home.name, definition.name, callee.attr)

    def _owner(self, value: ast.expr, place: Place, function: Function) -> tuple[Module, ast.ClassDef] | None:
        """Return the class of the object whose method is called, where annotations or constructors show it."""
        name = ""
        if isinstance(value, ast.Call):
            name = value.func.id if isinstance(value.func, ast.Name) else ""
        elif isinstance(value, ast.Name):
            name = place.owner if value.id in ("self", "cls") else self._class_of(value.id, function)
        known = self.code.find(place.module, name) if name else None
        if known is not None and isinstance(known[1], ast.ClassDef):
            return known[0], known[1]
        return None

    def _class_of(self, variable: str, function: Function) -> str:
        for parameter in parameters(function):
            if parameter.arg == variable and (names := names_of(parameter.annotation)):
                return sorted(names)[0]
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
                assigned = [target.id for target in node.targets if isinstance(target, ast.Name)]
                maker = node.value.func
                maker = maker.value if isinstance(maker, ast.Attribute) else maker
                if variable in assigned and isinstance(maker, ast.Name):
                    return maker.id
        return variable  # a class itself: Observations.of(...)


def _calls_in_order(function: Function) -> list[ast.Call]:
    """Return the calls of a function in the order of its text; arguments come before the call that takes them."""
    calls = [node for node in ast.walk(function) if isinstance(node, ast.Call)]
    return sorted(calls, key=lambda call: (call.end_lineno or 0, call.end_col_offset or 0))


def _holds_measurement(definition: ast.ClassDef) -> bool:
    """Return whether a class is made from a measurement: a field, or a parameter of its `__init__`."""
    for node in definition.body:
        if isinstance(node, ast.AnnAssign) and names_of(node.annotation) & MEASUREMENTS:
            return True
        if isinstance(node, Function) and node.name == "__init__" and takes(node, MEASUREMENTS):
            return True
    return False


def separate_parameters(code: Code) -> list[Place]:
    """Return the functions that take an assembly and a measurement as separate parameters."""
    return [
        place
        for place, function in code.functions()
        if takes(function, frozenset({ASSEMBLY})) and takes(function, MEASUREMENTS)
    ]


def makers(code: Code) -> dict[str, list[str]]:
    """Return the places of the calls that make observations or models, by maker."""
    found: dict[str, list[str]] = {maker: [] for maker in MAKERS}
    for module in code.modules.values():
        for node in ast.walk(module.tree):
            if isinstance(node, ast.Call) and (called := ast.unparse(node.func)) in found:
                found[called].append(f"{module.name}:{node.lineno}")
    return found


def posterior_walk(code: Code) -> Walk:
    """Walk from the posterior method."""
    return Walk(code, next(Place(*start) for start in STARTS if start[0] in code.modules))


def main() -> None:
    """Print the counts, and where each is."""
    code = Code(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2])
    walk = posterior_walk(code)
    print(f"from {walk.places[0]}: {len(walk.places)} functions, ", end="")
    print(f"{len(walk.modules)} stops, {len(walk.returns)} returns")
    print(*walk.modules, sep="\n")
    print(*(f"return: {start} -> {end}" for start, end in walk.returns), sep="\n")
    both = separate_parameters(code)
    print(f"{len(both)} functions take an assembly and a measurement", *both, sep="\n  ")
    for maker, places in makers(code).items():
        print(f"{maker}: {len(places)} calls", *places, sep="\n  ")


if __name__ == "__main__":
    main()
