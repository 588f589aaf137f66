"""`extends`: a document that overrides another one key by key."""

from __future__ import annotations

import os
from collections.abc import Mapping

from dovetail.documents.fault_list import FaultList
from dovetail.documents.mapping_reader import DICT, read_mapping
from dovetail.documents.tree import Entry, Item, Path, format_value
from dovetail.documents.yaml_reader import read_yaml
from dovetail.errors import DescriptionError

__all__ = ["read_source"]

LONGEST_CHAIN = 16
_EXTENDS = "extends"
_FORMATS = ("dovetail", "dovetail_cases")
"""Keys of which each document has one, or extends one that has."""


def read_source(source: str | os.PathLike[str] | Mapping[str, object], faults: FaultList) -> tuple[str, Item]:
    """Read a description and everything that it extends.

    Parameters
    ----------
    source : path or mapping
        The files that a mapping extends are taken relative to the working directory.
    faults : FaultList

    Returns
    -------
    name : str
        The file, or ``<dict>``.
    root : Item
        The merged mapping, without `extends`.

    Raises
    ------
    DescriptionError
        A file cannot be read at all, or extends itself.
    """
    if isinstance(source, Mapping):
        name, file, item = DICT, "", read_mapping(source, faults)
    else:
        name = file = os.fspath(source)
        item = read_yaml(file, 0, faults)
    chain = [item]
    seen = [os.path.realpath(file)] if file else []
    while (base := _base(chain[-1], file, faults)) is not None:
        if os.path.realpath(base) in seen or len(chain) == LONGEST_CHAIN:
            raise _endless(chain, base, os.path.realpath(base) in seen, faults)
        _check_exists(chain[-1], base, faults)
        file = base
        seen.append(os.path.realpath(file))
        of_base = FaultList()
        item = read_yaml(file, len(chain), of_base)
        if not {*_FORMATS, _EXTENDS} & item.entries.keys():
            raise _no_description(chain[-1], base, faults)
        faults.take(of_base)
        chain.append(item)
    merged = chain.pop()
    while chain:
        merged = _merge(merged, chain.pop(), ())
    return name, Item(merged.mark, {key: entry for key, entry in merged.entries.items() if key != _EXTENDS})


def _base(item: Item, file: str, faults: FaultList) -> str | None:
    """Return the path of the file that an item extends, or None."""
    entry = item.entries.get(_EXTENDS)
    if entry is None:
        return None
    base = entry.item.value
    if not isinstance(base, str) or not base:
        problem = f"{format_value(base or None)} is not a file."
        faults.add_at(entry.item.mark, (_EXTENDS,), problem, "the path of a file")
        raise faults.error()
    return os.path.normpath(os.path.join(os.path.dirname(file), base))


def _endless(chain: list[Item], base: str, cyclic: bool, faults: FaultList) -> DescriptionError:
    mark = chain[-1].entries[_EXTENDS].item.mark
    reason = "extends itself in the end." if cyclic else f"is the end of a chain of more than {LONGEST_CHAIN} files."
    faults.add_at(mark, (_EXTENDS,), f"'{base}' {reason}")
    return faults.error()


def _no_description(item: Item, base: str, faults: FaultList) -> DescriptionError:
    """Return an error that says nothing of what is in the file: it may be any file of the user's."""
    faults.add_at(item.entries[_EXTENDS].item.mark, (_EXTENDS,), f"'{base}' is no description.")
    return faults.error()


def _check_exists(item: Item, base: str, faults: FaultList) -> None:
    if not os.path.exists(base):
        problem = f"there is no file '{base}'."
        remedy = "The path is taken from the file that names it."
        faults.add_at(item.entries[_EXTENDS].item.mark, (_EXTENDS,), problem, remedy=remedy)
        raise faults.error()


def _merge(base: Item, over: Item, path: Path) -> Item:
    """Override `base` by `over`: sections key by key, any other value as a whole.

    A section that names another model describes another component, so nothing of the old one is kept.
    """
    if not (base.is_mapping and over.is_mapping) or _names_another_model(base, over):
        return over
    displaced = _displaced_keys(base, over, path)
    entries = {key: entry for key, entry in base.entries.items() if key not in displaced}
    for key, entry in over.entries.items():
        old = entries.get(key)
        item = entry.item if old is None else _merge(old.item, entry.item, (*path, key))
        entries[key] = Entry(entry.key, item)
    return Item(over.mark, entries)


_KNOWN = {"value": (), "about": ("sd", "scale"), "same_as": ("ratio",), "range": ("scale",)}
"""What may be known of a parameter, each with the keys beside it; one displaces the others."""


def _names_another_model(base: Item, over: Item) -> bool:
    old, new = base.entries.get("model"), over.entries.get("model")
    return old is not None and new is not None and old.item.value != new.item.value


def _displaced_keys(base: Item, over: Item, path: Path) -> set[str]:
    """Return the keys of the base that contradict a key of `over`."""
    if path == ():
        exclusive = [("response", "responses"), ("responses", "response")]
    elif path == ("frequency",):
        exclusive = [("step", "lines"), ("lines", "step")]
    elif {*base.entries, *over.entries} <= {key for kind, beside in _KNOWN.items() for key in (kind, *beside)}:
        kept = [kind for kind in _KNOWN if kind in base.entries and {*over.entries} <= {*_KNOWN[kind]}]
        kind = next((kind for kind in _KNOWN if kind in over.entries), (*kept, "range")[0])
        return {*base.entries} - {*over.entries, kind, *_KNOWN[kind]}
    else:
        return set()
    return {old for new, old in exclusive if new in over.entries and old not in over.entries}
