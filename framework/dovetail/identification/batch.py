"""Batches: the joint identified from each of many measurements, side by side."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from itertools import chain, count
from pathlib import Path
from textwrap import indent
from typing import Any

from dovetail.assembly import Assembly, AssemblySource, as_assembly
from dovetail.errors import DovetailError, Fault, MeasurementError, as_dovetail_error, listing
from dovetail.frf import Frf
from dovetail.identification.measured_lines import batch_contradictions
from dovetail.identification.one_measurement import Measurement, as_frfs, identify
from dovetail.identification.parameters import dataframe
from dovetail.identification.result import Identification, joined_warnings
from dovetail.interfaces import IdentificationMethod, Progress, progress_reporter
from dovetail.measurement import frf_suffixes
from dovetail.network.bundle import TrainedNetwork
from dovetail.parallel import cores, side_by_side
from dovetail.plain_text import html_table
from dovetail.registry import PluginPaths


@dataclass(frozen=True, eq=False)
class Batch:
    """Identifications from many measurements.

    Parameters
    ----------
    results : mapping of str to Identification
        By the measurement, in the order in which they were given.
    failures : mapping of str to str
        Why a measurement has no result.
    interrupted : bool
        Whether Ctrl-C ended the work; measurements that were not done are then in neither mapping.
    """

    results: Mapping[str, Identification]
    failures: Mapping[str, str]
    interrupted: bool = False

    def __repr__(self) -> str:
        return f"<Batch: {len(self.results)} identifications, {len(self.failures)} failures>"

    def _repr_html_(self) -> str:
        judged = {name: "" if one.adequacy is None else one.adequacy.word for name, one in self.results.items()}
        rows = [(name, judged[name], f"{one.mean_coherence:.3f}", one.warning) for name, one in self.results.items()]
        rows += [(name, "failed", "", reason) for name, reason in self.failures.items()]
        return html_table(repr(self), [("measurement", "model", "mean coherence", ""), *rows])

    @property
    def is_trustworthy(self) -> bool:
        """Whether all results can be trusted."""
        return all(result.is_trustworthy for result in self.results.values())

    @property
    def warning(self) -> str:
        """The warnings of the results, each after the names of those that have it; empty if none has."""
        return joined_warnings(self.results.items())

    @property
    def table(self) -> list[dict[str, Any]]:
        """The tables of all results, below each other, as plain values; the first column is the measurement."""
        return [{"measurement": name, **asdict(row)} for name, result in self.results.items() for row in result.table]

    def to_dataframe(self) -> Any:
        """Return `table` as a data frame of pandas, with an index of measurement and name."""
        return dataframe(self.table, ["measurement", "name"])


def identify_many(
    assembly: AssemblySource,
    measurements: Sequence[Measurement],
    method: str | IdentificationMethod | None = None,
    *,
    model: TrainedNetwork | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    on_outcome: Callable[[str, Identification | str], None] | None = None,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Batch:
    """Identify the joint of an assembly from each of many measurements.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description.
    measurements : sequence
        An FRF or its file each; or for several responses a sequence of them each, as `identify` takes it.
    method, model, **options
        As in `identify`. With a model, the measurements are identified one after another, in this process.
    processes : int, optional
        How many work at once; one for each core by default. With 1, the work is done in this process.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers identify instead of processes here, with a `model` too.
    on_outcome : callable, optional
        Called with the name and the result of each measurement, or why it has none, in the order in which they finish:
        to keep what is there.
    progress : bool or callable, optional
        True shows a bar in a terminal or a notebook; a function is called after each measurement.

    Returns
    -------
    Batch
        A measurement that cannot be read or identified is one of its failures, and does not end the others. Neither
        does one whose process is killed: it is repeated when no other is running, and fails if its process is killed
        again. After Ctrl-C: those that were done by then.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C before any measurement was done.
    """
    loaded, every = as_assembly(assembly), list(measurements)
    work = _Work(loaded, every, method, {"model": model, **options})
    workers = 1 if model is not None else processes or cores()
    if workers > 1:
        _compile(loaded)
    outcomes = work.outcomes(side_by_side(work, len(every), workers, scheduler, work.lost), on_outcome, progress)
    ordered = [(name, outcomes[index]) for index, name in enumerate(work.names) if index in outcomes]
    return Batch(
        {name: outcome for name, outcome in ordered if isinstance(outcome, Identification)},
        {name: outcome for name, outcome in ordered if isinstance(outcome, str)},
        interrupted=len(outcomes) < len(every),
    )


def _warn_of_copies(names: Sequence[str], measured: Sequence[Frf | Sequence[Frf] | None]) -> None:
    """Warn of measurements of a batch that hold the same values, so that one counts twice."""
    first_of: dict[bytes, str] = {}
    for name, given in zip(names, measured, strict=True):
        frfs = (given,) if isinstance(given, Frf) else tuple(given or ())
        content = b"".join(frf.frequency.tobytes() + frf.values.tobytes() for frf in frfs)
        if content and (first := first_of.setdefault(content, name)) != name:
            warnings.warn(f"{name}: it holds the same values as {first}. Is one a copy of the other?", stacklevel=4)


class _Work:
    """The identification from each measurement of a batch; its calls are made in other processes."""

    def __init__(
        self,
        assembly: Assembly,
        measurements: Sequence[Measurement],
        method: str | IdentificationMethod | None,
        options: Mapping[str, Any],
    ) -> None:
        self._assembly, self._measurements, self._method, self._options = assembly, measurements, method, options
        self.names = unique_names(measurements)
        frfs = [_read(measurement) for measurement in measurements]
        self._faults = batch_contradictions(assembly.description, frfs)
        _warn_of_copies(self.names, frfs)

    def __call__(self, index: int) -> Identification | str:
        """Return the result of a measurement, or why there is none."""
        name = self.names[index]
        try:
            if index in self._faults:
                raise MeasurementError(self._faults[index])
            return identify(self._assembly, self._measurements[index], self._method, **self._options)
        except Exception as error:  # of a plugin, or a bug: the other measurements go on
            logging.getLogger(__name__).info("%s: failed", name, exc_info=error)
            return _failure(name, as_dovetail_error(error, name))

    def lost(self, index: int, reason: Fault) -> str:
        """Return why a measurement has no result whose process was ended."""
        name = self.names[index]
        return _failure(name, DovetailError(replace(reason, where=name)))

    def outcomes(
        self,
        arriving: Generator[tuple[int, Identification | str], None, None],
        on_outcome: Callable[[str, Identification | str], None] | None,
        progress: Progress | bool | None,
    ) -> dict[int, Identification | str]:
        """Return what has arrived when all is done, or when Ctrl-C ends the work."""
        outcomes: dict[int, Identification | str] = {}
        try:
            with progress_reporter(progress) as report, closing(arriving):
                report("identifying", 0, len(self.names))
                for index, outcome in arriving:
                    outcomes[index] = outcome
                    if on_outcome is not None:
                        on_outcome(self.names[index], outcome)
                    report("identifying", len(outcomes), len(self.names))
        except KeyboardInterrupt:
            if not outcomes:
                raise
        return outcomes


def _read(measurement: Measurement) -> tuple[Frf, ...] | None:
    """Return the FRFs of a measurement, or None where they cannot be read; its identification reports what is wrong."""
    try:
        with warnings.catch_warnings(action="ignore"):
            return as_frfs(measurement)
    except Exception:  # whatever it is, the identification of this measurement meets it again
        return None


def _failure(name: str, error: DovetailError) -> str:
    """Return the text of an error, which names the measurement."""
    text = str(error)
    return text if name in text else f"{name}\n{text if text.startswith('  ') else indent(text, '  ')}"


def _compile(assembly: Assembly) -> None:
    """Compile the engine's kernels, so that processes that are copies of this one share them."""
    for one in assembly.each_response:
        few = one.on(one.frequency[:2])
        few.frf()
        if few.parameters:
            few.frf_jacobian()


def unique_names(measurements: Sequence[Measurement]) -> list[str]:
    """Name each measurement after its FRFs or files; the second of the same name ends in (2)."""
    names: list[str] = []
    for measurement in measurements:
        each = [measurement] if isinstance(measurement, (Frf, str, Path)) else measurement
        name = ", ".join(dict.fromkeys(one.label if isinstance(one, Frf) else Path(one).name for one in each))
        numbered = (f"{name} ({number})" for number in count(2))
        names.append(next(unique for unique in chain([name], numbered) if unique not in names))
    return names


def measurement_files(paths: Sequence[Path], plugins: PluginPaths = ()) -> list[Path]:
    """Return files as they are and, in alphabetical order, those in folders that have the suffix of an FRF.

    Raises
    ------
    MeasurementError
        A folder holds none.
    """
    suffixes = frf_suffixes(plugins)
    files: list[Path] = []
    for path in paths:
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in suffixes) if path.is_dir() else []
        if path.is_dir() and not inside:
            raise MeasurementError(Fault(str(path), "this folder holds no measurement.", listing(suffixes)))
        files += inside or [path]
    return files
