"""Checks of the declarations of any component's class."""

from __future__ import annotations

import difflib
import inspect
import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from dovetail.errors import UnitError
from dovetail.interfaces import Component, ComponentConfig, option_schema
from dovetail.testing.outcomes import Nonconformity
from dovetail.units import dimension, is_unit, to_si

_LONGEST_SUMMARY = 150
"""Characters: a list of models has one line for each."""
_CONTRACTS = "dovetail.interfaces."
_NEARLY = 0.85
"""Similarity (difflib) above which a name counts as a misspelling: one or two letters in ten."""


def check_name_summary_and_references_are_texts(model: type[Component]) -> None:
    """A model is listed with its name and one line of summary."""
    name, summary, references = (getattr(model, key, None) for key in ("name", "summary", "references"))
    if not isinstance(name, str) or not name.isidentifier():
        raise Nonconformity(f"the name is {name!r}.", "Give it letters, digits and '_', not beginning with a digit.")
    if not isinstance(summary, str) or not summary.strip() or "\n" in summary or len(summary) > _LONGEST_SUMMARY:
        raise Nonconformity(f"the summary is {summary!r:.80}.", "Give it one line of up to 150 characters.")
    if not isinstance(references, tuple) or not all(isinstance(entry, str) and entry for entry in references):
        raise Nonconformity(f"the references are {references!r:.80}.", "Make them a tuple of texts; () for none.")


def check_public_code_is_documented(model: type[Component]) -> None:
    """The class, its Config, and every public method and property has a docstring."""
    bare = [] if _own_docstring(model) else [model.__qualname__]
    if "Config" in vars(model) and not _own_docstring(model.Config):
        bare.append(model.Config.__qualname__)
    for name, member in vars(model).items():
        if name.startswith("_") or not _is_code(member):
            continue
        function = member.__func__ if isinstance(member, (classmethod, staticmethod)) else member
        if not inspect.cleandoc(function.__doc__ or ""):
            bare.append(f"{model.__qualname__}.{name}")
    if bare:
        raise Nonconformity(f"without a docstring: {', '.join(bare)}.", "Describe each in a line.")


def check_options_are_described_with_their_units(model: type[Component]) -> None:
    """Every option has a description for users, and a unit in this description is the one in which it is read."""
    schema = option_schema(model.Config)
    for section in (schema, *schema.get("$defs", {}).values()):
        for name, entry in section.get("properties", {}).items():
            text = entry.get("description", "")
            if not text:
                problem = f"the option '{name}' of {section.get('title', model.__qualname__)} is not described."
                raise Nonconformity(problem, "Describe it in the Attributes section of the Config's docstring.")
            _check_unit(name, text, set(_units(entry)))
            for unit in _units(entry):
                if is_unit(unit) and dimension(unit)[0] != 1.0:
                    problem = f"the option '{name}' is read in {unit}, which is not a unit of SI without a prefix."
                    raise Nonconformity(problem, 'Read it in SI, such as dovetail.InUnit("m"); "5 mm" may be written.')


def check_overrides_are_spelt_as_in_the_contract(model: type[Component]) -> None:
    """No method or attribute has nearly the name of one that may be overridden and is not."""
    contract = next(base for base in model.__mro__ if base.__module__.startswith(_CONTRACTS))
    defined = {name for base in model.__mro__[: model.__mro__.index(contract)] for name in vars(base)}
    missing = {_plain(name): name for name in dir(contract) if not name.startswith("_") and name not in defined}
    for name in sorted(defined - {*dir(contract)}):
        if name.startswith("__") or f"_{model.__name__}__" in name:
            continue
        for near in difflib.get_close_matches(_plain(name), missing, n=1, cutoff=_NEARLY):
            problem = f"'{name}' is nearly '{missing[near]}', which may be overridden; nothing calls it under its name."
            raise Nonconformity(
                problem, f"Rename it '{missing[near]}' if that is intended, or choose a different name."
            )


def check_options_have_a_schema(model: type[Component]) -> None:
    """Options can be converted to JSON Schema, for ``dovetail describe`` and ``dovetail schema``."""
    json.dumps(option_schema(model.Config), allow_nan=False)


def check_config_is_frozen_and_refuses_unknown_keys(model: type[Component]) -> None:
    """Options cannot change after validation, and a misspelt key is an error."""
    if not issubclass(model.Config, ComponentConfig):
        raise Nonconformity("its Config does not derive from dovetail.ComponentConfig.")
    for config in _sections(model.Config):
        wanted: Mapping[str, Any] = ComponentConfig.model_config
        for key, value in wanted.items():
            if config.model_config.get(key) != value:
                problem = f"{config.__qualname__} has {key} = {config.model_config.get(key)!r}, not {value!r}."
                raise Nonconformity(problem, "Inherit model_config from dovetail.ComponentConfig.")


def _plain(name: str) -> str:
    return name.replace("_", "").lower()


def _own_docstring(model: type) -> str:
    return inspect.cleandoc(vars(model).get("__doc__") or "")


def _is_code(member: object) -> bool:
    documented = inspect.isfunction(member) or isinstance(member, (property, classmethod, staticmethod))
    return documented or type(member).__name__ == "cached_property"


def _units(entry: Any) -> Iterator[str]:
    if isinstance(entry, dict):
        if "x-unit" in entry:
            yield entry["x-unit"]
        for value in entry.values():
            yield from _units(value)
    elif isinstance(entry, list):
        for value in entry:
            yield from _units(value)


def _check_unit(name: str, text: str, units: set[str]) -> None:
    """Compare a unit in brackets, such as "[m]", with the one in which the option is read."""
    for written in re.findall(r"\[([^\[\]]+)\]", text):
        if not is_unit(written):
            continue
        if not any(_same_dimension(written, unit) for unit in units):
            problem = (
                f"the option '{name}' is described in [{written}], but is read in {', '.join(units) or 'no unit'}."
            )
            raise Nonconformity(problem, f'Annotate it with dovetail.InUnit("{written}"), or correct the description.')


def _same_dimension(one: str, other: str) -> bool:
    try:
        to_si(f"1 {one}", other)
    except UnitError:
        return False
    return True


def _sections(config: type[ComponentConfig]) -> Iterator[type[ComponentConfig]]:
    """Yield a Config and all component options nested in it."""
    seen: set[type] = set()
    waiting: list[Any] = [config]
    while waiting:
        current = waiting.pop()
        if isinstance(current, type) and issubclass(current, ComponentConfig):
            if current not in seen:
                seen.add(current)
                yield current
                waiting += [field.annotation for field in current.model_fields.values()]
        else:
            waiting += [part for part in getattr(current, "__args__", ()) if part is not Ellipsis]
