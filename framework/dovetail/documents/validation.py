"""Validation of a section by a pydantic model; its errors become faults with positions, in plain words."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from dovetail.documents.extends import FORMATS
from dovetail.documents.fault_list import FaultList
from dovetail.documents.option_fields import keys_of, models_at
from dovetail.documents.tree import Item, Path, Scalar, format_path, format_value, plain_values, replace_value
from dovetail.errors import Fault, ParameterError, did_you_mean, listing

_Model = TypeVar("_Model", bound=BaseModel)
_Options = TypeVar("_Options", bound=BaseModel)

_WHOLE, _NUMBER, _LIST, _SECTION = "a whole number", "a number", "a list", "a section of keys and values"
_KINDS = {
    "int_type": _WHOLE, "int_parsing": _WHOLE, "int_from_float": _WHOLE, "int_parsing_size": _WHOLE,
    "float_type": _NUMBER, "float_parsing": _NUMBER, "finite_number": "a finite number",
    "bool_type": "true or false", "bool_parsing": "true or false",
    "string_type": "a text",
    "list_type": _LIST, "tuple_type": _LIST, "set_type": _LIST, "frozen_set_type": _LIST, "iterable_type": _LIST,
    "dict_type": _SECTION, "mapping_type": _SECTION, "model_type": _SECTION, "model_attributes_type": _SECTION,
    "none_required": "an empty value",
}  # fmt: skip
"""The type that pydantic expected, by the type of its error."""

_BOUNDS = {
    "greater_than": ("gt", "must be greater than {}"),
    "greater_than_equal": ("ge", "must be at least {}"),
    "less_than": ("lt", "must be less than {}"),
    "less_than_equal": ("le", "must be at most {}"),
    "multiple_of": ("multiple_of", "must be a multiple of {}"),
    "too_short": ("min_length", "must have {} or more elements"),
    "too_long": ("max_length", "must have {} elements or fewer"),
    "string_too_short": ("min_length", "must have {} or more characters"),
    "string_too_long": ("max_length", "must have {} characters or fewer"),
}


def validate(
    model: type[_Model],
    path: Path,
    faults: FaultList,
    owner: str,
    *,
    reserved: Collection[str] = (),
    data: Any = None,
    instead: Mapping[Path, Scalar] = MappingProxyType({}),
) -> _Model | None:
    """Validate the section at `path`.

    Parameters
    ----------
    model : pydantic model class
    path : Path
    faults : FaultList
        Collects the faults.
    owner : str
        The component to which the keys belong, for messages: ``"joint model 'collet' (dovetail-frf 0.1.0)"``.
    reserved : collection of str
        Keys of the section that are not options of the model.
    data : optional
        Default of a section that the document lacks.
    instead : mapping of Path to scalar
        Values to validate instead of those of the document, by their places in the section, which must exist.

    Returns
    -------
    model or None
        None if the section has faults.
    """
    item = faults.root.at(path)
    if item is not None:
        for place, value in instead.items():
            item = replace_value(item, place, value)
    section = plain_values(item) if item is not None else data
    if isinstance(section, Mapping):
        section = {key: value for key, value in section.items() if key not in reserved}
    try:
        return model.model_validate(section)
    except ValidationError as error:
        _Translation(model, path, faults, owner, reserved, item).report(error)
    except (Exception, SystemExit) as error:  # a plugin's validator may raise anything
        faults.add(path, f"{owner} cannot check this section: {type(error).__name__}: {error}", key=True)
    return None


def check_format(faults: FaultList, key: str, version: int, missing: str) -> None:
    """Report a fault unless the document has this format version under `key`; `missing` is the problem without one.

    Raises
    ------
    DescriptionError
        The document is of another kind, so that faults of its keys would not help.
    """
    item = faults.root.at((key,))
    others = [kind for other, kind in FORMATS.items() if faults.root.at((other,)) is not None]
    if item is None and others:
        problem = f"this describes {others[0]}, and {FORMATS[key]} is needed here."
        faults.add((), problem, f"a file that begins with '{key}: {version}'")
        raise faults.error()
    if item is None:
        faults.add((key,), missing, remedy=f"Begin it with '{key}: {version}'.")
    elif item.value != version or isinstance(item.value, bool):
        problem = f"{format_value(plain_values(item))} is not a format that this version of dovetail reads."
        faults.add((key,), problem, str(version))


@dataclass(frozen=True)
class _Translation:
    """Converts pydantic's errors in a section to faults; its fields are as in `validate`."""

    model: type[BaseModel]
    path: Path
    faults: FaultList
    owner: str
    reserved: Collection[str]
    item: Item | None

    def report(self, error: ValidationError) -> None:
        """Add one fault for each value, although pydantic reports each alternative of its type separately."""
        by_path: dict[Path, list[Any]] = {}
        for detail in error.errors(include_url=False):
            by_path.setdefault(self._data_path(detail), []).append(detail)
        misspelt: set[Path] = set()
        for path, details in by_path.items():
            if details[0]["type"] == "extra_forbidden":
                misspelt.add((*path[:-1], self._unknown(path)))
        for path, details in by_path.items():
            if details[0]["type"] == "missing" and path not in misspelt:
                self._missing(path, by_path)
            elif details[0]["type"] not in ("missing", "extra_forbidden") and not _is_implied(path, details, by_path):
                self._unfit(path, details)

    def _data_path(self, detail: Any) -> Path:
        """Return the error's path in the data, without the steps that name alternatives of a type."""
        path: Path = ()
        *steps, last = detail["loc"] or [None]
        for step in [*steps, last]:
            reached = self.item.at((*path, step)) if self.item is not None and step is not None else None
            if reached is not None:
                path = (*path, step)
        return (*path, last) if detail["type"] == "missing" else path

    def _missing(self, path: Path, refused: Collection[Path]) -> None:
        if isinstance(path[-1], int):
            lengths = [other[-1] for other in refused if other[:-1] == path[:-1] and isinstance(other[-1], int)]
            if path[-1] == min(lengths):
                problem = f"{self._title(path[:-1])} has {path[-1]} of {max(lengths) + 1} elements."
                self.faults.add((*self.path, *path[:-1]), problem)
            return
        keys = keys_of(models_at(self.model, path[:-1]))
        unit = keys.get(str(path[-1]), "")
        section = self._title(path[:-1])
        accepted = f"a quantity in {unit}" if unit else ""
        line = getattr(self.model, "lines_to_add", {}).get(path[-1], "") if len(path) == 1 else ""
        remedy = f"Add, for example: {line}" if line else ""
        self.faults.add((*self.path, *path), f"{section} lacks '{path[-1]}'.", accepted, remedy, key=True)

    def _unknown(self, path: Path) -> str:
        """Report an unknown key, and return the key that the author probably meant, or an empty text."""
        keys = keys_of(models_at(self.model, path[:-1]))
        names = [*self.reserved, *keys] if len(path) == 1 else list(keys)
        problem = f"{format_value(path[-1])} is not a key of {self._title(path[:-1])}."
        accepted = listing(f"{name} [{keys[name]}]" if keys.get(name) else name for name in names) or "no keys"
        hint = did_you_mean(str(path[-1]), names)
        self.faults.add((*self.path, *path), problem, accepted, hint, key=True)
        return next((name for name in names if f"'{name}'" in hint), "")

    def _unfit(self, path: Path, details: list[Any]) -> None:
        item = self.item.at(path) if self.item is not None else None
        value = format_value(plain_values(item)) if item is not None else "this"
        full = (*self.path, *path)
        kinds = list(dict.fromkeys(_KINDS[d["type"]] for d in details if d["type"] in _KINDS))
        specific = next((detail for detail in details if detail["type"] not in _KINDS), None)
        if specific is None:
            self.faults.add(full, f"{value} is not {' or '.join(kinds)}.")
            return
        if specific["type"] == "unit" and (item is None or type(item.value) not in (str, int, float)):
            self.faults.add(full, f"{value} is not a quantity{self._in_unit(path)}.")
            return
        problem, accepted, remedy = explain(specific, value, item)
        if kinds:
            accepted = " or ".join([*kinds, accepted] if accepted else kinds)
        self.faults.add(full, problem, accepted, remedy)

    def _in_unit(self, path: Path) -> str:
        keys = [step for step in path if isinstance(step, str)]
        unit = keys_of(models_at(self.model, tuple(keys[:-1]))).get(keys[-1], "") if keys else ""
        return f" in {unit}" if unit else ""

    def _title(self, path: Path) -> str:
        return f"'{format_path(path)}' of {self.owner}" if path else self.owner


def _is_implied(path: Path, details: list[Any], by_path: Collection[Path]) -> bool:
    """Return whether a list is too short only because its elements were refused."""
    beneath = any(other[: len(path)] == path and len(other) > len(path) for other in by_path)
    return beneath and details[0]["type"] in ("too_short", "too_long")


def validated(model: type[_Options], values: Mapping[str, Any], who: str) -> _Options:
    """Return options that a caller of the API gives, checked by their model.

    Raises
    ------
    ParameterError
        The model refuses them; `who` is the subject of the sentence.
    """
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        detail = error.errors()[0]
        where, value = ".".join(map(str, detail["loc"])) or "options", f"{detail['input']!r:.40}"
        problem, accepted, remedy = explain(detail, value)
        raise ParameterError(Fault(where, f"{who} refuses it: {problem}", accepted, remedy)) from None


def explain(detail: Any, value: str, item: Item | None = None) -> tuple[str, str, str]:
    """Return the problem with a value, the accepted values and a remedy, from what pydantic says of it."""
    kind, context = detail["type"], detail.get("ctx", {})
    if kind in _BOUNDS:
        key, words = _BOUNDS[kind]
        return f"{value} {words.format(_bound(context[key]))}.", "", ""
    if kind in ("literal_error", "enum"):
        choices = re.findall(r"'([^']*)'", str(context["expected"]))
        text = item.value if item is not None else detail.get("input")
        hint = did_you_mean(text, choices) if isinstance(text, str) else ""
        return f"{value} is not one of the choices.", listing(choices) or str(context["expected"]), hint
    if kind == "union_tag_invalid":
        return f"'{context['tag']}' is not a choice for {context['discriminator']}.", str(context["expected_tags"]), ""
    if kind == "string_pattern_mismatch":
        return f"{value} has characters that are not allowed here.", f"texts that match {context['pattern']}", ""
    message = str(context["error"]) if kind in ("value_error", "assertion_error") else str(detail["msg"])
    if kind not in ("value_error", "assertion_error", "unit"):
        message = f"{value} is not accepted: {message}"
    return message if message.endswith((".", "!", "?")) else f"{message}.", "", ""


def _bound(bound: Any) -> str:
    return f"{bound:g}" if isinstance(bound, float) else str(bound)
