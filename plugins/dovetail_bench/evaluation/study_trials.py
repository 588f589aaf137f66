"""The trials of a study in Optuna's storage, an SQLite file that several processes share. Needs Optuna.

A process sends heartbeats while it works on a trial. A trial without heartbeats is begun again with the same settings,
and a late result of its first process is refused. Trials are begun one at a time, under a lock of the folder, because
two processes can take the same queued trial from SQLite. A trial has its first heartbeat before it runs, because Optuna
gives up no trial without one. What must be repeated follows from all attempts, not from a queue that a process may be
killed before writing. So whenever processes are killed, no trial is lost and none that has ended is repeated.

Optuna alone does not guarantee this. Four processes worked on 40 settings while about ten were killed, twice each. With
`RDBStorage` 2 to 4 settings were finished twice, drawn by `GridSampler` or queued. With `JournalStorage` it was 1 and 3
by `GridSampler`; of queued trials one stayed running for ever, since this storage has no heartbeats.
"""

from __future__ import annotations

import json
import math
import sqlite3
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import optuna
from optuna.exceptions import StorageInternalError, UpdateFinishedTrialError
from optuna.trial import FrozenTrial, TrialState, create_trial
from sqlalchemy.pool import NullPool

from dovetail import DovetailError, Fault
from dovetail.evaluation import locked
from dovetail_bench.evaluation.study_plan import State, StudyTrial
from dovetail_bench.evaluation.study_search import SearchSpace

FILE = "trials.db"
_BEATS = 4
"""Heartbeats within the time after which a trial is given up, which is at least as many seconds."""
_BUSY = 60.0
"""Seconds to wait for another process that writes the file."""
_FEWEST = 4
"""Trials that must have ended on all samples before others are compared with their median on the first part."""
_FIRST_PART = 1
"""Optuna's step at which the error on the first part of the samples is reported."""


class TrialStore:
    """The trials of a study, for one of the processes that work on it.

    Parameters
    ----------
    folder : Path
        For the study's own files; made if it does not exist.
    about : mapping
        Identifies the study; the trials of another one are refused.
    lease : float
        Seconds without a heartbeat after which a trial is begun again.
    space : SearchSpace, optional
        From which trials of the kind "search" are drawn.

    Raises
    ------
    DovetailError
        The folder holds another study.
    """

    def __init__(self, folder: Path, about: Mapping[str, Any], lease: float, space: SearchSpace | None = None) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._lock, self._space = folder / "trials", space
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        pruner = optuna.pruners.MedianPruner(n_startup_trials=0, n_min_trials=_FEWEST)
        with locked(self._lock):
            self._storage = _open_storage(folder / FILE, max(_BEATS, math.ceil(lease)))
            self._study = optuna.create_study(
                storage=self._storage, pruner=pruner, study_name="dovetail", load_if_exists=True
            )
            about, known = json.loads(json.dumps(about)), self._study.user_attrs.get("about")
            if known is None and not self._study.get_trials(deepcopy=False):
                self._study.set_user_attr("about", known := about)
        if known != about:
            problem = "the folder holds a study of another description, or one with other settings."
            remedy = "Choose another folder, or remove this one."
            raise DovetailError(Fault(str(folder), problem, remedy=remedy))

    def trials(self) -> list[StudyTrial]:
        """Return all trials as they are now, by number."""
        attempts: dict[int, list[FrozenTrial]] = {}
        for attempt in self._study.get_trials(deepcopy=False):
            attempts.setdefault(attempt.user_attrs["number"], []).append(attempt)
        return [_from_attempts(attempts[number]) for number in sorted(attempts)]

    def begin(self, propose: Callable[[Sequence[StudyTrial]], StudyTrial | None]) -> Attempt | None:
        """Begin a trial in this process; return None if there is none to begin at the moment.

        Parameters
        ----------
        propose : callable
            Called with all trials if none must be repeated; returns a further one, or None.
        """
        with locked(self._lock), warnings.catch_warnings(action="ignore"):  # heartbeats are experimental
            optuna.storages.fail_stale_trials(self._study)
            if not self._queued():  # as it is where a process was killed before the trial began
                trials = self.trials()
                trial = next((trial for trial in trials if trial.state == "waiting"), None) or propose(trials)
                if trial is None:
                    return None
                self._enqueue(trial)
            self._storage.record_heartbeat(self._queued()[0]._trial_id)
            return Attempt(self._storage, self._study, self._study.ask())

    def _queued(self) -> list[FrozenTrial]:
        return self._study.get_trials(deepcopy=False, states=(TrialState.WAITING,))

    def _enqueue(self, trial: StudyTrial) -> None:
        """Queue a trial, with Optuna's parameters where its settings inform the search."""
        changes, params = trial.changes, dict[str, Any]()
        if self._space is not None and trial.kind != "test":
            if trial.kind == "search" and not changes:
                changes = self._space.sample(self._study.get_trials(deepcopy=False), trial.number)
            params = self._space.parameters(changes)
        self._study.add_trial(
            create_trial(
                state=TrialState.WAITING,
                params=params,
                distributions=self._space.distributions if self._space is not None and params else {},
                user_attrs={"number": trial.number, "kind": trial.kind, "changes": changes},
            )
        )


class Attempt:
    """A trial that this process works on. Once it was given up, its results are refused without an error."""

    def __init__(self, storage: optuna.storages.RDBStorage, study: optuna.Study, asked: optuna.Trial) -> None:
        self._storage, self._study, self._asked = storage, study, asked
        self.trial = StudyTrial(**asked.user_attrs, state="running")

    @contextmanager
    def heartbeats(self) -> Iterator[None]:
        """Send heartbeats while the block runs; the trial is begun again if the block has not ended it."""
        over = threading.Event()

        def beat() -> None:
            while not over.wait(self._storage.get_heartbeat_interval()):
                with suppress(StorageInternalError):  # the next one may succeed
                    self._storage.record_heartbeat(self._asked._trial_id)

        thread = threading.Thread(target=beat, daemon=True)
        thread.start()
        try:
            with suppress(UpdateFinishedTrialError):
                yield
        finally:
            over.set()
            thread.join()
            self._study.tell(self._asked, state=TrialState.FAIL, skip_if_finished=True)

    def is_pruned(self, error: float) -> bool:
        """Record the error on the first part of the samples; end the trial if it is above the median of the others."""
        self._asked.report(error, _FIRST_PART)
        if pruned := self._asked.should_prune():
            self._study.tell(self._asked, state=TrialState.PRUNED, skip_if_finished=True)
        return pruned

    def succeed(self, answer: Mapping[str, Any]) -> None:
        """End the trial with its errors and times."""
        self._asked.set_user_attr("answer", dict(answer))
        self._study.tell(self._asked, answer["mae"], skip_if_finished=True)

    def fail(self, reason: str) -> None:
        """End the trial with the reason why its settings cannot be used."""
        self._asked.set_user_attr("reason", reason)
        self._study.tell(self._asked, state=TrialState.FAIL, skip_if_finished=True)


def _open_storage(file: Path, patience: int) -> optuna.storages.RDBStorage:
    """Open the file by a function, since the name of a folder may contain signs that have a meaning in an address."""

    def connect() -> sqlite3.Connection:
        return sqlite3.connect(file, timeout=_BUSY, check_same_thread=False)

    with warnings.catch_warnings(action="ignore"):  # heartbeats are experimental
        return optuna.storages.RDBStorage(
            "sqlite://",
            engine_kwargs={"creator": connect, "poolclass": NullPool},
            heartbeat_interval=patience // _BEATS,
            grace_period=patience,
        )


def _from_attempts(attempts: Sequence[FrozenTrial]) -> StudyTrial:
    """Return a trial from all attempts at it, of which at most one has ended it."""
    last = next((attempt for attempt in attempts if _state(attempt) not in ("waiting", "running")), attempts[-1])
    first = last.intermediate_values.get(_FIRST_PART)
    return StudyTrial(**last.user_attrs, state=_state(last), first=first, attempts=len(attempts))


def _state(attempt: FrozenTrial) -> State:
    if "answer" in attempt.user_attrs:  # even if its process was killed before Optuna recorded the state
        return "done"
    if "reason" in attempt.user_attrs:
        return "failed"
    states: dict[TrialState, State] = {TrialState.PRUNED: "pruned", TrialState.RUNNING: "running"}
    return states.get(attempt.state, "waiting")
