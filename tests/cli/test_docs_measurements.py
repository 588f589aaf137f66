"""The commands of docs/measurements.md, run from top to bottom as a reader would."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np

import dovetail

ROOT = Path(__file__).resolve().parents[2]


SMALLER = {"--method posterior": "--method posterior --form laplace"}


def test_the_commands_of_the_page_run(tmp_path, type_line):
    """With a Gaussian for the samples of a posterior, which other tests draw."""
    shutil.copytree(ROOT / "assemblies", tmp_path / "assemblies")
    text = (ROOT / "docs" / "measurements.md").read_text(encoding="utf-8")
    blocks = "".join(re.findall(r"^```bash\n(.*?)^```", text, flags=re.S | re.M))
    commands = blocks.replace("\\\n", "").strip().splitlines()
    assert len(commands) == 16
    for command in commands:
        for option, quicker in SMALLER.items():
            command = command.replace(option, quicker)
        type_line(command)
    shipped = dovetail.read_frf(tmp_path / "assemblies/campaign/measurements/t0.uff")
    converted = dovetail.read_frf(tmp_path / "t0.npz")
    assert (converted.quantity, converted.averages, converted.response) == ("mobility", 10, "11+x")
    np.testing.assert_allclose(converted.to("accelerance").values, shipped.values, rtol=1e-12)
    bare = dovetail.read_frf(tmp_path / "bare.csv")
    np.testing.assert_allclose(bare.values, np.array([1.5 - 2j, 3 + 0.25j]) * 9.80665, rtol=1e-12)
    turned = dovetail.read_frf(tmp_path / "bare.uff")
    assert (turned.response, turned.force) == ("3+x", "1-x")
    np.testing.assert_allclose(turned.values, -bare.values, rtol=1e-11)
    np.testing.assert_allclose(dovetail.read_modal_parameters(tmp_path / "modes.csv").damping_ratio, [0.0031, 0.005])
    assert (tmp_path / "from_modes" / "modes.csv").read_text().splitlines()[1].endswith(",212.1,0.0031")
    estimated = dovetail.read_frf(tmp_path / "from_signals.uff")
    kept = np.isin(estimated.frequency, shipped.frequency)
    np.testing.assert_allclose(estimated.values[kept], shipped.values, rtol=1e-4)
    assert (tmp_path / "from_signals.png").exists()
