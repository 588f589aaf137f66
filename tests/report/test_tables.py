"""One table is written for CSV, JSON, Markdown, HTML and the terminal."""

from __future__ import annotations

import pytest

from dovetail.pages import Column, Table
from dovetail.report.pages import environment

TABLE = Table(
    [
        Column("case", "case", is_number=False, once=True),
        Column("", "value"),
        Column("error [%]", "error", lambda value: "-" if value is None else f"{value:+.1f}"),
        Column("joint", "", is_number=False, once=True),
        Column("note", "note"),
    ],
    [["a", 1, 0.25, "good", None], ["a", 1, None, "good", None], ["b|<i>", 2, -1.04, "good", None]],
)


def test_csv_and_json_have_every_value_under_its_key():
    assert TABLE.csv() == "case,value,error,note\na,1,0.25,\na,1,,\nb|<i>,2,-1.04,\n"
    assert TABLE.records()[2] == {"case": "b|<i>", "value": 2, "error": -1.04, "note": None}


def test_people_see_texts_without_empty_columns_and_without_repetitions():
    assert TABLE.headings == ["case", "error [%]", "joint"]
    assert TABLE.numbers == ["error [%]"]
    assert TABLE.texts == [["a", "+0.2", "good"], ["", "-", ""], ["b|<i>", "-1.0", "good"]]
    assert TABLE.without("case", "joint").texts == [["+0.2"], ["-"], ["-1.0"]]


def test_markdown_aligns_numbers_and_escapes():
    header, rule, *_, last = TABLE.markdown().splitlines()
    assert header == "| case | error &#91;%] | joint |"
    assert rule == "| --- | ---: | --- |"
    assert last == "| b/&lt;i&gt; | -1.0 | good |"


def test_two_columns_of_one_key_stay_two_in_csv():
    assert Table([Column("x", "x"), Column("x", "x")], [[1, 2]]).csv() == "x,x\n1,2\n"


def test_a_summary_is_for_people_only():
    table = Table([Column("case", "case"), Column("n", "n")], [["a", 1]], ["all", "1"])
    assert table.texts[-1] == ["all", "1"]
    assert table.csv() == "case,n\na,1\n"


@pytest.mark.parametrize(("marked", "flags"), [((), 0), (("a",), 1)])
def test_html_has_headers_escaped_cells_and_marked_rows(marked, flags):
    source = '{% import "tables.html.jinja" as html %}{{ html.write(table, "Errors", marked, "odd") }}'
    page = environment().from_string(source).render(table=TABLE, marked=marked)
    assert page.count("<tr") == 1 + len(TABLE.rows)
    assert '<th scope="col" class="number">error [%]</th>' in page
    assert '<th scope="row">b|&lt;i&gt;</th>' in page
    assert '<td class="number">\N{MINUS SIGN}1.0</td>' in page
    assert page.count('<span class="flag">odd</span>') == page.count('class="out"') == flags
