"""The JSON Schema of a component's options, with descriptions from its docstring."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel


def option_schema(config: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON Schema of a Config, with the descriptions of its options, if it has any.

    Parameters
    ----------
    config : pydantic model class
        Its options are described by ``Field(description=...)`` or in the Attributes section of its docstring;
        those that it inherits also in that of their class.

    Returns
    -------
    dict
        The schema from pydantic; ``x-unit`` is the SI unit of an option that may be written with a unit.

    Raises
    ------
    Exception
        The exception from pydantic for a type that JSON does not know.
    """
    schema = config.model_json_schema()
    inherited: dict[str, str] = {}
    for base in reversed(config.__mro__):
        inherited |= _attribute_section(inspect.cleandoc(base.__doc__ or ""))
    for section in (schema, *schema.get("$defs", {}).values()):
        if "properties" in section:
            _describe(section, inherited if section is schema else {})
    return schema


def _describe(section: dict[str, Any], inherited: Mapping[str, str]) -> None:
    text = section.get("description", "")
    descriptions = {**inherited, **_attribute_section(text)}
    for name, entry in section["properties"].items():
        if name in descriptions:
            entry.setdefault("description", descriptions[name])
    section["description"] = re.split(r"\n+\w[\w ]*\n-{3,}\n", text)[0]


def _attribute_section(docstring: str) -> dict[str, str]:
    """Return the text of each name in the Attributes section of a numpydoc docstring."""
    section = docstring.partition("Attributes\n----------\n")[2]
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in section.split("\n"):
        if re.fullmatch(r"-{3,}", line):  # the underline of the next section
            break
        if line and not line[0].isspace():
            names = [name.strip() for name in line.partition(":")[0].split(",")]
        elif line.strip():
            texts.update({name: f"{texts.get(name, '')} {line.strip()}".strip() for name in names})
    return texts
