"""Training: from a dataset to an evaluated network.

The samples are split into a training and a test part. Reducer and regressor are fitted to the training FRFs, as they
are or with noise that is new in every epoch. The test part gives the evaluation.
"""

from __future__ import annotations

import tempfile
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.dataset import Dataset, Storage, generate
from dovetail.description import AugmentationSection, IdentificationSettings
from dovetail.errors import Fault, ParameterError, PluginError
from dovetail.interfaces import (
    FeatureContext,
    FittedReducer,
    FittedRegressor,
    Progress,
    fit_in_context,
    plugin_errors,
    silent,
    takes_context,
)
from dovetail.interfaces.component import check_contract, component_label
from dovetail.network.augmentation import TRAINING_TOLERANCE, NoisyFeatures, measured_noises
from dovetail.network.bundle import TrainedNetwork
from dovetail.network.correction import Correction, GaussNewtonFeatures
from dovetail.network.epochs import FreshEpochs, ReducedEpochs
from dovetail.network.evaluation import Evaluation, parameter_metrics
from dovetail.network.novelty import learn_novelty
from dovetail.network.pipeline import Network, Reduction, missing_distribution, reduce_features
from dovetail.network.preprocessing import (
    TargetScaling,
    ZScore,
    blocks,
    draw_test_samples,
    log10p1,
    read_frfs,
)
from dovetail.network.stage_timer import StageTimer
from dovetail.parallel import one_blas_thread

_WORTH_FORECASTING = 10.0
"""Computation time of the FRFs [s] above which a training forecasts its duration."""
_CORRECTION_EPOCH = 2**31
"""First epoch of the first correction, and half that of the second, so that no FRF is used twice."""
_TRIAL_ROWS, _TRIAL_SECONDS = 256, 0.5
_PILOT_SHARE, _PILOT_EPOCHS = 0.02, 3
"""Share of the samples and number of epochs on which the forecast is based."""


def train_network(
    assembly: Assembly, dataset: Dataset | None, *, robust: bool, fresh: bool, minutes: float | None, progress: Progress
) -> TrainedNetwork:
    """Train the network of an assembly's description; parameters and errors as `dovetail.train` has them."""
    timer = StageTimer(__name__, _seconds(assembly, minutes))
    if robust or fresh:
        assembly = _with_augmentation(assembly, fresh=fresh)
    measured_noises(assembly)  # faults of their files are reported before any work
    _check_correction(assembly)
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
    """Return the time limit of the regressor [s].

    Raises
    ------
    ParameterError
        The time is not positive, or the regressor ignores it.
    """
    if minutes is None:
        return None
    if not 0.0 < minutes < np.inf:
        raise ParameterError(Fault("minutes", f"{minutes:g} min is not a positive time.", "more than 0"))
    regressor = assembly.description.identification.regressor
    augmented = assembly.description.identification.augmentation is not None
    if not takes_context(regressor.fit) or (augmented and not takes_context(regressor.fit_epochs)):
        problem = f"the {component_label(regressor)} has no time limit."
        raise ParameterError(Fault("minutes", problem, "a regressor whose 'fit' takes the context"))
    return 60.0 * minutes


def _check_correction(assembly: Assembly) -> None:
    """Make sure, before any work, that a correction can be trained.

    Raises
    ------
    ParameterError
        The training has no fresh samples.
    PluginError
        The regressor predicts values without a distribution, or fails on a few random rows.
    """
    settings = assembly.description.identification
    if settings.correction is None:
        return
    if settings.augmentation is None or not settings.augmentation.fresh:
        problem = (
            "a correction is trained on samples that the first regressor has not seen, but no fresh samples are drawn."
        )
        remedy = "Set 'augmentation: {fresh: true}', or train with `fresh=True`."
        raise ParameterError(Fault("identification.correction", problem, remedy=remedy))
    generator, label = np.random.default_rng(settings.seed), component_label(settings.regressor)
    features = generator.standard_normal((_TRIAL_ROWS, 4), dtype=np.float32)
    targets = generator.random((_TRIAL_ROWS, len(assembly.parameters)))
    names = tuple(parameter.name for parameter in assembly.parameters)
    context = FeatureContext(assembly.frequency, ("trial",), names, seconds=_TRIAL_SECONDS)
    with plugin_errors(settings.regressor, label):
        fitted = fit_in_context(settings.regressor.fit, features, targets, context=context, seed=settings.seed)
        check_contract(fitted, settings.regressor, FittedRegressor)
        if fitted.predict_distribution(features) is None:
            raise PluginError(missing_distribution(settings.regressor))


def _with_augmentation(assembly: Assembly, *, fresh: bool) -> Assembly:
    """Return the assembly with noise on its training FRFs, and with new ones in every epoch if `fresh`."""
    given = assembly.description.identification.augmentation
    changes = {"fresh": True} if fresh else {}
    settings = (given or AugmentationSection()).model_copy(update=changes)
    section = {"augmentation": settings.model_dump(exclude_unset=True)}
    return assembly.with_description(assembly.description.with_identification(section, augmentation=settings))


def needs_phase(assembly: Assembly) -> bool:
    """Return whether a remaining sensor mass is added to FRFs of the dataset, which requires their phases."""
    augmentation = assembly.description.identification.augmentation
    return augmentation is not None and augmentation.mass > 0 and not augmentation.fresh


def _train(assembly: Assembly, dataset: Dataset, timer: StageTimer, progress: Progress) -> TrainedNetwork:
    network, evaluation = train_and_evaluate(assembly, dataset, progress, timer)
    settings, theta = assembly.description.identification, np.asarray(dataset.parameters, dtype=np.float64)
    is_test = draw_test_samples(len(dataset), settings.test_fraction, settings.seed)
    novelty = None
    progress("novelty", 0, 1)
    with timer.stage("novelty"):
        if len(assembly.description.responses) == 1:
            rows = next(blocks(len(dataset)))
            amplitude = np.asarray(dataset.amplitude[rows], dtype=np.float32)[~is_test[rows]]
            with one_blas_thread():  # many small products, for which threads only wait
                count = int(np.count_nonzero(~is_test))
                novelty = learn_novelty(assembly, network, amplitude, theta[is_test], count, settings.seed)
    return TrainedNetwork(assembly, network, evaluation, novelty)


def train_and_evaluate(
    assembly: Assembly, dataset: Dataset, progress: Progress = silent, timer: StageTimer | None = None
) -> tuple[Network, Evaluation]:
    """Train a network on one part of a dataset, and evaluate it on the other.

    Parameters
    ----------
    assembly : Assembly
    dataset : Dataset
        Made from this assembly.
    progress : callable
    timer : optional
        Measures the stages.

    Raises
    ------
    DatasetError
        The dataset is that of another assembly, or too small.
    PluginError
        Reducer or regressor fail.
    """
    timer = StageTimer(__name__) if timer is None else timer
    dataset.require(assembly)
    _check_correction(assembly)
    settings = assembly.description.identification
    is_test = draw_test_samples(len(dataset), settings.test_fraction, settings.seed)
    theta = np.asarray(dataset.parameters, dtype=np.float64)
    network = _fit_network(assembly, dataset, is_test, timer, progress)
    progress("evaluation", 0, 1)
    with timer.stage("evaluation"):
        predicted = network.predict(test := read_frfs(dataset, is_test, silent))
        network.predict_distribution(test[:2])  # so that faults show before the first measurement
        if not np.isfinite(predicted).all():
            label = component_label(settings.regressor)
            with plugin_errors(settings.regressor, label):
                raise PluginError(Fault(label, "its predictions for the test FRFs are not finite.", "finite numbers"))
    evaluation = Evaluation(
        parameters=parameter_metrics(assembly.parameters, theta[is_test], predicted),
        training_samples=int(np.count_nonzero(~is_test)),
        test_samples=int(np.count_nonzero(is_test)),
        seed=settings.seed,
        seconds=timer.seconds,
    )
    return network, evaluation


def _fit_network(
    assembly: Assembly, dataset: Dataset, is_test: NDArray[np.bool_], timer: StageTimer, progress: Progress
) -> Network:
    """Fit to the training FRFs, with noise if the description has it."""
    settings = assembly.description.identification
    theta = dataset.parameters[~is_test]
    noisy = None
    with timer.stage("features"):
        features = read_frfs(dataset, ~is_test, progress, phase=needs_phase(assembly))
        if settings.augmentation is not None:
            noisy = NoisyFeatures.from_samples(assembly, features, theta)
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
    first = replace(context, seconds=timer.first_share) if settings.correction is not None else context
    named: dict[str, Any] = {"context": first, "seed": settings.seed, "progress": progress}
    with timer.stage("regressor"), plugin_errors(settings.regressor, component_label(settings.regressor)):
        pair = reduction.standardise(reduced, theta)
        if noisy is None:
            regressor = fit_in_context(settings.regressor.fit, *pair, **named)
        elif noisy.fresh:
            epochs = FreshEpochs(noisy, reduction, pair)
            regressor = fit_in_context(settings.regressor.fit_epochs, epochs, **named)
        else:
            with ReducedEpochs(noisy, reduction, pair) as copies:
                regressor = fit_in_context(settings.regressor.fit_epochs, copies, **named)
    recipes = settings.reducer, settings.regressor
    network = Network(reducer, feature_scaling, regressor, target_scaling, recipes)
    if settings.correction is None:
        return network
    assert noisy is not None  # checked by _check_correction
    for _ in range(settings.correction.rounds):
        correction = _fit_correction(assembly, noisy, network, context, timer, progress)
        network = replace(network, corrections=(*network.corrections, correction))
    return network


def _fit_correction(
    assembly: Assembly,
    noisy: NoisyFeatures,
    network: Network,
    context: FeatureContext,
    timer: StageTimer,
    progress: Progress,
) -> Correction:
    """Train a regressor that corrects the network's answers, on FRFs of its own."""
    settings, before = assembly.description.identification, len(network.corrections)
    assert settings.correction is not None
    count, rounds, recipe = settings.correction.samples, settings.correction.rounds, settings.regressor
    gauss_newton = GaussNewtonFeatures.for_assembly(assembly, network.target_scaling)
    name, features, targets = f"correction {before + 1} of {rounds}", [], []
    with timer.stage(f"FRFs of {name}"):
        for block, rows in enumerate(timer.blocks_in_time(blocks(count), rounds - before)):
            epoch = (before + 1) * _CORRECTION_EPOCH + block
            amplitude, theta = noisy.amplitudes(epoch, rows.stop - rows.start)
            distribution = network.predict_distribution(amplitude)
            assert distribution is not None  # checked by _check_correction
            features.append(gauss_newton(amplitude, distribution))
            targets.append(network.target_scaling.transform(theta))
            progress(f"FRFs of {name}", rows.stop, count)

    def report(stage: str, done: int, total: int, note: str = "") -> None:  # noqa: ARG001
        progress(name, done, total, note)

    seconds = timer.remaining_share(rounds - before)
    with timer.stage(name), plugin_errors(recipe, component_label(recipe)):
        standardised, features = np.concatenate(features), []  # 800 MB each for 400,000 FRFs
        scaling = ZScore.fit(standardised)
        standardised = scaling.transform(standardised, out=standardised)
        context = replace(context, seconds=seconds)
        named: dict[str, Any] = {"context": context, "seed": settings.seed, "progress": report}
        regressor = fit_in_context(recipe.fit, standardised, np.concatenate(targets), **named)
        return Correction(gauss_newton, scaling, regressor)


def _context(
    assembly: Assembly, dataset: Dataset, is_test: NDArray[np.bool_], noisy: NoisyFeatures | None, seconds: float | None
) -> FeatureContext:
    """Return the context of the features, with the FRFs' phases if they are stored and no noise is added."""
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
    timer: StageTimer,
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
    """Forecast the times of reducer and regressor from those for a few of the samples, as a note for the progress.

    It is empty if one of them fails on so few samples. A time limit of the regressor replaces its forecast.
    """
    with suppress(Exception):
        count = max(round(_PILOT_SHARE * len(features)), 2)
        sizes = count, count, 2 * count  # the first only loads and compiles
        _, once, twice = (_pilot(assembly, features[:rows], theta[:rows], context) for rows in sizes)
        further = len(features) / count - 1.0
        reducer, regressor = once + further * np.maximum(twice - once, 0.0)
        regressor = context.seconds or regressor
        return f"; about {_rounded(reducer)}, then the regressor at most {_rounded(regressor)}"
    return ""


class _PilotOver(Exception):  # noqa: N818 - nothing is wrong
    """Ends the training of the pilot."""


def _pilot(
    assembly: Assembly, features: NDArray[np.float32], theta: NDArray[np.float64], context: FeatureContext
) -> NDArray[np.float64]:
    """Return the seconds that the reducer and all epochs of the regressor take for few samples."""
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
    """Write a time in whole seconds or minutes."""
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"
