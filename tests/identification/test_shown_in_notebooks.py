"""How objects are displayed: one line, and in a notebook a table below it, whose texts are escaped."""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import dovetail
from dovetail.network.evaluation import Evaluation, ParameterMetrics

HOSTILE = "<script>alert(1)</script>\x1b[31m"
ELEMENTS = {"p", "table", "tr", "th", "td"}


class Elements(HTMLParser):
    """Lists elements, their attributes and the cells of the table."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.attributes: list[object] = []
        self.cells: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.found.append(tag)
        self.attributes += attrs

    def handle_data(self, data):
        self.cells.append(data)


@pytest.fixture(scope="module")
def shown(assemblies, tmp_path_factory) -> dict[str, object]:
    """An object of each kind, with a hostile text wherever a file gives it one."""
    folder = tmp_path_factory.mktemp("shown")
    plain = dovetail.load(assemblies / "sdof.yaml")
    assembly = dovetail.Assembly(replace(plain.description, name="<script>alert(1)</script>"))
    frf = replace(assembly.simulate(), label=HOSTILE, note=HOSTILE, response="<b>", origin=HOSTILE)
    result = dovetail.identify(assembly, frf, form="laplace")
    metrics = ParameterMetrics(0.9, 0.1, 0.1, 1e5, 1e5, "N/m")
    network: dict = {"network": None, "evaluation": Evaluation({"k": metrics, "<i>": metrics}, 160, 40, 0, {})}
    return {
        "Assembly": assembly,
        "Frf": frf,
        "Identification": result,
        "Batch": dovetail.Batch({HOSTILE: result}, {HOSTILE: HOSTILE}),
        "Identifier": dovetail.Identifier(assembly, **network),
        "Dataset": dovetail.generate(assembly, folder / "<i>.zarr", samples=4),
    }


@pytest.mark.parametrize("kind", ["Assembly", "Frf", "Identification", "Batch", "Identifier", "Dataset"])
def test_an_object_is_shown_as_a_line_and_as_a_table_of_texts(shown, kind):
    line, page = repr(shown[kind]), shown[kind]._repr_html_()
    assert kind in line
    assert len(line) < 400
    for text in (line, page):
        assert not [character for character in text if ord(character) < 32]
    elements = Elements()
    elements.feed(page)
    assert set(elements.found) == ELEMENTS
    assert elements.attributes == []
    assert kind in page


def test_what_the_lines_and_the_tables_say(shown, assemblies):
    frf = dovetail.Frf(np.array([10.0, 20.0]), np.array([1.0, 2.0j]), "accelerance", label="a.uff", averages=3)
    assert repr(frf) == "<Frf: a.uff, accelerance, 2 lines from 10 to 20 Hz>"
    assert "<td>largest amplitude</td><td>2 at 20 Hz</td>" in frf._repr_html_()
    assert "<td>averages</td><td>3</td>" in frf._repr_html_()
    assert repr(shown["Identifier"]) == ("<Identifier: <script>alert(1)</script>, 160 training samples, mean R2 0.900>")
    assert "<td>k</td><td>0.900</td><td>1e+05 N/m</td>" in shown["Identifier"]._repr_html_()
    result = shown["Identification"]
    low, high = (f"{end:.5g} N/m" for end in result.interval["k"])
    cells = f"<td>{low} to {high}</td><td>{result.table[0].precision}</td><td>identified</td>"
    assert cells in result._repr_html_()
    assert "<td>k</td><td>1e+05 N/m</td><td>1e+07 N/m</td><td>linear</td>" in shown["Assembly"]._repr_html_()
    assert "<td>4</td>" in shown["Dataset"]._repr_html_()


def test_a_result_that_is_not_trustworthy_says_so_in_a_notebook(shown):
    result = replace(shown["Identification"], adequacy=dovetail.Adequacy("does not fit"))
    page = result._repr_html_()
    assert f"&gt; {result.warning}</p>" in page
    assert " N/m to " not in page
    assert result.warning in dovetail.Batch({"other": result}, {})._repr_html_()


def test_parts_of_a_result_with_arrays_are_one_short_line(assemblies):
    assembly = dovetail.load(assemblies / "sdof.yaml")
    measured = dovetail.noisy_frf(assembly.simulate({"k": 1e6, "c": 20.0}), 0.01, np.random.default_rng(0))
    result = dovetail.identify(assembly, measured, samples=60)
    parts = result.fit, result.posterior, dovetail.predict_band(assembly, result)
    for part, words in zip(parts, ("searches agree", "samples of k, c", "90%, 600 lines"), strict=True):
        assert words in repr(part)
        assert len(repr(part)) < 120
        assert "\n" not in repr(part)
