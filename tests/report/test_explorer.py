"""The explorer without a browser: what it computes and saves, and which requests its server answers."""

from __future__ import annotations

import base64
import http.client
import json
import os
import stat
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import dovetail
from dovetail.errors import DovetailError
from dovetail.inference.fitting import refine
from dovetail.report.explorer import Explorer
from dovetail.report.page_server import PageServer
from support.waiting import PATIENCE

TRUE = {"k": 3e6, "c": 40.0}


@pytest.fixture(scope="module")
def explorer(assemblies: Path) -> Explorer:
    assembly = dovetail.load(assemblies / "sdof.yaml")
    return Explorer(assembly, [dovetail.noisy_frf(assembly.simulate(TRUE), 1e-4, 0)])


@pytest.fixture(scope="module")
def server(explorer: Explorer) -> Iterator[PageServer]:
    with PageServer(explorer) as serving:
        thread = threading.Thread(target=serving.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        thread.start()
        yield serving
        serving.shutdown()
        thread.join(timeout=PATIENCE)


def ask(server: PageServer, path: str, body: Any = None, /, **headers: str) -> tuple[int, bytes, dict[str, str]]:
    """Ask as the page does, but for what the headers say; None leaves a header out."""
    host, port = server.server_address[:2]
    connection = http.client.HTTPConnection(str(host), int(port), timeout=PATIENCE)
    usual: dict[str, str | None] = {"Host": server.hosts[0]}
    if body is not None:
        usual |= {"Origin": f"http://{server.hosts[0]}", "Content-Type": "application/json"}
    given = usual | {name.replace("_", "-"): value for name, value in headers.items()}
    content = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
    connection.putrequest("GET" if body is None else "POST", path, skip_host=True)
    for name, value in given.items():
        if value is not None:
            connection.putheader(name, value)
    if content is not None and "Content-Length" not in given:
        connection.putheader("Content-Length", str(len(content)))
    connection.endheaders(content)
    answer = connection.getresponse()
    reported = answer.status, answer.read(), dict(answer.getheaders())
    connection.close()
    return reported


def unpacked(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4")


def test_the_curve_is_the_assemblys_frf(explorer: Explorer, assemblies: Path) -> None:
    frf = dovetail.load(assemblies / "sdof.yaml").frf(TRUE)
    answer = explorer.frfs([3e6, 40.0], 0)
    assert unpacked(answer["amplitude"]) == pytest.approx(np.abs(frf), rel=1e-6)
    assert unpacked(answer["phase"]) == pytest.approx(np.rad2deg(np.angle(frf)), rel=1e-5, abs=1e-4)
    assert explorer.modes([3e6, 40.0])["natural"] == [pytest.approx(275.66, abs=0.01)]


def test_the_misfit_is_least_at_the_truth(explorer: Explorer) -> None:
    there, away = explorer.frfs([3e6, 40.0], 0), explorer.frfs([4e6, 40.0], 0)
    assert 2.0 * there["misfit"] < away["misfit"]
    assert there["coherence"] > 0.99 > away["coherence"]
    assert there["noises"] == pytest.approx(1.0, abs=0.1)
    assert np.sqrt(np.mean(unpacked(away["residual"]) ** 2)) == pytest.approx(away["noises"], rel=1e-5)
    assert away["noises"] > 10.0


def test_a_fit_from_elsewhere_finds_the_truth_with_intervals(explorer: Explorer) -> None:
    answer = explorer.fit([5e6, 10.0], [])
    assert answer["values"] == pytest.approx([3e6, 40.0], rel=0.02)
    assert all(low <= TRUE[name] <= high for name, (low, high) in answer["intervals"].items())
    assert answer["mark"] == "good"
    assert answer["verdicts"] == {"k": "identified", "c": "identified"}
    assert answer["marks"] == {"k": "good", "c": "good"}
    assert answer["outside"] == []
    assert answer["explanation"] == ""
    saved = json.loads(explorer.saved("json", answer["values"], answer["fit"]))
    assert saved["method"] == "posterior"
    assert saved["provenance"]["start"] == {"k": 5e6, "c": 10.0}
    report = explorer.saved("html", answer["values"], answer["fit"]).decode()
    assert "from the accelerance" in report
    assert "start={&#39;k&#39;: 5000000.0" in report


def test_a_locked_parameter_keeps_its_value(explorer: Explorer) -> None:
    answer = explorer.fit([4e6, 40.0], ["c"])
    assert answer["values"][1] == 40.0
    assert set(answer["intervals"]) == {"k"}
    assert answer["values"][0] == pytest.approx(3e6, rel=0.02)
    with pytest.raises(DovetailError, match="nothing to identify"):
        explorer.fit([3e6, 60.0], ["k", "c"])


def test_each_page_saves_its_own_fit(explorer: Explorer) -> None:
    here = explorer.fit([5e6, 10.0], [])
    elsewhere = explorer.fit([4e6, 20.0], ["c"])  # of another tab, which is the latest one
    saved = json.loads(explorer.saved("json", here["values"], here["fit"]))
    assert saved["provenance"]["start"] == {"k": 5e6, "c": 10.0}
    with pytest.raises(DovetailError, match="not those of the fit that the page shows"):
        explorer.saved("json", here["values"], elsewhere["fit"])
    with pytest.raises(DovetailError, match="no longer kept"):
        explorer.saved("html", here["values"], "gone")


def test_a_fitted_value_outside_its_range_is_saved_as_its_slider_shows_it(assemblies: Path, tmp_path: Path) -> None:
    (tmp_path / "narrow.yaml").write_text(
        f"extends: {assemblies / 'sdof.yaml'}\njoints: {{mount: {{parameters: {{k: {{range: [1e6, 2.9e6]}}}}}}}}\n"
    )
    assembly = dovetail.load(assemblies / "sdof.yaml")
    narrow = Explorer(dovetail.load(tmp_path / "narrow.yaml"), [dovetail.noisy_frf(assembly.simulate(TRUE), 1e-4, 0)])
    answer = narrow.fit([2e6, 40.0], [])
    shown = [min(answer["values"][0], 2.9e6), answer["values"][1]]
    assert json.loads(narrow.saved("json", shown, answer["fit"]))["parameters"]["k"]["value"] == answer["values"][0]


def test_a_fit_by_hand_is_saved_as_a_result(explorer: Explorer, tmp_path: Path) -> None:
    described = tmp_path / "saved.yaml"
    described.write_bytes(explorer.saved("yaml", [2e6, 30.0]))
    joint = yaml.safe_load(described.read_text())["joints"]["mount"]["parameters"]
    assert joint == {"k": {"value": "2000000 N/m"}, "c": {"value": "30 N s/m"}}
    again = dovetail.load(described)
    assert not again.parameters
    assert np.abs(again.frf()) == pytest.approx(unpacked(explorer.frfs([2e6, 30.0], 0)["amplitude"]), rel=1e-6)
    assert json.loads(explorer.saved("json", [2e6, 30.0]))["parameters"]["k"] == {"value": 2e6, "unit": "N/m"}
    assert "by the method “by hand”" in explorer.saved("html", [2e6, 30.0]).decode()


def test_every_kind_of_parameter_is_saved(tmp_path: Path, assemblies: Path) -> None:
    text = (assemblies / "sdof.yaml").read_text()
    text = text.replace("masses: [{mass: 1 kg}]", "masses: [{mass: {range: [0.8 kg, 1.2 kg]}}]")
    text = text.replace("quantity: accelerance}", "quantity: accelerance, calibration: {gain: {range: [0.9, 1.1]}}}")
    (tmp_path / "unknown.yaml").write_text(text)
    assembly = dovetail.load(tmp_path / "unknown.yaml")
    values = [parameter.lower + 0.3 * (parameter.upper - parameter.lower) for parameter in assembly.parameters]
    assert len(values) == 4
    (tmp_path / "saved.yaml").write_bytes(Explorer(assembly).saved("yaml", values))
    assert dovetail.load(tmp_path / "saved.yaml").frf() == pytest.approx(assembly.frf(values), rel=1e-6)


def test_without_a_measurement_there_is_neither_fit_nor_report(assemblies: Path) -> None:
    alone = Explorer(dovetail.load(assemblies / "sdof.yaml"))
    assert [curve["role"] for curve in alone.start()["charts"][0]["curves"]] == ["model"]
    with pytest.raises(DovetailError, match="no measured FRF to fit to"):
        alone.fit([3e6, 40.0], [])
    with pytest.raises(DovetailError, match="no measured FRF to report on"):
        alone.saved("html", [3e6, 40.0])


def test_an_assembly_without_parameters_is_refused(assemblies: Path, tmp_path: Path) -> None:
    (tmp_path / "known.yaml").write_text(
        f"extends: {assemblies / 'sdof.yaml'}\nname: known\n"
        "joints: {mount: {parameters: {k: {value: 1e6 N/m}, c: {value: 30}}}}\n"
    )
    with pytest.raises(DovetailError, match="nothing to explore"):
        Explorer(dovetail.load(tmp_path / "known.yaml"))


def test_the_server_answers_with_the_page_and_its_values(server: PageServer) -> None:
    token = f"/{server.token}/"
    status, page, headers = ask(server, token)
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert b"<script>" not in page
    assert b"style=" not in page
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'")
    assert "unsafe" not in policy
    for name in ("uPlot.js", "uPlot.css", "charts.js", "charts.css", "explore.js", "explore.css", "start"):
        assert ask(server, token + name)[0] == 200
    assert ask(server, token + "../page_server.py")[0] == 404
    status, body, _ = ask(server, f"{token}frf", {"values": [3e6, 40.0]})
    assert status == 200
    assert set(json.loads(body)) == {"amplitude", "phase", "coherence", "misfit", "residual", "noises"}


@pytest.mark.parametrize(
    ("path", "body", "headers"),
    [
        ("", None, {"Host": "evil.example"}),
        ("", None, {"Host": "127.0.0.1:1"}),
        ("", None, {"Host": None}),
        ("", None, {"Origin": "https://evil.example"}),
        ("", None, {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "no-cors"}),
        ("start", None, {"Sec_Fetch_Site": "cross-site"}),
        ("start", None, {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "navigate"}),
        ("frf", {"values": [3e6, 40.0]}, {"Origin": "https://evil.example"}),
        ("frf", {"values": [3e6, 40.0]}, {"Origin": None}),
        ("frf", {"values": [3e6, 40.0]}, {"Origin": "null"}),
        ("frf", {"values": [3e6, 40.0]}, {"Host": "evil.example", "Origin": "http://evil.example"}),
        ("fit", {"values": [3e6, 40.0]}, {"Sec_Fetch_Site": "same-site"}),
    ],
)
def test_requests_from_another_site_are_refused(
    server: PageServer, path: str, body: Any, headers: dict[str, Any]
) -> None:
    status, content, _ = ask(server, f"/{server.token}/{path}", body, **headers)
    assert (status, content) == (403, b"Forbidden\n")


@pytest.mark.parametrize("path", ["/", "/start", "//start", "/wrong/start", "/%00/start"])
def test_a_request_without_the_token_is_refused(server: PageServer, path: str) -> None:
    assert ask(server, path)[0] == 403
    assert ask(server, path, {"values": [3e6, 40.0]})[0] == 403


def test_the_file_that_leads_to_the_page_is_for_this_user_alone(server: PageServer) -> None:
    with server.redirect_file() as file:
        assert server.address in file.read_text()
        if os.name == "posix":
            assert stat.S_IMODE(file.stat().st_mode) == 0o600
            assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700
    assert not file.parent.exists()
    navigation = {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "navigate"}  # from a file, as browsers state it
    assert ask(server, f"/{server.token}/", None, **navigation)[0] == 200


def test_only_this_machine_is_served(server: PageServer) -> None:
    assert server.server_address[0] == "127.0.0.1"
    assert len(server.token) >= 32


@pytest.mark.parametrize(
    ("path", "body", "headers", "status"),
    [
        ("frf", b"[1, 2", {}, 400),
        ("frf", b"[" * 50_000, {}, 400),
        ("frf", [1, 2], {}, 400),
        ("frf", {}, {}, 400),
        ("frf", {"values": [3e6, 40.0]}, {"Content_Type": "text/plain"}, 400),
        ("frf", {"values": [3e6, 40.0]}, {"Content_Length": "1000000000"}, 400),
        ("frf", {"values": [3e6, 40.0], "response": 7}, {}, 422),
        ("frf", {"values": [3e6]}, {}, 422),
        ("frf", {"values": ["3e6", "import os"]}, {}, 422),
        ("frf", {"values": [float("nan"), 40.0]}, {}, 422),
        ("fit", {"values": [3e6, 40.0], "locked": ["k", "c"]}, {}, 422),
        ("save", {"values": [3e6, 40.0], "kind": "../../etc/passwd"}, {}, 400),
        ("save", {"values": [3e6, 40.0], "kind": "json", "fit": True}, {}, 400),
        ("save", {"values": [3e6, 40.0], "kind": "json", "fit": "no such fit"}, {}, 422),
        ("nothing", {}, {}, 404),
    ],
)
def test_odd_requests_get_one_answer(
    server: PageServer, path: str, body: Any, headers: dict[str, str], status: int
) -> None:
    reported, content, _ = ask(server, f"/{server.token}/{path}", body, **headers)
    assert reported == status
    assert b"Traceback" not in content
    if status == 422:
        assert json.loads(content)["error"]


def test_it_ends_when_the_last_page_is_closed(explorer: Explorer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dovetail.report.page_server._PATIENCE", 0.3)
    monkeypatch.setattr("dovetail.report.page_server._BEAT", 0.05)
    with PageServer(explorer) as serving:
        thread = threading.Thread(target=serving.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        thread.start()
        connection = http.client.HTTPConnection(*serving.server_address[:2], timeout=PATIENCE)
        connection.request("GET", f"/{serving.token}/alive", headers={"Host": serving.hosts[0]})
        line = connection.getresponse()
        assert line.readline() == b'data: ""\n'
        time.sleep(0.8)
        assert thread.is_alive()
        line.close()
        connection.close()
        thread.join(timeout=PATIENCE)
        assert not thread.is_alive()


def test_a_given_start_is_one_of_the_starts_of_the_fit(assemblies: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assembly = dovetail.load(assemblies / "sdof.yaml")
    measured = dovetail.noisy_frf(assembly.simulate(TRUE), 1e-3, 0)
    taken: list[Any] = []

    def recorded(*arguments: Any, **options: Any) -> Any:
        taken.append(arguments[1])
        return refine(*arguments, **options)

    monkeypatch.setattr(dovetail, "refine", recorded)
    for options in ({}, {"start": {"k": 3.1e6, "c": 41.0}}):
        dovetail.identify(assembly, measured, "refined", cause_seconds=0.0, **options)
    assert taken[0] == ()
    assert [start.tolist() for start in taken[1]] == [[3.1e6, 41.0]]
    with pytest.raises(DovetailError, match="no such parameter"):
        dovetail.identify(assembly, measured, "refined", start={"q": 1.0})
