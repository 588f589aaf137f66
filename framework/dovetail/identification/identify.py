"""Identification of a joint by any method, from one measurement or from each of many."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from dovetail.assembly import Assembly, AssemblySource, as_assembly
from dovetail.assembly.calibration import unknown_signs, with_signs
from dovetail.errors import DovetailError, Fault, MeasurementError, ParameterError, did_you_mean, listing
from dovetail.frf import Frf
from dovetail.identification.fitting import refine
from dovetail.identification.fitting.observations import MeasuredLines, one_per_response
from dovetail.identification.fitting.random_error import Weights, weighted_variance
from dovetail.identification.methods import DEFAULT_METHOD, METHODS
from dovetail.identification.modal_fit import identify_from_modes
from dovetail.identification.network.trained_network import TrainedNetwork
from dovetail.identification.parameters import dataframe
from dovetail.identification.result import Identification, ModalIdentification, caveats_of
from dovetail.interfaces import Progress, silent
from dovetail.measurement import ModalParameters, is_modal_table, read_frf
from dovetail.parallel import cores, side_by_side

__all__ = ["Batch", "Measurement", "identify", "identify_many", "method_options"]

Measurement = Frf | str | Path | Sequence[Frf | str | Path]
"""An FRF or its file; one for each response, if there are several."""

_MOST_ZEROS = 0.01
"""Part of the lines; single ones are bad lines like others."""
_LARGEST_SPIKE = 1e20
"""Times the median amplitude; above it squares and sums lose all other lines."""
_DELAYS = 201
"""Delays over their range with which a sign is told; enough for 25 turns of the phase."""


@overload
def identify(assembly: AssemblySource, measured: Measurement, method: str = ..., **options: Any) -> Identification: ...
@overload
def identify(
    assembly: AssemblySource, measured: ModalParameters, method: str = ..., **options: Any
) -> ModalIdentification: ...


def identify(
    assembly: AssemblySource,
    measured: Measurement | ModalParameters,
    method: str = DEFAULT_METHOD,
    *,
    model: TrainedNetwork | None = None,
    weights: Weights | Sequence[Weights] | None = None,
    phase: bool = True,
    **options: Any,
) -> Identification | ModalIdentification:
    """Identify the joint of an assembly from the measured FRF of its response point, or of each of its response points.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description.
    measured : Frf or path, or sequence of them; or ModalParameters
        One for each response of the description, in its order; of any quantity, without the accelerometer. The lines
        within the description's band count, each measurement on its own: the model is computed there, and measured
        values are never interpolated, but for the features of a network. From natural frequencies and damping ratios
        the method is ``"posterior"``, with the same options.
    method : str
        ``"posterior"``: the refined fit, with intervals and verdicts for each parameter. ``"refined"``: a
        least-squares fit alone, down to the measurement's random error. ``"multistart"``: many local searches from all
        over the ranges. ``"network"``: the answer of `model` as it is, which is the method of the publication.
    model : TrainedNetwork, optional
        A trained network of this assembly: its answer is one more start of the refined fit, and stands beside it in
        the result (`Identification.network`).
    weights : {"coherence", "amplitude"} or (n_freq,) array, optional
        How much lines count in a fit: by their random error by default; by their coherence; by amplitude, so that
        relative errors count; or an array for each measurement. The network does not ask.
    phase : bool
        False for a fit that takes no notice of the measurement's phase.
    **options
        Of the method: ``seed`` for all but the network; ``starts``, ``seconds`` and ``objective`` (``"frf"`` or
        ``"weighted"``) for ``"multistart"``; ``form`` (``"samples"`` or ``"laplace"``),
        ``samples`` and ``model_error`` for ``"posterior"``.

    Returns
    -------
    Identification
        Or a `ModalIdentification`, with the same table.

    Raises
    ------
    MeasurementError
        There are more or fewer measurements than responses, or some have no lines within the band. With the method
        ``"network"``: some do not cover the band, or the network has no finite answer.
    ParameterError
        The assembly has nothing to identify, or the method has no such option or needs a model.
    ValueError
        `method` is not a method.

    Notes
    -----
    What the measurement lacks of the band, at its ends or in a gap, is said in the result's warnings. The network
    takes part only where it can be given the whole band.

    Meanwhile the linear algebra of this process takes one thread: the matrices are small, and more threads wait for
    each other.
    """
    if method not in METHODS:
        accepted = ", ".join(METHODS)
        raise ValueError(f"'{method}' is not a method. {did_you_mean(method, METHODS)} Accepted: {accepted}")
    assembly = as_assembly(assembly)
    measured = measured if isinstance(measured, ModalParameters) else as_frfs(measured)
    if not assembly.parameters:
        raise ParameterError(Fault(assembly.name, "all parameters are known: there is nothing to identify."))
    of_modes = isinstance(measured, ModalParameters)
    if of_modes and (method != DEFAULT_METHOD or model is not None or weights is not None or not phase):
        problem = "modal parameters are no FRF: they take no other method, no network, no weights and no phase."
        raise ParameterError(Fault("identify", problem, f"the method '{DEFAULT_METHOD}' and its options"))
    accepted_options = method_options(method)
    for name in options:
        if name not in accepted_options:
            problem = f"the method '{method}' has no option '{name}'."
            raise ParameterError(Fault("options", problem, listing(accepted_options) or "none"))
    with threadpool_limits(1, user_api="blas"):
        if isinstance(measured, ModalParameters):
            return identify_from_modes(assembly, measured, **options)
        lines = _with_signs(MeasuredLines.of(assembly, _prepared(assembly, measured, weights, phase=phase)))
        return METHODS[method](lines, model, **options)


def as_frfs(measured: Measurement) -> tuple[Frf, ...]:
    """Return measured FRFs as they are, or read from their files.

    Raises
    ------
    MeasurementError
        Something is neither, or a file cannot be read.
    """
    each = [measured] if isinstance(measured, (Frf, str, Path)) else list(measured)
    for source in each:
        if not isinstance(source, (Frf, str, Path)):
            problem = f"this is an object of the type {type(source).__name__}."
            raise MeasurementError(Fault("measured", problem, "an Frf, or the path of its file"))
        if not isinstance(source, Frf) and is_modal_table(source):
            remedy = "Read it with dovetail.read_modal_parameters, and hand over what that returns."
            raise MeasurementError(Fault(str(source), "this is a table of modal parameters, no FRF.", remedy=remedy))
    return tuple(one if isinstance(one, Frf) else read_frf(one) for one in each)


def _prepared(
    assembly: Assembly,
    measured: Frf | Sequence[Frf],
    weights: Weights | Sequence[Weights] | None,
    *,
    phase: bool,
) -> tuple[Frf, ...]:
    """Return the measurements with the weights that are wanted, and without phase where that is not to count."""
    frfs = one_per_response(assembly, measured)
    for frf in frfs:
        _check_numbers(frf)
    if isinstance(weights, str):
        accepted_weights = ("coherence", "amplitude")
        if weights not in accepted_weights:
            problem = f"'{weights}' is no way to weight lines."
            hint = did_you_mean(weights, accepted_weights)
            raise ParameterError(Fault("weights", problem, f"{listing(accepted_weights)}; or an array", hint))
    if weights is not None:
        each: list[Any] = list(weights) if isinstance(weights, (list, tuple)) else [weights] * len(frfs)
        if len(each) != len(frfs):
            raise ParameterError(Fault("weights", f"{len(each)} were given for {len(frfs)} measurements."))
        counted: list[Any] = [by if isinstance(by, str) else np.asarray(by, dtype=np.float64) for by in each]
        frfs = tuple(replace(frf, variance=weighted_variance(frf, by)) for frf, by in zip(frfs, counted, strict=True))
    return frfs if phase else tuple(_amplitudes(frf) for frf in frfs)


def _check_numbers(frf: Frf) -> None:
    """Raise a MeasurementError where amplitudes are zero at many lines, or one beyond what arithmetic holds."""
    zeros = int(np.count_nonzero(frf.amplitude == 0.0))
    if zeros > _MOST_ZEROS * frf.amplitude.size:
        problem = f"its amplitude is exactly zero at {zeros} of {frf.amplitude.size} lines, as no structure's is."
        remedy = "Measure again, or leave these lines out: 'frequency: {without: ...}'."
        raise MeasurementError(Fault(frf.label, problem, remedy=remedy))
    line = int(np.argmax(frf.amplitude))
    if frf.amplitude[line] > _LARGEST_SPIKE * float(np.median(frf.amplitude)):
        problem = f"its amplitude is {frf.amplitude[line]:.3g} at {frf.frequency[line]:g} Hz, a damaged number."
        raise MeasurementError(Fault(frf.label, problem, remedy="Leave this line out: 'frequency: {without: ...}'."))


def _with_signs(lines: MeasuredLines) -> MeasuredLines:
    """Tell the signs of responses that the description leaves open, from a fit that does not look at their phase."""
    description = lines.assembly.description
    unknown = unknown_signs(description)
    if not unknown:
        return lines
    pairs = list(zip(description.responses, lines.frfs, strict=True))
    amplitudes = [_amplitudes(frf) if response.name in unknown else frf for response, frf in pairs]
    theta = refine(lines.assembly, amplitudes, seed=description.identification.seed).theta
    signs = {
        response.name: _sign(alone, theta, frf)
        for (response, frf), alone in zip(pairs, lines.assembly.each_response, strict=True)
        if response.name in unknown
    }
    described = Assembly(with_signs(lines.described.description, signs))
    return MeasuredLines.of(described, lines.whole)


def _amplitudes(frf: Frf) -> Frf:
    return replace(frf, values=np.abs(frf.values), has_phase=False)


def _sign(assembly: Assembly, theta: NDArray[np.float64], frf: Frf) -> float:
    """Return 1 or -1, by which an FRF is more like the model's, with the delay that suits it."""
    response = assembly.description.response
    delays = [column for column, p in enumerate(assembly.parameters) if p.name == f"{response.name}.delay"]
    vectors = np.repeat(theta[np.newaxis], _DELAYS if delays else 1, axis=0)
    for column in delays:
        vectors[:, column] = assembly.parameters[column].from_unit(np.linspace(0.0, 1.0, _DELAYS))
    model, values = assembly.frf(vectors), frf.to(response.quantity).values
    alike = np.real(np.conj(model) * values / np.abs(model) ** 2).mean(axis=1)
    return 1.0 if not frf.has_phase or alike.max() >= -alike.min() else -1.0


def method_options(method: str) -> tuple[str, ...]:
    """Return the names of the options that a method takes."""
    parameters = inspect.signature(METHODS[method]).parameters.values()
    return tuple(p.name for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY)


@dataclass(frozen=True, eq=False)
class Batch:
    """Identifications from many measurements.

    Parameters
    ----------
    results : mapping of str to Identification
        By the measurement, in the order in which they were given.
    failures : mapping of str to str
        Why a measurement has no result.
    """

    results: Mapping[str, Identification]
    failures: Mapping[str, str]

    def __repr__(self) -> str:
        return f"<Batch: {len(self.results)} identifications, {len(self.failures)} failures>"

    @property
    def believable(self) -> bool:
        """Whether all results may be believed."""
        return all(result.believable for result in self.results.values())

    @property
    def caveat(self) -> str:
        """The caveats of the results, each after the names of those that have it; empty if none has."""
        return caveats_of(self.results.items())

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
    method: str = DEFAULT_METHOD,
    *,
    model: TrainedNetwork | None = None,
    processes: int | None = None,
    progress: Progress = silent,
    **options: Any,
) -> Batch:
    """Identify the joint of an assembly from each of many measurements.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description.
    measurements : sequence
        An FRF or its file each; or for several responses a sequence of them each, as `identify` takes it.
    method : str
        As of `identify`.
    model : TrainedNetwork, optional
        As of `identify`; with it, one measurement follows the other.
    processes : int, optional
        How many work at once; one for each core by default.
    progress : Progress
        Called after each measurement.
    **options
        As of `identify`.

    Returns
    -------
    Batch
        A measurement that cannot be read or identified is one of its failures, and does not end the others.

    Notes
    -----
    The first measurement is identified before the others, so that all processes share the engine that it compiles.
    """
    loaded, frfs = as_assembly(assembly), list(measurements)
    names = _names(frfs)

    def work(index: int) -> Identification | str:
        try:
            return identify(loaded, frfs[index], method, model=model, **options)
        except DovetailError as error:
            return str(error)

    outcomes: dict[int, Identification | str] = {}
    workers = 1 if model is not None else processes or cores()

    def keep(index: int, outcome: Identification | str) -> None:
        outcomes[index] = outcome
        progress("identifying", len(outcomes), len(frfs))

    if frfs:
        keep(0, work(0))
        for index, outcome in side_by_side(lambda index: work(index + 1), len(frfs) - 1, workers):
            keep(index + 1, outcome)
    ordered = [(name, outcomes[index]) for index, name in enumerate(names)]
    return Batch(
        MappingProxyType({name: outcome for name, outcome in ordered if isinstance(outcome, Identification)}),
        MappingProxyType({name: outcome for name, outcome in ordered if isinstance(outcome, str)}),
    )


def _names(measurements: Sequence[Measurement]) -> list[str]:
    """Name each measurement after its FRFs or files; the second of the same name ends in (2)."""
    names: list[str] = []
    for measurement in measurements:
        each = [measurement] if isinstance(measurement, (Frf, str, Path)) else measurement
        name = ", ".join(dict.fromkeys(one.label if isinstance(one, Frf) else Path(one).name for one in each))
        count = 1 + sum(other == name or other.startswith(f"{name} (") for other in names)
        names.append(name if count == 1 else f"{name} ({count})")
    return names
