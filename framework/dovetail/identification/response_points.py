"""The points of responses in words, for the files of an assembly's own FRFs."""

from __future__ import annotations

from dataclasses import replace

from dovetail.description import Description, Place, direction_name
from dovetail.frf import Frf
from dovetail.identification.measured_lines import moving_parts, roles_of
from dovetail.measurement.roles import contradictions


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
