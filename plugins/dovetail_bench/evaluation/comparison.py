"""Methods of identification side by side, on the same measurements (section 4.6 of Processes 14 (2026) 1875)."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from dovetail import (
    Assembly,
    Dataset,
    DovetailError,
    Fault,
    Frf,
    Identification,
    IdentificationMethod,
    Identifier,
    MeasurementError,
    ParameterError,
    Progress,
    generate,
    identify,
    load,
    read_bounded,
    train,
)
from dovetail.evaluation import (
    batch_contradictions,
    check_cover,
    check_mass,
    check_measured,
    coherence_with_model,
    components,
    counterpart,
    find_method,
    joined_warnings,
    listing,
    progress_reporter,
    resonance_peaks,
    within_band,
)
from dovetail_bench.evaluation.cases import Case, Cases
from dovetail_bench.evaluation.failures import Failures
from dovetail_bench.evaluation.robustness import storage_for, variant
from dovetail_bench.evaluation.validation import PROMINENCE

RIGID = "rigid"
"""The joint's contacts rigid and its other parameters in the middle of their ranges: nothing is identified."""


@dataclass(frozen=True, eq=False)
class Compared:
    """The result of one method for one measurement.

    Parameters
    ----------
    case : Case
    method : str
    measured : Frf
        Without the accelerometer, on its own lines within the assembly's band.
    frf : Frf
        As the method reconstructs it.
    identification : Identification or None
        None for the rigid joint.
    peaks : tuple of (float, float or None)
        Hz; each resonance of the measurement, and of the reconstruction.
    seconds : float
        For the identification, training not included.
    """

    case: Case
    method: str
    measured: Frf
    frf: Frf
    identification: Identification | None
    peaks: tuple[tuple[float, float | None], ...]
    seconds: float

    @property
    def is_trustworthy(self) -> bool:
        """Whether the identification can be trusted; True for the rigid joint, which identifies nothing."""
        return self.identification is None or self.identification.is_trustworthy

    @property
    def coherence(self) -> NDArray[np.float64]:
        """(n_freq,) agreement of reconstruction and measurement (Eq. 15); of their amplitudes if there is no phase."""
        return coherence_with_model(self.measured, self.frf.values)

    @property
    def mean_coherence(self) -> float:
        """Mean agreement of reconstruction and measurement."""
        return float(self.coherence.mean())


@dataclass(frozen=True, eq=False)
class Comparison:
    """The results of all methods for all measurements.

    Parameters
    ----------
    title, series : str
        As in the series.
    methods : tuple of str
    rows : tuple of Compared
        Case by case, method by method.
    training : mapping of str to float
        Seconds that each network's training took; the dataset not included.
    dataset : float
        Seconds for the dataset that all networks share; 0 if it was there.
    truth : mapping of str to mapping
        True values of the parameters [SI] by the case's name, where they are known.
    failures : mapping of str to str
        Why a case has no rows, by its name.
    """

    title: str
    series: str
    methods: tuple[str, ...]
    rows: tuple[Compared, ...]
    training: Mapping[str, float]
    dataset: float
    truth: Mapping[str, Mapping[str, float]]
    failures: Mapping[str, str] = field(default_factory=dict)

    @property
    def cases(self) -> tuple[Case, ...]:
        """The measurements, in order."""
        return tuple(dict.fromkeys(row.case for row in self.rows))

    @property
    def is_trustworthy(self) -> bool:
        """Whether all identifications can be trusted."""
        return all(row.is_trustworthy for row in self.rows)

    @property
    def warning(self) -> str:
        """Warnings of the identifications, with case and method of each; empty if there are none."""
        return joined_warnings((f"{row.case.name} by {row.method}", row.identification) for row in self.rows)

    def of(self, case: Case) -> dict[str, Compared]:
        """Return the result of each method for one measurement."""
        return {row.method: row for row in self.rows if row.case == case}


def compare(
    cases: Cases,
    methods: Sequence[str] = (),
    *,
    samples: int | None = None,
    data: str | PathLike[str] | None = None,
    truth: Mapping[str, Mapping[str, float]] | None = None,
    plugins: Iterable[str | PathLike[str]] = (),
    progress: Progress | bool | None = None,
) -> Comparison:
    """Identify the joint of every case by every method.

    Parameters
    ----------
    cases : Cases
        Each with the assembly and the measurement that its joint comes from; one assembly for all.
    methods : sequence of str
        ``"refined"``, ``"posterior"``, ``"multistart"``, ``"rigid"``; or a network by its reducer, as ``"umap"`` or,
        with robust training, ``"pca+robust"``; or a plugin's method, with its package as
        ``"package:pca"`` if it has the name of a reducer. By default those that the plugins give.
    samples : int, optional
        FRFs to train on; as many as the description says by default.
    data : path, optional
        A dataset of the assembly to train on.
    truth : mapping, optional
        Of `read_truths`.
    plugins : iterable of paths
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    Comparison
        A case that fails by any method, as where its measurement cannot be read or does not reach both ends of the
        band, is one of its failures, and does not end the others.

    Raises
    ------
    DovetailError
        A method cannot be used; `samples` and `data` are both given; `truth` knows none of the cases; or every case
        fails: why the first does.

    Notes
    -----
    Each measurement is compared on its own lines. Only the features of networks are interpolated from it.
    """
    source = _one_assembly(cases)
    if samples is not None and data is not None:
        problem = "a number was asked for, and a dataset given, which has its own."
        raise ParameterError(Fault("samples", problem, remedy="Leave one of the two out."))
    known = {case.name: truth[stem] for case in cases.cases if truth and (stem := _stem(case)) in truth}
    if truth and not known:
        problem = "no case was measured in a file of these names."
        raise ParameterError(Fault("truth", problem, listing(map(_stem, cases.cases))))
    files = tuple(plugins)
    assembly, registry = load(source, plugins=files), components(files)
    methods = methods or registry.defaults.get("compare", (*registry.names("method"), RIGID))
    named = [method for method in methods if registry.kinds_of(method) == ("method",)]
    ways = {method: way for method in named if (way := find_method(method, assembly, registry)).fits_lines}
    networks = [method for method in methods if method not in (*ways, RIGID)]
    variants = {name: variant(assembly, name, registry) for name in networks}
    measured: dict[str, Frf] = {}
    rows: list[Compared] = []
    failures = Failures()
    for case in cases.cases:
        with failures.of(case.name):
            measured[case.name] = _measurement(case, assembly)
    failures.raise_unless(measured)
    if faults := batch_contradictions(assembly.description, list(measured.values())):
        raise MeasurementError(*faults.values())
    with progress_reporter(progress) as report:
        models, training, seconds = _trained(assembly, variants, samples, data, report)
        for index, case in enumerate(cases.cases):
            report("cases", index, len(cases.cases))
            if case.name not in measured:
                continue
            with failures.of(case.name):
                rows += [
                    _compared(case, method, assembly, models.get(method) or ways.get(method), measured[case.name])
                    for method in methods
                ]
        report("cases", len(cases.cases), len(cases.cases))
    failures.raise_unless(rows)
    title, series, reasons = cases.title, cases.series, failures.reasons
    return Comparison(title, series, tuple(methods), tuple(rows), training, seconds, known, reasons)


def _one_assembly(cases: Cases) -> Path:
    sources = {case.joint.assembly if case.joint is not None else None for case in cases.cases}
    source = sources.pop()
    if sources or source is None:
        problem = "the cases do not all identify the joint of one and the same assembly."
        remedy = "Give each case 'joint: {assembly: ..., measured: ...}' with one assembly."
        raise ParameterError(Fault(cases.title, problem, remedy=remedy))
    return source


def _measurement(case: Case, assembly: Assembly) -> Frf:
    assert case.joint is not None
    assert case.joint.measured is not None
    check_mass(assembly, case.joint.measured.accelerometer_mass)
    (read,) = check_measured(assembly.description, case.joint.measured.read(compensated=True))
    left_out = assembly.description.left_out
    check_cover(within_band(read, assembly.frequency, left_out), assembly.frequency)
    return read.to(assembly.description.response.quantity)


def _stem(case: Case) -> str:
    return "" if case.joint is None or case.joint.measured is None else case.joint.measured.file.stem


def _trained(
    assembly: Assembly,
    variants: Mapping[str, Assembly],
    samples: int | None,
    data: str | PathLike[str] | None,
    progress: Progress,
) -> tuple[dict[str, Identifier], dict[str, float], float]:
    """Train each network on one dataset; return them, the seconds each took, and those for the dataset."""
    if not variants:
        return {}, {}, 0.0
    with TemporaryDirectory(prefix="dovetail-") as folder:
        began = time.perf_counter()
        if data is None:
            file, storage = Path(folder) / "dataset.zarr", storage_for(variants.values())
            dataset = generate(assembly, file, samples=samples, storage=storage, progress=progress)
        else:
            dataset = Dataset(data)
        seconds = time.perf_counter() - began if data is None else 0.0
        models, training = {}, {}
        for name, one in variants.items():
            began = time.perf_counter()
            models[name] = train(one, dataset, progress=progress)
            training[name] = time.perf_counter() - began
    return models, training, seconds


def _compared(
    case: Case, method: str, assembly: Assembly, way: Identifier | str | IdentificationMethod | None, whole: Frf
) -> Compared:
    """Identify a joint by one method; `whole` is the measurement, also beyond the assembly's band."""
    measured = within_band(whole, assembly.frequency, assembly.description.left_out)
    began = time.perf_counter()
    if way is None:
        result, values = None, assembly.on(measured.frequency).rigid().frf()
        frf = assembly.description.response.frf(measured.frequency, values, label="rigid joint")
    else:
        result = way.identify(whole, "network") if isinstance(way, Identifier) else identify(assembly, whole, way)
        frf = result.responses[0].frf
    seconds = time.perf_counter() - began
    ours, theirs = resonance_peaks(measured, PROMINENCE), resonance_peaks(frf, PROMINENCE)
    peaks = tuple((float(peak), counterpart(peak, ours, theirs)) for peak in ours)
    return Compared(case, method, measured, frf, result, peaks, seconds)


class _Test(BaseModel):
    parameters: dict[str, float] = {}


class _Truths(BaseModel):
    tests: dict[str, _Test]


def read_truths(path: str | PathLike[str]) -> dict[str, dict[str, float]]:
    """Read the true parameters of synthetic measurements.

    Parameters
    ----------
    path : path
        JSON: under ``tests``, by the measured file's name without its suffix, ``parameters`` in SI.

    Returns
    -------
    dict
        Values by parameter, by file; files without parameters are left out.

    Raises
    ------
    DovetailError
        The file cannot be read, or is not such a file.
    """
    try:
        read = _Truths.model_validate_json(read_bounded(Path(path)))
    except ValidationError as error:
        problem = f"this is not a file of true parameters: {error.errors()[0]['msg']}."
        raise DovetailError(Fault(str(path), problem, "JSON with 'tests', each with 'parameters'")) from None
    return {name: test.parameters for name, test in read.tests.items() if test.parameters}
