"""All faults of a description are reported at once, in the order of its text."""

from __future__ import annotations

import re

import pytest

from dovetail.description import read_description
from dovetail.documents.fault_list import MOST_FAULTS
from dovetail.errors import DescriptionError
from dovetail.registry import Registry, hookimpl


def test_faults_of_every_section_in_the_order_of_the_text(message, broken):
    text = broken(
        {
            "name: test": "name: [test]",
            "step: 2 Hz": "step: 2 kg",
            "outer: 50 mm": "outer: 50 mn",
            "at: [90 mm, 100 mm]": "at: [90 mm, 96 mm]",
            "      kr_tc:": "      k_ry:",
            "position: 10 mm": "position: 11 mm",
            "model: squeeze": "model: squash",
            "samples: 100": "samples: 100\n  samples: 200",
        }
    )
    places = re.findall(r"^test\.yaml:(\d+:\d+  \S+)$", message(text), re.MULTILINE)
    assert places == [
        "2:1  name",
        "3:48  frequency.step",
        "13:32  substructures.holder.sections[0].outer",
        "18:36  joints.collet.connect.tool.at[1]",
        "22:7  joints.collet.parameters.k_ry",
        "23:32  response.position",
        "26:3  identification.samples",
        "27:20  identification.reducer.model",
    ]


def test_what_refers_to_a_faulty_part_is_not_reported_as_well(message, broken):
    text = broken({"outer: 50 mm": "outer: 50 kg", "response: {at: tool": "response: {at: holder"})
    assert message(text) == (
        "test.yaml:13:32  substructures.holder.sections[0].outer\n"
        "  '50 kg' is not in m, or in a unit that can be converted to it."
    )


def test_a_value_with_a_tag_is_reported_once(message, broken):
    text = broken({"material: {young: 200 GPa, density: 7800 kg/m^3}": "material: !steel [1, 2]"})
    assert message(text).count("material") == 1


class _Broken:
    @hookimpl
    def dovetail_components(self):
        return ["Clamp"]


def test_a_plugin_that_did_not_load_is_named_where_its_model_is_missing(sound, tmp_path):
    registry = Registry()
    registry.add(_Broken(), "acme 3.0")
    (tmp_path / "test.yaml").write_text(sound)
    with pytest.raises(DescriptionError) as caught:
        read_description(tmp_path / "test.yaml", registry)
    fault = next(fault for fault in caught.value.faults if fault.where.endswith("joints.collet.model"))
    assert fault.problem == "'clamp' is not a joint model."
    assert fault.remedy.startswith("(Not loaded: acme 3.0: 'Clamp' is not a component class")


def test_no_more_than_the_largest_number_of_faults_is_listed(message, broken):
    keys = "".join(f"      q{index}: 1\n" for index in range(5000))
    text = message(broken({"    parameters:\n": f"    parameters:\n{keys}"}))
    assert text.count("is not a parameter") == MOST_FAULTS
    assert text.endswith(f"\n  The search ended at {MOST_FAULTS} faults; there may be more.")
