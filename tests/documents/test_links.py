"""The link check of the built site finds links that lead nowhere."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "docs" / "check_links.py"
GOOD = [
    'href="other.html"',
    'href="other.html#there"',
    'src="a%20b.png"',
    'href="https://dovetail.invalid/x"',
    'href="#up"',
]
BAD = ['href="missing.html"', 'href="other.html#gone"', 'src="c.png"', 'href="#gone"']


def checked(folder, links, monkeypatch):
    (folder / "index.html").write_text(f'<h1 id="up">Up</h1>{"".join(f"<a {link}>here</a>" for link in links)}')
    (folder / "other.html").write_text('<h2 id="there">There</h2>')
    (folder / "a b.png").write_bytes(b"")
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(folder)])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(SCRIPT), run_name="__main__")
    return ended.value.code


def test_links_that_lead_somewhere_pass(tmp_path, monkeypatch, capsys):
    assert checked(tmp_path, GOOD, monkeypatch) == 0
    assert capsys.readouterr().out == "2 pages, 5 links\n"


@pytest.mark.parametrize("link", BAD)
def test_a_link_that_leads_nowhere_is_listed(link, tmp_path, monkeypatch, capsys):
    assert checked(tmp_path, [*GOOD, link], monkeypatch) == 1
    assert f"index.html: {link.partition(chr(34))[2][:-1]} leads nowhere" in capsys.readouterr().out
