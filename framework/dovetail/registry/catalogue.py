"""The registry of components from entry points and plugin files; a broken plugin affects no other."""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, TypeAlias, cast

from dovetail.errors import DovetailError, Fault, PluginError, contained, did_you_mean, listing
from dovetail.interfaces import KINDS, Component, FileReader, Kind, plugin_errors
from dovetail.registry.component_checks import reason_against
from dovetail.registry.loading import (
    COMPONENTS,
    DEFAULTS,
    HOW_TO_OFFER,
    LoadFailure,
    fault_of_path,
    hooks_of,
    installed_plugins,
    load_entry,
    load_module,
    returned_list,
)

PluginPaths: TypeAlias = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]
"""One plugin file, or several."""

_SLOW = 2.0
"""Seconds; an import that takes longer is listed."""
HEAD = 4096
"""Number of bytes from which a reader recognises its format."""


@dataclass(frozen=True)
class Offer:
    """A component class and its source: a distribution with its version, or a file."""

    component: type[Component]
    source: str

    @property
    def qualified_name(self) -> str:
        """The name prefixed with its package or file, such as ``"dovetail-frf:collet"``."""
        package = Path(self.source).stem if self.source.endswith(".py") else self.source.partition(" ")[0]
        return f"{package}:{self.component.name}"


def create_with_defaults(offer: Offer) -> Component:
    """Create a component with the defaults of its options.

    Raises
    ------
    PluginError
        An option has no default, or its constructor fails.
    """
    label = f"{offer.component.kind} '{offer.component.name}' ({offer.source})"
    fields = offer.component.Config.model_fields.items()
    if missing := [field.alias or name for name, field in fields if field.is_required()]:
        needed = listing(missing)
        remedy = f"Give it in a description: identification: {{method: {{model: {offer.component.name}, ...}}}}."
        remedy = remedy if offer.component.kind == "method" else "Its author must give it a default."
        raise PluginError(Fault(label, f"it needs the option {needed}.", remedy=remedy))
    with contained(label, "it cannot be created: "):
        return offer.component()


class Registry:
    """The available components, by kind and name.

    Notes
    -----
    A plugin that fails to load is listed in `failures` and affects no other. If two plugins offer
    the same name for one kind, each is used as ``package:name``. `slow` maps plugins to the seconds of their import, if
    these delay every command. A default comes from the first plugin that gives it.
    """

    def __init__(self) -> None:
        self._offers: dict[tuple[Kind, str], list[Offer]] = {}
        self._failures: list[LoadFailure] = []
        self._files: set[Path] = set()
        self._defaults: dict[str, Any] = {}
        self._givers: dict[tuple[str, str], str] = {}
        self.slow: dict[str, float] = {}

    @property
    def defaults(self) -> Mapping[str, Any]:
        """Defaults for sections that a user omits, as plain values, by key.

        A name that several plugins offer is qualified with the package of the plugin that gives the default.
        """
        return MappingProxyType({key: self._qualified(key, value) for key, value in self._defaults.items()})

    def _qualified(self, key: str, value: Any) -> Any:
        """Return a default in which models with ambiguous names are prefixed with their package."""
        if not isinstance(value, Mapping):
            parts = [str(name).partition("+") for name in value]
            return [self._full_name("reducer", name, (key, "")) + sign + addition for name, sign, addition in parts]
        sections = dict(value)
        for option, section in value.items():
            if option in KINDS and isinstance(section, Mapping) and "model" in section:
                sections[option] = {**section, "model": self._full_name(option, section["model"], (key, option))}
        return sections

    def _full_name(self, kind: Kind, name: str, default: tuple[str, str]) -> str:
        """Return the name of a model in a default, prefixed with its package if others offer the same name."""
        offers = self._offers.get((kind, name), [])
        own = [offer.qualified_name for offer in offers if offer.source == self._givers[default]]
        return own[0] if own and len(offers) > 1 else name

    @property
    def failures(self) -> tuple[LoadFailure, ...]:
        """The plugins and components that could not be loaded, with reasons."""
        return tuple(self._failures)

    @property
    def conflicts(self) -> dict[tuple[Kind, str], tuple[str, ...]]:
        """Names that are offered more than once, with their sources."""
        return {key: tuple(o.source for o in offers) for key, offers in self._offers.items() if len(offers) > 1}

    def offers(self, kind: Kind) -> tuple[Offer, ...]:
        """Return the usable offers of one kind, ordered by name."""
        usable = [offers[0] for key, offers in self._offers.items() if key[0] == kind and len(offers) == 1]
        return tuple(sorted(usable, key=lambda offer: offer.component.name))

    def readers(self, kind: Kind = "reader") -> dict[str, list[Offer]]:
        """Return the offers of file readers by the suffix of their files, including readers with the same name.

        Parameters
        ----------
        kind : str
            "reader" of FRFs, or "matrix_reader".
        """
        by_suffix: dict[str, list[Offer]] = {}
        for (offered, _), offers in self._offers.items():
            for offer in offers if offered == kind else ():
                for suffix in cast("type[FileReader]", offer.component).suffixes:
                    by_suffix.setdefault(suffix, []).append(offer)
        return by_suffix

    def names(self, kind: Kind) -> tuple[str, ...]:
        """Return the usable names of one kind."""
        return tuple(offer.component.name for offer in self.offers(kind))

    def find(self, kind: Kind, name: str) -> Offer:
        """Return the offer of this kind and name.

        Raises
        ------
        PluginError
            No plugin offers it, or more than one.
        """
        offers = self._matching(kind, name)
        if len(offers) == 1:
            return offers[0]
        if offers:
            problem = f"the {kind} model '{name}' is offered by {' and '.join(offer.source for offer in offers)}."
            remedy = f"Say which: {listing([offer.qualified_name for offer in offers])}."
            raise PluginError(Fault("", problem, remedy=remedy))
        raise PluginError(self.unknown(kind, name))

    def _matching(self, kind: Kind, name: str) -> list[Offer]:
        """Return the offers with a name, which may be prefixed with a package."""
        offers = self._offers.get((kind, name.rpartition(":")[2]), [])
        return [offer for offer in offers if name in (offer.component.name, offer.qualified_name)]

    def create(self, kind: Kind, name: str) -> Component:
        """Return the component of this kind and name with its defaults.

        Raises
        ------
        PluginError
            As in `find`; or an option has no default, or its constructor fails.
        """
        return create_with_defaults(self.find(kind, name))

    def source_of(self, component: type[Component]) -> str:
        """Return the source of a component class; an empty text if it is not registered."""
        offers = self._offers.get((component.kind, component.name), [])
        return next((offer.source for offer in offers if offer.component is component), "")

    def unknown(self, kind: Kind, name: str) -> Fault:
        """Return the fault of an unknown model name."""
        return self._fault_of_name(name, f"'{name}' is not a {kind} model.", self.names(kind), 30)

    def _fault_of_name(self, name: str, problem: str, known: Collection[str], listed: int) -> Fault:
        if fault := fault_of_path(name):
            return fault
        remedy = did_you_mean(name, known)
        for failure in self._failures:
            remedy += f"{' ' if remedy else ''}(Not loaded: {failure.source}: {failure.reason})"
        return Fault("", problem, listing(known, listed), f"{remedy} {HOW_TO_OFFER}".lstrip())

    def named(self, name: str) -> tuple[Offer, ...]:
        """Return the offers with this name, of all kinds.

        Raises
        ------
        PluginError
            There is none, or it is offered more than once for a kind.
        """
        if offers := tuple(self.find(kind, name) for kind in self.kinds_of(name)):
            return offers
        known = sorted({known for kind in KINDS for known in self.names(kind)})
        raise PluginError(self._fault_of_name(name, f"there is no model '{name}'.", known, 100))

    def kinds_of(self, name: str) -> tuple[Kind, ...]:
        """Return the kinds that have a model of this name."""
        return tuple(kind for kind in KINDS if self._matching(kind, name))

    def load_entry_points(self) -> None:
        """Load every installed plugin; a broken one is added to `failures`."""
        for owner, entry in installed_plugins():
            try:
                with self._timed(owner):
                    plugin = load_entry(owner, entry)
                self.add(plugin, owner)
            except PluginError as error:
                self._failures.append(LoadFailure(owner, error.faults[0].problem))

    def load_file(self, path: str | Path) -> None:
        """Load one plugin file.

        Raises
        ------
        PluginError
            The file is missing, fails to run, or offers no components.
        """
        file = Path(path).resolve()
        if file in self._files:
            return
        with self._timed(str(path)):
            module = load_module(path)
        self.add(module, str(path), strict=True)
        self._files.add(file)

    @contextmanager
    def _timed(self, source: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        if (seconds := time.perf_counter() - start) > _SLOW:
            self.slow[source] = seconds

    def add(self, plugin: ModuleType | object, source: str, *, strict: bool = False) -> None:
        """Add the components of a plugin module or object.

        Parameters
        ----------
        plugin : module or object
            Has the hook.
        source : str
            Its name in messages.
        strict : bool
            Raise an error for a single unfit component, instead of adding it to `failures`.

        Raises
        ------
        PluginError
            The hook is missing, misspelt, fails, or does not return component classes.
        """
        offered, defaults = _contributions_of(plugin, source)
        for key, value in defaults.items():
            known = self._defaults.setdefault(key, value)
            for option in ("", *(value if isinstance(value, Mapping) else ())):
                self._givers.setdefault((key, option), source)
            if isinstance(value, Mapping) and isinstance(known, Mapping):
                self._defaults[key] = {**value, **known}
        for component in offered:
            reason = reason_against(component)
            offers = [] if reason else self._offers.setdefault((component.kind, component.name), [])
            if any(offer.source == source and offer.component is not component for offer in offers):
                reason = f"it offers two {component.kind} models of the name '{component.name}'."
            if reason and strict:
                raise PluginError(Fault(source, reason))
            if reason:
                self._failures.append(LoadFailure(source, reason))
                continue
            if all(offer.component is not component for offer in offers):
                offers.append(Offer(component, source))


def _contributions_of(plugin: ModuleType | object, source: str) -> tuple[list[type[Component]], Mapping[str, Any]]:
    """Return the components and the defaults from a plugin's hooks."""
    hooks = hooks_of(plugin, source)
    offered: list[type[Component]] = returned_list(hooks, COMPONENTS, source, "classes")
    with contained(source, f"its hook '{DEFAULTS}' raised "):
        defaults: object = next(iter(hooks.dovetail_defaults()), {})
    if not isinstance(defaults, Mapping):
        raise PluginError(Fault(source, f"its hook '{DEFAULTS}' returned {defaults!r:.60}.", "a dict"))
    kinds: dict[str, Any] = {"identification": Mapping, "robustness": (list, tuple), "compare": (list, tuple)}
    for key, value in defaults.items():
        if key not in kinds or not isinstance(value, kinds[key]):
            problem = f"its hook '{DEFAULTS}' gave {value!r:.40} for {key!r:.40}."
            raise PluginError(Fault(source, problem, "identification, a dict; robustness and compare, lists of names"))
    return offered, defaults


@cache
def installed_components() -> Registry:
    """Return the registry of all installed components, which is created once."""
    registry = Registry()
    registry.load_entry_points()
    return registry


def components(plugins: PluginPaths = ()) -> Registry:
    """Return the installed components and those of plugin files."""
    files = [Path(file) for file in ([plugins] if isinstance(plugins, (str, os.PathLike)) else plugins)]
    if not files:
        return installed_components()
    registry = Registry()
    for file in files:
        registry.load_file(file)
    registry.load_entry_points()
    return registry


def find_reader(
    path: Path, content: bytes, offers: Mapping[str, Sequence[Offer]], error: type[DovetailError]
) -> FileReader:
    """Return the reader that recognises a file, or else the default reader of its suffix.

    Parameters
    ----------
    path, content : Path and bytes
    offers : mapping of str to sequence of Offer
        Readers by the suffix of their files; there are some for this one.
    error : type
        Of what is raised.

    Raises
    ------
    DovetailError
        Of the class `error`: none or several of them recognise it.
    PluginError
        The code of a reader fails.
    """
    suffix = path.suffix.lower()
    candidates = offers[suffix]
    defaults = [offer for offer in candidates if suffix in _reader_class(offer).default_for]
    takers = [offer for offer in candidates if offer not in defaults and _accepts(offer, content)] or defaults
    if len(takers) > 1:
        names = listing([offer.qualified_name for offer in takers])
        raise error(Fault(str(path), "several readers take this file.", names, "Say which by `reader=`."))
    if not takers:
        names = listing(offer.qualified_name for offer in candidates)
        problem = f"no reader of {suffix} files recognises the format of this one."
        raise error(Fault(str(path), problem, f"a file of one of the readers {names}"))
    return make_reader(takers[0])


def make_reader(offer: Offer) -> FileReader:
    """Return a reader, or raise a PluginError if its constructor fails."""
    with plugin_errors(offer.component, f"reader '{offer.component.name}'"):
        return _reader_class(offer)()


def label_of(reader: FileReader) -> str:
    """Return what a reader is called in messages."""
    return f"reader '{reader.name}'"


@contextmanager
def refusals_reported(path: Path, reader: FileReader, error: type[DovetailError]) -> Iterator[None]:
    """Turn a ValueError, with which a reader refuses a file, into an error about the file.

    Raises
    ------
    DovetailError
        Of the class `error`.
    PluginError
        The code of the reader fails in another way.
    """
    try:
        with plugin_errors(reader, label_of(reader)):
            yield
    except PluginError as failure:
        if isinstance(failure.__cause__, ValueError):
            raise error(Fault(str(path), str(failure.__cause__))) from None
        raise


def _reader_class(offer: Offer) -> type[FileReader]:
    return cast("type[FileReader]", offer.component)


def _accepts(offer: Offer, content: bytes) -> bool:
    reader = make_reader(offer)
    with plugin_errors(reader, label_of(reader)):
        return bool(reader.sniff(content[:HEAD]))
