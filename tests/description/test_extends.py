"""`extends`: overriding another description, with positions in the right file."""

from __future__ import annotations

from pathlib import Path

import pytest

from dovetail.assembly.reader import read_description
from dovetail.errors import DescriptionError


def test_a_new_tool_in_the_same_holder(read, sound):
    description = read(
        "extends: base.yaml\n"
        "name: longer\n"
        "substructures:\n"
        "  tool:\n"
        "    sections: [{length: 120 mm, outer: 10 mm, elements: 12}]\n",
        base=sound,
    )
    assert description.name == "longer"
    assert [len(part.nodes) for part in description.substructures.values()] == [13, 5]
    assert description.substructures["tool"].config.material.young == 580e9
    assert description.source == "test.yaml"
    assert "extends" not in description.text


def test_lists_are_replaced_whole(read, sound):
    new = (
        "extends: base.yaml\n"
        "substructures: {holder: {sections: [{length: 10 mm, outer: 5 mm}]}}\n"
        "joints: {collet: {connect: {tool: {at: [0, 10 mm]}}}}"
    )
    description = read(new, base=sound)
    assert len(description.substructures["holder"].nodes) == 2
    tool, holder = description.joints["collet"].connection.attachments
    assert tool.nodes == (0, 1)
    assert holder.nodes == (0, 1)


def test_another_model_takes_nothing_over_from_the_old_one(read, sound):
    new = "extends: base.yaml\nidentification: {reducer: {model: umap, metric: euclidean}}"
    description = read(new, base=sound)
    assert description.identification.reducer.name == "umap"
    assert description.identification.reducer.config.n_components == 10
    assert description.identification.samples == 100


def test_the_same_model_keeps_its_other_options(read, sound):
    new = "extends: base.yaml\nidentification: {reducer: {model: squeeze, metric: euclidean}}"
    assert read(new, base=sound).identification.reducer.config.n_components == 5


@pytest.mark.parametrize(
    ("known", "prior", "lower"),
    [("{about: 30 mm, sd: 1 mm}", "normal", 0.026), ("{range: [28 mm, 31 mm]}", "uniform", 0.028)],
)
def test_what_is_known_of_a_parameter_displaces_what_was(read, sound, known, prior, lower):
    """Over a range, over a prior, and over a tie."""
    for before in ("{about: 33 mm, sd: 2 mm}", "{same_as: collet.kr_tc, ratio: 2}", "31 mm"):
        base = f"extends: sound.yaml\njoints: {{collet: {{parameters: {{Dc: {before}}}}}}}"
        over = f"extends: base.yaml\njoints: {{collet: {{parameters: {{Dc: {known}}}}}}}"
        joint = read(over, base=base, sound=sound).joints["collet"]
        [parameter] = [p for p in joint.parameters if p.name == "Dc"]
        assert (parameter.prior, parameter.lower) == (prior, pytest.approx(lower))
        assert not joint.fixed
        assert not joint.ties


def test_a_value_displaces_the_range_and_a_range_the_value(read, sound):
    fixed = "extends: base.yaml\njoints: {collet: {parameters: {kr_tc: {value: 5e3}, mn1: {value: 80 g}}}}"
    assert dict(read(fixed, base=sound).joints["collet"].fixed) == {"kr_tc": 5e3, "mn1": 0.08}
    sought = "extends: fixed.yaml\njoints: {collet: {parameters: {kr_tc: {range: [1e3, 1e4]}}}}"
    joint = read(sought, fixed=fixed, base=sound).joints["collet"]
    assert dict(joint.fixed) == {"mn1": 0.08}
    assert (joint.parameters[2].lower, joint.parameters[2].upper) == (1e3, 1e4)


def test_a_range_keeps_the_scale_of_the_base(read, sound):
    new = "extends: base.yaml\njoints: {collet: {parameters: {kr_tc: {range: [1e3, 1e4]}}}}"
    assert read(new, base=sound).joints["collet"].parameters[2].scale == "log"


def test_a_number_of_lines_displaces_the_step(read, sound):
    assert len(read("extends: base.yaml\nfrequency: {lines: 11}", base=sound).frequency) == 11


def test_positions_are_those_of_the_file_that_says_it(message, sound):
    over = (
        "extends: middle.yaml\n"
        "frequency:\n"
        "  start: 100 kg\n"
        "joints: {collet: {parameters: {k_ry: {value: 1}}}}\n"
    )  # fmt: skip
    middle = "# nothing here\nextends: base.yaml\n\nresponse: {position: 12 mm}\n"
    base = sound.replace("outer: 50 mm", "outer: 50 s")
    assert message(over, middle=middle, base=base) == (
        "test.yaml:3:10  frequency.start\n"
        "  '100 kg' has the dimension [mass], but a unit of Hz 1 / [time] was expected.\n"
        "test.yaml:4:32  joints.collet.parameters.k_ry\n"
        "  'k_ry' is not a parameter of joint model 'clamp' (fake 1.0).\n"
        "  Did you mean 'kr_tc'?  Accepted: Dc [m], mn1 [kg], kr_tc [N m/rad]\n"
        "middle.yaml:4:22  response.position\n"
        "  substructure 'tool' has no node at 12 mm.\n"
        "  The nearest nodes are at 10 mm and 20 mm.  Accepted: 0 mm, 10 mm, 20 mm, 30 mm, 40 mm, 50 mm, 60 mm, "
        "70 mm, 80 mm, 90 mm, 100 mm\n"
        "base.yaml:13:32  substructures.holder.sections[0].outer\n"
        "  '50 s' has the dimension [time], but a unit of m [length] was expected."
    )


def test_the_path_is_taken_from_the_file_that_names_it(registry, sound, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("a", "a/b", "c"):
        Path(folder).mkdir()
    Path("a/b/test.yaml").write_text("extends: ../middle.yaml\nname: first")
    Path("a/middle.yaml").write_text("extends: ../c/base.yaml\nname: second")
    Path("c/base.yaml").write_text(sound.replace("samples: 100", "samples: 1"))
    with pytest.raises(DescriptionError, match=r"^c/base\.yaml:25:12  identification\.samples\n"):
        read_description("a/b/test.yaml", registry)
    with pytest.raises(DescriptionError, match=r"^c/base\.yaml:25:12  identification\.samples\n"):
        read_description({"extends": "a/b/test.yaml"}, registry)


def test_a_cycle_of_two(message):
    assert message("extends: other.yaml", other="# back\nextends: test.yaml") == (
        "other.yaml:2:10  extends\n  'test.yaml' extends itself in the end."
    )


def test_an_endless_chain(message):
    files = {f"f{index}": f"extends: f{index + 1}.yaml" for index in range(40)}
    assert message("extends: f0.yaml", **files) == (
        "f14.yaml:1:10  extends\n  'f15.yaml' is the end of a chain of more than 16 files."
    )


def test_faults_met_before_a_missing_file_are_not_lost(message):
    assert message("name: a\nname: b\nextends: none.yaml") == (
        "test.yaml:2:1  name\n"
        "  the key 'name' stands here a second time; the first is in line 1.\n"
        "  Remove one of them.\n"
        "test.yaml:3:10  extends\n"
        "  there is no file 'none.yaml'.\n"
        "  The path is taken from the file that names it."
    )


def test_a_base_that_is_no_yaml(message):
    assert message("extends: base.yaml", base="a: [") == (
        "base.yaml:1:5\n  this is not YAML: expected the node content, but found the end of the file."
    )


def test_what_a_section_lacks_is_told_where_it_is_overridden(message, sound):
    base = sound.replace("position: 10 mm", "quantity: mobility")
    assert message("extends: base.yaml\nresponse:\n  at: holder\n", base=base) == (
        "test.yaml:2:1  response.position\n  'response' lacks 'position'.\n  Accepted: a quantity in m"
    )


@pytest.mark.parametrize(
    ("base", "over", "expected"),
    [
        ("{about: 33 mm, sd: 5 %}", "{scale: log}", ("normal", "log")),
        ("{about: 33 mm, sd: 5 %}", "{sd: 2 %}", ("normal", "linear")),
        ("{range: [28 mm, 31 mm]}", "{scale: log}", ("uniform", "log")),
        ("31 mm", "{scale: log}", ("uniform", "log")),
    ],
)
def test_what_goes_with_a_prior_may_change_alone(read, sound, base, over, expected):
    text = f"extends: sound.yaml\njoints: {{collet: {{parameters: {{Dc: {base}}}}}}}"
    more = f"extends: base.yaml\njoints: {{collet: {{parameters: {{Dc: {over}}}}}}}"
    [parameter] = [p for p in read(more, base=text, sound=sound).joints["collet"].parameters if p.name == "Dc"]
    assert (parameter.prior, parameter.scale) == expected
    if "sd: 2 %" in over:
        assert parameter.upper - parameter.lower == pytest.approx(8 * 0.02 * 33e-3)
