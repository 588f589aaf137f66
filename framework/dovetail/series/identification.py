"""The identification of a series of tests."""

from __future__ import annotations

import os
from typing import Literal, TypeAlias

from dovetail.errors import Fault, ParameterError, did_you_mean
from dovetail.inference.posterior.distribution import check_options
from dovetail.interfaces import Progress, logged, progress_reporter
from dovetail.parallel import one_blas_thread
from dovetail.registry import PluginPaths
from dovetail.series.description import SeriesDescription
from dovetail.series.fitted_tests import fit_tests
from dovetail.series.fitting import fit_series
from dovetail.series.reading import read_series
from dovetail.series.result import SeriesIdentification
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns

Method: TypeAlias = Literal["posterior", "refined"]
METHODS: tuple[Method, ...] = ("posterior", "refined")


def identify_series(
    series: SeriesDescription | str | os.PathLike[str],
    method: Method = "posterior",
    *,
    samples: int = 400,
    model_error: float | None = None,
    seed: int | None = None,
    plugins: PluginPaths = (),
    progress: Progress | bool | None = None,
) -> SeriesIdentification:
    """Identify the joint of a series of tests from all its measurements together.

    Parameters
    ----------
    series : SeriesDescription or path
    method : {"posterior", "refined"}
        The fit with samples, intervals and verdicts; or the least-squares fit alone.
    samples : int
        Number of searches, each for one sample, for "posterior".
    model_error : float, optional
        Relative error of natural frequencies that the models are allowed, 0 for exact ones; by default the one that
        each test shows.
    seed : int, optional
        That of the description by default.
    plugins : path or iterable of paths
        As in `dovetail.load`.
    progress : bool or callable, optional
        As in `identify`.

    Returns
    -------
    SeriesIdentification

    Raises
    ------
    DescriptionError
        The description is wrong.
    MeasurementError
        A measurement cannot be read, or does not fit its test.
    ParameterError
        An option is out of its range.
    """
    if method not in METHODS:
        hint = did_you_mean(method, METHODS)
        raise ParameterError(Fault("method", f"'{method}' does not identify a series.", "posterior, refined", hint))
    check_options(samples)
    described = series if isinstance(series, SeriesDescription) else read_series(series, plugins=plugins)
    seed = described.seed if seed is None else seed
    with one_blas_thread(), progress_reporter(progress) as report, logged(__name__, f"series {described.name}"):
        tests = fit_tests(described, model_error=model_error, seed=seed, progress=report)
        unknowns = SeriesUnknowns(described)
        fit = fit_series(unknowns, tests, progress=report)
        if method == "refined":
            return SeriesIdentification(described, tests, unknowns, fit)
        posterior = sample_series(unknowns, tests, fit, samples=samples, seed=seed, progress=report)
        return SeriesIdentification(described, tests, unknowns, fit, posterior)
