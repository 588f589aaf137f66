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


def virtual_points(data, flexible, weighted=False):
    """Return the virtual points of the tables, with deformations of the first one."""
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
    return VirtualPoints(channels, impacts, points)


def difference(found, expected):
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("flexible", [(), FLEXIBLE])
def test_frfs_of_virtual_points_equal_those_of_pyfbs(flexible, weighted):
    data = np.load(FOLDER / "by_pyfbs.npz")
    points = virtual_points(data, flexible, weighted)
    theirs = data[("flexible" if flexible else "rigid") + ("_weighted" if weighted else "")]
    rows = [*range(6), *range(6 + len(flexible), 9 + len(flexible))]  # without their rows of deformations
    assert difference(points.transformed(data["Y"]), theirs[:, rows][:, :, rows]) < 1e-10
    assert difference(points.transformed(data["Y"], deformations=True), theirs) < 1e-10
    assert len(points.modes) == theirs.shape[1]


def test_coupling_by_deformations_equals_that_of_pyfbs_frfs():
    """Two such parts, equal in all twelve modes of point 1, by Lagrange multipliers as pyFBS's examples do it."""
    data = np.load(FOLDER / "by_pyfbs.npz")
    one, two = data["flexible"], np.swapaxes(data["flexible"], 1, 2)
    both = np.zeros((len(one), 30, 30), dtype=complex)
    both[:, :15, :15], both[:, 15:, 15:] = one, two
    equal = np.hstack([np.eye(12, 15), -np.eye(12, 15)])
    expected = both - both @ equal.T @ np.linalg.solve(equal @ both @ equal.T, equal @ both)
    at, tip = slice(0, 12), slice(12, 15)
    points = virtual_points(data, FLEXIBLE)
    A = points.transformed(data["Y"], deformations=True)
    B = np.swapaxes(A, 1, 2)
    found = dovetail.couple(A[:, tip, tip], A[:, tip, at], A[:, at, tip], A[:, at, at], B[:, at, at])
    assert difference(found, expected[:, tip, tip]) < 1e-10
    assert difference(dovetail.decouple(_whole(A, B, at), *(A[:, at, at],) * 4), B[:, at, at]) < 1e-8


def _whole(A, B, at):
    """Return the receptance of both parts at the modes of their interface."""
    return dovetail.couple(*(A[:, at, at],) * 4, B[:, at, at])
