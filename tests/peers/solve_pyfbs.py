"""pyFBS's virtual point transformation of a measured interface: ``python tests/peers/solve_pyfbs.py``.

Nine channels and nine impacts around a point see its six rigid-body DOFs, with noise of 1 % of each value.
"""

import importlib
import sys
import time

import numpy as np
import pandas as pd
from problems import Scores

try:
    pyfbs = importlib.import_module("pyfbs")
except ImportError as error:
    print(f"pyfbs cannot be imported: {error}", file=sys.stderr)
    raise SystemExit(1) from None

random, frequency = np.random.default_rng(2), np.arange(10.0, 500.0, 1.0)
residues = random.standard_normal((4, 6))
s = 2j * np.pi * frequency
truth = np.zeros((len(frequency), 6, 6), dtype=complex)
for shape, natural in zip(residues, (60.0, 150.0, 280.0, 410.0), strict=True):
    omega = 2 * np.pi * natural
    truth += (1.0 / (s**2 + 0.02 * omega * s + omega**2))[:, None, None] * np.outer(shape, shape)
positions = 0.05 * np.repeat([[1, 0, 0], [0, 1, 0], [0, 0, 1]], 3, axis=0)
directions = np.tile(np.eye(3), (3, 1))
rotated = np.cross(positions, directions)
motion = np.hstack([directions, rotated])  # of a channel by the six DOFs of the point
measured = motion @ truth @ motion.T
noise = random.standard_normal((*measured.shape, 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
measured = measured + 0.01 * np.abs(measured) * noise


def table(names, quantity, places, ways, words):
    columns = {"Name": names, "Description": words, "Quantity": quantity, "Grouping": 1}
    columns |= {f"Position_{n + 1}": places[:, n] for n in range(3)}
    return pd.DataFrame(columns | {f"Direction_{n + 1}": ways[:, n] for n in range(3)})


numbers = [str(n) for n in range(9)]
channels = table(numbers, "Acceleration", positions, directions, numbers)
impacts = table(numbers, "Force", positions, directions, numbers)
ways = np.tile(np.eye(3), (2, 1))
dofs = ["ux", "uy", "uz", "tx", "ty", "tz"]
loads = ["fx", "fy", "fz", "mx", "my", "mz"]
began = time.process_time()
for words_u, words_f in ((["ux", "uy", "uz", "rx", "ry", "rz"], ["fx", "fy", "fz", "mx", "my", "mz"]), (dofs, loads)):
    try:
        # begin
        points = table(words_u, "Acceleration", np.zeros((6, 3)), ways, words_u)
        point_loads = table(words_f, "Force", np.zeros((6, 3)), ways, words_f)
        vpt = pyfbs.interface.VPT(channels, impacts, points, point_loads)
        vpt.apply_vpt(frequency, measured)
        # end
        break
    except (KeyError, ValueError):
        continue
error = float(np.median(np.abs(vpt.frf - truth)) / np.median(np.abs(truth)))
Scores("virtual point").show(
    program="pyFBS", relative_error=round(error, 4), cpu_seconds=round(time.process_time() - began, 2)
)
