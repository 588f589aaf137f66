"""A study of settings: which options of reducer and regressor give the least error, one by one and together.

Settings are chosen by a validation part. The test part is a dataset of its own, generated when the choice is made, and
used once, by the best settings.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.assembly import Assembly, AssemblySource, as_assembly
from dovetail.atomic_files import locked
from dovetail.dataset import Dataset, generate
from dovetail.errors import DatasetError, DovetailError, Fault, FileError, as_dovetail_error
from dovetail.interfaces import Progress, progress_reporter, silent
from dovetail.network.evaluation import Evaluation, parameter_metrics
from dovetail.network.training import train_and_evaluate
from dovetail.parallel import on_cluster, require_cluster
from dovetail.registry import PluginPaths, Registry, components
from dovetail_bench.evaluation.study_ledger import Ledger, Trial
from dovetail_bench.evaluation.study_plan import StudyPlan, Sweep

_FIRST_PART = 0.25
"""Share of the samples on which a search's proposal is tried first."""
_PAUSE = 1.0
"""Seconds between two looks at what the others are doing."""
_WARM, _LARGE = 400, 1000
"""Samples on which a process trains once before it takes the time of a trial, and from how many on it does."""


@dataclass(frozen=True)
class Study:
    """What came out of a study.

    Parameters
    ----------
    assembly : Assembly
        As described.
    trials : tuple of Trial
        All that have ended, by number.
    sweeps : tuple of Sweep
    best : Trial
        With the least validation error.
    test : Trial
        The best settings on the test part.
    identification : mapping
        The section of a description with the best settings.
    described : mapping of str to Any
        What the description has for each option that was varied.
    """

    assembly: Assembly
    trials: tuple[Trial, ...]
    sweeps: tuple[Sweep, ...]
    best: Trial
    test: Trial
    identification: Mapping[str, Any]
    described: Mapping[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, fit for JSON."""
        plain = [_plain(trial) for trial in self.trials]
        return {
            "assembly": self.assembly.name,
            "best": self.best.number,
            "identification": dict(self.identification),
            "test": self.test.answer,
            "sweeps": [asdict(sweep) for sweep in self.sweeps],
            "trials": plain,
        }


def _plain(trial: Trial) -> dict[str, Any]:
    row = asdict(trial)
    return {name: row[name] for name in ("number", "kind", "changes", "state", "first", "answer", "reason", "claims")}


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
        For datasets and what is known so far. A study that was interrupted or killed goes on where it was. Several
        processes may work on the same one.
    plugins : path or iterable of paths
        Plugin files with further reducers and regressors.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers do the trials. They must see the folder, by the same path.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    Study
        When all trials have ended, those of other processes too.

    Raises
    ------
    DescriptionError
        The description has no study, or a value that an option cannot have.
    DovetailError
        The folder holds another study; a search needs Optuna, which is not installed; or no trial succeeded.
    """
    if scheduler is not None:
        require_cluster(scheduler)  # before a folder is made
    with progress_reporter(progress) as report:
        loaded, at, registry = as_assembly(assembly), Path(folder).absolute(), components(plugins)
        work = _Work(loaded, at, registry, report)
        if scheduler is None:
            with work.ledger.at_work():
                work.run(report)
        else:
            for _ in on_cluster(_Worker(loaded, at, registry), work.turns(report), scheduler):
                pass
    return work.result()


@dataclass(eq=False)
class _Worker:
    """What one worker of a cluster does in a study: take turns at its trials."""

    assembly: Assembly
    folder: Path
    registry: Registry

    @cached_property
    def _work(self) -> _Work:
        if not Ledger.is_in(self.folder):
            remedy = "Give a folder that is on every machine of the cluster, by the same path."
            problem = f"a worker on {socket.gethostname()} does not find the study there."
            raise DovetailError(Fault(str(self.folder), problem, "a folder that all workers share", remedy))
        work = _Work(self.assembly, self.folder, self.registry, silent)
        work.load_libraries(silent)
        return work

    def __call__(self, _turn: int) -> None:
        with self._work.ledger.at_work():
            self._work.take_turn(silent)


class _Work:
    """The work of this process on a study."""

    def __init__(self, assembly: Assembly, folder: Path, registry: Registry, progress: Progress) -> None:
        self.plan = StudyPlan(assembly, registry, progress)
        self._folder = folder
        self.ledger = Ledger(folder, self.plan.about(), self.plan.section.lease)

    def run(self, progress: Progress) -> None:
        """Work on trials until all have ended."""
        if not _is_over(self.ledger.trials()):
            self.load_libraries(progress)
        while not self.take_turn(progress):
            pass

    def turns(self, progress: Progress) -> Iterator[int]:
        """Yield a number for each turn that a worker may take, until all trials have ended."""
        for turn in count():
            trials = self.ledger.trials()
            if _is_over(trials):
                progress("trials", len(trials), len(trials))
                return
            progress("trials", sum(trial.ended for trial in trials), max(self._planned_trials, len(trials)))
            yield turn

    def take_turn(self, progress: Progress) -> bool:
        """Run a trial, or wait for those of other processes; return whether all have ended."""
        trial = self.ledger.claim(self.plan.propose)
        trials = self.ledger.trials()
        ended = sum(other.ended for other in trials)
        if trial is not None:
            progress("trials", ended, max(self._planned_trials, len(trials)), f"{trial.number}: {words(trial)}")
            self._try(trial, progress)
        elif _is_over(trials):
            progress("trials", ended, ended)
            return True
        else:
            progress("waiting", ended, len(trials), "for trials of other processes")
            time.sleep(_PAUSE)
        return False

    @property
    def _planned_trials(self) -> int:
        """The number of trials, as far as it is known from the start."""
        search = 0 if self.plan.section.search is None else self.plan.section.search.trials
        return len(self.plan.first) + search + (len(self.plan.sweeps) > 1) + 1

    def load_libraries(self, progress: Progress) -> None:
        """Train once on few samples, so that the first trial's times do not include loading and compiling."""
        if self.plan.settings.samples - self.plan.test_samples >= _LARGE:
            with suppress(DovetailError):
                train_and_evaluate(self.plan.variant({}), self._dataset(_WARM, self.plan.settings.seed, progress))

    def _try(self, trial: Trial, progress: Progress) -> None:
        with self.ledger.signs_of_life(trial):
            try:
                answer = self._answer(trial, progress)
            except (DatasetError, FileError):
                raise
            except Exception as error:  # of these settings, such as too little memory: the other trials go on
                if trial.kind == "test":
                    raise
                self.ledger.note(trial, state="failed", reason=str(as_dovetail_error(error, "").faults[0].problem))
                return
            if answer is not None:
                self.ledger.note(trial, state="done", answer=answer)

    def _answer(self, trial: Trial, progress: Progress) -> dict[str, Any] | None:
        """Run a trial and return its errors and times, or None if it was pruned."""
        assembly = self.plan.variant(trial.changes)
        samples = self.plan.settings.samples - self.plan.test_samples
        if trial.kind == "search" and self.plan.section.search is not None and self.plan.section.search.prune:
            dataset = self._dataset(round(_FIRST_PART * samples), self.plan.settings.seed, progress)
            first = _mean_error(train_and_evaluate(assembly, dataset, progress)[1])
            assert self.plan.space is not None
            hopeless = self.plan.space.is_hopeless(self.ledger.trials(), first)
            self.ledger.note(trial, first=first, **({"state": "pruned"} if hopeless else {}))
            if hopeless:
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
        plan, trials = self.plan, self.ledger.trials()
        best = plan.best(trials)
        test = next(trial for trial in trials if trial.kind == "test")
        sections = plan.complete_sections(best.changes)
        return Study(plan.assembly, tuple(trials), tuple(plan.sweeps), best, test, sections, dict(plan.described))


def _is_over(trials: Sequence[Trial]) -> bool:
    """Return whether the test, which is proposed after all other trials have ended, has ended."""
    return any(trial.kind == "test" and trial.ended for trial in trials)


def words(trial: Trial) -> str:
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
