"""Training: dataset in, evaluated network out."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, IdentificationSettings
from dovetail.dataset import Dataset, generate
from dovetail.errors import DatasetError, Fault, PluginError
from dovetail.identification.features import log10p1
from dovetail.identification.identifier import Identifier
from dovetail.identification.metrics import Evaluation, parameter_metrics
from dovetail.identification.network import Network
from dovetail.identification.scaling import TargetScaling, ZScore, blocks
from dovetail.interfaces import FittedReducer, Progress, silent

__all__ = ["split", "train"]

_SPLIT_STREAM = 1
"""Keeps the split's random numbers apart from those that sampled the dataset with the same seed."""

_FEWEST = 2
"""Samples that either part needs for a spread to exist."""


def train(assembly: Assembly, dataset: Dataset | None = None, *, progress: Progress = silent) -> Identifier:
    """Train the network of an assembly's description and evaluate it on the test part of the dataset.

    Parameters
    ----------
    assembly : Assembly
    dataset : Dataset, optional
        Samples of this assembly. Without one, as many as the description says are generated and then discarded.
    progress : Progress
        Called as training goes on.

    Returns
    -------
    Identifier

    Raises
    ------
    DatasetError
        The dataset is not of this assembly, too small to be split, or holds values that are not finite.
    PluginError
        The reducer or the regressor breaks its contract.
    """
    clock = _Clock()
    if dataset is not None:
        return _train(assembly, dataset, clock, progress)
    with tempfile.TemporaryDirectory(prefix="dovetail-") as folder:
        with clock.stage("dataset"):
            generated = generate(assembly, Path(folder) / "dataset.zarr", progress=progress)
        return _train(assembly, generated, clock, progress)


def split(samples: int, test_fraction: float, seed: int) -> NDArray[np.bool_]:
    """Draw the test part.

    Returns
    -------
    (samples,) bool array
        True for the samples of the test part, a fraction `test_fraction` of all.

    Raises
    ------
    DatasetError
        One of the two parts would be too small.
    """
    test_samples = round(test_fraction * samples)
    if min(test_samples, samples - test_samples) < _FEWEST:
        raise DatasetError(
            Fault(
                "",
                f"{samples} samples leave {samples - test_samples} for training and {test_samples} for the test.",
                f"at least {_FEWEST} of each",
                "Generate more samples, or change 'identification.test_fraction'.",
            )
        )
    order = np.random.default_rng([seed, _SPLIT_STREAM]).permutation(samples)
    is_test = np.zeros(samples, dtype=np.bool_)
    is_test[order[:test_samples]] = True
    return is_test


def _train(assembly: Assembly, dataset: Dataset, clock: _Clock, progress: Progress) -> Identifier:
    dataset.require(assembly)
    settings = assembly.description.identification
    is_test = split(len(dataset), settings.test_fraction, settings.seed)
    theta = np.asarray(dataset.parameters, dtype=np.float64)
    with clock.stage("features"):
        features, test_amplitude = _read(dataset, is_test, progress)
    reducer, reduced = _fit_reducer(settings, features, clock, progress)
    del features  # 700 MB at 40,000 FRFs of 4451 lines
    network = _fit_regressor(assembly, reducer, reduced, theta[~is_test], clock, progress)
    with clock.stage("evaluation"):
        predicted = network.predict(test_amplitude)
    evaluation = Evaluation(
        parameters=parameter_metrics(assembly.parameters, theta[is_test], predicted),
        training_samples=int(np.count_nonzero(~is_test)),
        test_samples=int(np.count_nonzero(is_test)),
        seed=settings.seed,
        seconds=clock.seconds,
    )
    return Identifier(assembly, network, evaluation)


def _fit_reducer(
    settings: IdentificationSettings, features: NDArray[np.float32], clock: _Clock, progress: Progress
) -> tuple[FittedReducer, NDArray[np.float32]]:
    """Fit the reducer to the training part and reduce that."""
    with clock.stage("reducer"):
        progress("reducer", 0, 1, f"{settings.reducer.name} on {len(features)} FRFs")
        reducer = settings.reducer.fit(features, seed=settings.seed)
        progress("reducer", 1, 1)
    with clock.stage("reduction"):
        return reducer, _reduce(reducer, settings.reducer.name, features, progress)


def _fit_regressor(
    assembly: Assembly,
    reducer: FittedReducer,
    reduced: NDArray[np.float32],
    theta: NDArray[np.float64],
    clock: _Clock,
    progress: Progress,
) -> Network:
    """Fit the scalings and then the regressor to the training part; `reduced` is standardised in place."""
    settings = assembly.description.identification
    with clock.stage("regressor"):
        feature_scaling = ZScore.fit(reduced)
        target_scaling = TargetScaling.fit(theta, assembly.parameters)
        regressor = settings.regressor.fit(
            feature_scaling.transform(reduced, out=reduced),
            target_scaling.transform(theta),
            seed=settings.seed,
            progress=progress,
        )
    return Network(reducer, feature_scaling, regressor, target_scaling)


def _read(
    dataset: Dataset, is_test: NDArray[np.bool_], progress: Progress
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Read the dataset once: training rows as features, test rows as amplitudes, each into its final place."""
    width = len(dataset.frequency)
    features = np.empty((np.count_nonzero(~is_test), width), dtype=np.float32)
    test_amplitude = np.empty((np.count_nonzero(is_test), width), dtype=np.float32)
    trained = tested = 0
    for rows in blocks(len(dataset)):
        amplitude = np.asarray(dataset.amplitude[rows], dtype=np.float32)
        if not np.isfinite(amplitude).all():
            raise DatasetError(
                f"the dataset holds amplitudes that are not finite, in samples {rows.start}-{rows.stop}."
            )
        for_test = is_test[rows]
        chosen, others = amplitude[for_test], amplitude[~for_test]
        test_amplitude[tested : tested + len(chosen)] = chosen
        log10p1(others, out=features[trained : trained + len(others)])
        tested, trained = tested + len(chosen), trained + len(others)
        progress("features", rows.stop, len(dataset))
    return features, test_amplitude


def _reduce(
    reducer: FittedReducer, name: str, features: NDArray[np.float32], progress: Progress
) -> NDArray[np.float32]:
    reduced = np.empty((len(features), 0), dtype=np.float32)
    for rows in blocks(len(features)):
        part = reducer.transform(features[rows])
        if part.ndim != 2 or len(part) != rows.stop - rows.start:
            raise PluginError(f"reducer '{name}' made {part.shape} of {rows.stop - rows.start} FRFs, not one row each.")
        if not np.isfinite(part).all():
            raise PluginError(f"reducer '{name}' made features that are not finite.")
        if rows.start == 0:
            reduced = np.empty((len(features), part.shape[1]), dtype=np.float32)
        reduced[rows] = part
        progress("reduction", rows.stop, len(features))
    return reduced


@dataclass
class _Clock:
    """Wall-clock seconds of each stage."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start
