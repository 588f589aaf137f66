"""The README's example description, taken from the page and used as the page says."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_example_description_is_checked_and_simulated(run, tmp_path):
    text = re.search(r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.S)[1]
    shutil.copy(ROOT / "assemblies" / "bt40_er32.yaml", tmp_path)
    description = tmp_path / "my_assembly.yaml"
    description.write_text(text, encoding="utf-8")
    checked = run("check", description).stdout
    assert "0 to 120 by 10" in checked
    assert re.search(r"collet\.mn1|mn1 +0\.08 kg", checked)
    run("simulate", description, "--set", "Dc=30mm", "-o", tmp_path / "frf.csv")
    assert (tmp_path / "frf.csv").read_text().count("\n") > 4451
