"""`dovetail explore`: an address that answers, an end by Ctrl-C, and what it refuses."""

from __future__ import annotations

import signal
import socket
import urllib.request


def test_it_serves_a_page_until_ctrl_c(interruptible, assemblies, bench):
    process = interruptible("explore", bench.description, bench.measured, "--no-browser")
    address = process.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(address, timeout=20) as answer:
        assert "small: explorer" in answer.read().decode()
    process.send_signal(signal.SIGINT)
    _, notes = process.communicate(timeout=20)
    assert process.returncode == 0
    assert notes.splitlines()[-1] == "Ended."


def test_a_port_that_is_taken_is_explained(run, assemblies):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        told = run("explore", assemblies / "sdof.yaml", "--no-browser", "--port", port, code=1).output
    assert f"--port {port}" in told
    assert "this port cannot be had" in told


def test_measurements_that_do_not_fit_are_refused_at_once(run, assemblies, bench):
    told = run("explore", assemblies / "sdof.yaml", bench.measured, bench.measured, "--no-browser", code=1).output
    assert "2 measured FRFs were given" in " ".join(told.split())
