"""Every command that writes an FRF writes the formats of plugins, and says what it cannot write."""

from __future__ import annotations

import json
from inspect import getmodule, getsource
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.cli.command_group import OWN
from dovetail.registry import CommandTable

WRITER = """\
import dovetail
import numpy as np


class Triplets(dovetail.FrfReader):
    '''Lines of frequency, real and imaginary part below a line '#triplets unit'.'''

    name = "triplets"
    summary = "Lines of three numbers"
    suffixes = (".trip",)
    written = (".trip",)

    def sniff(self, content):
        return content.startswith(b"#triplets ")

    def read(self, path, content):
        head, *lines = content.decode().splitlines()
        table = np.array([line.split() for line in lines], dtype=float)
        return [dovetail.RecordedFrf(table[:, 0], table[:, 1] + 1j * table[:, 2], unit=head.partition(" ")[2])]

    def write(self, content, path):
        if content.frf.quantity == "mobility":
            raise ValueError("mobilities cannot be written.")
        rows = zip(content.frf.frequency, content.values.real, content.values.imag)
        return "\\n".join([f"#triplets {content.unit}", *(f"{f!s} {x!s} {y!s}" for f, x, y in rows)]).encode()


@dovetail.hookimpl
def dovetail_components():
    return [Triplets]
"""
ARGUMENTS = {
    "convert": ("{measured}", "{target}"),
    "frf": ("{hits}", "-o", "{target}"),
    "predict": ("{description}", "{result}", "-o", "{target}"),
    "predict-series": (
        *("{series}", "--at", "torque=70Nm", "--samples", "20", "--model-error", "0"),
        *("-o", "{target}"),
    ),
    "simulate": ("{description}", "-o", "{target}"),
}
"""Commands that write an FRF, each with its arguments."""


@pytest.fixture(scope="module")
def files(run, assemblies, tmp_path_factory):
    """Inputs of the commands, and the plugin file."""
    folder = tmp_path_factory.mktemp("writers")
    (folder / "triplets.py").write_text(WRITER)
    description, measured, result = assemblies / "sdof.yaml", folder / "measured.csv", folder / "result"
    run("simulate", description, "--set", "k=3 MN/m", "--set", "c=40", "-o", measured)
    run("identify", description, measured, "-o", result)
    time = np.arange(1024) / 2048
    pulse = np.where(time < 0.004, np.sin(np.pi * time / 0.004), 0.0)
    response = np.exp(-20 * time) * np.sin(2 * np.pi * 200 * time)
    np.savez(folder / "hits.npz", force=pulse, response=response, rate=2048.0)
    names = {"description": description, "measured": measured, "result": result, "hits": folder / "hits.npz"}
    names["series"] = written_series(folder, description, run)
    return {name: str(path) for name, path in names.items()} | {"plugin": str(folder / "triplets.py")}


def written_series(folder, description, run):
    """A series of two short measurements of the same mount at different torques."""
    assembly = folder / "few_lines.yaml"
    axis = {"start": "20 Hz", "stop": "420 Hz", "step": "10 Hz"}
    assembly.write_text(json.dumps({"extends": str(description), "name": "few lines", "frequency": axis}))
    tests = {}
    for torque in (60, 80):
        run("simulate", assembly, "--set", f"k={torque / 20} MN/m", "--set", "c=40", "-o", folder / f"{torque}.csv")
        tests[f"at {torque}"] = {"measured": f"{torque}.csv", "at": {"torque": torque}}
    parameters = {"k": {"law": "linear", "over": "torque"}, "c": "shared"}
    series = {"assembly": assembly.name, "covariates": {"torque": "N m"}, "tests": tests, "parameters": parameters}
    (folder / "series.yaml").write_text(json.dumps({"dovetail_series": 1, "name": "two torques", **series}))
    return folder / "series.yaml"


def words(command, files, target):
    return [command, *(word.format(target=target, **files) for word in ARGUMENTS[command])]


def test_every_command_whose_code_writes_an_frf_is_tried_here():
    functions = {name: offer.command.load() for name, offer in CommandTable(OWN).offers.items()}
    writing = {name for name, function in functions.items() if "write_frf" in getsource(getmodule(function))}
    assert writing == set(ARGUMENTS)


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("command", ARGUMENTS)
def test_the_format_of_a_plugin_is_written(run, files, tmp_path, command):
    known, other = tmp_path / "known.npz", tmp_path / "other.trip"
    run(*words(command, files, known))
    run(*words(command, files, other), "--plugin", files["plugin"])
    expected, found = dovetail.read_frf(known), dovetail.read_frf(other, plugins=files["plugin"])
    assert found.quantity == expected.quantity
    np.testing.assert_array_equal(found.frequency, expected.frequency)
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-12)


@pytest.mark.parametrize("command", ARGUMENTS)
def test_an_unknown_suffix_is_refused_before_any_work_with_the_option_for_plugins(run, files, tmp_path, command):
    message = " ".join(run(*words(command, files, tmp_path / "a.trip"), code=2).stderr.split())
    place = "OUT" if command == "convert" else "--output"
    assert f" Invalid value for {place}: " in message
    figures = ".png, .svg, .html" if command == "convert" else ".png"
    accepted = f"Accepted: .uff, .unv, .csv, .npz, {figures}."
    assert message.endswith(f"{accepted} For a format that a plugin file writes, add --plugin.")


def test_an_frf_that_the_writer_refuses_is_reported_with_the_name_of_the_file(run, files, tmp_path):
    mobility = tmp_path / "mobility.yaml"
    mobility.write_text(f"extends: {files['description']}\nresponse: {{quantity: mobility}}\n")
    target = tmp_path / "a.trip"
    message = run("simulate", mobility, "-o", target, "--plugin", files["plugin"], code=1).stderr
    assert message == f"{target}\n  mobilities cannot be written.\n"


def test_signals_are_read_by_the_reader_of_a_plugin(run, files, tmp_path):
    plugin = tmp_path / "hammer.py"
    plugin.write_text(
        "import io\nimport dovetail\nimport numpy as np\n\n\n"
        "class Hammer(dovetail.FrfReader):\n"
        "    name = 'hammer'\n    summary = 'An archive under another suffix'\n    suffixes = ('.ham',)\n\n"
        "    def sniff(self, content):\n        return content.startswith(b'PK')\n\n"
        "    def read(self, path, content):\n"
        "        stored = np.load(io.BytesIO(content))\n"
        "        times = np.arange(stored['force'].size) / float(stored['rate'])\n"
        "        units = {'force': 'N', 'response': 'm/s^2'}\n"
        "        return [dovetail.RecordedSignal(name, stored[name], times, name,\n"
        "                                        [dovetail.Statement('unit', unit, name)])\n"
        "                for name, unit in units.items()]\n\n\n"
        "@dovetail.hookimpl\ndef dovetail_components():\n    return [Hammer]\n"
    )
    signals = tmp_path / "hits.ham"
    signals.write_bytes(Path(files["hits"]).read_bytes())
    assert "add --plugin" in run("frf", signals, "-o", tmp_path / "a.npz", code=1).stderr
    run("frf", signals, "-o", tmp_path / "a.npz", "--plugin", plugin)
    run("frf", files["hits"], "-o", tmp_path / "b.npz", "--response-unit", "m/s^2")
    np.testing.assert_array_equal(
        dovetail.read_frf(tmp_path / "a.npz").values, dovetail.read_frf(tmp_path / "b.npz").values
    )
