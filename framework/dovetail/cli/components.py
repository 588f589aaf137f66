"""``dovetail plugins`` and ``dovetail describe``: the available models, and the options of one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dovetail.cli.options import AsJson, ModelName, PluginFiles
from dovetail.cli.terminal import heading, print_json, range_text, say, table, title
from dovetail.errors import Fault, PluginError, nearest

if TYPE_CHECKING:
    from dovetail.registry import Registry


def plugins(plugin: PluginFiles = None, as_json: AsJson = False) -> None:
    """List the available models.

    Each with its kind and its package; then the commands of packages, and what could not be loaded.
    """
    from dovetail.cli.command_group import OWN
    from dovetail.interfaces import KINDS
    from dovetail.registry import CommandTable, components
    from dovetail.registry.model_description import list_models

    registry, commands = components(plugin or ()), CommandTable(OWN, plugin or ())
    added = [offer for offer in commands.offers.values() if offer not in OWN]
    failures = list(dict.fromkeys([*registry.failures, *commands.failures]))
    offers = [offer for kind in KINDS for offer in registry.offers(kind)]
    if as_json:
        listed = list_models(registry) | {
            "commands": [{"name": o.command.called, "summary": o.command.summary, "source": o.source} for o in added],
            "failures": [{"source": failure.source, "reason": failure.reason} for failure in failures],
        }
        print_json(listed)
        return
    table(
        ["kind", "name", "summary", "source"],
        [(o.component.kind, o.component.name, o.component.summary, o.source) for o in offers],
    )
    if added:
        heading("Commands of packages")
        table(["command", "summary", "source"], [(o.command.called, o.command.summary, o.source) for o in added])
    if failures:
        heading("Not loaded")
        table(["source", "reason"], [(failure.source, failure.reason) for failure in failures])
    if registry.slow:
        heading("Slow to import, at every command")
        table(["source", "seconds"], [(source, f"{seconds:.1f}") for source, seconds in registry.slow.items()])
    if registry.conflicts:
        heading("Offered more than once, and so not usable")
        rows = [(kind, name, " and ".join(sources)) for (kind, name), sources in registry.conflicts.items()]
        table(["kind", "name", "sources"], rows)


def describe(model: ModelName, plugin: PluginFiles = None, as_json: AsJson = False) -> None:
    """Describe a model: options, parameters, ports.

    If models of several kinds have this name, all of them are shown.
    """
    from dovetail.registry.model_description import as_plain, describe_offer

    described = [describe_offer(offer) for offer in registry_for(model, plugin or ()).named(model)]
    if as_json:
        print_json([as_plain(entry) for entry in described])
        return
    for index, entry in enumerate(described):
        if index:
            say()
        _print_model(entry)


def registry_for(name: str, files: Sequence[Path]) -> Registry:
    """Return the registry in which a model is looked up by its name.

    Raises
    ------
    PluginError
        The name is that of a command, not of a model, or is more similar to one than to any model's.
    """
    from dovetail.cli.command_group import OWN
    from dovetail.interfaces import KINDS
    from dovetail.registry import CommandTable, components

    registry = components(files)
    if registry.kinds_of(name):
        return registry
    commands = CommandTable(OWN, files).offers
    if name in commands:
        remedy = f"'dovetail {name} --help' describes it."
        raise PluginError(Fault("", f"'{name}' is a command, not a model.", "a model's name", remedy))
    models = [model for kind in KINDS for model in registry.names(kind)]
    meant = nearest(name, [*models, *commands])
    if meant in commands and meant not in models:
        remedy = f"Did you mean the command '{meant}'? 'dovetail {meant} --help' describes it."
        raise PluginError(Fault("", f"there is no model '{name}'.", "a model's name", remedy))
    return registry


def _print_model(entry: dict[str, Any]) -> None:
    title(f"{entry['kind']} {entry['name']}  ({entry['source']})")
    say(entry["summary"])
    for reference in entry["references"]:
        say(f"Reference: {reference}")
    heading("Options")
    if entry["options"]:
        keys = ("name", "type", "unit", "default", "description")
        table(["option", *keys[1:]], [[option[key] for key in keys] for option in entry["options"]])
    else:
        say("none")
    if entry["kind"] == "law":
        heading("Unknowns with the default options")
        unknowns = [(one["name"], _unknown_range(one), one["description"]) for one in entry["unknowns"]]
        table(["unknown", "range", "description"], unknowns)
    if entry["kind"] != "joint":
        return
    heading(f"Parameters {entry['valid_for']}".rstrip())
    if entry["parameters"] is None:
        say("They depend on the options.")
    elif entry["parameters"]:
        rows = [(p.name, range_text(p), p.scale, p.description) for p in entry["parameters"]]
        table(["parameter", "range", "scale", "description"], rows)
    else:
        say("none")
    heading(f"Ports {entry['valid_for']}".rstrip())
    if entry["ports"] is None:
        say("They depend on the options.")
    else:
        table(["port", "nodes"], [(port.name, str(port.nodes)) for port in entry["ports"]], numbers=["nodes"])


def _unknown_range(unknown: dict[str, Any]) -> str:
    """Return the range of an unknown of a law in words."""
    if unknown["lower"] is None:
        return "that of the parameter"
    return f"{unknown['lower']:g} to {unknown['upper']:g}, {unknown['scale']}"
