"""The joint of docs/plugins.md, taken from the page as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import dovetail

PAGE = Path(__file__).resolve().parents[2] / "docs" / "plugins.md"
ASSEMBLY = """
dovetail: 1
name: mounted
frequency: {start: 1 Hz, stop: 600 Hz, step: 1 Hz}
substructures:
  mass: {model: lumped, masses: [{mass: 1 kg}]}
  base: {model: ground}
joints:
  mount:
    model: mount
    loss_factor: 0.05
    connect: {a: {to: mass, at: 0}, b: {to: base, at: 0}}
response: {at: mass, position: 0, quantity: receptance}
"""


def test_the_joint_of_the_page_works_as_the_page_says(run, tmp_path):
    code = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.S)[1]
    plugin, description = tmp_path / "mount.py", tmp_path / "assembly.yaml"
    plugin.write_text(code, encoding="utf-8")
    description.write_text(ASSEMBLY, encoding="utf-8")
    assert "stiffness of each spring" in run("--plugin", plugin, "describe", "mount").stdout
    assert "0.1 to 10 MN/m" in run("--plugin", plugin, "check", description).stdout
    assembly = dovetail.load(description, plugins=[plugin])
    k, m, omega = 1e6, 0.05, 2 * np.pi * assembly.frequency
    spring = k * (1 + 0.05j)
    expected = 1 / (spring - omega**2 - spring**2 / (2 * spring - omega**2 * m))
    np.testing.assert_allclose(assembly.frf([k, m]), expected, rtol=1e-10)
