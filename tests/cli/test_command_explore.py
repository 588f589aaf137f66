"""`dovetail explore`: an address that answers, an end by Ctrl-C, and what it refuses."""

from __future__ import annotations

import signal
import socket
import sys
import urllib.request
from pathlib import Path

import pytest

from support.waiting import PATIENCE, wait_until


def test_it_serves_a_page_until_ctrl_c(interruptible, assemblies, bench):
    process = interruptible("explore", bench.description, bench.measured, "--no-browser")
    address = process.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(address, timeout=PATIENCE) as answer:
        assert "small: explorer" in answer.read().decode()
    process.send_signal(signal.SIGINT)
    _, notes = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert notes.splitlines()[-1] == "Ended."


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands for the browser")
def test_the_command_line_of_the_browser_does_not_hold_the_secret(interruptible, environment, bench, tmp_path):
    browser = tmp_path / "browser"
    browser.write_text(
        f'#!/bin/sh\necho "$@" > {tmp_path}/new && cat "${{1#file://}}" > {tmp_path}/page\n'
        f"mv {tmp_path}/new {tmp_path}/line\n"
    )
    browser.chmod(0o700)
    environment["BROWSER"] = str(browser)
    process = interruptible("explore", bench.description)
    address = process.stdout.readline().strip()
    wait_until((tmp_path / "line").exists, process)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE)
    assert address in (tmp_path / "page").read_text()
    secret = address.rstrip("/").rpartition("/")[2]
    assert secret not in (tmp_path / "line").read_text()
    assert not Path((tmp_path / "line").read_text().strip().removeprefix("file://")).exists()


def test_a_port_that_is_taken_is_explained(run, assemblies):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        reported = run("explore", assemblies / "sdof.yaml", "--no-browser", "--port", port, code=1).output
    assert f"--port {port}" in reported
    assert "this port cannot be had" in reported


def test_measurements_that_do_not_fit_are_refused_at_once(run, assemblies, bench):
    reported = run("explore", assemblies / "sdof.yaml", bench.measured, bench.measured, "--no-browser", code=1).output
    assert "2 measured FRFs were given" in " ".join(reported.split())
