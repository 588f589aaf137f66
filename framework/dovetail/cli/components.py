"""``dovetail plugins`` and ``dovetail describe``: the available models, and the options of one."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from dovetail.cli.options import AsJson, ModelName, PluginFiles
from dovetail.cli.terminal import heading, print_json, range_text, say, table, title

if TYPE_CHECKING:
    from dovetail.registry import Offer, Registry


def plugins(plugin: PluginFiles = None, as_json: AsJson = False) -> None:
    """List the models at hand.

    Each with its kind, who offers it, and below what could not be loaded.
    """
    from dovetail.interfaces import KINDS
    from dovetail.registry import components

    registry = components(plugin or ())
    offers = [offer for kind in KINDS for offer in registry.offers(kind)]
    if as_json:
        print_json(_registry_as_dict(registry, offers))
        return
    table(
        ["kind", "name", "summary", "source"],
        [(o.component.kind, o.component.name, o.component.summary, o.source) for o in offers],
    )
    if registry.failures:
        heading("Not loaded")
        table(["source", "reason"], [(failure.source, failure.reason) for failure in registry.failures])
    if registry.slow:
        heading("Slow to import, at every command")
        table(["source", "seconds"], [(source, f"{seconds:.1f}") for source, seconds in registry.slow.items()])
    if registry.conflicts:
        heading("Offered more than once, and so not usable")
        rows = [(kind, name, " and ".join(sources)) for (kind, name), sources in registry.conflicts.items()]
        table(["kind", "name", "sources"], rows)


def _registry_as_dict(registry: Registry, offers: list[Offer]) -> dict[str, Any]:
    return {
        "components": [
            {
                "kind": offer.component.kind,
                "name": offer.component.name,
                "summary": offer.component.summary,
                "source": offer.source,
            }
            for offer in offers
        ],
        "failures": [{"source": failure.source, "reason": failure.reason} for failure in registry.failures],
        "slow": registry.slow,
        "conflicts": [
            {"kind": kind, "name": name, "sources": list(sources)}
            for (kind, name), sources in registry.conflicts.items()
        ],
    }


def describe(model: ModelName, plugin: PluginFiles = None, as_json: AsJson = False) -> None:
    """Describe a model: options, parameters, ports.

    A name that models of several kinds bear shows all of them.
    """
    from dovetail.cli.model_description import describe_offer
    from dovetail.registry import components

    described = [describe_offer(offer) for offer in _offers_named(components(plugin or ()), model)]
    if as_json:
        print_json([_plain(entry) for entry in described])
        return
    for index, entry in enumerate(described):
        if index:
            say()
        _print_model(entry)


def _offers_named(registry: Registry, name: str) -> tuple[Offer, ...]:
    from dovetail.errors import Fault, PluginError, did_you_mean, listing
    from dovetail.interfaces import KINDS
    from dovetail.registry import HOW_TO_OFFER

    for kind, conflicting in registry.conflicts:
        if conflicting == name:
            registry.find(kind, name)
    offers = registry.named(name)
    if not offers:
        names = sorted({known for kind in KINDS for known in registry.names(kind)})
        remedy = did_you_mean(name, names)
        for failure in registry.failures:
            remedy += f"{' ' if remedy else ''}(Not loaded: {failure.source}: {failure.reason})"
        remedy = f"{remedy} {HOW_TO_OFFER}".lstrip()
        raise PluginError(Fault("", f"there is no model '{name}'.", listing(names, 30), remedy))
    return offers


def _plain(entry: dict[str, Any]) -> dict[str, Any]:
    """Return a description of a model as plain values for JSON."""
    listed = {name: entry[name] for name in ("parameters", "ports") if entry.get(name) is not None}
    return {**entry, **{name: [asdict(item) for item in items] for name, items in listed.items()}}


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
