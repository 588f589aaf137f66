"""Reading the measured files of a test, and the covariates that they give."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from dovetail.errors import Fault, FileError, MeasurementError, UnitError
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


_FEWEST_LETTERS = 3
"""Letters of a covariate's name from which a number behind it, without an equals sign, may be its value."""


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
        if not _agree(value, before):
            problem = f"{name} is '{text[:40]}' here, and {before:g} {covariates[name].unit} {place}."
            remedy = f"Correct one of them, or leave it out: 'names: {{skip: {name}}}' of the measured file."
            raise MeasurementError(Fault(where, problem, remedy=remedy))
    return values


def covariates_of(name: str, covariates: Mapping[str, Covariate]) -> dict[str, float]:
    """Return the covariates in a file's name, such as ``torque=40`` or ``torque=40 N m``, SI.

    Raises
    ------
    FileError
        A value is not a quantity of the covariate's dimension, there are two values, or the sign '=' is missing.
    """
    values = dict[str, float]()
    stem = _stem(name)
    for covariate in covariates.values():
        accepted = f"'{covariate.name}=' and a number, or a quantity in {covariate.unit}"
        for text in _values_of(stem, covariate.name):
            try:
                value = to_si(text, covariate.unit)
            except UnitError as error:
                raise FileError(Fault(name, error.faults[0].problem, accepted)) from None
            if values.setdefault(covariate.name, value) != value:
                problem = f"its name gives two values of {covariate.name}: {values[covariate.name]:g} and {value:g}."
                raise FileError(Fault(name, problem, "one value"))
        if covariate.name not in values and (match := _without_sign(stem, covariate.name)):
            problem = f"its name has '{match}', which may be a value of {covariate.name}."
            raise FileError(Fault(name, problem, accepted))
    return values


def _stem(name: str) -> str:
    return Path(name).stem if re.search(r"\.[A-Za-z]\w*$", name) else name


def _values_of(stem: str, covariate: str) -> Iterator[str]:
    """Yield the texts behind the equals signs of a covariate, up to the next covariate or mark."""
    pattern = rf"(?<![^\W_]){re.escape(covariate)}\s*=\s*(.*?)(?=$|[;)\]]|,(?!\d)|_(?!\d{{3}}(?!\d))|\s\w+\s*=)"
    yield from (match[1].strip() for match in re.finditer(pattern, stem, re.IGNORECASE))


def _without_sign(stem: str, covariate: str) -> str:
    """Return the name of a covariate with a number behind it, as in ``torque 40``; empty if there is none."""
    pattern = rf"(?<![^\W_]){re.escape(covariate)}[\s_:-]*\d[\d.]*(?![\w.]*\s*=)"
    match = re.search(pattern, stem, re.IGNORECASE) if len(covariate) >= _FEWEST_LETTERS else None
    return match[0] if match else ""


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
    for (path, options), file in zip(measured, files, strict=True):
        skipped = {name.lower() for name in skipped_names((options.get("names") or {}).get("skip", ""))}
        wanted = {name: one for name, one in known.items() if name.lower() not in skipped}
        in_name = [one for one in _in_name(path, wanted) if one.name in values]
        agreed_covariates([file, file._replace(covariates=tuple(in_name))], values, known, _place(name))
        for remark in _remarks(path, file.content, wanted, values):
            warnings.warn(f"{remark} {_place(name)}.", stacklevel=3)
    agreed_covariates(files, values, known, _place(name))
    return tuple(file.frf for file in files)


def _place(test: str) -> str:
    return f"in the test '{test}' of the series"


def _in_name(path: Path, covariates: Mapping[str, Covariate]) -> Iterator[GivenCovariate]:
    """Yield the covariates in a file's name, as in ``run torque=60 N m.csv``."""
    for covariate in covariates.values():
        for text in _values_of(_stem(path.name), covariate.name):
            with suppress(UnitError):
                yield GivenCovariate(covariate.name, to_si(text, covariate.unit), text, f"{path}, its name")


def _remarks(
    path: Path, content: Recorded, covariates: Mapping[str, Covariate], values: Mapping[str, float]
) -> Iterator[str]:
    """Yield what may be another value of a covariate: a number in the file's name, a longer name, another unit."""
    amounts = [(key, text, where) for key, text, where in named_values(path, content) if re.match(r"[-+]?\d", text)]
    for name, covariate in covariates.items():
        unit = covariate.unit
        known = f"and {name} is {values[name]:g} {unit}"
        number = re.search(r"\d[\d.]*$", _without_sign(_stem(path.name), name).rstrip("."))
        if number and not _agree(to_si(number[0], unit), values[name]):
            yield f"{path}: its name has '{name} {number[0]}', {known}"
        for key, text, where in amounts:
            if key != name.lower() and not key.endswith(f"_{name.lower()}"):
                continue
            try:
                agrees = _agree(to_si(text, unit), values[name]) or key == name.lower()
            except UnitError:
                yield f"{where}: '{key}: {text[:40]}' is not understood as a quantity in {unit}, {known}"
                continue
            if not agrees:
                yield f"{where}: it gives '{key}: {text[:40]}', {known}"


def _agree(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=_ROUNDING, abs_tol=_ROUNDING**2)
