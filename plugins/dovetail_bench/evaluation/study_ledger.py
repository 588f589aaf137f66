"""The ledger of a study: every trial, who works on it, and its result, in one file that several processes share.

A process claims a trial before it begins. The claim ends when the process ends, which a lock of the operating system
shows, or when the process has not renewed its lease in time. Another process then claims the trial, with the same
settings; the result of a process that has lost its claim is refused. So no trial is lost, and none has two results.
"""

from __future__ import annotations

import json
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

from dovetail.atomic_files import is_locked, locked, read_bounded, write_whole
from dovetail.errors import DovetailError, Fault

Kind: TypeAlias = Literal["described", "sweep", "together", "search", "test"]
State: TypeAlias = Literal["waiting", "running", "done", "pruned", "failed"]

_FORMAT = 1
_FILE = "ledger.json"
_SIGNS = 4
"""Number of times that a process renews its lease within the time of the lease."""


@dataclass
class Trial:
    """The settings of a trial, its state, and its result.

    Parameters
    ----------
    number : int
        From 0.
    kind : {"described", "sweep", "together", "search", "test"}
        The settings of the description, one option changed, the best value of each sweep, a search's proposal, or the
        best settings evaluated on the test part.
    changes : dict of str to Any
        Options that differ from the description, by their places in `identification`.
    state : {"waiting", "running", "done", "pruned", "failed"}
    owner, machine : str
        The process that claimed it, and its machine.
    until : float
        End of the lease, in seconds since 1970.
    first : float or None
        Validation error of a search's proposal on the first part of the samples, by which it is pruned.
    answer : dict or None
        Errors, times and sizes.
    reason : str
        Why it failed.
    claims : int
        How often it was claimed.
    """

    number: int
    kind: Kind
    changes: dict[str, Any]
    state: State = "waiting"
    owner: str = ""
    machine: str = ""
    until: float = 0.0
    first: float | None = None
    answer: dict[str, Any] | None = None
    reason: str = ""
    claims: int = 0

    @property
    def ended(self) -> bool:
        """Whether no process needs to work on it any more."""
        return self.state in ("done", "pruned", "failed")


@dataclass(frozen=True)
class Proposal:
    """A further trial."""

    kind: Kind
    changes: dict[str, Any] = field(default_factory=dict)


class Ledger:
    """The trials of a study, for one of the processes that work on it.

    Parameters
    ----------
    folder : Path
        For the study's own files; made if it does not exist.
    about : mapping
        Identifies the study; a ledger of another one is refused.
    lease : float
        Seconds after which a process that gives no sign of life loses its trial.

    Raises
    ------
    DovetailError
        The folder holds another study, or a ledger that cannot be read.
    """

    def __init__(self, folder: Path, about: Mapping[str, Any], lease: float) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self._lease = folder, lease
        self._about = json.loads(json.dumps(about))
        self._owner, self._machine = secrets.token_hex(8), socket.gethostname()
        with self._open():
            pass

    @staticmethod
    def is_in(folder: Path) -> bool:
        """Return whether a folder has a ledger."""
        return (folder / _FILE).exists()

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Hold the lock that shows others that this process is alive; remove the lock files of killed processes."""
        with locked(self._lock_of(self._owner)):
            yield
        for marker in self.folder.glob(".process-*.lock"):  # also of those that were killed before they claimed a trial
            is_locked(marker.with_name(marker.stem[1:]))

    def trials(self) -> list[Trial]:
        """Return all trials as they are now."""
        with self._open() as trials:
            return trials

    def claim(self, propose: Callable[[Sequence[Trial]], Proposal | None]) -> Trial | None:
        """Claim a trial for this process; return None if there is none to claim at the moment.

        Parameters
        ----------
        propose : callable
            Called with all trials if none is waiting; returns a further one, or None.
        """
        with self._open() as trials:
            for other in trials:
                if other.state == "running" and self._is_abandoned(other):
                    other.state = "waiting"
            trial = next((trial for trial in trials if trial.state == "waiting"), None)
            if trial is None:
                proposal = propose(trials)
                if proposal is None:
                    return None
                trial = Trial(len(trials), proposal.kind, proposal.changes)
                trials.append(trial)
            trial.state, trial.owner, trial.machine, trial.first = "running", self._owner, self._machine, None
            trial.until, trial.claims = time.time() + self._lease, trial.claims + 1
            return trial

    def note(self, trial: Trial, **values: Any) -> bool:
        """Record values of a trial; return False and record nothing if this process has lost its claim."""
        with self._open() as trials:
            known = trials[trial.number]
            if known.state != "running" or known.owner != self._owner:
                return False
            for name, value in values.items():
                setattr(known, name, value)
            return True

    @contextmanager
    def signs_of_life(self, trial: Trial) -> Iterator[None]:
        """Renew the lease of a trial while the block runs; give the trial back if the block has not ended it."""
        ended = threading.Event()

        def renew() -> None:
            while not ended.wait(self._lease / _SIGNS):
                if not self.note(trial, until=time.time() + self._lease):
                    return

        thread = threading.Thread(target=renew, daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()
            self.note(trial, state="waiting")  # nothing where it has ended

    def _is_abandoned(self, trial: Trial) -> bool:
        if trial.until < time.time():
            return True
        return trial.machine == self._machine and not (
            trial.owner == self._owner or is_locked(self._lock_of(trial.owner))
        )

    def _lock_of(self, owner: str) -> Path:
        return self.folder / f"process-{owner}"

    @contextmanager
    def _open(self) -> Iterator[list[Trial]]:
        """Yield the trials while no other process reads or writes them, and write the changes."""
        file = self.folder / _FILE
        with locked(self.folder / "trials"):
            before = self._read(file) if file.exists() else None
            trials = [] if before is None else [Trial(**trial) for trial in before]
            yield trials
            after = [asdict(trial) for trial in trials]
            if after != before:
                content = {"format": _FORMAT, "about": self._about, "trials": after}
                text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
                write_whole(file, text.encode(), overwrite=True)

    def _read(self, file: Path) -> list[dict[str, Any]]:
        try:
            stored = json.loads(read_bounded(file))
            about, trials = stored["about"], stored["trials"]
            known = stored["format"] == _FORMAT and all(Trial(**trial) for trial in trials)
        except (ValueError, KeyError, TypeError):
            known, about, trials = False, None, []
        if not known:
            raise DovetailError(Fault(str(file), "this is no ledger of a study.", remedy="Choose another folder."))
        if about != self._about:
            problem = "the folder holds a study of another description, or one with other settings."
            remedy = "Choose another folder, or remove this one."
            raise DovetailError(Fault(str(file.parent), problem, remedy=remedy))
        return list(trials)
