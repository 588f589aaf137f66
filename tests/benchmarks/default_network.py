"""The network that a description gets by default, compared with others, on structures drawn at random.

python tests/benchmarks/default_network.py [--structures N] [--seed N] [--samples N]

Prints the mean R2 over the parameters of UMAP, PCA and PCA with robust training, each with as many components as the
default has, on test FRFs without noise and with noise of 1 and 5 % of the data's standard deviation.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from random_structures import random_structure

import dovetail
import dovetail_bench

MODELS = ("umap", "pca", "pca+robust")
LEVELS = (0.0, 0.01, 0.05)
MOST_LINES = 800


def main() -> None:
    """Draw structures, train each network on each, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, value in (("structures", 5), ("seed", 5), ("samples", 1600)):
        parser.add_argument(f"--{name}", type=int, default=value)
    options = parser.parse_args()
    rng, began = np.random.default_rng(options.seed), time.perf_counter()
    print(
        f"{'structure':<12}{'unknowns':>9}  " + "".join(f"{m + f' {level:g}':>16}" for m in MODELS for level in LEVELS)
    )
    means = []
    for number in range(options.structures):
        described = random_structure(rng)
        described["frequency"] = {**described["frequency"], "lines": MOST_LINES}
        described["frequency"].pop("step", None)
        described["identification"] = {"samples": options.samples}
        assembly = dovetail.load(described)
        rows = dovetail_bench.robustness(assembly, models=MODELS, levels=LEVELS)
        r2 = [max(row.r2, -1.0) for row in rows]
        means.append(r2)
        print(f"{number:<12}{len(assembly.parameters):>9}  " + "".join(f"{value:>16.3f}" for value in r2), flush=True)
    print(f"{'mean':<21}  " + "".join(f"{value:>16.3f}" for value in np.mean(means, axis=0)))
    print(f"below -1 counts as -1; {time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main()
