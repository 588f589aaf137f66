"""Robustness to noise: how the network's accuracy falls when noise is added to the test FRFs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from dovetail import Assembly, Dataset, Fault, Identifier, PluginError, Progress, generate, train
from dovetail.evaluation import (
    AssemblySource,
    Registry,
    Storage,
    as_assembly,
    components,
    data_noise,
    draw_test_samples,
    needs_phase,
    parameter_metrics,
    progress_reporter,
    read_description,
)

_ROBUST = "robust"

LEVELS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2)
"""Noise levels of the study: standard deviation of the noise over that of the data."""


@dataclass(frozen=True)
class RobustnessRow:
    """Accuracy of one model at one noise level.

    Parameters
    ----------
    model : str
        The reducer's name, with ``+robust`` after robust training.
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
    assembly: AssemblySource,
    dataset: Dataset | None = None,
    *,
    models: Sequence[str] = (),
    levels: Sequence[float] = LEVELS,
    seed: int = 0,
    plugins: Iterable[str | PathLike[str]] = (),
    progress: Progress | bool | None = None,
) -> tuple[RobustnessRow, ...]:
    """Train one network for each model and evaluate it on noisy FRFs.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description.
    dataset : Dataset, optional
        Of this assembly; its training and test parts are those of `train`. Without one, as many samples as the
        description says are generated and then discarded.
    models : sequence of str
        Names of reducers, alone for training on clean FRFs or with ``+robust`` (see `variant`); by default those that
        the plugins give.
    levels : sequence of float
    seed : int
        Of the noise; the same noise meets every model.
    plugins : iterable of paths
        Plugin files with further reducers.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    tuple of RobustnessRow
        Model by model, level by level.

    Notes
    -----
    Noise x + level * sigma * n is added to the amplitude of the accelerance, sigma the standard deviation of all test
    amplitudes of a response; what becomes negative is taken as its magnitude.
    """
    assembly = as_assembly(assembly)
    registry = components(tuple(plugins))
    models = models or registry.defaults.get("robustness", ())
    variants = {name: variant(assembly, name, registry) for name in models}
    rows: list[RobustnessRow] = []
    with progress_reporter(progress) as report, TemporaryDirectory(prefix="dovetail-") as folder:
        if dataset is None:
            file, storage = Path(folder) / "dataset.zarr", storage_for(variants.values())
            dataset = generate(assembly, file, storage=storage, progress=report)
        for name, described in variants.items():
            identifier = train(described, dataset, progress=report)
            rows.extend(_evaluate(name, identifier, dataset, levels, seed, report))
    return tuple(rows)


def storage_for(variants: Iterable[Assembly]) -> Storage:
    """Return what a dataset must hold on which all of these are trained."""
    return "complex" if any(map(needs_phase, variants)) else "amplitude"


def variant(assembly: Assembly, name: str, registry: Registry) -> Assembly:
    """Return the assembly with the reducer and the training that a model's name denotes.

    Parameters
    ----------
    assembly : Assembly
    name : str
        A reducer, alone (``"pca"``) or with robust training (``"pca+robust"``). Another reducer than the description's
        gets as many components; robust training takes the description's `augmentation`, or the default one.
    registry : Registry

    Raises
    ------
    PluginError
        No such reducer, or another addition than ``robust``.
    DescriptionError
        The reducer cannot be made with these options.
    """
    reducer, _, addition = name.partition("+")
    if addition not in ("", _ROBUST):
        problem = f"'{addition}' is nothing that a model can be trained with."
        raise PluginError(Fault(f"model '{name}'", problem, f"'{reducer}', '{reducer}+{_ROBUST}'"))
    description = json.loads(assembly.description.text)
    section = dict(description.get("identification") or {})
    current = assembly.description.identification.reducer
    if current.name != reducer:
        component = registry.find("reducer", reducer).component
        section["reducer"] = {"model": reducer}
        if "n_components" in component.Config.model_fields and hasattr(current.config, "n_components"):
            section["reducer"]["n_components"] = current.config.n_components
    if addition:
        section.setdefault("augmentation", {})
    else:
        section.pop("augmentation", None)
        section.pop("correction", None)  # which needs fresh samples
    return Assembly(read_description({**description, "identification": section}, registry))


def with_noise(amplitude: NDArray[np.float32], responses: int, level: float, seed: int) -> NDArray[np.float32]:
    """Return amplitudes (n, n_responses n_freq) with noise, over the standard deviation of each response on its own."""
    random = np.random.default_rng(seed)
    noisy = [data_noise(amplitudes, level, random) for amplitudes in np.split(amplitude, responses, axis=1)]
    return np.abs(np.concatenate(noisy, axis=1)).astype(np.float32)


def _evaluate(
    model: str, identifier: Identifier, dataset: Dataset, levels: Sequence[float], seed: int, progress: Progress
) -> Iterator[RobustnessRow]:
    assembly = identifier.assembly
    settings = assembly.description.identification
    is_test = np.flatnonzero(draw_test_samples(len(dataset), settings.test_fraction, settings.seed))
    clean, truth = np.asarray(dataset.amplitude[:])[is_test], dataset.parameters[is_test]
    for index, level in enumerate(levels):
        progress(f"noise on {model}", index, len(levels))
        noisy = with_noise(clean, len(assembly.description.responses), level, seed)
        predicted = identifier.predict_parameters(noisy)
        metrics = parameter_metrics(assembly.parameters, truth, predicted)
        r2 = {name: float("nan") if m.r2 is None else m.r2 for name, m in metrics.items()}
        rmse = float(np.sqrt(np.mean([m.rmse**2 for m in metrics.values()])))
        yield RobustnessRow(model, level, float(np.nanmean(list(r2.values()))), rmse, r2)
    progress(f"noise on {model}", len(levels), len(levels))
