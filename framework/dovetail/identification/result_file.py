"""Reading an identification from the JSON of `Identification.to_dict`."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Json,
    Tag,
    ValidationError,
)

from dovetail.assembly import ParameterScales
from dovetail.atomic_files import read_bounded
from dovetail.documents.result_folder import MANIFEST, RESULT_FILE, listed_hashes
from dovetail.errors import DovetailError, Fault, damage_reported
from dovetail.frf import Frf, Quantity
from dovetail.identification.parameters import IdentifiedParameter
from dovetail.identification.result import Identification, Mode
from dovetail.inference.adequacy import Adequacy, AdequacyWord, Cause
from dovetail.inference.adequacy.verdict import AtPoint
from dovetail.inference.posterior import Form, ModelError, Posterior, VerdictLimits
from dovetail.inference.posterior.distribution import central_fractions
from dovetail.inference.posterior.evidence import Evidence
from dovetail.interfaces import CutShort
from dovetail.measurement import ModalParameters

_LARGEST = 400_000_000
"""Bytes of the largest result that is read; that of a million lines has 140 million."""
_MOST_FAULTS = 5
"""Faults of a result that are listed."""
_ACCEPTED = "the result.json of identify"
_CONTRADICTION = "its values contradict each other, so this is not the result of an identification"


class _Stored(BaseModel):
    """Entries that are needed; others, of a later version, are ignored."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class _StoredFrf(_Stored):
    label: str
    has_phase: bool
    rotation: bool
    moment: bool
    real: list[float]
    imag: list[float]


class _StoredResponse(_Stored):
    point: str
    quantity: Quantity
    frf: _StoredFrf
    measured: _StoredFrf


class _StoredFurther(_StoredResponse):
    frequency_Hz: list[float]  # noqa: N815  the unit's own spelling


class _StoredSamples(_Stored):
    theta: list[list[float]]
    weight: list[float]
    log_likelihood: list[float] | None = None


class _StoredParameter(_Stored):
    unreliable: bool


class _StoredPosterior(_Stored):
    form: Form = "samples"
    mode: list[float] | None = None
    parameters: dict[str, _StoredParameter] = {}
    samples: _StoredSamples
    reached: float
    evidence: Evidence | None = None
    effective_samples: float = np.inf
    limits: VerdictLimits = VerdictLimits()
    model_error: ModelError
    lines: int
    seconds: float


class _StoredSizes(_Stored):
    """Those of a `ModelError`; None for each that is unknown."""

    natural_frequency: float | None
    damping: float | None = 0.0
    magnitude: float | None = 0.0
    phase: float | None = 0.0
    other: float | None = 0.0
    quantities: float | None = 0.0
    background: float | None = 0.0

    @property
    def sizes(self) -> ModelError:
        return ModelError(**{name: np.nan if size is None else size for name, size in self.model_dump().items()})


class _StoredAdequacy(_Stored):
    word: AdequacyWord
    model_error: _StoredSizes | None
    model_error_in_intervals: ModelError | None
    allowed: float | None
    causes: tuple[Cause, ...]
    reasons: tuple[str, ...]
    bands_Hz: tuple[tuple[float, float], ...]  # noqa: N815  the unit's own spelling


class _StoredMetrics(_Stored):
    r2: float | None
    mae_si: float
    unit: str


class _StoredEvaluation(_Stored):
    parameters: dict[str, _StoredMetrics] = {}


class _StoredDescription(_Stored):
    joints: dict[str, dict[str, Any]] | None = None


class _StoredProvenance(_Stored):
    """What is read of it again; all else is shown as it is."""

    assembly: str = ""
    measurement: str = ""
    measurement_note: str = ""
    description: Json[_StoredDescription] = _StoredDescription()
    evaluation: _StoredEvaluation | None = None


def _checked(provenance: dict[str, Any]) -> dict[str, Any]:
    _StoredProvenance.model_validate(provenance)
    return provenance


class _StoredTable(_Stored):
    frequency: list[float]
    damping_ratio: list[float] | None
    frequency_sd: list[float] | None
    damping_sd: list[float] | None
    label: str


def _kind_of_measured(stored: object) -> str:
    return "table" if isinstance(stored, dict) and "frequency" in stored else "frf"


class _StoredPeak(_Stored):
    reconstructed_peak: float | None
    measured_peak: float


class _StoredIdentification(_Stored):
    """FRFs, their frequencies and quantity are None where the measurement is a table of modal parameters."""

    method: str
    parameters: dict[str, IdentifiedParameter]
    known: dict[str, float]
    warnings: tuple[str, ...]
    provenance: Annotated[dict[str, Any], AfterValidator(_checked)]
    point: str = ""
    quantity: Quantity | None
    frf: _StoredFrf | None
    measured: Annotated[
        Annotated[_StoredFrf, Tag("frf")] | Annotated[_StoredTable, Tag("table")], Discriminator(_kind_of_measured)
    ]
    modes: tuple[Mode, ...]
    peaks_without_mode: tuple[_StoredPeak, ...] = ()
    frequency_Hz: list[float] | None  # noqa: N815  the unit's own spelling
    band_Hz: tuple[float, float] | None = None  # noqa: N815
    posterior: _StoredPosterior | None = None
    network: dict[str, float] | None = None
    cut_short: CutShort | None = None
    fit: dict[str, Any] | None = {}  # None for the estimate of a network
    further_responses: tuple[_StoredFurther, ...] = ()
    adequacy: _StoredAdequacy | None = None


def load_result(path: str | Path) -> Identification:
    """Read a result of an earlier identification.

    Parameters
    ----------
    path : str or Path
        A file with the JSON of `Identification.to_dict`, or a folder that holds it as ``result.json``.

    Returns
    -------
    Identification

    Raises
    ------
    DovetailError
        The file cannot be read, or is not such a result.
    """
    file = Path(path)
    if file.is_dir():
        file = file / RESULT_FILE
        if not file.exists():
            problem = f"this folder has no {RESULT_FILE}, which 'identify' writes for a single measurement."
            remedy = "Of a batch, name one of its files, such as measured.csv.json."
            raise DovetailError(Fault(str(path), problem, remedy=remedy))
    content = read_bounded(file, _LARGEST)
    result = result_from_json(content, file)
    written = listed_hashes(file.parent).get(file.name)
    if written is not None and written != hashlib.sha256(content).hexdigest():
        text = f"{file}: the file was changed after it was written, as {MANIFEST} next to it shows."
        warnings.warn(f"{text} Its numbers may contradict each other; identify again.", stacklevel=2)
    return result


def result_from_json(content: str | bytes, source: str | Path) -> Identification:
    """Return the result whose `Identification.to_dict` JSON holds; `source` names it in messages.

    Raises
    ------
    DovetailError
        It is not such a result.
    """
    file = Path(source)
    with _named(file):
        try:
            stored = _StoredIdentification.model_validate_json(content)
        except ValidationError as error:
            raise DovetailError(*_faults(file, error)) from None
        return _identification(file, stored)


@contextmanager
def _named(file: Path) -> Iterator[None]:
    """Name the file in every error about its content, and report what is contradictory as such."""
    try:
        with damage_reported(str(file), _CONTRADICTION, _ACCEPTED, DovetailError):
            yield
    except DovetailError as error:
        faults = [
            fault if str(file) in fault.where else replace(fault, where=f"{file}  {fault.where}")
            for fault in error.faults
        ]
        raise DovetailError(*faults) from None


def _identification(file: Path, stored: _StoredIdentification) -> Identification:
    frf, measured, further = _measurement(file, stored)
    return Identification(
        method=stored.method,
        parameters=stored.parameters,
        known=stored.known,
        frf=frf,
        measured=measured,
        modes=stored.modes,
        peaks_without_mode=tuple(
            Mode(np.nan, peak.reconstructed_peak, peak.measured_peak) for peak in stored.peaks_without_mode
        ),
        warnings=stored.warnings,
        provenance=stored.provenance,
        posterior=None if stored.posterior is None else _posterior(file, stored.parameters, stored.posterior),
        point=stored.point,
        further=further,
        adequacy=None if stored.adequacy is None else _adequacy(stored.adequacy),
        band=stored.band_Hz,
        network=stored.network,
        is_fitted=stored.fit is not None,
        cut_short=stored.cut_short,
        stored_fit=stored.fit,
    )


def _measurement(
    file: Path, stored: _StoredIdentification
) -> tuple[Frf | None, Frf | ModalParameters, tuple[AtPoint, ...]]:
    """Return the reconstructed FRF and the measured one at the first response, and those at the others; or a table."""
    frequency, quantity = stored.frequency_Hz, stored.quantity
    if isinstance(stored.measured, _StoredTable):
        return None, ModalParameters(**stored.measured.model_dump()), ()
    if stored.frf is None or quantity is None or frequency is None:
        raise DovetailError(Fault(str(file), "it has a measured FRF, and no reconstructed one."))
    frf, measured = (_frf(file, frequency, quantity, values) for values in (stored.frf, stored.measured))
    further = (_at_point(file, response.frequency_Hz, response) for response in stored.further_responses)
    return frf, measured, tuple(further)


def _adequacy(stored: _StoredAdequacy) -> Adequacy:
    size = None if stored.model_error is None else stored.model_error.sizes
    return Adequacy(
        stored.word,
        size,
        stored.allowed,
        stored.causes,
        stored.reasons,
        stored.bands_Hz,
        stored.model_error_in_intervals,
    )


def _posterior(file: Path, parameters: Mapping[str, IdentifiedParameter], stored: _StoredPosterior) -> Posterior:
    """Return the posterior with its samples; what follows from them is computed again."""
    weight = np.array(stored.samples.weight)
    if any(len(vector) != len(parameters) for vector in stored.samples.theta):
        raise DovetailError(Fault(str(file), "a sample of its posterior has not as many values as it has parameters."))
    theta = np.array(stored.samples.theta, dtype=np.float64)
    total = float(weight.sum())
    if theta.shape != (len(weight), len(parameters)) or not len(weight) or not total > 0 or not 0 < stored.reached <= 1:
        raise DovetailError(Fault(str(file), "the samples of its posterior do not fit its parameters."))
    log_likelihood = stored.samples.log_likelihood
    if log_likelihood is not None and len(log_likelihood) != len(weight):
        raise DovetailError(Fault(str(file), "its posterior has not as many log-likelihoods as samples."))
    if stored.mode is not None and len(stored.mode) != len(parameters):
        raise DovetailError(Fault(str(file), "the most probable place of its posterior does not fit its parameters."))
    ranges = [parameter.definition for parameter in parameters.values()]
    scales = ParameterScales(ranges)
    fraction = scales.to_unit(theta)
    normal = np.array([parameter.prior == "normal" for parameter in ranges])
    middle = central_fractions(fraction, weight / total, normal)
    return Posterior(
        names=tuple(parameters),
        theta=theta,
        fraction=fraction,
        weight=weight / total,
        estimate=scales.from_unit(middle),
        model_error=stored.model_error,
        searches=round(len(weight) / stored.reached),
        lines=stored.lines,
        seconds=stored.seconds,
        form=stored.form,
        mode=None if stored.mode is None else np.array(stored.mode),
        log_likelihood=None if log_likelihood is None else np.array(log_likelihood),
        unreliable=tuple(name for name, parameter in stored.parameters.items() if parameter.unreliable),
        normal=tuple(parameter.name for parameter in ranges if parameter.prior == "normal"),
        evidence=stored.evidence,
        effective=stored.effective_samples,
        limits=stored.limits,
    )


def _at_point(file: Path, frequency: list[float], response: _StoredResponse) -> AtPoint:
    frf, measured = (_frf(file, frequency, response.quantity, values) for values in (response.frf, response.measured))
    return AtPoint(response.point, frf, measured)


def _frf(file: Path, frequency: list[float], quantity: Quantity, frf: _StoredFrf) -> Frf:
    if len(frf.real) != len(frequency):
        raise DovetailError(Fault(str(file), "its FRFs differ in length from its frequencies."))
    if len(frf.real) != len(frf.imag):
        raise DovetailError(Fault(str(file), f"the FRF '{frf.label}' has real and imaginary parts of unlike length."))
    values = np.array(frf.real) + 1j * np.array(frf.imag)
    return Frf(
        np.array(frequency),
        values,
        quantity,
        has_phase=frf.has_phase,
        label=frf.label,
        rotation=frf.rotation,
        moment=frf.moment,
    )


def _faults(file: Path, error: ValidationError) -> list[Fault]:
    other = Fault(str(file), "this is not the result of an identification.", _ACCEPTED)
    details = error.errors(include_url=False)
    wrong = {one["loc"] for one in details}
    if details[0]["type"] == "json_invalid" or {("method",), ("parameters",)} <= wrong:
        return [other]  # a file of another kind: what it lacks would not help
    faults = [
        Fault(f"{file}  {'.'.join(str(key) for key in fault['loc'])}".rstrip(), f"{fault['msg']}.")
        for fault in details[:_MOST_FAULTS]
    ]
    return [other, *faults]
