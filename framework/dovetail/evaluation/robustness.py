"""Robustness to noise: how the network's accuracy falls when noise is added to the test FRFs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from dovetail.assembly import Assembly, components
from dovetail.dataset import Dataset
from dovetail.errors import PluginError
from dovetail.identification import Identifier, train
from dovetail.identification.metrics import parameter_metrics
from dovetail.identification.training import split
from dovetail.interfaces import Progress, Reducer, silent
from dovetail.measurement import data_noise
from dovetail.registry import Registry

__all__ = ["LEVELS", "RobustnessRow", "robustness"]

LEVELS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2)
"""Noise levels of the study: standard deviation of the noise over that of the data."""


@dataclass(frozen=True)
class RobustnessRow:
    """Accuracy of one model at one noise level.

    Parameters
    ----------
    model : str
        The reducer's name.
    level : float
        Standard deviation of the noise over that of the test amplitudes.
    r2 : float
        Mean coefficient of determination over the parameters, on their sampling scales.
    rmse : float
        Root of the mean square error over all parameters, as a fraction of their ranges.
    r2_by_parameter : dict of str to float
    """

    model: str
    level: float
    r2: float
    rmse: float
    r2_by_parameter: dict[str, float]

    def flat(self) -> dict[str, float | str]:
        """Return one row of a table, the parameters' R2 as columns of their own."""
        row = asdict(self)
        by_parameter = row.pop("r2_by_parameter")
        return row | {f"r2 {name}": value for name, value in by_parameter.items()}


def robustness(
    assembly: Assembly,
    dataset: Dataset,
    *,
    models: Sequence[str] = ("umap", "pca", "none"),
    levels: Sequence[float] = LEVELS,
    seed: int = 0,
    registry: Registry | None = None,
    progress: Progress = silent,
) -> tuple[RobustnessRow, ...]:
    """Train one network for each reducer on clean FRFs and evaluate it on noisy ones.

    Parameters
    ----------
    assembly : Assembly
    dataset : Dataset
        Of this assembly; its training and test parts are those of `train`.
    models : sequence of str
        Names of reducers. One with as many components as the description's own takes their number from there.
    levels : sequence of float
    seed : int
        Of the noise; the same noise meets every model.
    registry : Registry, optional
        Where reducers are looked up; the installed ones by default.
    progress : callable

    Returns
    -------
    tuple of RobustnessRow
        Model by model, level by level.

    Notes
    -----
    Noise x + level * sigma * n is added to the amplitude of the accelerance; what becomes negative is taken as its
    magnitude.
    """
    rows: list[RobustnessRow] = []
    for name in models:
        variant = with_reducer(assembly, name, registry or components())
        identifier = train(variant, dataset, progress=progress)
        rows.extend(_evaluate(name, identifier, dataset, levels, seed, progress))
    return tuple(rows)


def with_reducer(assembly: Assembly, name: str, registry: Registry) -> Assembly:
    """Return the assembly with another reducer, of as many components as its own one has.

    Raises
    ------
    PluginError
        No such reducer, or it cannot be made with these options.
    """
    settings = assembly.description.identification
    if settings.reducer.name == name:
        return assembly
    component = registry.find("reducer", name).component
    options = {}
    if "n_components" in component.Config.model_fields and hasattr(settings.reducer.config, "n_components"):
        options["n_components"] = settings.reducer.config.n_components
    reducer = component(component.Config(**options))
    if not isinstance(reducer, Reducer):
        raise PluginError(f"'{name}' is not a reducer.")
    described = replace(assembly.description, identification=replace(settings, reducer=reducer))
    return Assembly(described)


def _evaluate(
    model: str, identifier: Identifier, dataset: Dataset, levels: Sequence[float], seed: int, progress: Progress
) -> Iterator[RobustnessRow]:
    assembly = identifier.assembly
    settings = assembly.description.identification
    is_test = np.flatnonzero(split(len(dataset), settings.test_fraction, settings.seed))
    clean, truth = np.asarray(dataset.amplitude[:])[is_test], dataset.parameters[is_test]
    for index, level in enumerate(levels):
        progress(f"noise on {model}", index, len(levels))
        noisy = np.abs(data_noise(clean, level, seed)).astype(np.float32)
        predicted = identifier.predict_parameters(noisy)
        metrics = parameter_metrics(assembly.parameters, truth, predicted)
        r2 = {name: float("nan") if m.r2 is None else m.r2 for name, m in metrics.items()}
        rmse = float(np.sqrt(np.mean([m.rmse**2 for m in metrics.values()])))
        yield RobustnessRow(model, level, float(np.nanmean(list(r2.values()))), rmse, r2)
    progress(f"noise on {model}", len(levels), len(levels))
