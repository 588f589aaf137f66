"""Whatever a misfit is said to be, terminal, report, chart, tables and JSON say the same of it.

Random chains of masses, identified with a chain that lacks some of them and has other masses.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from html import unescape
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail.frf import LOW_COHERENCE, poor_bands
from dovetail.inference.adequacy.resonances import lacking_resonances
from dovetail.report.batch import write_batch
from dovetail.report.result_files import write_results
from support.short_search import one_batch

identify, in_batches = (import_module(f"dovetail.cli.{name}") for name in ("identify", "batch"))

SEEDS = (1, 4, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, 2, 5, 7, 9, 11)))
BAND = {"start": 20.0, "stop": 420.0, "step": 1.0}


def chain(masses, stiffness, *, known):
    """Masses in a row on springs, from the ground; the first is driven."""
    names = [f"m{index}" for index in range(len(masses))]
    parts = {name: {"model": "lumped", "masses": [{"mass": mass}]} for name, mass in zip(names, masses, strict=True)}
    joints = {}
    for index, (name, k) in enumerate(zip(names, stiffness, strict=True)):
        below = "base" if index == 0 else names[index - 1]
        spring = {"value": k} if known else {"range": [k / 2.0, k * 2.0], "scale": "log"}
        joints[f"s{index}"] = {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": name, "at": 0}, "b": {"to": below, "at": 0}},
            "parameters": {"k": spring, "c": {"value": 8.0}},
        }
    return {
        "dovetail": 1,
        "name": "chain",
        "frequency": BAND,
        "substructures": {"base": {"model": "ground"}, **parts},
        "joints": joints,
        "response": {"at": "m0", "position": 0, "quantity": "accelerance"},
    }


def draw(seed):
    """The description with the wrong model, and the measurement, which lacks a part of the band for odd seeds."""
    random = np.random.default_rng([seed, 41])
    count = int(random.integers(3, 6))
    masses, stiffness = random.uniform(0.3, 1.5, count), 10.0 ** random.uniform(5.2, 6.3, count)
    structure = dovetail.load(chain(masses.tolist(), stiffness.tolist(), known=True))
    kept = int(random.integers(1, count))
    wrong = masses[:kept] * random.uniform(0.5, 2.0, kept)
    model = chain(wrong.tolist(), stiffness[:kept].tolist(), known=False)
    values = structure.frf()
    noise = random.standard_normal((2, values.size))
    values = values + 0.003 * values.std() * (noise[0] + 1j * noise[1])
    lines = structure.frequency < (250.0 if seed % 2 else 500.0)
    return model, dovetail.Frf(structure.frequency[lines], values[lines], "accelerance")


def printed(show):
    """What a function prints, its lines joined."""
    with contextlib.redirect_stdout(io.StringIO()) as stream:
        show()
    return " ".join(stream.getvalue().split())


@pytest.fixture(scope="module")
def short_search():
    """A single batch of searches is enough for a fit that is wrong anyway."""
    with one_batch():
        yield


@pytest.fixture(scope="module", params=SEEDS)
def misfit(request, short_search, tmp_path_factory):
    """The result of each seed, as it is written and printed, alone and in a batch."""
    folder, (model, measured) = tmp_path_factory.mktemp("misfit"), draw(request.param)
    assembly = dovetail.load(model)
    result = dovetail.identify(assembly, measured, "refined", cause_seconds=2.0)
    assert not result.is_trustworthy
    batch = dovetail.Batch({"measured.csv": result}, {})
    write_results(result, folder, None)
    page = unescape((folder / "report.html").read_text(encoding="utf-8"))
    summary = write_batch(batch, folder / "summary.html", "chain", {}).read_text(encoding="utf-8")
    return SimpleNamespace(
        result=result,
        read=dovetail.load_result(folder),
        terminal=printed(lambda: identify._print(result, None)),
        plain=json.loads((folder / "result.json").read_text()),
        page=page,
        chart=json.loads(page.split('<script type="application/json" id="chart-1">')[1].split("</script>")[0]),
        batch=printed(lambda: in_batches._print(assembly, batch)),
        summary=unescape(summary),
        is_partial=bool(request.param % 2),
    )


def hertz_after(text, words):
    """The frequencies of each sentence that goes on so."""
    found = re.findall(rf"{re.escape(words)}: ([\d., ]+) Hz", text)
    return [tuple(float(number) for number in numbers.split(", ")) for numbers in found]


def test_no_resonance_that_the_model_lacks_is_paired(misfit):
    lacking = hertz_after(misfit.terminal, "resonances that the model lacks")
    assert lacking == hertz_after(misfit.page, "resonances that the model lacks")
    assert lacking == hertz_after(" ".join(misfit.plain["adequacy"]["reasons"]), "resonances that the model lacks")
    paired = [mode["measured_peak"] for mode in misfit.plain["modes"] if mode["measured_peak"] is not None]
    for frequency in lacking[0] if lacking else ():
        assert all(abs(frequency - peak) > 5e-4 * peak for peak in paired)
    response = misfit.result.responses[0]
    assert {*paired} <= {*response.peaks.measured} - {*response.peaks.unpaired}
    error = misfit.result.adequacy.size.natural_frequency
    expected = lacking_resonances([response], error)
    assert [f"{frequency:.4g}" for frequency in expected[:5]] == [f"{one:.4g}" for one in (lacking or [()])[0]]


def test_one_mean_coherence_is_given_everywhere(misfit):
    mean = f"{misfit.result.mean_coherence:.3f}"
    assert f"{misfit.plain['mean_coherence']:.3f}" == mean
    assert f"Mean coherence of measured and reconstructed FRF: {mean}" in misfit.terminal
    assert f"have a mean coherence of <strong>{mean}</strong>" in misfit.page
    assert f'<td class="number">{mean}</td>' in misfit.summary
    assert f" {mean} " in misfit.batch
    for text in (misfit.terminal, misfit.page):
        assert set(re.findall(r"the coherence rises from (\d\.\d+)", text)) <= {mean}
    assert {cause["coherence"][0] for cause in misfit.plain["adequacy"]["causes"]} <= {misfit.plain["mean_coherence"]}
    assert float(np.mean(misfit.plain["coherence"])) == pytest.approx(misfit.plain["mean_coherence"])


def test_shaded_bands_are_those_that_the_text_calls_poor(misfit):
    bands = [tuple(band) for band in misfit.plain["poor_bands_Hz"]]
    assert [tuple(band) for band in misfit.chart["bands"]] == bands
    assert [tuple(band) for band in misfit.plain["adequacy"]["bands_Hz"]] == bands
    assert list(misfit.result.adequacy.bands) == list(misfit.read.adequacy.bands) == bands
    for text in (misfit.terminal, misfit.page):
        assert ("(coherence below 0.9) at " in text) == bool(bands)
        assert all(f"{low:.6g} to {high:.6g} Hz" in text for low, high in bands[:5])
    frequency, coherence = misfit.result.frf.frequency, misfit.result.coherence
    shaded = np.zeros(len(frequency), dtype=bool)
    for low, high in bands:
        inside = (frequency >= low) & (frequency <= high)
        assert coherence[inside].mean() < LOW_COHERENCE
        shaded |= inside
    assert coherence[~shaded].mean() > LOW_COHERENCE
    least = re.search(r"The agreement is least from (\S+) to (\S+) Hz, with a mean of (\S+?)\.?<", misfit.page)
    if least and float(least[3]) < 0.85:
        low, high = float(least[1]), float(least[2])
        assert any(below < high * 1.001 and above > low * 0.999 for below, above in bands)


def test_what_decides_comes_first_in_the_same_order(misfit):
    """Half of the measurements lack most of the band."""
    warnings = list(misfit.result.warnings)
    positions = [misfit.terminal.index(f"Note: {warning}") for warning in warnings]
    assert positions == sorted(positions)
    places = [misfit.page.index(f"<li>{warning}</li>") for warning in warnings]
    assert places == sorted(places)
    gap = "The measurement has no lines from 249 to 420 Hz"
    assert (misfit.is_partial) == (gap in " ".join(warnings))
    if misfit.is_partial:
        assert warnings[0].startswith(gap)
        assert misfit.terminal.index(gap) < misfit.terminal.index("The model does not fit")
        assert misfit.page.index(f"<li>{gap}") < misfit.page.index("<h2>The model does not fit")
        assert misfit.summary.index(gap) < misfit.summary.index("do not trust the numbers.</span>")
    lacking = misfit.terminal.find("resonances that the model lacks")
    searches = misfit.terminal.find("searches")
    assert lacking == -1 or lacking < searches


@pytest.mark.parametrize("seed", range(20))
def test_poor_bands_are_where_the_coherence_is_low(seed):
    """Of smooth curves with narrow and wide dips."""
    random = np.random.default_rng(seed)
    frequency = np.linspace(10.0, 1000.0, int(random.integers(50, 3000)))
    coherence = np.ones_like(frequency)
    for _ in range(int(random.integers(0, 5))):
        at, width, depth = random.uniform(10.0, 1000.0), random.uniform(5.0, 200.0), random.uniform(0.02, 1.0)
        coherence *= 1.0 - depth * np.exp(-(((frequency - at) / width) ** 2))
    bands = poor_bands(frequency, coherence)
    shaded = np.zeros(len(frequency), dtype=bool)
    for low, high in bands:
        inside = (frequency >= low) & (frequency <= high)
        assert coherence[inside].mean() < LOW_COHERENCE
        shaded |= inside
    missed = np.count_nonzero(~shaded & (coherence < LOW_COHERENCE))
    assert missed <= max(4, 0.01 * len(frequency)) * (len(bands) + 2)
    assert bands or coherence.min() > 0.85 or missed <= 4
