"""The numbers among the options of a component, and their units."""

from __future__ import annotations

from typing import Annotated

import pytest
from pydantic import Field

import dovetail
from dovetail.documents.option_fields import number_unit, numbers_within


class Section(dovetail.ComponentConfig):
    length: Annotated[float, dovetail.InUnit("m")]
    elements: int = 2


class Options(dovetail.ComponentConfig):
    young: Annotated[float, dovetail.InUnit("Pa")] = 2e11
    ratio: float | None = None
    sections: tuple[Section, ...] = ()
    positions: tuple[Annotated[float, dovetail.InUnit("m")], ...] = ()
    nodes: Annotated[dict[str, Annotated[float, dovetail.InUnit("m")]], Field(default_factory=dict)]
    label: str = ""


CASES = {
    "number": ({}, [(("young",), 2e11, "Pa", True)]),
    "without_a_unit": ({"ratio": 0.3}, [(("ratio",), 0.3, "", True)]),
    "in_a_list_of_sections": ({"sections": [{"length": 0.1}]}, [(("sections", 0, "length"), 0.1, "m", True)]),
    "in_a_list": (
        {"positions": [0.0, 0.2]},
        [(("positions", 0), 0.0, "m", False), (("positions", 1), 0.2, "m", False)],
    ),
    "in_a_mapping": ({"nodes": {"tip": 0.4}}, [(("nodes", "tip"), 0.4, "m", False)]),
    "text": ({"label": "3"}, []),
}


@pytest.mark.parametrize("case", CASES)
def test_each_number_is_found_once_with_its_unit(case):
    options, expected = CASES[case]
    found = [(n.path, n.value, n.unit, n.is_single) for n in numbers_within(Options.model_validate(options))]
    assert [number for number in found if number[0] != ("young",) or case == "number"] == expected


def test_the_path_has_the_key_of_a_description_where_the_field_has_another_name():
    class Aliased(dovetail.ComponentConfig):
        area: Annotated[float, Field(alias="A"), dovetail.InUnit("m^2")]

    (number,) = numbers_within(Aliased.model_validate({"A": 2.0}))
    assert (number.path, number.unit) == (("A",), "m^2")
    assert number_unit(Aliased, ("A",)) == number_unit(Aliased, ("area",)) == "m^2"
