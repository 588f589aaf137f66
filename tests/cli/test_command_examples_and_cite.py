"""``dovetail examples`` and ``dovetail cite``."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import dovetail
from dovetail import citation, examples

ROOT = Path(__file__).resolve().parents[2]


def test_the_examples_are_listed(run):
    printed = run("examples").stdout
    assert re.findall(r"^(\S+)  ", printed, flags=re.M) == list(examples.names())


@pytest.mark.parametrize("name", examples.names())
def test_an_example_is_copied_and_can_be_used_there(run, tmp_path, name):
    run("examples", name, "-o", tmp_path / "mine")
    example = examples.EXAMPLES[name]
    if name == "series":
        assert len(dovetail.read_series(tmp_path / "mine" / example.description).tests) == 5
    else:
        copied = dovetail.load(tmp_path / "mine" / example.description)
        assert copied.description.fingerprint == examples.load(name).description.fingerprint
    if example.measurement:
        read = dovetail.read_frf(tmp_path / "mine" / example.measurement)
        assert (read.values == examples.measurement(name).values).all()


def test_every_file_that_the_pages_use_is_copied_with_all(run, tmp_path):
    run("examples", "all", "-o", tmp_path / "assemblies")
    pages = [*(ROOT / "docs").glob("*.md"), ROOT / "README.md"]
    named = {
        word
        for page in pages
        for word in re.findall(r"\bassemblies/[\w/]+\.(?:yaml|uff|npz|csv|json|py)\b", page.read_text())
    }
    assert len(named) > 20
    assert [word for word in sorted(named) if not (tmp_path / word).exists() and (ROOT / word).exists()] == []


def test_files_that_are_the_same_stay_and_others_are_not_replaced(run, tmp_path):
    run("examples", "sdof", "-o", tmp_path)
    run("examples", "sdof", "-o", tmp_path)
    (tmp_path / "sdof.yaml").write_text("mine")
    failed = run("examples", "all", "-o", tmp_path, code=1)
    assert "another file or folder of this name is here already" in failed.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["sdof.yaml"]


def test_an_unknown_example_is_named_with_those_that_exist(run, tmp_path):
    failed = run("examples", "colet", "-o", tmp_path, code=1)
    assert "Did you mean 'collet'?" in failed.stderr
    with pytest.raises(dovetail.ParameterError, match="'sdof' has no measurement"):
        examples.measurement("sdof")


def test_the_package_takes_the_files_of_the_repository():
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["force-include"] == {"assemblies": "dovetail/assemblies", "CITATION.cff": "dovetail/CITATION.cff"}


def test_what_to_cite_is_printed_in_three_forms(run):
    assert run("cite").stdout == citation.plain() + "\n"
    entries = run("cite", "--format", "bibtex").stdout
    assert re.findall(r"^@(\w+)\{", entries, flags=re.M) == ["software", "article"]
    assert f"version = {{{dovetail.__version__}}}" in entries
    assert yaml.safe_load(run("cite", "--format", "cff").stdout)["type"] == "software"
    assert "doi.org/10.3390/pr14121875" in run("cite").stdout
    assert run("cite", "--format", "ris", code=2).stderr


def test_the_citation_is_complete_and_of_this_version():
    content = yaml.safe_load(citation.citation_file())
    needed = {"cff-version", "message", "title", "type", "authors", "version", "date-released", "license", "url"}
    assert needed | {"repository-code", "abstract", "keywords", "references"} <= set(content)
    assert content["version"] == dovetail.__version__
