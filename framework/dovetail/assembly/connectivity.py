"""Whether the response feels every part of a description."""

from __future__ import annotations

from collections.abc import Mapping

from dovetail.assembly.description import JointEntry
from dovetail.assembly.findings import Findings
from dovetail.interfaces import SubstructureModel

__all__ = ["check_connected"]


def check_connected(
    substructures: Mapping[str, SubstructureModel], joints: Mapping[str, JointEntry], response: str, findings: Findings
) -> None:
    """Report substructures and joints that the response cannot feel; motion does not pass through the ground."""
    parts = {
        name: {attachment.substructure for attachment in joint.connection.attachments} for name, joint in joints.items()
    }
    reached, new = {response}, [response]
    while new:
        part = new.pop()
        for attached in parts.values():
            if part in attached and not substructures[part].grounded:
                new.extend(attached - reached)
                reached |= attached
    for name in substructures:
        if name not in reached:
            found = f"no joint connects '{name}' with '{response}', where the response is."
            findings.add(("substructures", name), found, remedy="Connect it or remove it.", key=True)
    for name, attached in parts.items():
        if attached and all(substructures[part].grounded for part in attached):
            found = f"the joint '{name}' attaches to nothing that moves."
            findings.add(("joints", name), found, remedy="Connect it to a part that moves, or remove it.", key=True)
