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
"""Groups of keys of a section, of which only one group may be used."""

LONGEST_CHAIN = 16
"""Files that extend one another."""
_EXTENDS = "extends"
FORMATS = {"dovetail": "an assembly", "dovetail_series": "a series of tests"}
"""Keys of which each document has one, or extends one that has, and what it describes."""


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
            raise _cyclic_or_long(chain, base, os.path.realpath(base) in seen, faults)
        _check_exists(chain[-1], base, faults)
        file = base
        seen.append(os.path.realpath(file))
        base_faults = FaultList()
        item = read_yaml(file, len(chain), base_faults)
        if not {*FORMATS, _EXTENDS} & item.entries.keys():
            raise _not_a_description(chain[-1], base, faults)
        faults.extend(base_faults)
        chain.append(item)
    merged = chain.pop()
    while chain:
        merged = _merge(merged, chain.pop(), ())
    merged = _resolve(merged, ())  # also if nothing is extended
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


def _cyclic_or_long(chain: list[Item], base: str, cyclic: bool, faults: FaultList) -> DescriptionError:
    mark = chain[-1].entries[_EXTENDS].item.mark
    reason = "extends itself in a circle." if cyclic else f"is in a chain of more than {LONGEST_CHAIN} files."
    faults.add_at(mark, (_EXTENDS,), f"'{base}' {reason}")
    return faults.error()


def _not_a_description(item: Item, base: str, faults: FaultList) -> DescriptionError:
    """Return an error that does not show the content of the file, which may be any file of the user."""
    faults.add_at(item.entries[_EXTENDS].item.mark, (_EXTENDS,), f"'{base}' is not a description.")
    return faults.error()


def _check_exists(item: Item, base: str, faults: FaultList) -> None:
    if not os.path.exists(base):
        problem = f"there is no file '{base}'."
        remedy = "The path is relative to the file that names it."
        faults.add_at(item.entries[_EXTENDS].item.mark, (_EXTENDS,), problem, remedy=remedy)
        raise faults.error()


def _merge(base: Item, over: Item, path: Path) -> Item:
    """Override `base` by `over`: sections key by key, any other value as a whole.

    A section with another model describes another component, so it replaces the old one.
    """
    if not (base.is_mapping and over.is_mapping) or _names_another_model(base, over):
        return over
    replaced = _replaced_keys(base, over)
    entries = {key: entry for key, entry in base.entries.items() if key not in replaced}
    for key, entry in over.entries.items():
        old = entries.get(key)
        item = entry.item if old is None else _merge(old.item, entry.item, (*path, key))
        entries[key] = Entry(entry.key, item)
    if {*entries} <= _PARAMETER_KEYS and any(
        entries[key].item.value is not None for key in _VALUE_KEYS if key in entries
    ):
        entries = {key: entry for key, entry in entries.items() if entry.item.value is not None}
    return _resolve(Item(over.mark, entries), path)


_VALUE_KEYS = {"value": (), "about": ("sd", "scale"), "same_as": ("ratio",), "range": ("scale",)}
"""Ways to specify a parameter, each with its additional keys; one replaces the others."""
_PARAMETER_KEYS = {key for kind, additional in _VALUE_KEYS.items() for key in (kind, *additional)}
_ALTERNATIVES: Mapping[Path, Alternatives] = {
    (): (("response",), ("responses",)),
    ("frequency",): (("step",), ("lines",)),
    ("tests", "*", "joint"): (("assembly", "measured"), ("result",)),
}
"""Alternative keys by the path of their section; `*` is any key."""
_CHAIN = "calibration"
"""Key of the section of a measurement chain: in a response or, for all responses, at the top level."""


def _names_another_model(base: Item, over: Item) -> bool:
    old, new = base.entries.get("model"), over.entries.get("model")
    return old is not None and new is not None and old.item.value != new.item.value


def _replaced_keys(base: Item, over: Item) -> set[str]:
    """Return the keys of the base that contradict the specification of a parameter in `over`."""
    if not {*base.entries, *over.entries} <= _PARAMETER_KEYS:
        return set()
    kept = [kind for kind in _VALUE_KEYS if kind in base.entries and {*over.entries} <= {*_VALUE_KEYS[kind]}]
    given = (kind for kind in _VALUE_KEYS if kind in over.entries and over.entries[kind].item.value is not None)
    kind = next(given, (*kept, "range")[0])
    return {*base.entries} - {*over.entries, kind, *_VALUE_KEYS[kind]}


def resolve_alternatives(section: Item, alternatives: Alternatives) -> Item:
    """Return a section without the keys of a base that contradict those of the document that extends it.

    Parameters
    ----------
    section : Item
        A mapping, merged from documents.
    alternatives : sequence of sequences of str
        Groups of keys, of which only one may be used. A key with an empty value does not count.

    Returns
    -------
    Item
        With one group, or with all groups in the same document.
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


def _resolve(section: Item, path: Path) -> Item:
    """Return a section whose path has alternative keys without those that are replaced."""
    for pattern, alternatives in _ALTERNATIVES.items():
        if len(pattern) == len(path) and all(step in ("*", key) for step, key in zip(pattern, path, strict=True)):
            section = resolve_alternatives(section, alternatives)
    return _resolve_chains(section) if path == () else section


def _resolve_chains(root: Item) -> Item:
    """Return a description without contradictions between the chain of a response and that of all responses."""
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
    """Return the rank of the document with a key; -1 if none has it."""
    return section.entries[key].key.rank if key in section.entries else -1
