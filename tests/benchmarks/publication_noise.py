"""Mean R2 of a trained network at the publication's noise, on joints that it was not trained on.

    dovetail train docs/network/bt40_er32.yaml --minutes 13.5 -o model
    python tests/benchmarks/publication_noise.py model [--cases 2000]

The noise is that of `dovetail robustness`: real, added to the amplitude, in units of the standard deviation of all
amplitudes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail_bench.evaluation.robustness import LEVELS, parameter_metrics, with_noise

SEED = 99


def main() -> None:
    """Read the command line, and print a row of a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("--cases", type=int, default=2000)
    options = parser.parse_args()
    model = dovetail.load_model(options.model)
    theta = latin_hypercube(model.assembly, options.cases, (SEED, 1))
    clean = model.assembly.accelerance_amplitude(theta).astype(np.float32)
    print(f"| {' | '.join(f'{level:g}' for level in LEVELS)} |\n|{'---|' * len(LEVELS)}")
    cells = []
    for level in LEVELS:
        noisy = with_noise(clean, len(model.assembly.description.responses), level, 0)
        metrics = parameter_metrics(model.assembly.parameters, theta, model.predict_parameters(noisy))
        cells.append(f"{np.mean([metric.r2 for metric in metrics.values()]):.3f}")
    print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
