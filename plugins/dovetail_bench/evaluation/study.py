"""A study of settings: which options of reducer and regressor give the smallest error, one by one and together.

Settings are chosen on a validation part. The test part is a separate dataset, generated after the choice and used once,
for the best settings.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail import (
    Assembly,
    Dataset,
    DatasetError,
    DovetailError,
    Evaluation,
    Fault,
    FileError,
    Progress,
    generate,
    silent,
)
from dovetail.evaluation import (
    AssemblySource,
    PluginPaths,
    Registry,
    as_assembly,
    as_dovetail_error,
    components,
    locked,
    on_cluster,
    parameter_metrics,
    progress_reporter,
    require_cluster,
    require_package,
    train_and_evaluate,
)
from dovetail_bench.evaluation.study_plan import StudyPlan, StudyTrial, Sweep

if TYPE_CHECKING:
    from dovetail_bench.evaluation.study_trials import Attempt

_FIRST_PART = 0.25
"""Share of the samples on which a search's settings are trained first."""
_PAUSE = 1.0
"""Seconds between two looks for a trial to begin."""
_WARM, _LARGE = 400, 1000
"""Samples of the training that loads the libraries, and number of samples from which on it is worth its time."""


@dataclass(frozen=True)
class Study:
    """The results of a study.

    Parameters
    ----------
    assembly : Assembly
        As described, without changed settings.
    trials : tuple of StudyTrial
        All that have ended, by number.
    sweeps : tuple of Sweep
    best : StudyTrial
        With the smallest validation error.
    test : StudyTrial
        The best settings on the test part.
    identification : mapping
        The section of a description with the best settings.
    described : mapping of str to Any
        The description's value of each option that was varied.
    """

    assembly: Assembly
    trials: tuple[StudyTrial, ...]
    sweeps: tuple[Sweep, ...]
    best: StudyTrial
    test: StudyTrial
    identification: Mapping[str, Any]
    described: Mapping[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Return the results as plain values for JSON."""
        return {
            "assembly": self.assembly.name,
            "best": self.best.number,
            "identification": dict(self.identification),
            "test": self.test.answer,
            "sweeps": [asdict(sweep) for sweep in self.sweeps],
            "trials": [asdict(trial) for trial in self.trials],
        }


def study(
    assembly: AssemblySource,
    folder: str | os.PathLike[str],
    *,
    plugins: PluginPaths = (),
    scheduler: str | None = None,
    progress: Progress | bool | None = None,
) -> Study:
    """Try the settings that the section ``study:`` of a description names, and report the best ones.

    Parameters
    ----------
    assembly : Assembly or path
        With a section ``study:``.
    folder : path
        For datasets and the record of trials. A study that was interrupted or killed continues. Several processes may
        share one folder.
    plugins : path or iterable of paths
        Plugin files with further reducers and regressors.
    scheduler : str, optional
        Address of a Dask scheduler whose workers run the trials. They need the folder under the same path.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as described in `Progress`.

    Returns
    -------
    Study
        After all trials have ended, including those of other processes.

    Raises
    ------
    DescriptionError
        The description has no study, or a value that an option cannot have.
    DovetailError
        Optuna is not installed, the folder holds another study, or no trial succeeded.
    """
    if scheduler is not None:
        require_cluster(scheduler)  # before a folder is made
    require_package("optuna", "study", "dovetail study")
    loaded, at, registry = as_assembly(assembly), Path(folder).absolute(), components(plugins)
    with progress_reporter(progress) as report, _storage_errors(at):
        work = _Work(loaded, at, registry, report)
        if scheduler is None:
            work.run(report)
        else:
            for _ in on_cluster(_Worker(loaded, at, registry), work.turns(report), scheduler):
                pass
        return work.result()


@contextmanager
def _storage_errors(folder: Path) -> Iterator[None]:
    """Convert errors of the storage of trials to one of its folder."""
    from optuna.exceptions import StorageInternalError
    from sqlalchemy.exc import SQLAlchemyError

    try:
        yield
    except (StorageInternalError, SQLAlchemyError) as error:
        cause = error.__cause__ or error
        problem = f"the record of the trials cannot be read or written: {getattr(cause, 'orig', None) or cause}."
        raise FileError(Fault(str(folder), problem, remedy="Check the disk, or choose another folder.")) from None


@dataclass(eq=False)
class _Worker:
    """The work of one worker of a cluster on a study, one trial at a time."""

    assembly: Assembly
    folder: Path
    registry: Registry

    @cached_property
    def _work(self) -> _Work:
        from dovetail_bench.evaluation.study_trials import FILE

        if not (self.folder / FILE).exists():
            remedy = "Give a folder that every machine of the cluster has under the same path."
            problem = f"a worker on {socket.gethostname()} does not find the study there."
            raise DovetailError(Fault(str(self.folder), problem, "a folder that all workers share", remedy))
        work = _Work(self.assembly, self.folder, self.registry, silent)
        work.load_libraries(silent)
        return work

    def __call__(self, _turn: int) -> None:
        with _storage_errors(self.folder):
            self._work.take_turn(silent)


class _Work:
    """The work of this process on a study."""

    def __init__(self, assembly: Assembly, folder: Path, registry: Registry, progress: Progress) -> None:
        from dovetail_bench.evaluation.study_search import SearchSpace
        from dovetail_bench.evaluation.study_trials import TrialStore

        self.plan = StudyPlan(assembly, registry, progress)
        self._folder, self._lease, search = folder, self.plan.section.lease, self.plan.section.search
        space = SearchSpace(search, self.plan.described, self.plan.settings.seed) if search else None
        self.store = TrialStore(folder, self.plan.about(), self._lease, space)

    def run(self, progress: Progress) -> None:
        """Work on trials until all have ended."""
        if not _is_over(self.store.trials()):
            self.load_libraries(progress)
        while not self.take_turn(progress):
            pass

    def turns(self, progress: Progress) -> Iterator[int]:
        """Yield a number for each trial that a worker may begin, until all trials have ended."""
        for turn in count():
            trials = self.store.trials()
            if _is_over(trials):
                progress("trials", len(trials), len(trials))
                return
            progress("trials", sum(trial.ended for trial in trials), max(self._planned_trials, len(trials)))
            yield turn

    def take_turn(self, progress: Progress) -> bool:
        """Run a trial, or wait for those of other processes; return whether all have ended."""
        attempt = self.store.begin(self.plan.propose)
        trials = self.store.trials()
        ended = sum(trial.ended for trial in trials)
        if attempt is not None:
            trial = attempt.trial
            progress("trials", ended, max(self._planned_trials, len(trials)), f"{trial.number}: {words(trial)}")
            self._try(attempt, progress)
        elif _is_over(trials):
            progress("trials", ended, ended)
            return True
        else:
            note = f"for other processes, {self._lease:.0f} s for one that was killed"
            progress("waiting", ended, len(trials), note)
            time.sleep(_PAUSE)
        return False

    @property
    def _planned_trials(self) -> int:
        """The expected number of trials."""
        search = 0 if self.plan.section.search is None else self.plan.section.search.trials
        return len(self.plan.first) + search + (len(self.plan.sweeps) > 1) + 1

    def load_libraries(self, progress: Progress) -> None:
        """Train once on few samples, so that the times of the first trial exclude loading and compiling."""
        if self.plan.settings.samples - self.plan.test_samples >= _LARGE:
            with suppress(DovetailError):
                train_and_evaluate(self.plan.variant({}), self._dataset(_WARM, self.plan.settings.seed, progress))

    def _try(self, attempt: Attempt, progress: Progress) -> None:
        with attempt.heartbeats():
            try:
                answer = self._answer(attempt, progress)
            except (DatasetError, FileError):
                raise
            except Exception as error:  # of these settings, such as too little memory: the other trials go on
                if attempt.trial.kind == "test":
                    raise
                attempt.fail(str(as_dovetail_error(error, "").faults[0].problem))
                return
            if answer is not None:
                attempt.succeed(answer)

    def _answer(self, attempt: Attempt, progress: Progress) -> dict[str, Any] | None:
        """Run a trial and return its errors and times, or None if it was pruned."""
        trial, samples = attempt.trial, self.plan.settings.samples - self.plan.test_samples
        assembly = self.plan.variant(trial.changes)
        if trial.kind == "search" and self.plan.section.search is not None and self.plan.section.search.prune:
            dataset = self._dataset(round(_FIRST_PART * samples), self.plan.settings.seed, progress)
            error = _mean_error(train_and_evaluate(assembly, dataset, progress)[1])
            with _storage_errors(self._folder):
                if attempt.is_pruned(error):
                    return None
        dataset = self._dataset(samples, self.plan.settings.seed, progress)
        network, evaluation = train_and_evaluate(assembly, dataset, progress)
        if trial.kind == "test":
            test = self._dataset(self.plan.test_samples, self.plan.settings.seed + 1, progress)
            predicted = network.predict(np.asarray(test.amplitude[:], dtype=np.float32))
            metrics = parameter_metrics(assembly.parameters, test.parameters, predicted)
            evaluation = replace(evaluation, parameters=metrics, test_samples=len(test))
        return _as_dict(evaluation)

    def _dataset(self, samples: int, seed: int, progress: Progress) -> Dataset:
        folder = self._folder / f"samples-{samples}-seed-{seed}.zarr"
        with locked(self._folder / "datasets", wait=-1):
            if folder.exists() and (made := Dataset(folder)).complete:
                return made
            return generate(
                self.plan.assembly,
                folder,
                samples=samples,
                seed=seed,
                storage=self.plan.storage,
                resume=folder.exists(),
                progress=progress,
            )

    def result(self) -> Study:
        """Return the results, once all trials have ended."""
        plan, trials = self.plan, self.store.trials()
        best = plan.best(trials)
        test = next(trial for trial in trials if trial.kind == "test")
        sections = plan.complete_sections(best.changes)
        return Study(plan.assembly, tuple(trials), tuple(plan.sweeps), best, test, sections, dict(plan.described))


def _is_over(trials: Sequence[StudyTrial]) -> bool:
    """Return whether the test, which is proposed after all other trials have ended, has ended."""
    return any(trial.kind == "test" and trial.ended for trial in trials)


def words(trial: StudyTrial) -> str:
    """Describe the settings of a trial in one line."""
    changes = ", ".join(f"{place} = {value}" for place, value in trial.changes.items())
    return f"test of {changes or 'the description'}" if trial.kind == "test" else changes or "as described"


def _mean_error(evaluation: Evaluation) -> float:
    return float(np.mean([metrics.mae for metrics in evaluation.parameters.values()]))


def _as_dict(evaluation: Evaluation) -> dict[str, Any]:
    return {
        "mae": _mean_error(evaluation),
        "r2": None if np.isnan(evaluation.mean_r2) else evaluation.mean_r2,
        "seconds": dict(evaluation.seconds),
        "training_samples": evaluation.training_samples,
        "samples": evaluation.test_samples,
        "parameters": {name: {"mae": m.mae, "r2": m.r2} for name, m in evaluation.parameters.items()},
    }
