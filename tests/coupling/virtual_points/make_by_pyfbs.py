"""Writes the FRFs of virtual points as pyFBS computes them: ``python tests/coupling/virtual_points/make_by_pyfbs.py``.

It needs an environment with pyFBS 1.0.7 (``python -m venv /tmp/pyfbs; /tmp/pyfbs/bin/pip install pyFBS``), and writes
`by_pyfbs.npz`, `tables.xlsx` and the same tables as CSV files into its own folder.
"""

import importlib
from pathlib import Path

import numpy as np
import pandas as pd

FOLDER = Path(__file__).parent
RIGID = ["ux", "uy", "uz", "rx", "ry", "rz"], ["fx", "fy", "fz", "mx", "my", "mz"]
FLEXIBLE = ["ex", "ey", "tz", "sxy", "bzx", "bxy"]
POINTS = {1: (0.1, -0.05, 0.2), 2: (-0.3, 0.15, 0.05)}
MOTIONS = {1: RIGID, 2: (RIGID[0][:3], RIGID[1][:3])}


def dofs(random, quantity, prefix, counts):
    """Return a table of channels or impacts at random places around both points, along random directions."""
    rows = []
    for group, count in counts.items():
        for number in range(count):
            direction = random.standard_normal(3)
            row = {"Name": f"{prefix}{group}.{number + 1}", "Description": "", "Quantity": quantity, "Grouping": group}
            position = np.array(POINTS[group]) + random.uniform(-0.04, 0.04, 3)
            direction = direction / np.linalg.norm(direction)
            rows.append({**row, **{f"Position_{n + 1}": position[n] for n in range(3)},
                         **{f"Direction_{n + 1}": direction[n] for n in range(3)}})  # fmt: skip
    return pd.DataFrame(rows).sample(frac=1.0, random_state=3).reset_index(drop=True)  # groups in any order


def point_table(quantity, side, flexible):
    """Return pyFBS's table of virtual points."""
    rows = []
    for group, position in POINTS.items():
        for word in [*MOTIONS[group][side], *(flexible if group == 1 else [])]:
            row = {"Name": f"{group}", "Description": word, "Quantity": quantity, "Grouping": group}
            rows.append({**row, **{f"Position_{n + 1}": position[n] for n in range(3)},
                         **{f"Direction_{n + 1}": 0.0 for n in range(3)}})  # fmt: skip
    return pd.DataFrame(rows)


def main():
    vpt = importlib.import_module("pyfbs.interface.vpt").VPT
    random = np.random.default_rng(7)
    channels = dofs(random, "Acceleration", "s", {1: 18, 2: 6})
    impacts = dofs(random, "Force", "h", {1: 21, 2: 5})
    frequency = np.array([100.0, 200.0])
    shape = 2, len(channels), len(impacts)
    measured = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    weights = random.uniform(0.2, 2.0, len(channels)), random.uniform(0.2, 2.0, len(impacts))
    results = {}
    for name, flexible in (("rigid", []), ("flexible", FLEXIBLE)):
        tables = point_table("Acceleration", 0, flexible), point_table("Force", 1, flexible)
        for kind, (wu, wf) in {"": (None, None), "_weighted": (np.diag(weights[0]), np.diag(1.0 / weights[1]))}.items():
            points = vpt(channels, impacts, *tables, wu=wu, wf=wf)
            points.apply_vpt(frequency, measured)
            results[name + kind] = points.frf
    np.savez_compressed(
        FOLDER / "by_pyfbs.npz",
        freq=frequency,
        Y=measured,
        channel_weights=weights[0],
        impact_weights=weights[1],
        **results,
    )
    channels.to_csv(FOLDER / "channels.csv", index=False)
    impacts.to_csv(FOLDER / "impacts.csv", index=False)
    with pd.ExcelWriter(FOLDER / "tables.xlsx") as writer:
        channels.to_excel(writer, sheet_name="Channels_A")
        impacts.to_excel(writer, sheet_name="Impacts_A")


if __name__ == "__main__":
    main()
