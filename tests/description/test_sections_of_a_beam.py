"""A beam's section is round or rectangular, not both and not neither."""

from __future__ import annotations

import pytest

import dovetail
from dovetail.errors import DescriptionError


@pytest.mark.parametrize(
    ("section", "found"),
    [
        ({"length": 0.1}, "either round, with 'outer', or rectangular"),
        ({"length": 0.1, "outer": 0.02, "width": 0.02, "height": 0.01}, "either round, with 'outer', or rectangular"),
        ({"length": 0.1, "width": 0.02}, "has a width and a height"),
        ({"length": 0.1, "width": 0.02, "height": 0.01, "inner": 0.005}, "has no diameters"),
        ({"length": 0.1, "outer": 0.02, "inner": 0.03}, "inner diameter must be smaller"),
    ],
)
def test_a_section_has_one_shape(section, found):
    description = {
        "dovetail": 1,
        "name": "beam",
        "frequency": {"start": 10, "stop": 20, "step": 5},
        "substructures": {
            "beam": {
                "model": "timoshenko_beam",
                "material": {"young": 210e9, "density": 7800},
                "sections": [section],
            }
        },
        "response": {"at": "beam", "position": 0},
    }
    with pytest.raises(DescriptionError, match=found):
        dovetail.load(description)
