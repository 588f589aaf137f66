"""The benchmark of the network's draws as a proposal: it goes on where they have no width in some parameter."""

from __future__ import annotations

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from support.mass_on_mount import mass_on_mount


class Certain:
    """Stands for a network that takes a parameter to be at the end of its range, without any doubt."""

    def __init__(self, assembly: dovetail.Assembly) -> None:
        self.assembly, self.network = assembly, self

    def identify(self, _frf: dovetail.Frf, _method: str) -> SimpleNamespace:
        return SimpleNamespace(theta=self.assembly.from_unit(np.full((1, len(self.assembly.parameters)), 0.5))[0])

    def predict_samples(self, _amplitude: np.ndarray) -> np.ndarray:
        fraction = np.random.default_rng(1).random((200, len(self.assembly.parameters)))
        fraction[:, -1] = 1.0
        return self.assembly.from_unit(fraction)


@pytest.mark.parametrize("known", [{}, {"k": {"value": 4e6}}], ids=["two unknowns", "one"])
def test_a_network_without_a_width_is_not_to_be_trusted_and_the_fit_remains(known) -> None:
    benchmark = runpy.run_path(str(Path(__file__).parent / "from_network.py"))
    assembly = dovetail.load(mass_on_mount({"start": 150, "stop": 600, "step": 2}, known))
    lines = list[str]()
    benchmark["study"](Certain(assembly), 2, [0.01], 100, 0, lines.append)
    (row,) = (line for line in lines if "importance" in line)
    assert row.startswith("| 1.0% | importance | 0 | 0% |")
    assert any("refined, network's start" in line for line in lines)
