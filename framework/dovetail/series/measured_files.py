"""Reading the measured files of a test, and the covariates that they give."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from dovetail.errors import Fault, MeasurementError, UnitError
from dovetail.frf import Frf
from dovetail.interfaces import Recorded
from dovetail.measurement import remove_accelerometer_mass
from dovetail.measurement.frf_files import recording_and_content, skipped_names
from dovetail.measurement.named_values import named_values
from dovetail.registry import Registry, components
from dovetail.series.description import Covariate
from dovetail.units import to_si

_ROUNDING = 0.01
"""Relative difference of two values of a covariate that is rounding, or the precision of its setting."""


class GivenCovariate(NamedTuple):
    """A covariate as a measured file gives it.

    Parameters
    ----------
    name : str
    value : float
        SI.
    text, where : str
        As in the file, and its place there.
    """

    name: str
    value: float
    text: str
    where: str


class ReadFile(NamedTuple):
    """What a measured file contains.

    Parameters
    ----------
    frf : Frf
    covariates : tuple of GivenCovariate
    content : Recorded
        All that its reader returned.
    """

    frf: Frf
    covariates: tuple[GivenCovariate, ...]
    content: Recorded


def read_file(
    file: Path, options: Mapping[str, Any], covariates: Mapping[str, Covariate], registry: Registry
) -> ReadFile:
    """Read the FRF of a measured file, and the covariates that it gives.

    Parameters
    ----------
    file : Path
    options : mapping
        Those of `read_frf`; covariates that ``names: {skip: ...}`` names are left out.
    covariates : mapping of str to Covariate
        Those of the series.
    registry : Registry

    Raises
    ------
    DovetailError
        As in `read_frf`.
    """
    own = dict(options)
    quantity, unit, mass = (own.pop(name, None) for name in ("quantity", "unit", "accelerometer_mass"))
    recording, content = recording_and_content(file, registry, **own)
    frf = recording.to_frf(quantity, unit)
    frf = remove_accelerometer_mass(frf, mass) if mass else frf
    skipped = {name.lower() for name in skipped_names((options.get("names") or {}).get("skip", ""))}
    wanted = {name.lower(): one for name, one in covariates.items() if name.lower() not in skipped}
    return ReadFile(frf, tuple(_given(file, content, wanted)) if wanted else (), content)


def _given(file: Path, content: Recorded, wanted: Mapping[str, Covariate]) -> Iterator[GivenCovariate]:
    for key, text, where in named_values(file, content):
        if key not in wanted:
            continue
        try:
            value = to_si(text, wanted[key].unit)
        except UnitError:
            continue  # another quantity of that name
        yield GivenCovariate(wanted[key].name, value, text, where)


def agreed_covariates(
    files: Sequence[ReadFile], known: Mapping[str, float], covariates: Mapping[str, Covariate], known_from: str
) -> dict[str, float]:
    """Return the covariates of a measurement, which its files may give in addition to those that are known.

    Parameters
    ----------
    files : sequence of ReadFile
    known : mapping of str to float
        SI.
    covariates : mapping of str to Covariate
    known_from : str
        Where the known ones are given, for messages.

    Raises
    ------
    MeasurementError
        Two values of a covariate differ by more than 1 %.
    """
    values, places = dict(known), dict.fromkeys(known, known_from)
    for name, value, text, where in (covariate for file in files for covariate in file.covariates):
        before, place = values.setdefault(name, value), places.setdefault(name, f"at {where}")
        if not math.isclose(value, before, rel_tol=_ROUNDING, abs_tol=_ROUNDING**2):
            problem = f"{name} is '{text[:40]}' here, and {before:g} {covariates[name].unit} {place}."
            remedy = f"Correct one of them, or leave it out: 'names: {{skip: {name}}}' of the measured file."
            raise MeasurementError(Fault(where, problem, remedy=remedy))
    return values


def read_test(
    name: str,
    measured: Sequence[tuple[Path, Mapping[str, Any]]],
    values: Mapping[str, float],
    covariates: Mapping[str, Covariate],
) -> tuple[Frf, ...]:
    """Read the measured files of a test, each once.

    Parameters
    ----------
    name : str
        Of the test.
    measured : sequence of (Path, mapping)
        Files, and the options of `read_frf` with which they are read.
    values : mapping of str to float
        Covariates of the test, SI.
    covariates : mapping of str to Covariate
        Those of the series.

    Raises
    ------
    DovetailError
        A file cannot be read, or gives another value of a covariate.
    """
    known = {covariate: covariates[covariate] for covariate in values}
    files = [read_file(file, options, known, components()) for file, options in measured]
    agreed_covariates(files, values, known, f"in the test '{name}' of the series")
    return tuple(file.frf for file in files)
