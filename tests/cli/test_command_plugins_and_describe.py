from __future__ import annotations

import json

import pytest

from dovetail.registry import LoadFailure, Offer, installed_components


def test_plugins_lists_installed_components(run):
    printed = run("plugins").stdout
    for kind, name in (
        ("substructure", "timoshenko_beam"),
        ("joint", "collet"),
        ("reducer", "umap"),
        ("regressor", "mlp"),
    ):
        assert any(line.split()[:2] == [kind, name] and "dovetail-frf" in line for line in printed.splitlines())
    assert "Not loaded" not in printed
    assert "Offered more than once" not in printed


def test_plugins_prints_json(run):
    found = json.loads(run("plugins", "--json").stdout)
    assert {"kind": "joint", "name": "collet"}.items() <= next(
        entry for entry in found["components"] if entry["name"] == "collet"
    ).items()
    assert found["failures"] == []
    assert found["conflicts"] == []


@pytest.fixture
def troubled(monkeypatch):
    """The installed registry with a package that failed and a name that two packages offer."""
    registry = installed_components()
    rigid = registry.find("joint", "rigid")
    monkeypatch.setattr(registry, "_failures", [LoadFailure("broken-pkg 1.0", "ModuleNotFoundError: no 'gone'")])
    monkeypatch.setitem(registry._offers, ("joint", "rigid"), [rigid, Offer(rigid.component, "other-pkg 2.0")])


@pytest.mark.usefixtures("troubled")
def test_failures_and_conflicts_are_listed_below_the_components(run):
    lines = run("plugins").stdout.splitlines()
    failures, conflicts = lines.index("Not loaded"), lines.index("Offered more than once, and so not usable")
    assert any("broken-pkg 1.0" in line and "ModuleNotFoundError" in line for line in lines[failures:conflicts])
    assert any(line.split()[:2] == ["joint", "rigid"] and "other-pkg 2.0" in line for line in lines[conflicts:])
    as_json = json.loads(run("plugins", "--json").stdout)
    assert as_json["failures"] == [{"source": "broken-pkg 1.0", "reason": "ModuleNotFoundError: no 'gone'"}]
    assert [entry["name"] for entry in as_json["conflicts"]] == ["rigid"]


@pytest.mark.usefixtures("troubled")
def test_describe_names_both_sources_of_a_conflict(run):
    message = run("describe", "rigid", code=1).stderr
    assert "other-pkg 2.0" in message
    assert "dovetail-frf" in message


@pytest.mark.usefixtures("troubled")
def test_an_unknown_model_is_reported_with_the_plugins_that_failed_to_load(run):
    offered = sorted({row["name"] for row in json.loads(run("plugins", "--json").stdout)["components"]} - {"rigid"})
    assert run("describe", "colet", code=1).stderr == (
        "dovetail describe\n  there is no model 'colet'.\n"
        "  Did you mean 'collet'? (Not loaded: broken-pkg 1.0: ModuleNotFoundError: no 'gone') "
        "A model of your own needs --plugin FILE.py or, in a package, `pip install -e FOLDER` once more.  "
        f"Accepted: {', '.join(offered)}\n"
    )


def test_describe_a_joint_whose_options_have_no_default(run):
    printed = run("describe", "collet").stdout
    rows = [line.split() for line in printed.splitlines()]
    assert any(row[:6] == ["material.young", "number", ">", "0", "Pa", "required"] for row in rows)
    assert any(row[:5] == ["material.poisson", "number", "[0,", "0.5)", "0.3"] for row in rows)
    assert any(row[:7] == ["segment", "number", ">", "0", "m", "10", "mm"] for row in rows)
    assert any(row[:5] == ["Dc", "26", "to", "40", "mm"] and row[5] == "linear" for row in rows)
    assert any(row[:5] == ["kt_tc", "100", "to", "2000", "MN/m"] and row[5] == "log" for row in rows)
    assert ["holder", "3"] in rows
    assert "Processes 14 (2026) 1875, doi:10.3390/pr14121875" in printed


def test_describe_a_joint_with_its_default_options(run):
    printed = run("describe", "spring_damper").stdout
    assert "Parameters with the default options" in printed
    assert "x | rz | both" in printed


def test_describe_takes_texts_from_a_docstring(run):
    options = {option["name"]: option for option in json.loads(run("describe", "mlp", "--json").stdout)[0]["options"]}
    assert options["hidden"]["description"] == "Units of each hidden layer."
    assert options["hidden"]["type"] == "list of 1 or more"
    assert options["learning_rate"]["default"] == "0.001"


def test_describe_options_of_lists_of_options(run):
    (beam,) = json.loads(run("describe", "timoshenko_beam", "--json").stdout)
    options = {option["name"]: option for option in beam["options"]}
    assert options["sections"]["type"] == "list of 1 or more"
    assert options["sections[].length"]["default"] == "required"
    assert options["sections[].outer_end"]["default"] == "none"
    assert options["sections[].outer_end"]["unit"] == "m"
    assert "parameters" not in beam


def test_describe_a_joint_as_json(run):
    (collet,) = json.loads(run("describe", "collet", "--json").stdout)
    assert [parameter["name"] for parameter in collet["parameters"]][:3] == ["Dc", "dc", "mn1"]
    assert collet["parameters"][0]["upper"] == pytest.approx(0.04)
    assert [(port["name"], port["nodes"]) for port in collet["ports"]] == [("tool", 3), ("holder", 3)]
    assert collet["ports"][1]["positions"] == pytest.approx([0.02, 0.03, 0.04])


DEPENDENT = """
import dovetail

class Row(dovetail.JointModel):
    name = "row"
    summary = "A row of springs"

    class Config(dovetail.ComponentConfig):
        count: int

    @property
    def parameters(self):
        return tuple(dovetail.Parameter(f"k{i}", "N/m", 1.0, 2.0) for i in range(self.config.count))

    @property
    def ports(self):
        return (dovetail.JointPort("a", self.config.count),)

    def matrices(self, theta):
        return dovetail.StructuralMatrices.zeros(len(theta), self.size)

class None_(dovetail.JointModel):
    name = "none"
    summary = "A joint with the name of a reducer"
    parameters = ()
    ports = ()

    def matrices(self, theta):
        return dovetail.StructuralMatrices.zeros(len(theta), 0)

@dovetail.hookimpl
def dovetail_components():
    return [Row, None_]
"""


@pytest.fixture
def dependent(tmp_path):
    file = tmp_path / "row.py"
    file.write_text(DEPENDENT)
    return file


def test_describe_says_when_parameters_depend_on_options(run, dependent):
    assert run("describe", "row", "--plugin", dependent).stdout.count("They depend on the options.") == 2


def test_a_name_of_several_kinds_shows_all(run, dependent):
    printed = run("--plugin", dependent, "describe", "none").stdout
    assert [line.split()[0] for line in printed.splitlines() if line.split()[1:2] == ["none"]] == ["joint", "reducer"]


def test_wide_tables_stay_within_80_columns(run):
    for arguments in (["plugins"], ["describe", "collet"], ["describe", "timoshenko_beam"], ["describe", "mlp"]):
        assert max(len(line) for line in run(*arguments).stdout.splitlines()) <= 80


def test_a_row_stays_a_line_in_a_pipe(run, monkeypatch):
    monkeypatch.delenv("COLUMNS")
    printed = run("describe", "mlp").stdout
    assert (
        "The learning rate is halved each time the validation loss has not fallen for a third of `patience`;" in printed
    )
