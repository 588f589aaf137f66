"""The true parameters behind a synthetic measurement, read from JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dovetail.errors import FileError, MeasurementError
from dovetail.identification.truth import TrueValues, read_truth
from dovetail.interfaces import Parameter

PARAMETERS = (
    Parameter("Dc", "m", 26e-3, 40e-3),
    Parameter("kr_tc", "N m/rad", 2e3, 6e4, "log"),
    Parameter("mn1", "kg", 0.02, 0.2),
)


def truth_file(tmp_path: Path, content: Any) -> Path:
    path = tmp_path / "truth.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_texts_with_units_and_numbers_become_si(tmp_path: Path) -> None:
    path = truth_file(
        tmp_path,
        {
            "synthetic": True,
            "note": "made by a script",
            "parameters": {"Dc": "34.6 mm", "kr_tc": "18.7 kN m/rad", "mn1": 0.06},
            "natural_frequencies_Hz": [6610.0, "1.33 kHz"],
        },
    )
    truth = read_truth(path, PARAMETERS)
    assert truth.parameters == pytest.approx({"Dc": 34.6e-3, "kr_tc": 18.7e3, "mn1": 0.06})
    assert truth.natural_frequencies == pytest.approx((1330.0, 6610.0))
    assert truth.synthetic
    assert truth.note == "made by a script"


def test_every_key_may_be_missing(tmp_path: Path) -> None:
    assert read_truth(truth_file(tmp_path, {}), PARAMETERS) == TrueValues()


def test_a_truth_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        TrueValues({"Dc": 1.0}).parameters["Dc"] = 2.0  # type: ignore[index]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "this is not JSON"),
        ("[" * 100_000, "this is not JSON"),
        ('{"note": "a", "note": "b"}', "the key 'note' occurs twice"),
        ("[1]", r"a truth file holds one object, not \[1\]"),
        ({"parameter": {}}, "'parameter' is not a key of a truth file.\n.*Did you mean 'parameters'?"),
        ({"parameters": [1]}, r"\[1\] is not an object of names and values"),
        ({"parameters": {"kr_tx": 1.0}}, "'kr_tx' is not a parameter of this assembly.\n.*Did you mean 'kr_tc'?"),
        ({"parameters": {"Dc": "34.6 kg"}}, r"parameters.Dc\n.*'34.6 kg' is not in m, or"),
        ({"parameters": {"Dc": None}}, "a quantity in m is a number or a text"),
        ('{"parameters": {"Dc": NaN}}', "nan is not a finite quantity in m"),
        ({"natural_frequencies_Hz": ["high"]}, "natural_frequencies_Hz\n.*'high' is not a quantity"),
        ({"natural_frequencies_Hz": [-1.0]}, "a natural frequency is not positive"),
        ({"synthetic": "yes"}, "'yes' is not a truth value.\n.*true, false"),
        ({"note": 3}, "3 is not a text"),
    ],
)
def test_a_faulty_truth_file_is_refused_with_the_reason(tmp_path: Path, content: Any, message: str) -> None:
    path = truth_file(tmp_path, content)
    with pytest.raises(MeasurementError, match=message) as caught:
        read_truth(path, PARAMETERS)
    assert all(fault.where.startswith(str(path)) for fault in caught.value.faults)


def test_all_faults_are_reported_at_once(tmp_path: Path) -> None:
    path = truth_file(tmp_path, {"parameters": {"Dc": "1 kg", "x": 1}, "note": 3, "more": 1})
    with pytest.raises(MeasurementError) as caught:
        read_truth(path, PARAMETERS)
    assert len(caught.value.faults) == 4


def test_a_missing_file_is_reported_as_missing(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="there is no such file"):
        read_truth(tmp_path / "none.json", PARAMETERS)
