"""Every file and table made from a result that should not be trusted says so; those of other results do not.

The measurement that does not fit is that of the described structure with the sign reversed.
"""

from __future__ import annotations

import csv
import json
import re
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
import dovetail_bench
from dovetail.identification.application import Application
from dovetail.identification.result_file import load_result
from dovetail.inference.adequacy import judgement
from dovetail.report.result_files import write_results
from support.short_search import one_batch

pytestmark = pytest.mark.usefixtures("few_mode_searches")
WARNING = "The model does not fit the measurement: do not trust the numbers."
HEAVIER = "extends: sdof.yaml\nname: heavier\nsubstructures: {mass: {masses: [{mass: 2 kg}]}}\n"
JOINT = "{assembly: sdof.yaml, measured: measured.uff}"
CASES = f"""\
dovetail_series: 1
covariates: {{number: 1}}
tests:
  identified: {{assembly: heavier.yaml, measured: heavier.csv, joint: {JOINT}, at: {{number: 1}}}}
  read: {{assembly: heavier.yaml, measured: heavier.csv, joint: {{result: results}}, at: {{number: 2}}}}
"""
COMPARED = f"dovetail_series: 1\ntests: {{same: {{assembly: sdof.yaml, measured: measured.uff, joint: {JOINT}}}}}\n"


def make_bench(folder, assemblies, sign):
    """Write descriptions, cases and measurements, with noise, of an SDOF on a fifth of its lines."""
    text = (assemblies / "sdof.yaml").read_text()
    assert "start: 1 Hz, stop: 600 Hz, step: 1 Hz" in text
    (folder / "sdof.yaml").write_text(
        text.replace("start: 1 Hz, stop: 600 Hz, step: 1 Hz", "start: 5 Hz, stop: 600 Hz, step: 5 Hz")
    )
    for name, text in (("heavier.yaml", HEAVIER), ("cases.yaml", CASES), ("compared.yaml", COMPARED)):
        (folder / name).write_text(text)
    random = np.random.default_rng(0)
    for description, file in (("sdof", "measured.uff"), ("heavier", "heavier.csv")):
        assembly = dovetail.load(folder / f"{description}.yaml")
        values = sign * assembly.frf({"k": 3e6, "c": 40.0})
        noise = 1e-3 * values.std() * random.standard_normal((2, values.size))
        frf = dovetail.Frf(assembly.frequency, values + noise[0] + 1j * noise[1], "accelerance")
        dovetail.write_frf(frf, folder / file)


def run_all(run, folder, code):
    """Run every command that makes something of a result, for people and for programs; return what each printed."""
    at = {name: folder / name for name in ("results", "sdof.yaml", "heavier.yaml", "measured.uff")}
    commands = {
        "identify": ["identify", at["sdof.yaml"], at["measured.uff"], "--method", "posterior", "--samples", 60],
        "predict": ["predict", at["heavier.yaml"], at["results"]],
        "validate": ["validate", folder / "cases.yaml"],
        "compare": ["compare", folder / "compared.yaml", "--methods", "refined,posterior"],
    }
    files = [word for suffix in ("csv", "uff", "npz", "png") for word in ("-o", folder / f"predicted.{suffix}")]
    outputs = {name: ["-o", folder / name] for name in commands}
    outputs |= {"identify": ["-o", at["results"]], "predict": [*files, "--band", folder / "band.csv"]}
    tables = {name: run(*words, *outputs[name], code=code) for name, words in commands.items()}
    plain = {name: run(*words, "--json", code=code) for name, words in commands.items()}
    return SimpleNamespace(folder=folder, tables=tables, plain=plain)


@pytest.fixture(scope="module")
def each_fit_once():
    """Let a fit of the same assembly to the same measurement be made once: eight commands differ in what they say.

    It is made with a single batch of searches and one number of draws, and its causes are not looked for, which takes
    longer than all else.
    """
    made, apply = {}, Application.to

    def remembered(self, measured):
        assert self.trained is None
        values = tuple((frf.label, frf.values.tobytes()) for frf in measured.frfs)
        start = None if self.start is None else str(self.start)
        key = (self.method.name, start, self.judgement, self.seed, measured.described.description.text, values)
        if key not in made:
            made[key] = apply(self, measured)
        return made[key]

    with one_batch(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(judgement, "find_causes", lambda *_, **__: ())
        patch.setattr(Application, "to", remembered)
        yield


@pytest.fixture(scope="module", params=[(-1.0, 3), (1.0, 0)], ids=["another sign", "genuine"])
def made(request, run, assemblies, tmp_path_factory, each_fit_once):
    sign, code = request.param
    folder = tmp_path_factory.mktemp("made")
    make_bench(folder, assemblies, sign)
    before = set(folder.rglob("*"))
    done = run_all(run, folder, code)
    result = load_result(folder / "results")
    (folder / "several").mkdir()
    second = replace(result.responses[0], frf=replace(result.frf, note=""))
    write_results(replace(result, further=(second,)), folder / "several", None)
    written = [
        file for file in folder.rglob("*") if file.is_file() and file not in before and file.name != "SHA256SUMS"
    ]
    return SimpleNamespace(**vars(done), result=result, written=written, is_trustworthy=code == 0)


def says_so(file):
    """Whether a file says of itself that its numbers are not trustworthy; an unknown kind of file is refused."""
    if file.suffix in (".uff", ".npz"):
        return dovetail.read_frf(file).note == WARNING
    content = file.read_bytes()
    if file.suffix == ".png":
        return WARNING.encode() in content
    text = content.decode()
    return {".csv": csv_says_so, ".json": json_says_so, ".html": html_says_so, ".md": lambda text: WARNING in text}[
        file.suffix
    ](text)


def csv_says_so(text):
    comments = [line for line in text.splitlines() if line.startswith("#")]
    if comments:
        return f"# note: {WARNING}" in comments
    rows = list(csv.DictReader(text.splitlines()))
    assert rows
    said = {
        row["is_trustworthy"] == "False" if "is_trustworthy" in row else bool(row["not_trustworthy"]) for row in rows
    }
    assert len(said) == 1
    return said.pop()


def json_says_so(text):
    content = json.loads(text)
    assert content["is_trustworthy"] == (content["warning"] == "")
    return not content["is_trustworthy"] and WARNING in content["warning"]


def html_says_so(text):
    head = text[: text.index("<table")]
    title = head[head.index("<title>") : head.index("</title>")]
    sections = [section for section in text.split("<section") if "<table" in section]
    assert len(sections) >= (1 if "models against measurements" in title else 2)  # one of each case, here one
    marked = all("not trustworthy" in section.lower() for section in sections)
    return "trustworthy:" in title and WARNING in head[head.index("<body>") :] and marked


def test_a_result_that_is_not_trustworthy_is_marked_in_every_file(made):
    assert len(made.written) == 28
    said = {str(file.relative_to(made.folder)): says_so(file) for file in made.written}
    assert said == dict.fromkeys(said, not made.is_trustworthy)


def test_a_trustworthy_result_does_not_mention_trust(made):
    if not made.is_trustworthy:
        return
    for file in made.written:
        text = file.read_bytes().replace(b"is_trustworthy", b"").replace(b"not_trustworthy", b"")
        assert b"trustworthy" not in text, file
    for done in made.tables.values():
        assert "not trustworthy" not in done.output


def test_a_result_that_is_not_trustworthy_is_marked_in_every_table(made):
    blocks = {name: done.stdout.split("\n\n") for name, done in made.tables.items()}
    tables = [(name, block) for name, texts in blocks.items() for block in texts if "───" in block]
    assert {name for name, _ in tables} == set(made.tables)
    marked = [table for table in tables if "not trustworthy" in table[1] or "not_trustworthy" in table[1]]
    assert marked == ([] if made.is_trustworthy else tables)
    for done in made.tables.values():
        assert (WARNING in " ".join(done.stdout.split())) != made.is_trustworthy


def test_a_result_that_is_not_trustworthy_is_reported_on_stderr(made):
    for done in (*made.tables.values(), *made.plain.values()):
        assert (WARNING in done.stderr) != made.is_trustworthy


def test_a_result_that_is_not_trustworthy_is_marked_in_printed_json(made):
    assert {name: json_says_so(done.stdout) for name, done in made.plain.items()} == dict.fromkeys(
        made.plain, not made.is_trustworthy
    )


def test_intervals_are_withheld_and_no_verdict_is_given(made):
    page = (made.folder / "results" / "report.html").read_text(encoding="utf-8")
    compared = (made.folder / "compare" / "comparison.html").read_text(encoding="utf-8")
    low, _ = made.result.interval["k"]
    for text in (made.tables["identify"].stdout, page):
        assert (f"{low / 1e6:.4g} to" in text) == made.is_trustworthy
    for text in (made.tables["identify"].stdout, page, compared):
        assert ("withheld" in text) != made.is_trustworthy
        assert not made.is_trustworthy or re.search(r"2\.99\d to 3\.00\d", text)
    assert ('stroke-width="7"' in page) == made.is_trustworthy  # the interval drawn on the range
    with (made.folder / "compare" / "parameters.csv").open(encoding="utf-8") as stream:
        ends = {bool(row["lower"]) for row in csv.DictReader(stream) if row["method"] == "posterior"}
    assert ends == {made.is_trustworthy}
    words = {verdict.word for verdict in made.result.posterior.verdicts.values()}
    assert made.result.posterior.form == ("samples" if made.is_trustworthy else "laplace")  # samples take minutes
    assert (words == {"not trustworthy"}) != made.is_trustworthy


def test_a_result_that_is_not_trustworthy_is_marked_in_python(made):
    result = made.result
    assert result.is_trustworthy == made.is_trustworthy
    for shown in (repr(result), str(result), repr(result.posterior), repr(result.frf)):
        assert (WARNING in shown) != made.is_trustworthy
    assert repr(result).startswith("<Identification: sdof, measured.uff, posterior: ")
    assert result.warning == ("" if made.is_trustworthy else WARNING)
    assert (dovetail.plot_frf(result).get_suptitle() == WARNING) != made.is_trustworthy


@pytest.mark.parametrize("predict", [dovetail.predict, dovetail.predict_band])
def test_a_prediction_in_python_warns(made, predict):
    heavier = dovetail.load(made.folder / "heavier.yaml")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        done = predict(heavier, made.result)
    assert [(str(warning.message), warning.filename) for warning in caught] == (
        [] if made.is_trustworthy else [(f"predicted from measured.uff: {WARNING}", __file__)]
    )
    assert (WARNING in repr(done)) != made.is_trustworthy


def test_a_result_without_a_misfit_carries_no_warning(made):
    genuine = replace(made.result, adequacy=None)
    assert genuine.frf.note == genuine.posterior.warning == ""
    assert "not trustworthy" not in {verdict.word for verdict in genuine.posterior.verdicts.values()}


def test_a_calibration_counts_the_results_that_are_not_trustworthy(run, sdof, assemblies, tmp_path, monkeypatch):
    done = dovetail_bench.calibrate(sdof, cases=2, samples=50, workers=1)
    assert done.is_trustworthy.all()
    monkeypatch.setattr(
        dovetail_bench, "calibrate", lambda *_, **__: replace(done, is_trustworthy=np.array([True, False]))
    )
    printed = run("calibrate", assemblies / "sdof.yaml", "--cases", 2, "-o", tmp_path / "out")
    said = "Results that are not trustworthy: 1; they count like the others."
    assert said in " ".join(printed.stdout.split())
    assert said in (tmp_path / "out" / "calibration.md").read_text()
    assert json.loads((tmp_path / "out" / "calibration.json").read_text())["not_trustworthy"] == 1
    with (tmp_path / "out" / "cases.csv").open() as stream:
        next(stream)
        assert [row["is_trustworthy"] for row in csv.DictReader(stream)] == ["True", "False"]
