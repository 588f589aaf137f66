"""Report and explorer in headless Chromium: no network requests, no errors, charts that respond, accessibility.

Without Chromium these tests are skipped. axe-core lies in `vendor/`, MPL-2.0, for these tests alone.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

import dovetail
import dovetail_bench
from dovetail.report.batch import write_batch
from dovetail.report.explorer import Explorer
from dovetail.report.page_server import PageServer
from dovetail_bench.pages.calibration import write_calibration
from dovetail_bench.pages.comparison import write_comparison
from dovetail_bench.pages.validation import write_validation
from support.waiting import PATIENCE

pytest.importorskip("fcntl", reason="the browser is reached over pipes, as POSIX has them")
from chromium import Browser, Page, find_chromium

CHROMIUM = find_chromium()
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine")

AXE = Path(__file__).parent / "vendor" / "axe.min.js"
SIZES = [(390, "light"), (390, "dark"), (768, "dark"), (1440, "light"), (1440, "dark")]
READY = "document.documentElement.dataset.ready === 'true'"
CHART = "DovetailCharts.charts[DovetailCharts.charts.length - 1]"
TRUE = {"k": 3e6, "c": 40.0}


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    assert CHROMIUM is not None
    started = Browser(CHROMIUM, tmp_path_factory.mktemp("profile"))
    yield started
    started.close()


@pytest.fixture(scope="module")
def server(assemblies: Path) -> Iterator[PageServer]:
    assembly = dovetail.load(assemblies / "sdof.yaml")
    explorer = Explorer(assembly, [dovetail.noisy_frf(assembly.simulate(TRUE), 1e-3, 0)])
    with PageServer(explorer) as serving:
        serving.service_actions = lambda: None  # type: ignore[method-assign]  # pages come and go
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        yield serving
        serving.shutdown()


@pytest.fixture(scope="module")
def report(assemblies: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of a report of two parameters that trade with each other."""
    assembly = dovetail.load(assemblies / "sdof.yaml")
    measured = dovetail.noisy_frf(assembly.simulate(TRUE), 0.01, 0)
    result = dovetail.identify(assembly, measured, form="laplace", cause_seconds=0.0)
    assert result.posterior is not None
    theta = np.random.default_rng(0).multivariate_normal([3e6, 40.0], [[1e10, 9e5], [9e5, 100.0]], 400)
    result = replace(result, posterior=replace(result.posterior, theta=theta, fraction=assembly.to_unit(theta)))
    file = tmp_path_factory.mktemp("report") / "report.html"
    return dovetail.write_report(result, file, assembly=assembly).as_uri()


CASES = """\
dovetail_series: 1
name: Two springs
covariates: {k: N/m}
tests:
  soft: {assembly: sdof.yaml, measured: soft.csv, joint: {assembly: sdof.yaml, measured: soft.csv}, at: {k: 1}}
  stiff: {assembly: sdof.yaml, measured: stiff.csv, joint: {assembly: sdof.yaml, measured: stiff.csv}, at: {k: 4}}
"""


@pytest.fixture(scope="module")
def evaluated(assemblies: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The addresses of a comparison and of a validation of two cases, of their batch and of a calibration."""
    folder = tmp_path_factory.mktemp("cases")
    (folder / "sdof.yaml").write_bytes((assemblies / "sdof.yaml").read_bytes())
    (folder / "cases.yaml").write_text(CASES)
    assembly = dovetail.load(folder / "sdof.yaml")
    for name, k in (("soft", 1e6), ("stiff", 4e6)):
        dovetail.write_frf(dovetail.noisy_frf(assembly.simulate({"k": k}), 1e-2, 0), folder / f"{name}.csv")
    cases = dovetail_bench.read_cases(folder / "cases.yaml")
    compared = write_comparison(dovetail_bench.compare(cases, ("refined", "posterior")), folder / "comparison.html")
    validated = write_validation(dovetail_bench.validate(cases), folder / "validation.html")
    measured = [folder / "soft.csv", folder / "stiff.csv"]
    batch = dovetail.identify_many(assembly, measured, form="laplace", cause_seconds=0.0, processes=1)
    calibration = dovetail_bench.calibrate(assembly, cases=2, samples=30, workers=1)
    pages = {
        "comparison": compared,
        "validation": validated,
        "batch": write_batch(batch, folder / "batch.html", "sdof", {"soft.csv": "soft.html"}),
        "calibration": write_calibration(calibration, folder / "calibration.html", "sdof"),
    }
    return {kind: page.as_uri() for kind, page in pages.items()}


def serious_faults(page: Page) -> list[str]:
    """What axe-core finds that keeps somebody out."""
    page.evaluate(AXE.read_text(encoding="utf-8") + "; 0")
    found = page.evaluate(
        "axe.run(document, {resultTypes: ['violations']}).then(r => r.violations.map(v => [v.impact, v.id, "
        "v.nodes.map(n => n.html.slice(0, 120) + ' ' + n.failureSummary)].flat().join(' | ')))"
    )
    return [fault for fault in found if fault.startswith(("serious", "critical"))]


def overflow(page: Page) -> int:
    """By how many pixels the page is wider than its window."""
    width: int = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
    return width


@pytest.mark.parametrize(("width", "scheme"), SIZES)
def test_the_report_reads_well(browser: Browser, report: str, width: int, scheme: str) -> None:
    with browser.page(report, width, 900, scheme) as page:
        page.wait_for("document.querySelectorAll('canvas').length === 3")
        assert page.errors() == []
        assert page.requests() == [report]
        assert overflow(page) <= 0
        assert page.evaluate("document.querySelectorAll('svg.pairs path:not(.tick)').length") == 1
        assert page.evaluate("document.querySelectorAll('.mode polyline[points]').length") == 1
        assert serious_faults(page) == []


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize(("width", "scheme"), SIZES)
@pytest.mark.parametrize(("kind", "panels", "curves"), [("comparison", 3, 3), ("validation", 2, 3)])
def test_reports_of_several_cases_read_well(
    browser: Browser, evaluated: dict[str, str], kind: str, panels: int, curves: int, width: int, scheme: str
) -> None:
    with browser.page(evaluated[kind], width, 900, scheme) as page:
        page.wait_for(f"document.querySelectorAll('canvas').length === {2 * panels}")
        assert page.errors() == []
        assert page.requests() == [evaluated[kind]]
        assert overflow(page) <= 0
        assert page.evaluate("document.querySelectorAll('.chart')[1].querySelectorAll('.key').length") == curves
        assert serious_faults(page) == []


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize(("width", "scheme"), SIZES)
@pytest.mark.parametrize(("kind", "drawings"), [("batch", 4), ("calibration", 2)])
def test_pages_without_charts_read_well(
    browser: Browser, evaluated: dict[str, str], kind: str, drawings: int, width: int, scheme: str
) -> None:
    with browser.page(evaluated[kind], width, 900, scheme) as page:
        assert page.errors() == []
        assert page.requests() == [evaluated[kind]]
        assert overflow(page) <= 0
        assert page.evaluate("document.querySelectorAll('section svg').length") == drawings
        assert serious_faults(page) == []


@pytest.mark.parametrize(("width", "scheme"), SIZES)
def test_the_explorer_reads_well(browser: Browser, server: PageServer, width: int, scheme: str) -> None:
    with browser.page(server.address, width, 900, scheme) as page:
        page.wait_for(READY)
        assert page.errors() == []
        assert {urlsplit(url).netloc for url in page.requests()} == {server.hosts[0]}
        assert overflow(page) <= 0
        assert serious_faults(page) == []


def test_zoom_and_cursor_are_linked_in_the_report(browser: Browser, report: str) -> None:
    with browser.page(report) as page:
        page.wait_for("document.querySelectorAll('canvas').length === 3")
        page.evaluate("document.querySelector('.chart').scrollIntoView(); 0")
        box = page.box(".u-over")
        middle = box["y"] + box["height"] / 2
        page.drag((box["x"] + 0.4 * box["width"], middle), (box["x"] + 0.6 * box["width"], middle))
        page.wait_for(f"{CHART}.range[0] > 100")
        low, high = page.evaluate(f"{CHART}.range")
        assert (low, high) == (pytest.approx(0.4 * 599 + 1, abs=5), pytest.approx(0.6 * 599 + 1, abs=5))
        assert page.evaluate(f"{CHART}.plots.map(p => [p.scales.x.min, p.scales.x.max])") == [[low, high]] * 3
        page.mouse("mouseMoved", box["x"] + 0.5 * box["width"], middle)
        lines = page.evaluate(f"{CHART}.plots.map(p => p.cursor.idx)")
        assert len(set(lines)) == 1
        frequency = page.evaluate(f"{CHART}.frequency[{lines[0]}]")
        assert page.evaluate("document.querySelector('.chart-readout').textContent").startswith(f"{frequency:.6g}"[:3])


def test_the_keyboard_moves_and_zooms_the_chart(browser: Browser, report: str) -> None:
    with browser.page(report) as page:
        page.wait_for("document.querySelectorAll('canvas').length === 3")
        page.evaluate("document.querySelector('.chart-panels').focus(); 0")
        page.key("n")
        readout = "document.querySelector('.chart-readout').textContent"
        page.wait_for(f"{readout}.startsWith('276')")
        page.key("ArrowRight")
        page.wait_for(f"{readout}.startsWith('277')")
        page.key("+")
        page.wait_for(f"{CHART}.range[0] > 100")
        page.key("0")
        page.wait_for(f"{CHART}.range[0] === 1 && {CHART}.range[1] === 600")
        page.key("l")
        page.wait_for(f"{CHART}.plots[0].scales.x.distr === 3")
        page.evaluate("document.querySelector('.chart-values summary').click(); 0")
        page.wait_for("document.querySelectorAll('.chart-table tbody tr').length > 20")
        cells = page.evaluate("[...document.querySelectorAll('.chart-table th')].map(cell => cell.textContent)")
        assert cells[0] == "Frequency [Hz]"
        assert len(cells) == 6
        assert page.errors() == []


def test_the_report_prints(browser: Browser, report: str, tmp_path: Path) -> None:
    with browser.page(report, scheme="dark") as page:
        page.wait_for("document.querySelectorAll('canvas').length === 3")
        assert page.pdf(tmp_path / "report.pdf") <= 2
        assert page.errors() == []
        page.wait_for("!document.documentElement.classList.contains('printing')")


@pytest.mark.parametrize("width", [390, 1440])
def test_the_misfit_stays_in_view_while_a_slider_moves(browser: Browser, assemblies: Path, width: int) -> None:
    assembly = dovetail.load(assemblies / "bt40_er32_quick.yaml")
    with PageServer(Explorer(assembly, [assembly.simulate(None)])) as serving:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        with browser.page(serving.address, width, 844) as page:
            page.wait_for(READY)
            page.evaluate("document.querySelector('#parameters').lastChild.scrollIntoView({block: 'end'}); 0")
            misfit, chart = page.box("#misfit"), page.box("#chart")
            assert 0 <= misfit["top"] < misfit["bottom"] <= chart["top"]
            box = page.box(".parameter:last-child input[type=range]")
            assert chart["top"] < 844
            page.drag((box["x"] + 0.5 * box["width"], box["y"] + 9), (box["x"] + 0.9 * box["width"], box["y"] + 9))
            page.wait_for("document.querySelector('#misfit dd').textContent !== '0.00 dB'")
            assert page.box("#misfit")["top"] == misfit["top"]
            assert page.errors() == []


def test_sliders_move_the_curve(browser: Browser, server: PageServer, assemblies: Path) -> None:
    assembly = dovetail.load(assemblies / "sdof.yaml")
    with browser.page(server.address) as page:
        page.wait_for(READY)
        peak = f"{CHART}.frequency[{CHART}.curves[1].amplitude.indexOf(Math.max(...{CHART}.curves[1].amplitude))]"
        before = page.evaluate(peak)
        box = page.box("input[type=range]")
        y = box["y"] + box["height"] / 2
        page.drag((box["x"] + 0.5 * box["width"], y), (box["x"] + 0.2 * box["width"], y))
        page.wait_for("performance.getEntriesByName('input to curve').length > 0")
        page.wait_for(f"{peak} < {before} - 50")
        value = page.evaluate("Number(document.querySelector('input[type=number]').value)") * 1e6
        natural = f"{assembly.natural_frequencies({'k': value}, 1)[0]:.1f}"[:-2]
        page.wait_for(f"document.querySelector('#natural dd')?.textContent.startsWith('{natural}')")
        page.evaluate("document.getElementById('undo').click(); 0")
        page.wait_for(f"{peak} === {before}")
        page.evaluate("document.getElementById('redo').click(); 0")
        page.wait_for(f"{peak} < {before} - 50")
        assert page.errors() == []


def test_the_file_that_the_browser_is_given_leads_to_the_page(browser: Browser, server: PageServer) -> None:
    with server.redirect_file() as file, browser.page(file.as_uri()) as page:
        page.wait_for(f"location.href === '{server.address}'")
        page.wait_for(READY)
        assert page.errors() == []


def test_mode_shapes_swing_until_they_are_held(browser: Browser, assemblies: Path) -> None:
    explorer = Explorer(dovetail.load(assemblies / "bt40_er32_quick.yaml"))
    with PageServer(explorer) as serving:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        with browser.page(serving.address) as page:
            page.wait_for(READY)
            page.wait_for("document.querySelectorAll('.mode polyline').length === 6")
            points = "document.querySelector('.mode polyline').getAttribute('points')"
            first = page.evaluate(points)
            page.wait_for(f"{points} !== '{first}'")
            page.evaluate("document.querySelector('#modes button').click(); 0")
            held = page.evaluate(points)
            assert page.evaluate(f"new Promise(go => setTimeout(() => go({points}), 150))") == held


def test_mode_shapes_in_space_turn_by_keys_and_by_hand(browser: Browser) -> None:
    bar = {"length": 0.2, "width": 0.02, "height": 0.01, "elements": 2}
    beam = {"model": "spatial_beam", "material": {"young": 210e9, "density": 7850.0}, "sections": [bar]}
    ends = {"a": {"to": "beam", "at": 0.0}, "b": {"to": "ground", "at": 0.0}}
    known = {f"{letter}_{each}": {"value": 1e3} for letter in "kc" for each in ("x", "y", "z", "rx", "ry")}
    assembly = {
        "dovetail": 1,
        "name": "beam",
        "frequency": {"start": 10.0, "stop": 2000.0, "lines": 100},
        "substructures": {"beam": {**beam, "place": {"along": "z"}}, "ground": {"model": "ground"}},
        "joints": {"foot": {"model": "bushing", "connect": ends, "parameters": known}},
        "response": {"at": "beam", "position": 0.2},
    }
    with PageServer(Explorer(dovetail.load(assembly))) as serving:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        with browser.page(serving.address) as page:
            page.wait_for(READY)
            page.wait_for("document.querySelectorAll('.mode path').length > 0")
            page.evaluate("document.querySelector('#modes button').click(); 0")
            shape = "document.querySelector('.mode path').getAttribute('d')"
            held = page.evaluate(shape)
            page.evaluate("document.querySelector('.mode svg').focus(); 0")
            page.key("ArrowRight")
            page.wait_for(f"{shape} !== '{held}'")
            page.key("ArrowLeft")
            page.wait_for(f"{shape} === '{held}'")
            box = page.box(".mode svg")
            middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
            page.drag(middle, (middle[0] + 40, middle[1] + 20))
            page.wait_for(f"{shape} !== '{held}'")
            assert page.errors() == []


@pytest.mark.parametrize("width", [390, 1440])
def test_long_names_of_responses_in_space_do_not_widen_the_page(browser: Browser, width: int) -> None:
    bar = {"length": 0.2, "width": 0.02, "height": 0.01, "elements": 2}
    beam = {"model": "spatial_beam", "material": {"young": 210e9, "density": 7850.0}, "sections": [bar]}
    force = {"position": 0.1, "direction": [1, 2, 3]}
    assembly = {
        "dovetail": 1,
        "name": "beam",
        "frequency": {"start": 10.0, "stop": 2000.0, "lines": 100},
        "substructures": {"a_beam_with_a_very_long_name_indeed": {**beam, "place": {}}, "ground": {"model": "ground"}},
        "joints": {"foot": {"model": "bushing", "connect": {}}},
        "responses": [
            {"at": "a_beam_with_a_very_long_name_indeed", "position": 0.2, "direction": each, "force": force}
            for each in ("x", "z")
        ],
    }
    ends = {"a": {"to": "a_beam_with_a_very_long_name_indeed", "at": 0.0}, "b": {"to": "ground", "at": 0.0}}
    assembly["joints"]["foot"]["connect"] = ends
    loaded = dovetail.load(assembly)
    assert loaded.description.response_labels[0].startswith("a_beam_with_a_very_long_name_indeed, 200 mm, x, force at")
    with PageServer(Explorer(loaded)) as serving:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        with browser.page(serving.address, width) as page:
            page.wait_for(READY)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.errors() == []


def test_fit_from_here_shows_intervals_and_keeps_what_is_locked(browser: Browser, server: PageServer) -> None:
    with browser.page(server.address) as page:
        page.wait_for(READY)
        page.evaluate("field = document.getElementById('parameter-1'); field.value = 40; 0")
        page.evaluate("field.dispatchEvent(new Event('change')); 0")
        page.evaluate("document.querySelectorAll('.lock input')[1].click(); document.getElementById('fit').click(); 0")
        page.wait_for("document.querySelectorAll('.interval:not([hidden])').length === 1")
        page.wait_for("!document.getElementById('fit').disabled")
        fields = page.evaluate("[...document.querySelectorAll('input[type=number]')].map(field => Number(field.value))")
        assert fields == [pytest.approx(3.0, rel=0.02), 40.0]
        assert page.evaluate("document.querySelectorAll('input[type=range]')[1].disabled")
        assert "90 %" in page.evaluate("document.querySelector('.about').textContent")
        assert page.errors() == []


def test_the_page_says_when_the_program_has_ended(browser: Browser, assemblies: Path) -> None:
    serving = PageServer(Explorer(dovetail.load(assemblies / "sdof.yaml")))
    thread = threading.Thread(target=serving.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    with browser.page(serving.address) as page:
        page.wait_for(READY)
        assert page.evaluate("document.getElementById('fit').disabled")
    thread.join(timeout=PATIENCE)  # the page was closed
    assert not thread.is_alive()
    serving.server_close()
