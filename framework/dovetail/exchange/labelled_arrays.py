"""FRFs, posteriors, results, modes and datasets as labelled arrays of xarray, with units as attributes."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict, fields
from functools import singledispatch
from typing import Any, Literal

import numpy as np

from dovetail.assembly import load
from dovetail.dataset import Dataset
from dovetail.errors import DovetailError, Fault, MeasurementError, require_package
from dovetail.frf import QUANTITIES, Frf, unit_of
from dovetail.identification import Identification, ModelError, Modes, Posterior, VerdictLimits
from dovetail.identification.result_file import result_from_json
from dovetail.inference.posterior.evidence import Evidence

_KIND = "dovetail"
"""Attribute that says what an array was made from."""
_PLAIN = ("quantity", "label", "note", "response", "force", "origin", "averages", "has_phase", "rotation", "moment")
_SCALARS = ("searches", "lines", "seconds", "form", "warning", "least_log_evidence")
_JSON = "json"
_SI = "SI, by the coordinate 'unit'"


@singledispatch
def to_xarray(source: object) -> Any:
    """Return an object of Dovetail as labelled arrays of xarray (an extra), from which `from_xarray` makes it again.

    Parameters
    ----------
    source : Frf, Identification, Posterior, Modes or Dataset

    Returns
    -------
    xarray.Dataset or xarray.DataTree
        With named dimensions, and the unit of each variable as its attribute ``units``. An FRF has the dimension
        ``frequency``, a posterior ``sample``, modes ``mode``, a dataset ``sample``, ``response`` and ``frequency``. A
        result is a tree: its table as ``parameters``, the FRFs of each response below ``responses``, and ``posterior``.

    Raises
    ------
    DovetailError
        xarray is not installed, or the object is of another kind.

    Notes
    -----
    FRFs are complex: Zarr stores them (``tree.to_zarr(folder)``), while netCDF has no complex numbers.
    """
    problem = f"an object of the type {type(source).__name__} has no labelled arrays."
    raise DovetailError(Fault("to_xarray", problem, "Frf, Identification, Posterior, Modes, Dataset"))


def from_xarray(arrays: Any) -> Frf | Identification | Posterior:
    """Return what `to_xarray` made labelled arrays from: an FRF, a result or a posterior.

    Parameters
    ----------
    arrays : xarray.Dataset or xarray.DataTree

    Raises
    ------
    DovetailError
        They were not made by `to_xarray`, or from something that is not restored: modes follow from a result, and a
        dataset stays on disk.
    """
    kind = getattr(arrays, "attrs", {}).get(_KIND)
    if kind == "Frf":
        return _frf_from(arrays)
    if kind == "Posterior":
        return _posterior_from(arrays)
    if kind == "Identification":
        return result_from_json(str(arrays.attrs[_JSON]), "the attribute 'json'")
    problem = "these arrays were not made by 'to_xarray'." if kind is None else f"{kind} is not restored from arrays."
    raise DovetailError(Fault("from_xarray", problem, "arrays of an Frf, an Identification or a Posterior"))


def _xarray() -> Any:
    return require_package("xarray", "xarray", "to_xarray")


@to_xarray.register
def _frf_arrays(frf: Frf) -> Any:
    dims, units = ("frequency",), _units(frf.unit)
    named = {"units": units["frf"], "long_name": frf.quantity}
    variables: dict[str, Any] = {"frf": (dims, np.array(frf.values), named)}
    for name in ("coherence", "variance"):
        if (values := getattr(frf, name)) is not None:
            variables[name] = dims, np.array(values), {"units": units[name]}
    given = {name: getattr(frf, name) for name in _PLAIN}
    attributes = {name: int(value) if isinstance(value, bool) else value for name, value in given.items()}
    attributes = {name: value for name, value in attributes.items() if value is not None}
    axis = {"frequency": (dims, np.array(frf.frequency), {"units": units["frequency"]})}
    return _xarray().Dataset(variables, axis, {_KIND: "Frf", **attributes})


def _frf_from(arrays: Any) -> Frf:
    _check_units(arrays)
    given = {name: arrays.attrs[name] for name in _PLAIN if name in arrays.attrs}
    given |= {name: bool(given[name]) for name in ("has_phase", "rotation", "moment") if name in given}
    optional = {name: arrays[name].to_numpy() for name in ("coherence", "variance") if name in arrays}
    return Frf(arrays["frequency"].to_numpy(), arrays["frf"].to_numpy(), **given, **optional)


def _units(unit: str) -> dict[str, str]:
    """Return the units of each array of an FRF."""
    return {"frf": unit, "frequency": "Hz", "coherence": "1", "variance": f"({unit})^2"}


def _check_units(arrays: Any) -> None:
    """Refuse an FRF whose units or quantity are no longer those that `to_xarray` wrote."""
    quantity = arrays.attrs.get("quantity")
    moment = arrays.attrs.get("moment")
    turns, by_moment = bool(arrays.attrs.get("rotation", False)), None if moment is None else bool(moment)
    unit = unit_of(quantity, rotation=turns, moment=by_moment) if quantity in QUANTITIES else ""
    written = {("frf", "units"): unit, ("frf", "long_name"): quantity}
    written |= {(name, "units"): each for name, each in _units(unit).items()}
    for (name, attribute), expected in written.items():
        found = arrays[name].attrs.get(attribute, expected) if name in arrays.variables else expected
        if found != expected:
            problem = f"its attribute '{attribute}' is '{found}', not '{expected}'."
            raise MeasurementError(Fault(name, problem, remedy="Convert it to the units of 'to_xarray'."))


@to_xarray.register
def _posterior_arrays(posterior: Posterior) -> Any:
    variables: dict[str, Any] = {
        "theta": (("sample", "parameter"), posterior.theta, {"units": _SI}),
        "fraction": (("sample", "parameter"), posterior.fraction, {"units": "1"}),
        "weight": ("sample", posterior.weight, {"units": "1"}),
        "estimate": ("parameter", posterior.estimate),
    }
    if posterior.log_likelihood is not None:
        variables["log_likelihood"] = "sample", posterior.log_likelihood, {"units": "1"}
    if posterior.mode is not None:
        variables["mode"] = "parameter", posterior.mode
    structured = {
        "model_error": asdict(posterior.model_error),
        "evidence": None if posterior.evidence is None else asdict(posterior.evidence),
        "limits": asdict(posterior.limits),
        "moved_by_causes": dict(posterior.moved_by_causes),
        "unreliable": posterior.unreliable,
        "normal": posterior.normal,
    }
    attributes = {_KIND: "Posterior", **{name: getattr(posterior, name) for name in _SCALARS}}
    attributes |= {name: json.dumps(value) for name, value in structured.items()}
    return _xarray().Dataset(variables, {"parameter": list(posterior.names)}, attributes)


def _posterior_from(arrays: Any) -> Posterior:
    attributes = arrays.attrs
    evidence = json.loads(attributes["evidence"])
    names = {field.name for field in fields(Posterior)} & set(arrays.data_vars)
    return Posterior(
        names=tuple(map(str, arrays["parameter"].to_numpy())),
        **{name: arrays[name].to_numpy() for name in names},
        **{name: attributes[name] for name in _SCALARS},
        model_error=ModelError(**json.loads(attributes["model_error"])),
        evidence=None if evidence is None else Evidence(**evidence),
        limits=VerdictLimits(**json.loads(attributes["limits"])),
        moved_by_causes=json.loads(attributes["moved_by_causes"]),
        unreliable=tuple(json.loads(attributes["unreliable"])),
        normal=tuple(json.loads(attributes["normal"])),
    )


@to_xarray.register
def _result_arrays(result: Identification) -> Any:
    xarray = _xarray()
    rows, units = result.table, [row.unit for row in result.table]
    numbers = ("estimate", "interval_low", "interval_high", "best_fit", "range_low", "range_high")
    columns: dict[str, Any] = {
        name: ("parameter", np.array([getattr(row, name) for row in rows], dtype=np.float64)) for name in numbers
    }
    columns["verdict"] = "parameter", [row.verdict for row in rows]
    names = [row.name for row in rows]
    table = xarray.Dataset(columns, {"parameter": names, "unit": ("parameter", units)})
    children: dict[str, Any] = {"parameters": table}
    for number, response in enumerate(result.responses):
        computed, measured = (to_xarray(frf) for frf in (response.frf, response.measured))
        name = f"responses/{number}"
        children[name] = xarray.Dataset(attrs={"point": response.point})
        children[f"{name}/reconstructed"], children[f"{name}/measured"] = computed, measured
    if result.posterior is not None:
        posterior = to_xarray(result.posterior)
        identified = [parameter.unit for parameter in result.parameters.values()]
        children["posterior"] = posterior.assign_coords(unit=("parameter", identified))
    attributes = {
        _KIND: "Identification",
        "method": result.method,
        "warning": result.warning,
        _JSON: json.dumps(result.to_dict(), ensure_ascii=False),
    }
    return xarray.DataTree.from_dict({"/": xarray.Dataset(attrs=attributes), **children})


@to_xarray.register
def _modes_arrays(modes: Modes) -> Any:
    dims = ("mode",)
    variables: dict[str, Any] = {
        "natural_frequency": (dims, modes.natural_frequency, {"units": "Hz"}),
        "damping_ratio": (dims, modes.damping_ratio, {"units": "1"}),
    }
    intervals = {"natural_frequency": modes.natural_frequency_interval, "damping_ratio": modes.damping_ratio_interval}
    units = {"natural_frequency": "Hz", "damping_ratio": "1"}
    for name, ends in intervals.items():
        if ends is not None:
            variables[f"{name}_interval"] = ("mode", "end"), ends, {"units": units[name], "probability": modes.level}
    for name, shape in modes.shapes.items():
        variables[f"shape {name}"] = (("mode", f"node of {name}", f"direction of {name}"), shape)
    coordinates: dict[str, Any] = {"mode": np.arange(1, len(modes) + 1)}
    if any(ends is not None for ends in intervals.values()):
        coordinates["end"] = ["low", "high"]
    return _xarray().Dataset(variables, coordinates, {_KIND: "Modes", "warning": modes.warning})


@to_xarray.register
def _dataset_arrays(dataset: Dataset) -> Any:
    lines, samples = len(dataset.frequency), len(dataset)
    stored: Literal["amplitude", "accelerance"] = "accelerance" if dataset.storage == "complex" else "amplitude"
    values = np.asarray(getattr(dataset, stored)[:]).reshape(samples, -1, lines)
    coordinates: dict[str, Any] = {
        "frequency": ("frequency", dataset.frequency, {"units": "Hz"}),
        "response": list(dataset.attributes["responses"]),
        "parameter": list(dataset.attributes["parameter_names"]),
    }
    with suppress(DovetailError):  # a component may be missing here
        parameters = load(json.loads(dataset.description)).parameters
        coordinates["unit"] = "parameter", [parameter.unit for parameter in parameters]
    variables = {
        "theta": (("sample", "parameter"), dataset.parameters, {"units": _SI}),
        stored: (("sample", "response", "frequency"), values, {"units": "m/(N s^2)"}),
    }
    described = {"name": dataset.attributes["name"], "seed": dataset.seed, "description": dataset.description}
    return _xarray().Dataset(variables, coordinates, {_KIND: "Dataset", **described})
