"""A watch: it looks at a folder again and again, and takes each new measurement once."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dovetail.errors import DovetailError, Fault, FileError, ParameterError, as_dovetail_error, reason_of
from dovetail.interfaces import Progress, silent
from dovetail.monitoring.arrivals import Arrival, Folder, Version
from dovetail.monitoring.dates import date_remarks
from dovetail.monitoring.journal import Journal
from dovetail.monitoring.records import DUPLICATE, MEASURED, SET_ASIDE, measured_record, record_of
from dovetail.monitoring.reference import Reference
from dovetail.monitoring.same_values import are_same_values, values_of_some_lines
from dovetail.monitoring.tracker import Step, Tracker, WatchOptions
from dovetail.parallel import one_blas_thread
from dovetail.registry import PluginPaths
from dovetail.series import SeriesDescription, read_series
from dovetail.series.measured_files import agreed_covariates, covariates_of

_LONGEST_WAIT = 30.0
"""Seconds for which a single look waits for files that are still being written."""


class Watch:
    """The watch of a folder of measured files.

    Parameters
    ----------
    series : SeriesDescription or path
        Its first test says how files are read and with which assembly they are compared. A parameter that is
        `shared` is constant; one that is `varying`, or follows a law, drifts from file to file; of one that is `free`,
        earlier files say nothing.
    folder : path
        Only its files are looked at, not those of folders within it.
    output : path
        Folder of the state and the journal; a watch that was stopped goes on from there.
    options : WatchOptions, optional
    settle : float
        Seconds for which a file must not have changed before it is read.
    plugins : path or iterable of paths
        As in `dovetail.load`.
    progress : Progress

    Raises
    ------
    DescriptionError
        The description is wrong.
    MeasurementError
        A measurement of a test cannot be read, or does not fit its test.
    ParameterError
        The names of the first test's files do not show which belong together, there are too few files to learn from,
        or nothing can change.
    FileError
        A folder cannot be used, or has the state of another watch.
    """

    def __init__(
        self,
        series: SeriesDescription | str | os.PathLike[str],
        folder: str | os.PathLike[str],
        output: str | os.PathLike[str],
        options: WatchOptions | None = None,
        *,
        settle: float = 2.0,
        plugins: PluginPaths = (),
        progress: Progress = silent,
    ) -> None:
        self.options = options or WatchOptions()
        _check_folders(Path(folder), Path(output))
        described = series if isinstance(series, SeriesDescription) else read_series(series, plugins=plugins)
        with one_blas_thread():
            self.reference = Reference.of(described, plugins=plugins, progress=progress)
        self._tracker = Tracker(self.reference, self.options)
        fingerprint = f"{self.reference.fingerprint} {self.options.reference} {self.options.false_alarms!r}"
        self._journal = Journal.open(Path(output), fingerprint, self._tracker.start())
        self._folder = Folder(Path(folder), settle, responses=self.reference.responses)
        self._counted: dict[str, str] = {}
        self._said: set[tuple[str, str]] = set()
        for record in self._journal.records:
            self._remember(record)

    @property
    def records(self) -> list[dict[str, Any]]:
        """A record of each file so far, in the order in which they were taken; as in ``files.jsonl``."""
        return self._journal.records

    @property
    def folder(self) -> Path:
        """The watched folder."""
        return self._folder.path

    def _remember(self, record: dict[str, Any]) -> None:
        for file in record.get("files", [record]):
            self._folder.known[file["file"]] = Version(file["size"], file["changed_ns"])
        self._said.add((record["file"], record["sha256"]))
        if record["status"] != DUPLICATE:
            self._counted.setdefault(record["sha256"], record["file"])

    def look(
        self,
        *,
        trust_old: bool = False,
        stop: threading.Event | None = None,
        report: Callable[[dict[str, Any]], None] | None = None,
    ) -> bool:
        """Take all complete new files, and return whether others are still being written.

        Parameters
        ----------
        trust_old : bool
            Take files at once that were changed long ago.
        stop : threading.Event, optional
            Ends the look after the present file.
        report : callable, optional
            Called with the record of each file.
        """
        arrivals, waiting = self._folder.look(trust_old=trust_old)
        for arrival in arrivals:
            if stop is not None and stop.is_set():
                break
            record = self._take(arrival)
            if record is not None and report is not None:
                report(record)
        return waiting

    def run(
        self,
        stop: threading.Event,
        *,
        once: bool = False,
        interval: float = 2.0,
        report: Callable[[dict[str, Any]], None] | None = None,
        looked: Callable[[], None] | None = None,
        failed: Callable[[DovetailError], None] | None = None,
    ) -> None:
        """Look at the folder until stopped.

        Parameters
        ----------
        stop : threading.Event
        once : bool
            End when all files are taken; those that are still being written are waited for up to half a minute.
        interval : float
            Seconds between two looks.
        report : callable, optional
            Called with the record of each file.
        looked : callable, optional
            Called after each look.
        failed : callable, optional
            Called when the folder cannot be read, as where a network is down; without it, and with `once`, the error
            is raised.
        """
        patience, wait = _LONGEST_WAIT, max(self._folder.settle, 0.1)
        while not stop.is_set():
            waiting = False
            try:
                waiting = self.look(trust_old=once, stop=stop, report=report)
            except FileError as error:
                if once or failed is None or self._folder.path.is_dir():
                    raise
                failed(error)
            if looked is not None:
                looked()
            if once:
                if not waiting or patience <= 0.0:
                    return
                patience -= wait
            stop.wait(wait if once else interval)

    def _take(self, arrival: Arrival) -> dict[str, Any] | None:
        """Take one file, and return its record; None if it has changed meanwhile, or nothing new is to be said."""
        if (arrival.name, arrival.digest) in self._said:
            self._folder.settled(arrival)
            return None
        known = self._counted.get(arrival.digest)
        if known is not None:
            return self._add(arrival, record_of(arrival, DUPLICATE, reason=f"it has the same content as '{known}'."))
        step = None
        if arrival.digest.startswith("unread: "):
            record = record_of(arrival, SET_ASIDE, reason=arrival.digest.removeprefix("unread: "))
        else:
            try:
                with one_blas_thread(), warnings.catch_warnings(record=True) as caught:
                    warnings.simplefilter("always", UserWarning)
                    record, step = self._measured(arrival, caught)
            except Exception as error:  # whatever is wrong with one file, the watch goes on
                reason = self._shortened(reason_of(as_dovetail_error(error, arrival.name)))
                record = record_of(arrival, SET_ASIDE, reason=reason.removeprefix(f"{arrival.name}: "))
        if not self._folder.is_unchanged(arrival):
            return None
        return self._add(arrival, record, step)

    def _measured(self, arrival: Arrival, caught: list[warnings.WarningMessage]) -> tuple[dict[str, Any], Step | None]:
        counted = [record for record in self.records if record["status"] in MEASURED]
        dofs = next((record["dofs"] for record in counted if record["dofs"]), ())
        reading = self.reference.read([file.path for file in arrival.files], dofs)
        values = values_of_some_lines(reading.observations)
        same = next((record["file"] for record in counted if are_same_values(record["values"], values)), None)
        if same is not None:
            return record_of(arrival, DUPLICATE, reason=f"it has the same values as '{same}', in another form."), None
        described = self.reference.series.covariates
        named = covariates_of(arrival.name, described)
        covariates = agreed_covariates([file for _, file in reading.files], named, described, "in its name")
        step = self._tracker.step(self._journal.state, reading.observations, covariates)
        notes = [str(warning.message) for warning in caught]
        notes += [remark for path, file in reading.files for remark in date_remarks(path.name, path, file.content)]
        if counted and arrival.date < counted[-1]["date"]:
            notes.append(f"It came after '{counted[-1]['file']}', and its date is earlier.")
        if arrival.name in {record["file"] for record in counted}:
            notes.append("A file of this name was counted before, with other values.")
        notes = list(dict.fromkeys(map(self._shortened, notes)))
        record = measured_record(arrival, step, self.reference, covariates, notes)
        return {**record, "values": values, "dofs": [list(pair) for pair in reading.dofs]}, step

    def _shortened(self, text: str) -> str:
        """Return a text with the names of files in the watched folder instead of their paths."""
        return text.replace(f"{self._folder.path}{os.sep}", "")

    def _add(self, arrival: Arrival, record: dict[str, Any], step: Step | None = None) -> dict[str, Any]:
        self._journal.add(record, self._journal.state if step is None else step.state)
        self._remember(record)
        self._folder.settled(arrival)
        return record


def _check_folders(folder: Path, output: Path) -> None:
    if not folder.is_dir():
        problem = "this is a file." if folder.exists() else "there is no such folder."
        raise FileError(Fault(str(folder), problem, "a folder of measured files"))
    if output.exists() and not output.is_dir():
        raise FileError(Fault(str(output), "this is a file, not a folder for results."))
    if folder.resolve() == output.resolve():
        problem = "the results cannot be in the folder that is watched: they would count as measurements."
        raise ParameterError(Fault(str(output), problem, remedy="Choose another folder, or one within it."))
