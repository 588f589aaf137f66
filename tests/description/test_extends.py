"""`extends`: overriding another description, with positions in the right file."""

from __future__ import annotations

from pathlib import Path

import pytest

from dovetail.description import read_description
from dovetail.errors import DescriptionError


def test_an_extension_replaces_the_tool_and_keeps_the_holder(read, sound):
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
def test_a_new_value_range_or_prior_replaces_that_of_the_base(read, sound, known, prior, lower):
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
    unknown = "extends: fixed.yaml\njoints: {collet: {parameters: {kr_tc: {range: [1e3, 1e4]}}}}"
    joint = read(unknown, fixed=fixed, base=sound).joints["collet"]
    assert dict(joint.fixed) == {"mn1": 0.08}
    assert (joint.parameters[2].lower, joint.parameters[2].upper) == (1e3, 1e4)


def test_a_range_keeps_the_scale_of_the_base(read, sound):
    new = "extends: base.yaml\njoints: {collet: {parameters: {kr_tc: {range: [1e3, 1e4]}}}}"
    assert read(new, base=sound).joints["collet"].parameters[2].scale == "log"


def test_a_number_of_lines_displaces_the_step(read, sound):
    assert len(read("extends: base.yaml\nfrequency: {lines: 11}", base=sound).frequency) == 11


def test_faults_are_reported_at_the_lines_of_the_file_that_holds_them(message, sound):
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
        "  '100 kg' is not in Hz, or in a unit that can be converted to it.\n"
        "test.yaml:4:32  joints.collet.parameters.k_ry\n"
        "  'k_ry' is not a parameter of joint model 'clamp' (fake 1.0).\n"
        "  Did you mean 'kr_tc'?  Accepted: Dc [m], mn1 [kg], kr_tc [N m/rad]\n"
        "middle.yaml:4:22  response.position\n"
        "  substructure 'tool' has no node at 12 mm.\n"
        "  The nearest nodes are at 10 mm and 20 mm.  Accepted: 0 mm, 10 mm, 20 mm, 30 mm, 40 mm, 50 mm, 60 mm, "
        "70 mm, 80 mm, 90 mm, 100 mm\n"
        "base.yaml:13:32  substructures.holder.sections[0].outer\n"
        "  '50 s' is not in m, or in a unit that can be converted to it."
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


def test_files_that_extend_each_other_are_refused(message):
    assert message("extends: other.yaml", other="# back\nextends: test.yaml") == (
        "other.yaml:2:10  extends\n  'test.yaml' extends itself in a circle."
    )


def test_a_chain_of_too_many_files_is_refused(message):
    files = {f"f{index}": f"extends: f{index + 1}.yaml" for index in range(40)}
    assert message("extends: f0.yaml", **files) == (
        "f14.yaml:1:10  extends\n  'f15.yaml' is in a chain of more than 16 files."
    )


def test_faults_met_before_a_missing_file_are_not_lost(message):
    assert message("name: a\nname: b\nextends: none.yaml") == (
        "test.yaml:2:1  name\n"
        "  the key 'name' is repeated; it is first used in line 1.\n"
        "  Remove one of them.\n"
        "test.yaml:3:10  extends\n"
        "  there is no file 'none.yaml'.\n"
        "  The path is relative to the file that names it."
    )


def test_a_base_with_a_yaml_error_is_reported_at_its_line(message):
    assert message("extends: base.yaml", base="a: [") == (
        "base.yaml:1:5\n  this is not YAML: expected the node content, but found the end of the file."
    )


def test_a_missing_key_is_reported_in_the_overriding_file(message, sound):
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
def test_mean_deviation_and_scale_of_a_prior_can_be_changed_separately(read, sound, base, over, expected):
    text = f"extends: sound.yaml\njoints: {{collet: {{parameters: {{Dc: {base}}}}}}}"
    more = f"extends: base.yaml\njoints: {{collet: {{parameters: {{Dc: {over}}}}}}}"
    [parameter] = [p for p in read(more, base=text, sound=sound).joints["collet"].parameters if p.name == "Dc"]
    assert (parameter.prior, parameter.scale) == expected
    if "sd: 2 %" in over:
        assert parameter.upper - parameter.lower == pytest.approx(8 * 0.02 * 33e-3)


@pytest.mark.parametrize(
    ("base", "over"),
    [
        ("{range: [28 mm, 31 mm]}", "{range: null, value: 30 mm}"),
        ("{about: 30 mm, sd: 1 mm}", "{about: null, sd: null, value: 30 mm}"),
        ("{same_as: collet.kr_tc, ratio: 2}", "{same_as: null, value: 30 mm}"),
        ("{range: [28 mm, 31 mm]}", "{range: null, about: null, value: 30 mm}"),
    ],
)
def test_null_removes_the_range_or_prior_of_a_parameter(read, sound, base, over):
    text = f"extends: sound.yaml\njoints: {{collet: {{parameters: {{Dc: {base}}}}}}}"
    more = f"extends: base.yaml\njoints: {{collet: {{parameters: {{Dc: {over}}}}}}}"
    assert read(more, base=text, sound=sound).joints["collet"].fixed["Dc"] == 30e-3


def test_a_prior_may_be_emptied_for_a_range(read, sound):
    base = "extends: sound.yaml\njoints: {collet: {parameters: {Dc: {about: 30 mm, sd: 1 mm}}}}"
    over = "extends: base.yaml\njoints: {collet: {parameters: {Dc: {about: null, range: [28 mm, 31 mm]}}}}"
    [parameter] = [p for p in read(over, base=base, sound=sound).joints["collet"].parameters if p.name == "Dc"]
    assert (parameter.prior, parameter.lower) == ("uniform", pytest.approx(0.028))


RESPONSE = "{at: tool, position: 10 mm}"
LIST = "\n  - {at: tool, position: 10 mm}\n  - {at: tool, position: 20 mm}"


@pytest.mark.parametrize(
    ("base", "over", "count"),
    [
        (f"response: {RESPONSE}", f"responses: {LIST}", 2),
        (f"responses: {LIST}", f"response: {RESPONSE}", 1),
        (f"response: {RESPONSE}", f"response: null\nresponses: {LIST}", 2),
        (f"responses: {LIST}", f"responses: null\nresponse: {RESPONSE}", 1),
        (f"response: {RESPONSE}", f"responses: {LIST}\nresponse:", 2),
    ],
)
def test_one_response_and_a_list_displace_each_other(read, sound, base, over, count):
    plain = sound.replace("response: {at: tool, position: 10 mm}\n", "")
    assert "response" not in plain
    description = read(f"extends: base.yaml\n{over}", base=f"{plain}{base}\n")
    assert len(description.responses) == count
    assert (
        len(
            read(
                f"extends: over.yaml\nname: last\n{over}", over="extends: base.yaml\n", base=f"{plain}{base}\n"
            ).responses
        )
        == count
    )


@pytest.mark.parametrize(("first", "second"), [("response:", "responses: "), ("responses: null", "response: ")])
def test_an_empty_response_counts_as_missing_without_a_base(read, sound, first, second):
    entry = {"responses: ": LIST, "response: ": RESPONSE}[second]
    plain = sound.replace("response: {at: tool, position: 10 mm}", f"{first}\n{second}{entry}")
    assert read(plain).responses


def test_both_in_one_document_are_still_a_fault(message, sound):
    text = message(f"extends: base.yaml\nresponse: {RESPONSE}\nresponses: {LIST}\n", base=sound)
    assert "the description has 'response' and 'responses'." in text


@pytest.mark.parametrize(
    ("base", "over", "lines"),
    [("step: 2 Hz", "lines: 11", 11), ("lines: 11", "step: 2 Hz", 51), ("step: 2 Hz", "step: null, lines: 11", 11)],
)
def test_step_and_lines_displace_each_other(read, sound, base, over, lines):
    assert (
        len(read(f"extends: base.yaml\nfrequency: {{{over}}}", base=sound.replace("step: 2 Hz", base)).frequency)
        == lines
    )


@pytest.mark.parametrize(
    ("base", "over", "owners"),
    [
        ("", "response: {calibration: {mass: 3 g}}", {"response"}),
        ("calibration: {mass: 5 g}\n", "response: {calibration: {mass: 3 g}}", {"response"}),
        ("calibration: {mass: 5 g, gain: 1.1}\n", "response: {calibration: {mass: 3 g}}", {"response", "calibration"}),
    ],
)
def test_the_chain_of_a_response_displaces_that_of_all(read, sound, base, over, owners):
    description = read(f"extends: base.yaml\n{over}", base=base + sound)
    assert {name for name, entry in description.calibrations.items() if entry.parameters} == owners
    assert description.calibrations["response"].fixed["mass"] == 3e-3


def test_the_chain_of_all_displaces_that_of_a_response(read, sound):
    base = sound.replace(
        "position: 10 mm}\nidentification", "position: 10 mm, calibration: {mass: 3 g}}\nidentification"
    )
    assert "3 g" in base
    description = read("extends: base.yaml\ncalibration: {mass: 5 g}", base=base)
    assert description.calibrations["calibration"].fixed["mass"] == 5e-3
    assert "mass" not in description.calibrations.get("response", description.calibrations["calibration"]).ties
    assert len(description.sensors) == 1


@pytest.mark.usefixtures("unguarded_matrices")
def test_files_of_matrices_displace_an_archive_and_the_reverse(tmp_path):
    import numpy as np
    import scipy.io
    import yaml

    import dovetail

    chain = 1e6 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    np.savez(tmp_path / "part.npz", M=np.eye(2), K=chain, nodes=["1", "2"], directions=["x", "x"])
    for name, matrix in (("M", 2 * np.eye(2)), ("K", chain), ("D", 0.01 * chain)):
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", matrix)
    (tmp_path / "dofs.csv").write_text("node,direction\n1,x\n2,x\n")
    archive = {"model": "matrices", "file": "part.npz"}
    files = {"model": "matrices", "mass": "M.mtx", "stiffness": "K.mtx", "dofs": "dofs.csv"}
    whole = {
        "dovetail": 1,
        "name": "part",
        "frequency": {"start": 1, "stop": 2, "lines": 2},
        "response": {"at": "part", "position": "node 1"},
    }

    def load(base, over):
        (tmp_path / "base.yaml").write_text(yaml.safe_dump({**whole, "substructures": {"part": base}}))
        over = {key: value for key, value in over.items() if key != "model"}
        (tmp_path / "over.yaml").write_text(yaml.safe_dump({"extends": "base.yaml", "substructures": {"part": over}}))
        return dovetail.load(tmp_path / "over.yaml").description.substructures["part"].matrices()

    assert load(archive, files).M[0, 0] == 2.0
    assert load(files, archive).M[0, 0] == 1.0
    for loss_factor in (0.1, {"value": 0.1}, {"range": [0.01, 0.1]}, {"about": 0.1, "sd": 0.01}):
        damped = load({**files, "loss_factor": loss_factor}, {"structural_damping": "D.mtx"})
        assert damped.D[0, 0] == pytest.approx(1e4)
    assert load({**files, "structural_damping": "D.mtx"}, {"loss_factor": 0.1}).D[0, 0] == pytest.approx(1e5)


def test_the_source_of_a_joint_displaces_the_other_in_a_series(tmp_path):
    from dovetail_bench.evaluation.cases import read_cases

    case = "{assembly: a.yaml, measured: m.uff, joint: %s}"
    fitted, result = "{assembly: b.yaml, measured: b.uff}", "{result: r}"
    for base, over, expected in ((fitted, result, "r"), (result, fitted, None)):
        (tmp_path / "base.yaml").write_text(f"dovetail_series: 1\ntests: {{one: {case % base}}}\n")
        (tmp_path / "over.yaml").write_text(f"extends: base.yaml\ntests: {{one: {{joint: {over}}}}}\n")
        for name in ("a.yaml", "m.uff", "b.yaml", "b.uff", "r"):
            (tmp_path / name).touch()
        (read,) = read_cases(tmp_path / "over.yaml").cases
        assert (read.joint.result.name if read.joint.result else None) == expected
