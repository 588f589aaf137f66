"""`extends`: a document that overrides another one key by key."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from dovetail.documents.fault_list import FaultList
from dovetail.documents.mapping_reader import DICT, read_mapping
from dovetail.documents.tree import Entry, Item, Path, format_value, replace_item
from dovetail.documents.yaml_reader import read_yaml
from dovetail.errors import DescriptionError

Alternatives: TypeAlias = Sequence[Sequence[str]]
"""Keys of a section of which only those of one group may be stated."""

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
    merged = _settled(merged, ())  # also of a document that extends none
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
    displaced = _displaced_keys(base, over)
    entries = {key: entry for key, entry in base.entries.items() if key not in displaced}
    for key, entry in over.entries.items():
        old = entries.get(key)
        item = entry.item if old is None else _merge(old.item, entry.item, (*path, key))
        entries[key] = Entry(entry.key, item)
    if {*entries} <= _OF_PARAMETERS and any(entries[key].item.value is not None for key in _KNOWN if key in entries):
        entries = {key: entry for key, entry in entries.items() if entry.item.value is not None}
    return _settled(Item(over.mark, entries), path)


_KNOWN = {"value": (), "about": ("sd", "scale"), "same_as": ("ratio",), "range": ("scale",)}
"""What may be known of a parameter, each with the keys beside it; one displaces the others."""
_OF_PARAMETERS = {key for kind, beside in _KNOWN.items() for key in (kind, *beside)}
_ALTERNATIVES: Mapping[Path, Alternatives] = {
    (): (("response",), ("responses",)),
    ("frequency",): (("step",), ("lines",)),
    ("cases", "*", "joint"): (("assembly", "measured"), ("result",)),
}
"""Alternative keys by the path of their section; `*` is any key."""
_CHAIN = "calibration"
"""Key of what is known of a measurement chain, in a response or, for all of them, at the top."""


def _names_another_model(base: Item, over: Item) -> bool:
    old, new = base.entries.get("model"), over.entries.get("model")
    return old is not None and new is not None and old.item.value != new.item.value


def _displaced_keys(base: Item, over: Item) -> set[str]:
    """Return the keys of the base that contradict what `over` says to be known of a parameter."""
    if not {*base.entries, *over.entries} <= _OF_PARAMETERS:
        return set()
    kept = [kind for kind in _KNOWN if kind in base.entries and {*over.entries} <= {*_KNOWN[kind]}]
    stated = (kind for kind in _KNOWN if kind in over.entries and over.entries[kind].item.value is not None)
    kind = next(stated, (*kept, "range")[0])
    return {*base.entries} - {*over.entries, kind, *_KNOWN[kind]}


def settle_alternatives(section: Item, alternatives: Alternatives) -> Item:
    """Return a section without the keys of a base that contradict those of the document that extends it.

    Parameters
    ----------
    section : Item
        A mapping, merged from documents.
    alternatives : sequence of sequences of str
        Groups of keys, of which only one may be stated. An empty value says that a key is not stated.

    Returns
    -------
    Item
        With one group, or with all those that the same document states.
    """
    entries = section.entries
    empty = {key for group in alternatives for key in group if key in entries and entries[key].item.value is None}
    ranks = [
        min((entries[key].key.rank for key in group if key in entries and key not in empty), default=None)
        for group in alternatives
    ]
    latest = min((rank for rank in ranks if rank is not None), default=0)
    lost = {key for group, rank in zip(alternatives, ranks, strict=True) if rank != latest for key in group}
    kept = {key for group, rank in zip(alternatives, ranks, strict=True) if rank == latest for key in group}
    dropped = (empty | lost) - (kept - empty)
    return Item(section.mark, {key: entry for key, entry in entries.items() if key not in dropped})


def _settled(section: Item, path: Path) -> Item:
    """Return a section whose path has alternative keys without those that are displaced."""
    for pattern, alternatives in _ALTERNATIVES.items():
        if len(pattern) == len(path) and all(step in ("*", key) for step, key in zip(pattern, path, strict=True)):
            section = settle_alternatives(section, alternatives)
    return _settled_chains(section) if path == () else section


def _settled_chains(root: Item) -> Item:
    """Return a description in which a response's chain and that of all responses do not contradict each other."""
    several = root.at(("responses",))
    count = len(several.value) if several is not None and isinstance(several.value, tuple) else 0
    shared: Path = (_CHAIN,)
    for own in (("response", _CHAIN), *(("responses", index, _CHAIN) for index in range(count))):
        for path, other in ((own, shared), (shared, own)):
            section, against = root.at(path), root.at(other)
            if section is None or against is None:
                continue
            newer = {key for key, entry in against.entries.items() if entry.key.rank < _rank(section, key)}
            if newer:
                kept = {key: entry for key, entry in section.entries.items() if key not in newer}
                root = replace_item(root, path, Item(section.mark, kept))
    return root


def _rank(section: Item, key: str) -> int:
    """Return the number of the document that states a key; -1 if none does."""
    return section.entries[key].key.rank if key in section.entries else -1
