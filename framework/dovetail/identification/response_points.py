"""The points of an assembly's responses, as FRFs are compared with them, and as the files of its own FRFs name them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dovetail.description import Description, Place, direction_name
from dovetail.frf import Frf
from dovetail.measurement import ModelDof, Role
from dovetail.measurement.roles import contradictions


def roles_of(description: Description, frfs: Sequence[Frf]) -> list[Role]:
    """Return what FRFs are used as, of which there is one for each response."""
    return [
        Role(frf, _model_dof(description, response), _model_dof(description, response.force or response))
        for frf, response in zip(frfs, description.responses, strict=True)
    ]


def moving_parts(description: Description) -> dict[str, bool]:
    """Return the names of all substructures, and whether they move."""
    return {name: not model.grounded for name, model in description.substructures.items()}


def with_points(description: Description, frf: Frf) -> Frf:
    """Return the FRF of the only response with the names of its points, as in ``tool, 20 mm, x``.

    It has none if they cannot be read back from a file as what they are, as those of a part that is called ``x``.
    """
    response = description.response
    named = replace(frf, response=_name(description, response), force=_name(description, response.force or response))
    found = contradictions(roles_of(description, [named]), substructures=moving_parts(description))
    return frf if any(found) else named


def _name(description: Description, place: Place) -> str:
    direction = direction_name(place.direction).replace("-", "minus ")
    is_skew = direction.startswith("(")
    return description.point_label(place) + ("" if is_skew else f", {direction}")


def _model_dof(description: Description, place: Place) -> ModelDof:
    nodes = description.substructures[place.substructure].nodes
    label, position, directions = nodes[place.node].label, nodes[place.node].position, nodes[place.node].directions
    in_space = not set(directions) <= {"x", "rz"}
    words, direction = description.point_label(place), direction_name(place.direction) if in_space else ""
    labels = tuple(other.label for other in nodes)
    return ModelDof(words, place.rotation, place.substructure, label, labels, position, direction)
