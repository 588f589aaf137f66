"""Virtual points: the same FRFs as pyFBS computes, and what channels around a point determine."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail import MeasuredDofs, VirtualPoint, VirtualPoints

FOLDER = Path(__file__).parent / "virtual_points"
POINTS = {"1": (0.1, -0.05, 0.2), "2": (-0.3, 0.15, 0.05)}
DIRECTIONS = {"1": dovetail.DIRECTIONS, "2": ("x", "y", "z")}
FLEXIBLE = ("ex", "ey", "tz", "sxy", "bzx", "bxy")


def table(name, weights=None):
    with (FOLDER / f"{name}.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    places, ways = (
        np.array([[float(row[f"{word}_{n}"]) for n in (1, 2, 3)] for row in rows]) for word in ("Position", "Direction")
    )
    groups = [row["Grouping"] for row in rows]
    return MeasuredDofs(tuple(row["Name"] for row in rows), places, ways, weights=weights), groups


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("flexible", [(), FLEXIBLE])
def test_frfs_of_virtual_points_equal_those_of_pyfbs(flexible, weighted):
    data = np.load(FOLDER / "by_pyfbs.npz")
    weights = (data["channel_weights"], data["impact_weights"]) if weighted else (None, None)
    (channels, of_channels), (impacts, of_impacts) = table("channels", weights[0]), table("impacts", weights[1])
    points = {
        name: VirtualPoint(
            point,
            *(tuple(n for n, group in enumerate(groups) if group == name) for groups in (of_channels, of_impacts)),
            DIRECTIONS[name],
            flexible if name == "1" else (),
        )
        for name, point in POINTS.items()
    }
    found = VirtualPoints(channels, impacts, points).transformed(data["Y"])
    theirs = data[("flexible" if flexible else "rigid") + ("_weighted" if weighted else "")]
    rows = [*range(6), *range(6 + len(flexible), 9 + len(flexible))]  # without their rows of deformations
    expected = theirs[:, rows][:, :, rows]
    assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
