"""Warnings while a command runs: sentences without a line of source; what libraries warn of is not shown."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.cli.warning_notes import warnings_as_notes


def test_an_unknown_sign_with_a_response_of_noise_is_one_note(run, tmp_path, assemblies):
    described = tmp_path / "a.yaml"
    text = "frequency: {start: 10 Hz, stop: 300 Hz, step: 10 Hz}\nresponse: {calibration: {sign: unknown}}\n"
    described.write_text(f"extends: {assemblies / 'sdof.yaml'}\n{text}")
    random = np.random.default_rng(0)
    noise = random.standard_normal((2, 30))
    frf = dovetail.Frf(np.arange(10.0, 301.0, 10.0), noise[0] + 1j * noise[1], "accelerance")
    dovetail.write_frf(frf, tmp_path / "noise.csv")
    arguments = [sys.executable, "-m", "dovetail", "identify", str(described), "noise.csv"]
    options = ["--method", "refined", "--cause-seconds", "0"]
    done = subprocess.run([*arguments, *options], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode in (0, 3), done.stderr
    assert done.stderr.count("Note: noise.csv: phases agree with the model's as little with one sign") == 1
    for raw in ("Warning:", ".py:", "warnings.warn", "warn("):
        assert raw not in done.stderr.replace("Warning: The model", "")


@pytest.fixture
def plugin(tmp_path):
    """A function in a file that belongs to no installed package."""
    file = tmp_path / "plugin.py"
    file.write_text("import warnings\ndef warn(*a, **b): warnings.warn(*a, **b)\n")
    names: dict = {}
    exec(compile(file.read_text(), str(file), "exec"), names)
    return names["warn"]


def test_user_warnings_are_printed_once_and_deprecations_are_not(plugin, capsys):
    import scipy

    library = str(Path(scipy.__file__).parent / "optimize" / "_minimize.py")
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        with warnings_as_notes():
            for _ in range(2):
                plugin("the file is odd")
            for category in (RuntimeWarning, DeprecationWarning, FutureWarning, type("Own", (UserWarning,), {})):
                plugin("about code", category)
            warnings.warn_explicit("of a library", UserWarning, library, 1)
            np.float64(1e300) ** 2
    assert capsys.readouterr().err == "Note: the file is odd\n"
