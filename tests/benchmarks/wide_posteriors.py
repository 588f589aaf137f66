"""How wide are intervals where a posterior reaches far beyond its modes, with and without annealing?

    python tests/benchmarks/wide_posteriors.py [--cases 6] [--seed 100]

The FRF of a machine with an end mill is explained by a model with another tool, which can fit only roughly. For each
machine, samples by searches near modes alone, and those of the default method, are compared with annealed points that
are four times as many and move five times as often. "Narrow" counts intervals that are less than half as wide as
theirs; "found" is the marginal likelihood over theirs.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from processors import processor_time

import dovetail
from dovetail.inference.posterior import annealing
from support.end_mill import measured_with_another_tool

THOROUGH = replace(annealing._SETTINGS, least_points=1600, steps=100)


@contextmanager
def annealed(settings: annealing.Settings | None) -> Iterator[None]:
    """Anneal by other settings, or not at all."""
    with patch.object(annealing, "_SETTINGS", settings or annealing._SETTINGS):
        if settings is None:
            with patch.object(annealing, "anneal", lambda *_, **__: None):
                yield
        else:
            yield


def widths(posterior: dovetail.Posterior, model: dovetail.Assembly) -> np.ndarray:
    """Return the widths (p,) of the 90 % intervals, in parts of the ranges."""
    lower, upper = np.array(list(posterior.interval().values())).T
    return np.asarray(model.to_unit(upper) - model.to_unit(lower))


def main() -> None:
    """Print a row for each machine, and one for all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=6)
    parser.add_argument("--seed", type=int, default=100)
    options = parser.parse_args()
    print("| machine | narrow by searches | narrow by default | found by searches | seconds | seconds by default |")
    print("|---|---|---|---|---|---|")
    narrow, count = np.zeros(2, dtype=int), 0
    for case in range(options.seed, options.seed + options.cases):
        model, measured = measured_with_another_tool(case)
        found, seconds = [], []
        for settings in (None, annealing._SETTINGS, THOROUGH):
            began = processor_time()
            with annealed(settings):
                found.append(dovetail.identify(model, measured, cause_seconds=0).posterior)
            seconds.append(processor_time() - began)
        whole = widths(found[-1], model)
        few = [int(np.sum(widths(each, model) < whole / 2.0)) for each in found[:2]]
        ratio = np.exp(found[0].least_log_evidence - found[-1].least_log_evidence)
        narrow, count = narrow + few, count + len(whole)
        times = f"{seconds[0]:.1f} | {seconds[1]:.1f}"
        print(f"| {case} | {few[0]} of {len(whole)} | {few[1]} | {ratio:.2g} | {times} |", flush=True)
    print(f"| all | {narrow[0]} of {count} | {narrow[1]} | | | |")


if __name__ == "__main__":
    main()
