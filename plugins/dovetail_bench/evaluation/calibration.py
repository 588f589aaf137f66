"""Calibration of the posterior: coverage of its intervals and ranks of the truth, over cases whose truth is known."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    Assembly,
    DovetailError,
    Fault,
    Frf,
    IdentificationMethod,
    ParameterError,
    Progress,
    identify,
    noisy_frf,
)
from dovetail.evaluation import (
    LEVEL,
    PRIOR_PRECISION,
    AssemblySource,
    NoiseKind,
    TrainedNetwork,
    as_assembly,
    as_dovetail_error,
    cores,
    listing,
    progress_reporter,
    side_by_side,
)
from dovetail_bench.evaluation.mesh_refinement import finer


@dataclass(frozen=True)
class Setting:
    """How the cases of a calibration are made and identified.

    Parameters
    ----------
    cases : int
    noise : float
        Standard deviation of the complex noise of every line over that of the FRF.
    samples : int
        Of each posterior.
    model_error : float
        Relative error of natural frequencies that the posterior allows the model.
    finer_mesh : int
        How many times finer the mesh of the truth is than the model's.
    seed : int
    method : str
        By which joints are identified.
    noise_kind : {"uniform", "proportional"}
        The same at every line, or over the magnitude of each.
    """

    cases: int = 100
    noise: float = 0.01
    samples: int = 400
    model_error: float = 0.0
    finer_mesh: int = 1
    seed: int = 0
    method: str = "posterior"
    noise_kind: NoiseKind = "uniform"


@dataclass(frozen=True)
class CalibratedParameter:
    """Coverage, ranks and R2 of one parameter over all cases.

    Parameters
    ----------
    name : str
    coverage : float
        Part of the cases in which the 90 % interval holds the truth.
    by_chance : tuple of float
        Between which that lies in 95 of 100 such studies if the posterior is right.
    r2 : float
        Of the estimates, on the parameter's scale: 1 - mean squared error over the variance of the range.
    p_uniform : float
        Probability that the truth's ranks among the samples are as uneven as these if the posterior is right
        (Kolmogorov and Smirnov).
    """

    name: str
    coverage: float
    by_chance: tuple[float, float]
    r2: float
    p_uniform: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """Results of a calibration: ranks, estimates and times of all cases.

    Parameters
    ----------
    setting : Setting
    names : tuple of str
        The n_params parameters.
    case : (n,) int array
        Numbers of the cases, in order; fewer than were asked for where the study was interrupted.
    truth, estimate : (n, n_params) arrays
        In fractions of the ranges, on the parameters' scales.
    rank : (n, n_params) array
        Posterior probability below the truth: uniform from 0 to 1 if the posterior is right.
    effective : (n,) array
        Effective samples of each posterior.
    reached : (n,) array
        Part of its searches that reached their target.
    seconds : (n,) array
        For the fit and the samples of each case, while others run at the same time.
    is_trustworthy : (n,) bool array
        Whether each result can be trusted; those that may not count like the others.
    wall_seconds : float
        For the whole study.
    workers : int or None
        Cases identified at the same time; None on a cluster, whose workers come and go.
    failures : mapping of int to str
        Why a case has no result, by its number.
    """

    setting: Setting
    names: tuple[str, ...]
    case: NDArray[np.int64]
    truth: NDArray[np.float64]
    estimate: NDArray[np.float64]
    rank: NDArray[np.float64]
    effective: NDArray[np.float64]
    reached: NDArray[np.float64]
    seconds: NDArray[np.float64]
    is_trustworthy: NDArray[np.bool_]
    wall_seconds: float
    workers: int | None
    failures: Mapping[int, str] = field(default_factory=dict)

    def inside(self, level: float = LEVEL) -> NDArray[np.bool_]:
        """Return whether the central interval of this probability holds the truth, (n, n_params)."""
        return np.asarray(np.abs(2.0 * self.rank - 1.0) < level)

    def by_chance(self, level: float = LEVEL, confidence: float = 0.95) -> tuple[float, float]:
        """Return the bounds within which the coverage of a calibrated posterior lies with this confidence."""
        from scipy.stats import binom

        count = len(self.case)
        low, high = binom.ppf([(1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0], count, level) / count
        return float(low), float(high)

    @property
    def parameters(self) -> tuple[CalibratedParameter, ...]:
        """Coverage, R2 and evenness of ranks, parameter by parameter."""
        from scipy.stats import kstest

        covered = self.inside().mean(axis=0)
        r2 = 1.0 - PRIOR_PRECISION * np.mean((self.estimate - self.truth) ** 2, axis=0)
        return tuple(
            CalibratedParameter(
                name,
                float(covered[column]),
                self.by_chance(),
                float(r2[column]),
                float(kstest(self.rank[:, column], "uniform").pvalue),
            )
            for column, name in enumerate(self.names)
        )

    @property
    def coverage(self) -> tuple[float, float]:
        """Part of all intervals of 90 % that hold the truth, and its standard error; a case is drawn as a whole."""
        by_case = self.inside().mean(axis=1)
        return float(by_case.mean()), float(by_case.std() / np.sqrt(len(by_case)))

    def to_dict(self) -> dict[str, Any]:
        """Return settings, results and times as plain values, fit for JSON."""
        covered, error = self.coverage
        return {
            "setting": asdict(self.setting),
            "cases": len(self.case),
            "not_trustworthy": int(np.sum(~self.is_trustworthy)),
            "level": LEVEL,
            "parameters": [asdict(parameter) for parameter in self.parameters],
            "coverage": covered,
            "coverage_error": error,
            "mean_r2": float(np.mean([parameter.r2 for parameter in self.parameters])),
            "effective_samples": {"median": float(np.median(self.effective)), "least": float(self.effective.min())},
            "reached": {"median": float(np.median(self.reached)), "least": float(self.reached.min())},
            "seconds": {"median": float(np.median(self.seconds)), "most": float(self.seconds.max())},
            "wall_seconds": self.wall_seconds,
            "workers": self.workers,
            "failures": {str(index): reason for index, reason in sorted(self.failures.items())},
        }


def calibrate(
    assembly: AssemblySource,
    *,
    cases: int = 100,
    noise: float = 0.01,
    samples: int = 400,
    model_error: float = 0.0,
    finer_mesh: int = 1,
    seed: int = 0,
    method: str | IdentificationMethod = "posterior",
    model: TrainedNetwork | None = None,
    noise_kind: NoiseKind = "uniform",
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | bool | None = None,
) -> Calibration:
    """Simulate noisy measurements of random joints, identify each, and rank the truth within its posterior.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description; with parameters to identify.
    cases : int
    noise : float
        Standard deviation of the complex noise over that of the FRF. Methods may use it.
    samples : int
        Of each posterior.
    model_error : float
        Relative error of natural frequencies that the posterior allows the model.
    finer_mesh : int
        The measurements come from a mesh so many times finer than the model's.
    seed : int
        The cases do not depend on their number, nor on that of the workers.
    method : str or IdentificationMethod
        ``"posterior"``, or another method with intervals: ``"network"`` with a `model` whose regressor has them, or
        that of a plugin. Of the options above it takes `seed` alone, if any.
    model : TrainedNetwork, optional
    noise_kind : {"uniform", "proportional"}
        The same standard deviation at every line, or `noise` times the magnitude of each.
    workers : int, optional
        Cases identified at the same time, each in its own process; by default one for each processor.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers do the cases instead of `workers` here.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    Calibration
        Of the cases that have a result; the others are among its failures. After Ctrl-C, of those done by then.

    Raises
    ------
    ParameterError
        There is nothing to identify, an option is out of its range, or the method has no intervals.
    DovetailError
        No case has a result: why the first has none.
    KeyboardInterrupt
        Ctrl-C before any case was done.

    References
    ----------
    S. Talts, M. Betancourt, D. Simpson, A. Vehtari, A. Gelman, Validating Bayesian inference algorithms with
    simulation-based calibration, arXiv:1804.06788 (2018).
    """
    assembly = as_assembly(assembly)
    called = method if isinstance(method, str) else method.name
    setting = Setting(cases, noise, samples, model_error, finer_mesh, seed, called, noise_kind)
    study = _Study(assembly, setting, method, model)
    at_once = min(cases, cores() if workers is None else workers)
    if at_once < 1:
        raise ParameterError(Fault("workers", f"{workers} are none.", "1 or more"))
    began = time.perf_counter()
    done: dict[int, _Case] = {}
    failures: dict[int, str] = {}
    try:
        cases_done = side_by_side(study.case_or_reason, cases, at_once, scheduler, _lost)
        with progress_reporter(progress) as report, closing(cases_done) as results:
            report("cases", 0, cases)
            for index, case in results:
                if isinstance(case, str):
                    failures[index] = case
                    continue
                done[index] = case
                inside = np.mean([np.abs(2.0 * other.rank - 1.0) < LEVEL for other in done.values()])
                note = f"truth in {inside:.0%} of the {LEVEL:.0%} intervals"
                report("cases", len(done) + len(failures), cases, note)
    except KeyboardInterrupt:
        if not done:
            raise
    if not done:
        raise DovetailError(next(iter(failures.values())).strip())
    seconds = time.perf_counter() - began
    return replace(_calibration(setting, assembly, done, seconds, None if scheduler else at_once), failures=failures)


def _lost(index: int, reason: Fault) -> str:
    return str(replace(reason, where=_place(index)))


def _place(index: int) -> str:
    return f"case {index + 1}"


@dataclass(frozen=True, eq=False)
class _Case:
    """One case: the rank of the truth within its posterior."""

    truth: NDArray[np.float64]
    estimate: NDArray[np.float64]
    rank: NDArray[np.float64]
    effective: float
    reached: float
    seconds: float
    is_trustworthy: bool


class _Study:
    """Simulates and identifies the cases of one study."""

    def __init__(
        self, assembly: Assembly, setting: Setting, method: str | IdentificationMethod, model: TrainedNetwork | None
    ) -> None:
        if not assembly.parameters:
            raise ParameterError(Fault(assembly.name, "all parameters are known: there is nothing to identify."))
        if setting.cases < 1:
            raise ParameterError(Fault("cases", f"{setting.cases} cases are none.", "1 or more"))
        if not (np.isfinite(setting.noise) and setting.noise > 0.0):
            raise ParameterError(Fault("noise", f"a noise of {setting.noise:g} is not positive.", "more than 0"))
        unknown = [name for name in ("samples", "model_error") if getattr(setting, name) != getattr(Setting, name)]
        if setting.method != "posterior" and unknown:
            problem = f"the method '{setting.method}' has no option {listing(unknown)} in a calibration."
            raise ParameterError(Fault("options", problem, "seed"))
        self._assembly = assembly
        self._setting, self._method, self._model = setting, method, model
        self._options: dict[str, Any] = {}
        if setting.method == "posterior":
            self._options = {"samples": setting.samples, "model_error": setting.model_error}
        self._true = finer(assembly, setting.finer_mesh)
        for response_assembly in (*assembly.each_response, *self._true.each_response):
            response_assembly.frf()  # so that processes that are copies of this one find all engines ready

    def case_or_reason(self, index: int) -> _Case | str:
        """Make and identify a measurement; return why there is no result if that fails for this case alone."""
        try:
            return self.case(index)
        except ParameterError:  # of the setting, and so of every case
            raise
        except Exception as error:  # of a plugin, or a bug: the other cases go on
            return str(as_dovetail_error(error, _place(index)))

    def case(self, index: int) -> _Case:
        """Make and identify a measurement."""
        setting, random = self._setting, np.random.default_rng([self._setting.seed, index])
        fraction = random.random(len(self._assembly.parameters))
        measured = self._measured(fraction, random)
        began = time.perf_counter()
        options = self._options if self._setting.method == "network" else {**self._options, "seed": index}
        result = identify(self._assembly, measured, self._method, model=self._model, **options)
        posterior = result.posterior
        seconds = time.perf_counter() - began
        if posterior is None:
            problem = f"the method '{setting.method}' gives no intervals here."
            remedy = "A network does with the regressor {model: mlp, uncertainty: gaussian}."
            raise ParameterError(Fault("method", problem, remedy=remedy))
        rank = posterior.weight @ (posterior.fraction < fraction)
        return _Case(
            fraction,
            posterior.weight @ posterior.fraction,
            rank,
            posterior.effective_sample_size,
            posterior.converged_fraction,
            seconds,
            result.is_trustworthy,
        )

    def _measured(self, fraction: NDArray[np.float64], random: np.random.Generator) -> list[Frf]:
        """Return one FRF with noise for each response."""
        theta = self._assembly.from_unit(fraction)
        responses = self._assembly.description.responses
        clean = [
            response.frf(assembly.frequency, assembly.frf(theta))
            for assembly, response in zip(self._true.each_response, responses, strict=True)
        ]
        setting = self._setting
        return [noisy_frf(frf, setting.noise, random, kind=setting.noise_kind) for frf in clean]


def _calibration(
    setting: Setting, assembly: Assembly, done: dict[int, _Case], wall_seconds: float, workers: int | None
) -> Calibration:
    order = sorted(done)
    rows: Sequence[_Case] = [done[index] for index in order]
    columns: dict[str, Any] = {
        name: np.array([getattr(row, name) for row in rows]) for name in _Case.__dataclass_fields__
    }
    names = tuple(parameter.name for parameter in assembly.parameters)
    return Calibration(
        setting=setting, names=names, case=np.array(order), wall_seconds=wall_seconds, workers=workers, **columns
    )
