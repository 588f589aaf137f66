"""What builds on `identify`: a trained model, which can be saved and loaded, and batches of measurements."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from itertools import chain, count
from pathlib import Path
from textwrap import indent
from typing import Any, Self

from dovetail.assembly import Assembly, AssemblySource, as_assembly
from dovetail.dataset import Dataset
from dovetail.description import SHARED
from dovetail.errors import DovetailError, Fault, MeasurementError, ParameterError, as_dovetail_error, listing
from dovetail.frf import Frf
from dovetail.identification.identify import Measurement, as_frfs, identify
from dovetail.identification.measured_lines import batch_contradictions
from dovetail.identification.parameters import dataframe
from dovetail.identification.result import Identification, joined_warnings
from dovetail.interfaces import IdentificationMethod, Progress, logged, progress_reporter
from dovetail.network.bundle import TrainedNetwork, read_bundle, write_bundle
from dovetail.network.training import train_network
from dovetail.parallel import cores, side_by_side
from dovetail.plain_text import html_table, terminal_text
from dovetail.registry import PluginPaths
from dovetail.units import format_quantity


class Identifier(TrainedNetwork):
    """A trained network that identifies joints of the assembly it was trained for.

    `train` and `load_model` give one. Its fields are those of `TrainedNetwork`.
    """

    def __repr__(self) -> str:
        tested = f"{self.evaluation.training_samples} training samples, mean R2 {self.evaluation.mean_r2:.3f}"
        return f"<Identifier: {terminal_text(self.assembly.name)}, {tested}>"

    def _repr_html_(self) -> str:
        rows = [
            (name, "" if metrics.r2 is None else f"{metrics.r2:.3f}", format_quantity(metrics.rmse_si, metrics.unit, 3))
            for name, metrics in self.evaluation.parameters.items()
        ]
        return html_table(repr(self), [("parameter", "R2", "RMS error"), *rows])

    @classmethod
    def of(cls, trained: TrainedNetwork) -> Self:
        """Return the identifier of a trained network."""
        return cls(trained.assembly, trained.network, trained.evaluation, trained.novelty)

    def identify(
        self, measured: Measurement, method: str | IdentificationMethod | None = None, **options: Any
    ) -> Identification:
        """Identify the joint from the measured FRF of the assembly's response point, or of each of its points.

        Parameters
        ----------
        measured : Frf or path, or sequence of them
            One for each response, of any quantity. For the network it must cover the assembly's frequencies, to which
            it is interpolated; the other methods compare its own lines, as `dovetail.identify` says.
        method : str or IdentificationMethod, optional
            As in `dovetail.identify`: ``"posterior"``, with intervals, where the trained network's answer is one of the
            starts and is part of the result; or ``"network"``, its answer as it is, in milliseconds; and so on.
        **options
            Of the method, see `dovetail.identify`.

        Returns
        -------
        Identification

        Raises
        ------
        MeasurementError
            The measurement has no lines within the assembly's frequencies; for the network: does not cover them, or
            lies so far from the training data that the network has no finite answer.
        ParameterError
            The method has no such option.
        ValueError
            `method` is not a method.
        """
        return identify(self.assembly, measured, method, model=self, **options)

    def save(self, path: str | Path) -> Path:
        """Write the model as a bundle: a folder of JSON and safetensors, nothing pickled.

        Parameters
        ----------
        path : str or Path
            The folder; a model that is there already is replaced at once and never absent.

        Returns
        -------
        Path

        Raises
        ------
        BundleError
            Something else than a model is at `path`, or it cannot be written.
        """
        return write_bundle(self, path)


def train(
    assembly: AssemblySource,
    dataset: Dataset | str | Path | None = None,
    *,
    robust: bool = False,
    fresh: bool = False,
    minutes: float | None = None,
    progress: Progress | bool | None = None,
) -> Identifier:
    """Train the network of an assembly's description and evaluate it on the test part of the dataset.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description.
    dataset : Dataset or path, optional
        Samples of this assembly. Without one, as many as the description says are generated and then discarded.
    robust : bool
        Train on FRFs with noise, as the description's `augmentation` says or else by its defaults. A description that
        has an `augmentation` is trained so in any case.
    fresh : bool
        Robust training in which every epoch draws new parameters and new noise, as many as the dataset has: no sample
        is seen twice. The dataset gives the first ones, the reducer's, and the test.
    minutes : float, optional
        Time for the regressor, which then ends with the best that it has; the same machine and load aside, results are
        reproducible only without it.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    Identifier

    Raises
    ------
    DatasetError
        The dataset is not of this assembly, too small to be split, or holds values that are not finite.
    ParameterError
        `minutes` is not a positive time, or the regressor ignores it; or the assembly is one response of several
        (`Assembly.at`) and has parameters of another one's measurement chain, which its FRF does not depend on.
    PluginError
        The reducer or the regressor breaks its contract.
    """
    samples = Dataset(dataset) if isinstance(dataset, (str, Path)) else dataset
    known = as_assembly(assembly)
    _check_chains(known)
    with progress_reporter(progress) as report:
        trained = train_network(known, samples, robust=robust, fresh=fresh, minutes=minutes, progress=report)
    return Identifier.of(trained)


def _check_chains(assembly: Assembly) -> None:
    """Refuse what remains of other responses' chains: a saved model is read by its description, without those."""
    description = assembly.description
    here = {SHARED, *(response.name for response in description.responses)}
    owners = {owner for owner, _ in description.identified_parameters}
    owners |= {tie.owner for entry in description.entries.values() for tie in entry.ties.values()}
    if strange := sorted((owners & set(description.calibrations)) - here):
        problem = f"it has parameters of the chain of {listing(strange)}, whose FRF is not among its own."
        remedy = "Train on all responses, or describe this one alone."
        raise ParameterError(Fault(f"assembly {assembly.name}", problem, remedy=remedy))


def load_model(path: str | Path, *, plugins: PluginPaths = ()) -> Identifier:
    """Load a model that `Identifier.save` wrote.

    Parameters
    ----------
    path : str or Path
        The folder.
    plugins : path or iterable of paths
        Plugin files that the model's components come from. A bundle itself never runs code.

    Returns
    -------
    Identifier

    Raises
    ------
    BundleError
        The bundle is damaged, tampered with, of another program or of a newer format; a component is missing; or the
        components here answer otherwise, or give other FRFs, than when the model was trained.
    PluginError
        A plugin file cannot be loaded.
    """
    with logged(__name__, f"model {path} read"):
        return Identifier.of(read_bundle(path, plugins=plugins))


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
    method : str or IdentificationMethod, optional
        As in `identify`.
    model : TrainedNetwork, optional
        As in `identify`; with it, the measurements are identified one after another, in this process.
    processes : int, optional
        How many work at once; one for each core by default. With 1, the work is done in this process.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers identify instead of processes here, with a `model` too.
    on_outcome : callable, optional
        Called with the name and the result of each measurement, or why it has none, in the order in which they finish:
        to keep what is there.
    progress : bool or callable, optional
        True shows a bar in a terminal or a notebook; a function is called after each measurement.
    **options
        As in `identify`.

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
    loaded, frfs = as_assembly(assembly), list(measurements)
    names = unique_names(frfs)
    faults = batch_contradictions(loaded, [_read(measurement) for measurement in frfs])

    def work(index: int) -> Identification | str:
        try:
            if index in faults:
                raise MeasurementError(faults[index])
            return identify(loaded, frfs[index], method, model=model, **options)
        except Exception as error:  # of a plugin, or a bug: the other measurements go on
            logging.getLogger(__name__).info("%s: failed", names[index], exc_info=error)
            return _failure(names[index], as_dovetail_error(error, names[index]))

    def lost(index: int, reason: Fault) -> str:
        return _failure(names[index], DovetailError(replace(reason, where=names[index])))

    outcomes: dict[int, Identification | str] = {}
    workers = 1 if model is not None else processes or cores()
    interrupted = False
    try:
        if workers > 1:
            _compile(loaded)
        done = side_by_side(work, len(frfs), workers, scheduler, lost)
        with progress_reporter(progress) as report, closing(done) as arriving:
            report("identifying", 0, len(frfs))
            for index, outcome in arriving:
                outcomes[index] = outcome
                if on_outcome is not None:
                    on_outcome(names[index], outcome)
                report("identifying", len(outcomes), len(frfs))
    except KeyboardInterrupt:
        if not outcomes:
            raise
        interrupted = True
    ordered = [(name, outcomes[index]) for index, name in enumerate(names) if index in outcomes]
    return Batch(
        {name: outcome for name, outcome in ordered if isinstance(outcome, Identification)},
        {name: outcome for name, outcome in ordered if isinstance(outcome, str)},
        interrupted,
    )


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
