"""The JSON Schema of a component's options, with what its docstrings say of them."""

from __future__ import annotations

import re
from typing import Any

from pydantic import BaseModel

__all__ = ["option_schema"]


def option_schema(config: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON Schema of a Config, each option with a description where its author gave one.

    Parameters
    ----------
    config : pydantic model class
        Options are described by ``Field(description=...)`` or in the Attributes section of the docstring.

    Returns
    -------
    dict
        As pydantic gives it; ``x-unit`` is the SI unit of an option that may be written with a unit.

    Raises
    ------
    Exception
        Whatever pydantic raises for a type that JSON does not know.
    """
    schema = config.model_json_schema()
    for section in (schema, *schema.get("$defs", {}).values()):
        if "properties" in section:
            _describe(section)
    return schema


def _describe(section: dict[str, Any]) -> None:
    text = section.get("description", "")
    said = _attribute_section(text)
    for name, entry in section["properties"].items():
        if name in said:
            entry.setdefault("description", said[name])
    section["description"] = re.split(r"\n+\w[\w ]*\n-{3,}\n", text)[0]


def _attribute_section(docstring: str) -> dict[str, str]:
    """Return what the Attributes section of a numpydoc docstring says of each name."""
    _, found, section = docstring.partition("Attributes\n----------\n")
    texts: dict[str, str] = {}
    if not found:
        return texts
    names: list[str] = []
    for line in section.split("\n"):
        if re.fullmatch(r"-{3,}", line):  # the underline of the next section
            break
        if line and not line[0].isspace():
            names = [name.strip() for name in line.partition(":")[0].split(",")]
        elif line.strip():
            texts.update({name: f"{texts.get(name, '')} {line.strip()}".strip() for name in names})
    return texts
