"""An identification read back from the JSON that `Identification.to_dict` gives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from dovetail.atomic_files import read_bounded
from dovetail.errors import DovetailError, Fault
from dovetail.frf import Frf, Quantity
from dovetail.identification.misspecification import Foreign
from dovetail.identification.posterior import Form, Posterior
from dovetail.identification.result import AtPoint, Identification, IdentifiedParameter, Mode
from dovetail.interfaces import Parameter

__all__ = ["RESULT_FILE", "read_identification"]

RESULT_FILE = "result.json"
"""Name of the file within a folder of results."""

_MOST_FAULTS = 5


class _StoredFrf(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    label: str
    has_phase: bool
    real: list[float]
    imag: list[float]


class _StoredResponse(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    point: str
    quantity: Quantity
    frf: _StoredFrf
    measured: _StoredFrf


class _StoredSamples(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    theta: list[list[float]]
    weight: list[float]


class _StoredDoubt(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    doubtful: bool = False


class _StoredPosterior(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    form: Form = "samples"
    mode: list[float] | None = None
    parameters: dict[str, _StoredDoubt] = {}
    samples: _StoredSamples
    reached: float
    model_error: float
    lines: int
    seconds: float


class _StoredForeign(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    flagged: bool
    statistic: float
    looks_like: str
    reasons: tuple[str, ...]
    bands_Hz: tuple[tuple[float, float], ...]  # noqa: N815  the unit's own spelling


class _Stored(BaseModel):
    """The entries that are needed; what a later version adds is passed over."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    method: str
    parameters: dict[str, IdentifiedParameter]
    known: dict[str, float]
    modes: tuple[Mode, ...]
    warnings: tuple[str, ...]
    provenance: dict[str, Any]
    frequency_Hz: list[float]  # noqa: N815  the unit's own spelling
    quantity: Quantity
    frf: _StoredFrf
    measured: _StoredFrf
    posterior: _StoredPosterior | None = None
    point: str = ""
    further_responses: tuple[_StoredResponse, ...] = ()
    foreign: _StoredForeign | None = None


def read_identification(path: str | Path) -> Identification:
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
            raise DovetailError(Fault(str(path), f"this folder has no {RESULT_FILE}, so 'identify' did not write it."))
    content = read_bounded(file)
    try:
        stored = _Stored.model_validate_json(content)
    except ValidationError as error:
        raise DovetailError(*_faults(file, error)) from None
    frfs = [stored.frf, stored.measured]
    frfs += [frf for one in stored.further_responses for frf in (one.frf, one.measured)]
    if any(len(frf.real) != len(stored.frequency_Hz) for frf in frfs):
        raise DovetailError(Fault(str(file), "its FRFs differ in length from its frequencies."))
    return Identification(
        method=stored.method,
        parameters=MappingProxyType(stored.parameters),
        known=MappingProxyType(stored.known),
        frf=_frf(file, stored, stored.quantity, stored.frf),
        measured=_frf(file, stored, stored.quantity, stored.measured),
        modes=stored.modes,
        warnings=stored.warnings,
        provenance=MappingProxyType(stored.provenance),
        posterior=None if stored.posterior is None else _posterior(file, stored.parameters, stored.posterior),
        point=stored.point,
        further=tuple(_at_point(file, stored, one) for one in stored.further_responses),
        foreign=None if stored.foreign is None else _foreign(stored.foreign),
    )


def _posterior(file: Path, parameters: Mapping[str, IdentifiedParameter], stored: _StoredPosterior) -> Posterior:
    """Return the posterior with its samples; what follows from them is computed anew."""
    weight = np.array(stored.samples.weight)
    theta = np.array(stored.samples.theta, dtype=np.float64)
    total = float(weight.sum())
    if theta.shape != (len(weight), len(parameters)) or not len(weight) or not total > 0 or not 0 < stored.reached <= 1:
        raise DovetailError(Fault(str(file), "the samples of its posterior do not fit its parameters."))
    if stored.mode is not None and len(stored.mode) != len(parameters):
        raise DovetailError(Fault(str(file), "the most probable place of its posterior does not fit its parameters."))
    ranges = [Parameter(name, p.unit, p.lower, p.upper, p.scale) for name, p in parameters.items()]
    fraction = np.stack([one.to_unit(theta[:, index]) for index, one in enumerate(ranges)], axis=1)
    mean = (weight / total) @ fraction
    return Posterior(
        names=tuple(parameters),
        theta=theta,
        fraction=fraction,
        weight=weight / total,
        estimate=np.array([one.from_unit(mean[index]) for index, one in enumerate(ranges)]),
        model_error=stored.model_error,
        drawn=round(len(weight) / stored.reached),
        lines=stored.lines,
        seconds=stored.seconds,
        form=stored.form,
        mode=None if stored.mode is None else np.array(stored.mode),
        doubtful=tuple(name for name, one in stored.parameters.items() if one.doubtful),
    )


def _at_point(file: Path, stored: _Stored, one: _StoredResponse) -> AtPoint:
    frf, measured = (_frf(file, stored, one.quantity, values) for values in (one.frf, one.measured))
    return AtPoint(one.point, frf, measured)


def _foreign(stored: _StoredForeign) -> Foreign:
    return Foreign(stored.flagged, stored.statistic, stored.looks_like, stored.reasons, stored.bands_Hz)


def _frf(file: Path, stored: _Stored, quantity: Quantity, frf: _StoredFrf) -> Frf:
    if len(frf.real) != len(frf.imag):
        raise DovetailError(Fault(str(file), f"the FRF '{frf.label}' has real and imaginary parts of unlike length."))
    values = np.array(frf.real) + 1j * np.array(frf.imag)
    return Frf(np.array(stored.frequency_Hz), values, quantity, has_phase=frf.has_phase, label=frf.label)


def _faults(file: Path, error: ValidationError) -> list[Fault]:
    found = error.errors(include_url=False)
    faults = [
        Fault(f"{file}  {'.'.join(str(part) for part in fault['loc'])}".rstrip(), f"{fault['msg']}.")
        for fault in found[:_MOST_FAULTS]
    ]
    return [Fault(str(file), "this is not the result of an identification.", "the result.json of identify"), *faults]
