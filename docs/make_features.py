"""Draws the first two features of UMAP and PCA over the FRFs of one mass: Figure 4 of the publication.

    python docs/make_features.py

writes docs/features.png and prints how well the two features determine stiffness and damping: R2 of the mean of the
nearest training samples, over samples that were not used for the reducers.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.stats import qmc

import dovetail
from dovetail_plugins.reducers.pca import PCA
from dovetail_plugins.reducers.umap import UMAP

TRAINING, TEST, NEIGHBOURS, SEED = 4000, 1000, 5, 0
"""Samples as in the publication, and neighbours whose mean is the estimate."""


def r_squared(features: NDArray[np.float64], fractions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return R2 (n_params,) of the test samples' parameters from the nearest training samples."""
    _, nearest = KDTree(features[:TRAINING]).query(features[TRAINING:], NEIGHBOURS)
    estimate, truth = fractions[:TRAINING][nearest].mean(axis=1), fractions[TRAINING:]
    return np.asarray(1 - np.sum((estimate - truth) ** 2, axis=0) / np.sum((truth - truth.mean(axis=0)) ** 2, axis=0))


def main() -> None:
    """Compute, draw and print."""
    assembly = dovetail.examples.load("sdof")
    fractions = qmc.LatinHypercube(len(assembly.parameters), seed=SEED).random(TRAINING + TEST)
    theta = assembly.from_unit(fractions)
    amplitudes = np.log10(np.abs(assembly.frf(theta)) + 1.0).astype(np.float32)
    figure, panels = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    for axes, (name, reducer) in zip(panels, {"UMAP": UMAP, "PCA": PCA}.items(), strict=True):
        fitted = reducer(reducer.Config()).fit(amplitudes[:TRAINING], seed=SEED)
        features = fitted.transform(amplitudes)[:, :2].astype(np.float64)
        scores = r_squared(features, fractions)
        print(f"{name}: R2 of k {scores[0]:.2f}, of c {scores[1]:.2f}")
        dots = axes.scatter(*features[:TRAINING].T, c=theta[:TRAINING, 0] / 1e6, s=3, cmap="viridis", linewidths=0)
        axes.set(title=name, xlabel="first feature", ylabel="second feature")
    figure.colorbar(dots, ax=panels, label="k [MN/m]")
    figure.savefig(Path(__file__).with_name("features.png"), dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
