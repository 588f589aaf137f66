"""``dovetail check-plugin``."""

from __future__ import annotations

import json
import re

from dovetail.testing import check_names

SOUND = '''
import numpy as np
import dovetail


class Pad(dovetail.JointModel):
    """A pad."""

    name = "pad"
    summary = "Elastic pad"
    parameters = (dovetail.Parameter("kp", "N/m", 1e5, 1e7, "log", "stiffness"),)
    ports = (dovetail.Port("a", 1), dovetail.Port("b", 1))

    def matrices(self, theta):
        """Return the (n, 4, 4) matrices."""
        joint = dovetail.StructuralMatrices.zeros(len(theta), self.size)
        joint.K[:] = theta[:, 0, None, None] * np.outer([1, 0, -1, 0], [1, 0, -1, 0])
        return joint


@dovetail.hookimpl
def dovetail_components():
    """Return what this plugin offers."""
    return [Pad]
'''


def test_a_sound_plugin_file(run, tmp_path):
    file = tmp_path / "pad.py"
    file.write_text(SOUND)
    printed = run("check-plugin", "pad", "--plugin", file).stdout
    assert "matrices are symmetric" in printed
    counts = re.fullmatch(r"(\d+) checks run: \1 passed, (\d+) not applicable\.", printed.splitlines()[-1])
    assert sum(map(int, counts.groups())) == len(check_names("joint"))
    assert "not applicable  the law has a limit at rest: " in printed


def test_a_broken_plugin_file_ends_with_one(run, tmp_path):
    file = tmp_path / "pad.py"
    file.write_text(SOUND.replace("np.outer([1, 0, -1, 0]", "np.outer([1, 0, -2, 0]"))
    results = json.loads(run("check-plugin", "pad", "--plugin", file, "--json", code=1).stdout)
    assert [result["name"] for result in results if result["outcome"] == "failed"] == [
        "matrices_are_symmetric",
        "stiffness_is_positive_semidefinite",
    ]
    printed = run("check-plugin", "pad", "--plugin", file, code=1).stdout
    assert "2 failed" in printed.splitlines()[-1]
    assert "Traceback" not in printed


def test_a_name_of_several_kinds_checks_them_all(run, tmp_path):
    file = tmp_path / "none.py"
    file.write_text(SOUND.replace('"pad"', '"none"'))
    components = {r["component"] for r in json.loads(run("check-plugin", "none", "--plugin", file, "--json").stdout)}
    assert components == {"joint 'none'", "reducer 'none'"}


def test_an_unknown_name(run):
    assert run("check-plugin", "colet", code=1).stderr.startswith("  there is no model 'colet'.\n")
