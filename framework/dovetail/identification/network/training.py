"""Training: from a dataset to an evaluated network.

The samples are split into a training and a test part. Reducer and regressor are fitted to the training FRFs, as they
are or with noise that is new in every epoch. The test part gives the evaluation.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from dovetail.assembly import Assembly, AugmentationSection, IdentificationSettings
from dovetail.dataset import Dataset, Storage, generate
from dovetail.errors import DatasetError, Fault, ParameterError, PluginError
from dovetail.identification.network.augmentation import (
    TRAINING_TOLERANCE,
    FreshEpochs,
    NoisyFeatures,
    ReducedEpochs,
    measured_noises,
)
from dovetail.identification.network.network import Network, Reduction, check_contract, component_label, reduce_features
from dovetail.identification.network.novelty import learn_novelty
from dovetail.identification.network.preprocessing import TargetScaling, ZScore, blocks, log10p1
from dovetail.identification.network.trained_network import TrainedNetwork
from dovetail.identification.provenance import Evaluation, parameter_metrics
from dovetail.interfaces import (
    FeatureContext,
    FittedReducer,
    Progress,
    fit_in_context,
    logged,
    plugin_errors,
    silent,
    takes_context,
)

__all__ = ["draw_test_samples", "needs_phase", "read_frfs", "train_and_evaluate", "train_network"]

_SPLIT_STREAM = 1
"""Keeps the split's random numbers apart from those that sampled the dataset with the same seed."""

_FEWEST_SAMPLES = 2
"""In either part, for a spread to exist."""

_WORTH_FORECASTING = 10.0
"""Seconds for the FRFs from which a training says beforehand how long it will take."""

_PILOT_SHARE, _PILOT_EPOCHS = 0.02, 3
"""Of the samples, on which reducer and regressor are tried for that, and epochs of the regressor."""


def train_network(
    assembly: Assembly,
    dataset: Dataset | None = None,
    *,
    robust: bool = False,
    fresh: bool = False,
    minutes: float | None = None,
    progress: Progress = silent,
) -> TrainedNetwork:
    """Train the network of an assembly's description; parameters and errors as `dovetail.train` has them."""
    timer = _StageTimer(_seconds(assembly, minutes))
    if robust or fresh:
        assembly = _with_augmentation(assembly, fresh=fresh)
    measured_noises(assembly)  # what is wrong with their files is said before any work
    if dataset is not None:
        return _train(assembly, dataset, timer, progress)
    with tempfile.TemporaryDirectory(prefix="dovetail-") as folder:
        with timer.stage("dataset"):
            storage: Storage = "complex" if needs_phase(assembly) else "amplitude"
            generated = generate(
                assembly,
                Path(folder) / "dataset.zarr",
                storage=storage,
                interpolation=TRAINING_TOLERANCE,
                progress=progress,
            )
        return _train(assembly, generated, timer, progress)


def _seconds(assembly: Assembly, minutes: float | None) -> float | None:
    """Return the time for the regressor.

    Raises
    ------
    ParameterError
        It is no time, or the regressor takes no notice of one.
    """
    if minutes is None:
        return None
    if not 0.0 < minutes < np.inf:
        raise ParameterError(Fault("minutes", f"{minutes:g} min is no time.", "more than 0"))
    regressor = assembly.description.identification.regressor
    if not takes_context(regressor.fit):
        problem = f"the {component_label(regressor)} cannot be told how long to train."
        raise ParameterError(Fault("minutes", problem, "a regressor whose 'fit' takes the context"))
    return 60.0 * minutes


def _with_augmentation(assembly: Assembly, *, fresh: bool) -> Assembly:
    """Return the assembly with noise on its training FRFs, and with new ones in every epoch if `fresh`."""
    stated = assembly.description.identification.augmentation
    changes = {"fresh": True} if fresh else {}
    settings = (stated or AugmentationSection()).model_copy(update=changes)
    section = {"augmentation": settings.model_dump(exclude_unset=True)}
    return Assembly(assembly.description.with_identification(section, augmentation=settings))


def needs_phase(assembly: Assembly) -> bool:
    """Whether a mass is to be left at the drive point of FRFs that come from the dataset."""
    augmentation = assembly.description.identification.augmentation
    return augmentation is not None and augmentation.mass > 0 and not augmentation.fresh


def draw_test_samples(samples: int, test_fraction: float, seed: int) -> NDArray[np.bool_]:
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
    if min(test_samples, samples - test_samples) < _FEWEST_SAMPLES:
        problem = f"{samples} samples leave {samples - test_samples} for training and {test_samples} for the test."
        remedy = "Generate more samples, or change 'identification.test_fraction'."
        raise DatasetError(Fault("", problem, f"at least {_FEWEST_SAMPLES} of each", remedy))
    order = np.random.default_rng([seed, _SPLIT_STREAM]).permutation(samples)
    is_test = np.zeros(samples, dtype=np.bool_)
    is_test[order[:test_samples]] = True
    return is_test


def _train(assembly: Assembly, dataset: Dataset, timer: _StageTimer, progress: Progress) -> TrainedNetwork:
    network, evaluation = train_and_evaluate(assembly, dataset, progress, timer)
    settings, theta = assembly.description.identification, np.asarray(dataset.parameters, dtype=np.float64)
    is_test = draw_test_samples(len(dataset), settings.test_fraction, settings.seed)
    novelty = None
    progress("novelty", 0, 1)
    with timer.stage("novelty"):
        if len(assembly.description.responses) == 1:
            rows = next(blocks(len(dataset)))
            amplitude = np.asarray(dataset.amplitude[rows], dtype=np.float32)[~is_test[rows]]
            with threadpool_limits(1, user_api="blas"):  # many small products, for which threads only wait
                count = int(np.count_nonzero(~is_test))
                novelty = learn_novelty(assembly, network, amplitude, theta[is_test], count, settings.seed)
    return TrainedNetwork(assembly, network, evaluation, novelty)


def train_and_evaluate(
    assembly: Assembly, dataset: Dataset, progress: Progress = silent, timer: _StageTimer | None = None
) -> tuple[Network, Evaluation]:
    """Train a network on one part of a dataset, and evaluate it on the other.

    Parameters
    ----------
    assembly : Assembly
    dataset : Dataset
        Of this assembly.
    progress : callable
    timer : optional
        Of the stages.

    Raises
    ------
    DatasetError
        The dataset is that of another assembly, or too small.
    PluginError
        Reducer or regressor fail.
    """
    timer = _StageTimer() if timer is None else timer
    dataset.require(assembly)
    settings = assembly.description.identification
    is_test = draw_test_samples(len(dataset), settings.test_fraction, settings.seed)
    theta = np.asarray(dataset.parameters, dtype=np.float64)
    network = _fit_network(assembly, dataset, is_test, timer, progress)
    progress("evaluation", 0, 1)
    with timer.stage("evaluation"):
        predicted = network.predict(read_frfs(dataset, is_test, silent))
        if not np.isfinite(predicted).all():
            label = component_label(settings.regressor)
            with plugin_errors(settings.regressor, label):
                raise PluginError(Fault(label, "its answers to the test FRFs are not finite.", "finite numbers"))
    evaluation = Evaluation(
        parameters=parameter_metrics(assembly.parameters, theta[is_test], predicted),
        training_samples=int(np.count_nonzero(~is_test)),
        test_samples=int(np.count_nonzero(is_test)),
        seed=settings.seed,
        seconds=timer.seconds,
    )
    return network, evaluation


def _fit_network(
    assembly: Assembly, dataset: Dataset, is_test: NDArray[np.bool_], timer: _StageTimer, progress: Progress
) -> Network:
    """Fit to the training FRFs, with noise if the description has it."""
    settings = assembly.description.identification
    theta = dataset.parameters[~is_test]
    noisy = None
    with timer.stage("features"):
        features = read_frfs(dataset, ~is_test, progress, phase=needs_phase(assembly))
        if settings.augmentation is not None:
            noisy = NoisyFeatures.of(assembly, features, theta)
            features, theta = noisy(0)
        else:
            for rows in blocks(len(features)):
                log10p1(features[rows], out=features[rows])
    context = _context(assembly, dataset, is_test, noisy, timer.limit)
    expected = ""
    if sum(timer.seconds.values()) > _WORTH_FORECASTING:
        with timer.stage("forecast"):
            expected = _forecast(assembly, features, theta, context)
    reducer = _fit_reducer(settings, features, context, timer, progress, expected)
    with timer.stage("reduction"):
        reduced = reduce_features(reducer, settings.reducer.name, features, progress)
    del features  # 700 MB at 40,000 FRFs of 4451 lines
    scaling = feature_scaling, target_scaling = ZScore.fit(reduced), TargetScaling.fit(theta, assembly.parameters)
    reduction = Reduction(settings.reducer.name, reducer, *scaling)
    named: dict[str, Any] = {"context": context, "seed": settings.seed, "progress": progress}
    with timer.stage("regressor"), plugin_errors(settings.regressor, component_label(settings.regressor)):
        if noisy is None:
            regressor = fit_in_context(settings.regressor.fit, *reduction.standardise(reduced, theta), **named)
        elif noisy.fresh:
            epochs = FreshEpochs(noisy, reduction, reduction.standardise(reduced, theta))
            regressor = fit_in_context(settings.regressor.fit_epochs, epochs, **named)
        else:
            regressor = fit_in_context(settings.regressor.fit_epochs, ReducedEpochs(noisy, reduction), **named)
    recipes = settings.reducer, settings.regressor
    return Network(reducer, feature_scaling, regressor, target_scaling, recipes)


def _context(
    assembly: Assembly,
    dataset: Dataset,
    is_test: NDArray[np.bool_],
    noisy: NoisyFeatures | None,
    seconds: float | None,
) -> FeatureContext:
    """Return what the features are of; their FRFs with phases where these are as the dataset keeps them."""
    return FeatureContext(
        frequency=assembly.frequency,
        responses=tuple(response.name for response in assembly.description.responses),
        parameters=tuple(parameter.name for parameter in assembly.parameters),
        accelerance=None
        if noisy is not None or dataset.storage != "complex"
        else lambda: read_frfs(dataset, ~is_test, silent, phase=True),
        seconds=seconds,
    )


def _fit_reducer(
    settings: IdentificationSettings,
    features: NDArray[np.float32],
    context: FeatureContext,
    timer: _StageTimer,
    progress: Progress,
    expected: str,
) -> FittedReducer:
    with timer.stage("reducer"):
        progress("reducer", 0, 1, f"{settings.reducer.name} on {len(features)} FRFs{expected}")
        with plugin_errors(settings.reducer, component_label(settings.reducer)):
            reducer = fit_in_context(settings.reducer.fit, features, context=context, seed=settings.seed)
            check_contract(reducer, settings.reducer, FittedReducer)
        assert isinstance(reducer, FittedReducer)
        progress("reducer", 1, 1)
    return reducer


def _forecast(
    assembly: Assembly, features: NDArray[np.float32], theta: NDArray[np.float64], context: FeatureContext
) -> str:
    """Say how long reducer and regressor will take, from what they take for a few of the samples.

    Nothing is said where one of them fails on so few. Where the regressor was told a time, that holds.
    """
    with suppress(Exception):
        count = max(round(_PILOT_SHARE * len(features)), _FEWEST_SAMPLES)
        sizes = count, count, 2 * count  # the first only loads and compiles what is needed
        _, once, twice = (_pilot(assembly, features[:rows], theta[:rows], context) for rows in sizes)
        further = len(features) / count - 1.0
        reducer, regressor = once + further * np.maximum(twice - once, 0.0)
        regressor = context.seconds or regressor
        return f"; about {_rounded(reducer)}, then the regressor at most {_rounded(regressor)}"
    return ""


class _PilotOver(Exception):  # noqa: N818 - nothing is wrong
    """Ends a regressor's training."""


def _pilot(
    assembly: Assembly, features: NDArray[np.float32], theta: NDArray[np.float64], context: FeatureContext
) -> NDArray[np.float64]:
    """Return the seconds that the reducer and all epochs of the regressor take for these samples."""
    settings = assembly.description.identification
    start, epochs, all_epochs = time.perf_counter(), 1, 1

    def stop_early(stage: str, done: int, total: int, note: str = "") -> None:  # noqa: ARG001
        nonlocal epochs, all_epochs
        if stage == "regressor":
            epochs, all_epochs = max(done, 1), total
            if done >= _PILOT_EPOCHS:
                raise _PilotOver

    reducer = fit_in_context(settings.reducer.fit, features, context=context, seed=settings.seed)
    reduced = reducer.transform(features)
    standardised = ZScore.fit(reduced).transform(reduced)
    targets = TargetScaling.fit(theta, assembly.parameters).transform(theta)
    middle = time.perf_counter()
    with suppress(_PilotOver):
        fit_in_context(
            settings.regressor.fit, standardised, targets, context=context, seed=settings.seed, progress=stop_early
        )
    return np.array([middle - start, (time.perf_counter() - middle) * all_epochs / epochs])


def _rounded(seconds: float) -> str:
    """Write a time as one would say it."""
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"


@dataclass
class _StageTimer:
    """Wall-timer seconds of each stage, and those that the regressor may take at most."""

    limit: float | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        with logged(__name__, f"training, {name}"):
            yield
        self.seconds[name] = time.perf_counter() - start


def read_frfs(dataset: Dataset, wanted: NDArray[np.bool_], progress: Progress, *, phase: bool = False) -> NDArray[Any]:
    """Read the FRFs of some samples, each into its final place.

    Parameters
    ----------
    dataset : Dataset
    wanted : (n_samples,) bool array
    progress : callable
    phase : bool
        Read them with their phases.

    Returns
    -------
    (n, n_responses n_freq) array
        float32 amplitudes, or complex64 [m/(N s^2)].

    Raises
    ------
    DatasetError
        An FRF is not finite, a chunk is damaged, or phases are asked for and not stored.
    """
    stored, dtype = (dataset.accelerance, np.complex64) if phase else (dataset.amplitude, np.float32)
    frfs = np.empty((np.count_nonzero(wanted), dataset.amplitude.shape[1]), dtype=dtype)
    count = 0
    for rows in blocks(len(dataset)):
        block = np.asarray(stored[rows], dtype=dtype)
        if not np.isfinite(block).all():
            raise DatasetError(
                f"the dataset holds amplitudes that are not finite, in samples {rows.start}-{rows.stop}."
            )
        block = block[wanted[rows]]
        frfs[count : count + len(block)] = block
        count += len(block)
        progress("features", rows.stop, len(dataset))
    return frfs
