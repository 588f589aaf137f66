"""pyFBS's virtual point transformation of a measured interface: ``python tests/peers/solve_pyfbs.py``.

Nine channels and nine impacts around a point see its six rigid-body DOFs, with noise of 1 % of each value.
"""

import importlib
import sys
import time

import numpy as np
import pandas as pd
from interface import directions, frequency, positions, recorded, relative_error
from problems import Scores

try:
    pyfbs = importlib.import_module("pyfbs")
except ImportError as error:
    print(f"pyfbs cannot be imported: {error}", file=sys.stderr)
    raise SystemExit(1) from None


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
        vpt.apply_vpt(frequency, recorded)
        # end
        break
    except (KeyError, ValueError):
        continue
Scores("virtual point").show(
    program="pyFBS", relative_error=relative_error(vpt.frf), cpu_seconds=round(time.process_time() - began, 2)
)
