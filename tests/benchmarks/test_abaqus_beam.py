"""The comparison with a genuine pair of Abaqus files runs on files of the same form, and notices a wrong entry."""

from __future__ import annotations

import re
import sys

import abaqus_beam
import numpy as np
import pytest

LABELS = [*((node, dof) for node in (1, 2) for dof in range(1, 7)), (-1, 1), (-1, 2)]


def written(folder, wrong=1.0):
    """Write both matrices as Abaqus does: the lower half, column by column, internal nodes first."""
    for name, matrix in zip(("STIF", "MASS"), abaqus_beam.matrices(), strict=True):
        changed = matrix.copy()
        changed[1, 1] *= wrong
        order = sorted(range(14), key=lambda row: LABELS[row])
        lines = []
        for column in order:
            for row in order[order.index(column) :]:
                if changed[row, column] != 0.0:
                    (node, dof), (other, along) = LABELS[row], LABELS[column]
                    lines.append(f"{node},{dof}, {other},{along}, {changed[row, column]:22.15e}")
        (folder / f"model_{name}1.mtx").write_text("\n".join(lines) + "\n")
    (folder / "model.inp").write_text("*NODE\n 1, 0.0, 0.0, 0.0\n 2, 3.0, 0.0, 0.0\n*STEP\n")


@pytest.mark.parametrize("wrong", [1.0, 1.01])
def test_matrices_and_frfs_are_compared(wrong, tmp_path, monkeypatch, capsys):
    written(tmp_path, wrong)
    monkeypatch.setattr(sys, "argv", ["abaqus_beam.py", str(tmp_path)])
    abaqus_beam.main()
    differences = [float(number) for number in re.findall(r"([\d.e+-]+)$", capsys.readouterr().out, flags=re.M)]
    assert len(differences) == 8
    along_y = [differences[0], differences[1], differences[3]]
    assert (max(along_y) < 1e-9) == (wrong == 1.0)
    assert np.max(np.delete(differences, [0, 1, 3, 7])) < 1e-9
