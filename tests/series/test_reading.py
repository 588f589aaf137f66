"""Faults in the description of a series are reported at once, with their places and the nearest spelling."""

import copy
from pathlib import Path

import pytest
import yaml

from dovetail import DescriptionError, read_series

SERIES = Path(__file__).parents[2] / "assemblies" / "series"


def described():
    content = yaml.safe_load((SERIES / "torques.yaml").read_text(encoding="utf-8"))
    content["assembly"] = str(SERIES / content["assembly"])
    for test in content["tests"].values():
        test["measured"] = str(SERIES / test["measured"])
    return content


def test_the_shipped_series_is_read():
    series = read_series(SERIES / "torques.yaml")
    assert [test.covariates["torque"] for test in series.tests] == [20.0, 40.0, 60.0, 80.0, 100.0]
    assert {name: role.describe() for name, role in series.roles.items()} == {
        "k": "exponential_approach over torque",
        "kr": "varying",
        "c": "shared",
        "cr": "shared",
    }
    assert len({id(test.assembly) for test in series.tests}) == 1


def test_two_frfs_of_one_file_are_two_measurements():
    content = described()
    file = content["tests"]["T20"]["measured"]
    content["tests"]["T20"]["measured"] = {"file": file, "index": 1}
    content["tests"]["T40"]["measured"] = {"file": file, "index": 2}
    assert [test.measured[0][1]["index"] for test in read_series(content).tests[:2]] == [1, 2]


def test_covariates_are_converted_to_their_units():
    content = described()
    content["tests"]["T20"]["at"]["torque"] = "20000 N mm"
    assert read_series(content).tests[0].covariates == {"torque": 20.0}


def test_a_test_may_change_the_assembly_of_the_series():
    content = described()
    content["tests"]["T20"]["change"] = {"joints": {"clamp": {"parameters": {"cr": {"value": "0.6 N m s/rad"}}}}}
    series = read_series(content)
    names = [[parameter.name for parameter in test.assembly.parameters] for test in series.tests]
    assert names[0] == ["k", "c", "kr"]
    assert names[1] == ["k", "c", "kr", "cr"]


FAULTS = {
    "no format": (lambda c: c.pop("dovetail_series"), "does not say that it describes a series"),
    "another format": (lambda c: c.update(dovetail_series=2), "not a format that this version"),
    "a misspelt key": (lambda c: c.update(test={}), "'test' is not a key"),
    "no tests": (lambda c: c.update(tests={}), "tests"),
    "a misspelt key of a test": (lambda c: c["tests"]["T20"].update(measure="x.csv"), "Did you mean 'measured'"),
    "no file": (lambda c: c["tests"]["T20"].update(measured="missing.csv"), "there is no file 'missing.csv'"),
    "a measurement of two tests": (
        lambda c: c["tests"]["T40"].update(measured=c["tests"]["T20"]["measured"]),
        "'torque_20.csv' is the measurement of 'T20' too",
    ),
    "two files for one response": (
        lambda c: c["tests"]["T20"].update(measured=[c["tests"]["T20"]["measured"]] * 2),
        "2 measured files, and its assembly has 1",
    ),
    "no assembly": (lambda c: c.pop("assembly"), "names no assembly"),
    "a broken assembly": (lambda c: c.update(assembly="missing.yaml"), "'missing.yaml' is not usable"),
    "a change with a fault": (lambda c: c["tests"]["T20"].update(change={"joint": {}}), "'joint' is not a key"),
    "an unknown covariate": (lambda c: c["tests"]["T20"].update(at={"torqe": 1}), "Did you mean 'torque'"),
    "a covariate of another unit": (lambda c: c["tests"]["T20"].update(at={"torque": "20 mm"}), "N m"),
    "a covariate without a value": (lambda c: c["tests"]["T20"].update(at={"torque": None}), "tests.T20.at.torque"),
    "an unknown unit": (lambda c: c.update(covariates={"torque": "foo"}), "'foo' is not a unit"),
    "an unknown parameter": (lambda c: c["parameters"].update(kk="shared"), "no test has a parameter 'kk'"),
    "a misspelt role": (lambda c: c["parameters"].update(k="shraed"), "Did you mean 'shared'"),
    "a role that is a number": (lambda c: c["parameters"].update(k=3), "3 is not a role"),
    "a role that is empty": (lambda c: c["parameters"].update(k=None), "is not a role"),
    "a misspelt law": (lambda c: c["parameters"].update(k={"law": "liner"}), "Did you mean 'linear'"),
    "a law that is a number": (lambda c: c["parameters"].update(k={"law": 3}), "parameters.k.law"),
    "a misspelt option of a law": (
        lambda c: c["parameters"].update(k={"law": {"model": "monotone_spline", "piece": 3}}),
        "Did you mean 'pieces'",
    ),
    "a law over something else": (lambda c: c["parameters"].update(k={"law": "linear", "over": "torqe"}), "torque"),
    "a law of a shared value": (
        lambda c: c["parameters"].update(k={"role": "shared", "law": "linear"}),
        "'shared' takes no 'law'",
    ),
    "a role without its law": (lambda c: c["parameters"].update(k={"role": "law"}), "needs 'law'"),
    "a role without anything": (lambda c: c["parameters"].update(k={}), "neither a role nor a law"),
    "a scatter of a shared value": (
        lambda c: c["parameters"].update(k={"role": "shared", "scatter": [0.01, 0.1]}),
        "'shared' takes no 'scatter'",
    ),
    "a scatter that decreases": (
        lambda c: c["parameters"].update(k={"role": "varying", "scatter": [0.1, 0.01]}),
        "cannot range from 0.1 to 0.01",
    ),
    "a test without the covariate of a law": (lambda c: c["tests"]["T20"].pop("at"), "which T20 does not give"),
    "one value of the covariate": (
        lambda c: [test.update(at={"torque": 20}) for test in c["tests"].values()],
        "the same 'torque'",
    ),
    "a power of a negative covariate": (
        lambda c: (c["parameters"].update(k={"law": "power"}), c["tests"]["T20"].update(at={"torque": -1})),
        "positive covariates",
    ),
    "different ranges of a shared value": (
        lambda c: c["tests"]["T20"].update(
            change={"joints": {"clamp": {"parameters": {"c": {"range": ["6 N s/m", "500 N s/m"]}}}}}
        ),
        "its range in 'T40' is not that in 'T20'",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_explained(fault):
    content, (change, expected) = copy.deepcopy(described()), FAULTS[fault]
    change(content)
    with pytest.raises(DescriptionError) as error:
        read_series(content)
    assert expected in str(error.value)


def test_all_faults_are_reported_at_once_with_their_lines(tmp_path):
    content = described()
    content["parameters"] = {"k": "shraed", "kx": "free"}
    content["tests"]["T20"]["at"] = {"torqe": "20 N m"}
    file = tmp_path / "series.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    with pytest.raises(DescriptionError) as error:
        read_series(file)
    assert len(error.value.faults) == 3
    assert all(f"{file}:" in fault.where for fault in error.value.faults)
