"""Prediction: the FRF of another assembly with an identified joint, and a band of its uncertainty."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, AssemblySource, ParameterScales, as_assembly
from dovetail.errors import Fault, ParameterError, UnitError, listing
from dovetail.frf import Frf
from dovetail.identification.joint_changes import joint_faults, joint_warnings
from dovetail.identification.parameters import IdentifiedParameter, is_in_range
from dovetail.identification.result import Identification
from dovetail.identification.result_file import load_result
from dovetail.inference.posterior import LEVEL, Posterior, with_model_error
from dovetail.inference.posterior.likelihood import normal_from_unit, unit_from_normal
from dovetail.inference.posterior.verdicts import ends_of
from dovetail.units import format_quantity, to_si

_Number = TypeVar("_Number", np.float64, np.complex128)

Joint: TypeAlias = Identification | Mapping[str, float | str] | Mapping[str, IdentifiedParameter]
"""An identified joint: the result, its parameters, or values by name."""


def predict(assembly: AssemblySource, result: Joint | str | Path) -> Frf:
    """Predict the FRF of an assembly with a joint that was identified in another.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description; for example another tool in the same holder and joint. Parameters that its description fixes
        keep their values.
    result : Identification, path, or mapping of str to float or str
        The identified joint, or where its result was written; or its ``parameters``; or values by name, bare or as
        ``joint.parameter``: numbers in SI, or texts with units.

    Returns
    -------
    Frf
        In the quantity and on the frequencies of `assembly`, at the first of its responses. For the second, pass
        ``assembly.at(1)``. Its note is the warning of `result`, which `write_frf` writes to every format.

    Raises
    ------
    ParameterError
        The assembly needs a parameter that `result` does not have, or has in another unit; a joint has another model or
        another structural damping; or a value is given twice.

    Warns
    -----
    UserWarning
        `result` is not trustworthy, a joint has other options or known values than where it was identified, or values
        have names that the assembly does not have.

    Notes
    -----
    A parameter is matched by joint and name, or else by its name alone if only one joint on either side has it.
    Parameters that the identified assembly's description fixes belong to the joint and are taken along.
    """
    joint = load_result(result) if isinstance(result, (str, Path)) else result
    _warn(joint)
    if isinstance(joint, Mapping):
        _check_names(as_assembly(assembly), joint)
    return predicted_frf(as_assembly(assembly), joint)


def predicted_frf(assembly: Assembly, result: Joint) -> Frf:
    """Return the same as `predict`, without a warning: the callers show the note of the FRF."""
    values, warning = joint_values(assembly, result), "" if isinstance(result, Mapping) else result.warning
    response, label = assembly.description.response, f"{assembly.name}, predicted"
    frf = with_signs_of(assembly, result).frf(values)
    return response.frf(assembly.frequency, frf, label=label, note=warning)


def determined_signs(assembly: Assembly, result: Joint) -> dict[str, float]:
    """Return the signs, by response, that the measurement determined and that the description leaves unknown."""
    known = result if isinstance(result, Mapping) else result.known
    names = assembly.description.unknown_signs
    return {name: to_si(known[f"{name}.sign"], "1") for name in names if f"{name}.sign" in known}


def with_signs_of(assembly: Assembly, result: Joint) -> Assembly:
    """Return the assembly with the signs that were determined from the measurement, where its own are unknown."""
    signs = determined_signs(assembly, result)
    return assembly.with_description(assembly.description.with_signs(signs)) if signs else assembly


def _warn(result: Joint) -> None:
    """Warn whoever called the caller if the joint is not trustworthy."""
    if not isinstance(result, Mapping) and result.warning:
        warnings.warn(f"predicted from {result.measured.label}: {result.warning}", stacklevel=3)


def _check_names(assembly: Assembly, values: Mapping[str, Any]) -> None:
    """Refuse a value that is given twice, and warn of names that the assembly does not have."""
    if any(isinstance(value, IdentifiedParameter) for value in values.values()):
        return
    entries = assembly.description.entries.items()
    names = {f"{owner}.{p.name}" for owner, entry in entries for p in entry.parameters}
    names |= {f"{owner}.{name}" for owner, entry in entries for name in (*entry.fixed, *entry.ties)}
    bare = {name.partition(".")[2] for name in names}
    twice = [name for name in values if any(other.partition(".")[2] == name for other in values)]
    if twice:
        problem = f"{listing(twice)} is given with and without the name of its joint."
        raise ParameterError(Fault("result", problem, "each value once"))
    if unused := [name for name in values if name not in names | bare]:
        warnings.warn(f"assembly '{assembly.name}' has no parameter {listing(unused)}.", stacklevel=3)


def joint_values(assembly: Assembly, result: Joint) -> dict[str, float]:
    """Return the values of an identified joint for the identified parameters of another assembly.

    Parameters
    ----------
    assembly, result
        As in `predict`.

    Returns
    -------
    dict of str to float
        SI values by the names of ``assembly.parameters``.

    Raises
    ------
    ParameterError
        As in `predict`.
    """
    values = _values(result)
    names = assembly.description.identified_parameters
    matched: dict[str, float] = {}
    sources: dict[str, str | None] = {}
    faults, missing = [], []
    for parameter, (joint, name) in zip(assembly.parameters, names, strict=True):
        shared = joint not in assembly.description.joints or sum(other == name for _, other in names) > 1
        value = _match(values, joint, name, shared)
        if value is None or (value.joint != joint and value.joint in assembly.description.joints):
            missing.append(parameter.name)
        elif value.unit not in (None, parameter.unit):
            faults.append(
                Fault(f"parameter {parameter.name}", f"it was identified in {value.unit}.", f"{parameter.unit}")
            )
        else:
            sources[joint] = value.joint
            try:
                matched[parameter.name] = to_si(value.value, parameter.unit)
            except UnitError as error:
                faults.append(Fault(f"parameter {parameter.name}", error.faults[0].problem))
    if not isinstance(result, Mapping):
        faults.extend(joint_faults(assembly, result, sources))
    if missing:
        noun, them = ("parameter", "it") if len(missing) == 1 else ("parameters", "them")
        problem = f"assembly '{assembly.name}' needs {them}, and the identification does not hold {them}."
        known = listing((str(value) for value in values), 20)
        remedy = f"Fix {them} in the description, or identify {them}."
        faults.insert(0, Fault(f"{noun} {listing(missing, 20)}", problem, known, remedy))
    if faults:
        raise ParameterError(*faults)
    changes = () if isinstance(result, Mapping) else joint_warnings(assembly, result, sources)
    for sentence in (*changes, *_outside(assembly, matched)):
        warnings.warn(sentence, stacklevel=2)
    return matched


def _outside(assembly: Assembly, values: Mapping[str, float]) -> Iterator[str]:
    """Yield a sentence for each identified value outside of the range that the other description has."""
    for parameter in assembly.parameters:
        value, ends = values[parameter.name], (parameter.lower, parameter.upper)
        if parameter.prior == "uniform" and not is_in_range(value, *ends, parameter.scale):
            given, low, high = (format_quantity(each, parameter.unit) for each in (value, *ends))
            yield f"{parameter.name}: {given} is outside of its range in '{assembly.name}', {low} to {high}."


@dataclass(frozen=True)
class _Value:
    joint: str | None
    name: str
    value: float | str
    unit: str | None = None

    def __str__(self) -> str:
        return f"{self.joint}.{self.name}" if self.joint else self.name


def _values(result: Joint) -> list[_Value]:
    entries: Mapping[str, Any] = result if isinstance(result, Mapping) else {**result.parameters, **result.known}
    values = []
    for name, value in entries.items():
        if isinstance(value, IdentifiedParameter):
            values += [_Value(*_split_name(tied), at, value.unit) for tied, at in value.with_tied(value.value).items()]
        else:
            values.append(_Value(*_split_name(name), value.item() if isinstance(value, np.generic) else value))
    return values


def _split_name(name: str) -> tuple[str | None, str]:
    owner, dot, bare = name.partition(".")
    return (owner, bare) if dot else (None, name)


def _match(values: list[_Value], joint: str, name: str, shared: bool) -> _Value | None:
    """Return the value for a parameter; if its name is `shared` by several owners, the owner must be the same."""
    same_name = [value for value in values if value.name == name]
    exact = [value for value in same_name if value.joint == joint]
    if exact:
        return exact[0]
    return same_name[0] if len(same_name) == 1 and not shared else None


@dataclass(frozen=True)
class Settings:
    """How intervals of what is computed from a posterior are computed."""

    draws: int = 400
    """Posterior samples that are drawn; enough for quantiles of 5 and 95 %."""
    step: float = 1e-4
    """Step of the normal coordinates for derivatives by central differences."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class PredictedBand:
    """Amplitudes between which an FRF lies.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    lower, upper : (n_freq,) arrays
        Amplitudes in the quantity of the assembly's response.
    level : float
        Probability, line by line.
    warning : str
        That of the result it comes from.
    """

    frequency: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    level: float
    warning: str = ""

    def __repr__(self) -> str:
        lines = f"{len(self.frequency)} lines from {self.frequency[0]:g} to {self.frequency[-1]:g} Hz"
        return f"<PredictedBand: {f'{self.warning} ' if self.warning else ''}{self.level:.0%}, {lines}>"


def predict_band(
    assembly: AssemblySource, result: Identification | str | Path, *, level: float = LEVEL, seed: int = 0
) -> PredictedBand:
    """Predict the amplitudes between which the FRF of another assembly with the identified joint lies.

    Parameters
    ----------
    assembly : Assembly or path
        As in `predict`.
    result : Identification or path
        By the method "posterior".
    level : float
        Probability, line by line.
    seed : int

    Returns
    -------
    PredictedBand
        From the posterior's samples. The model of this assembly is allowed the same error as the model in which the
        joint was identified. With the form "laplace" the FRF is linearised at the posterior mode: the Gaussian is
        valid only there, and its samples by themselves do not reproduce the measurement.

    Raises
    ------
    ParameterError
        The result has no posterior, or does not hold what the assembly needs; or `level` is not a probability.

    Warns
    -----
    UserWarning
        `result` is not trustworthy.
    """
    joint = load_result(result) if isinstance(result, (str, Path)) else result
    _warn(joint)
    return predicted_band(as_assembly(assembly), joint, level, seed)


def predicted_band(assembly: Assembly, result: Identification, level: float = LEVEL, seed: int = 0) -> PredictedBand:
    """Return the same as `predict_band`, without a warning."""
    if not 0.0 < level < 1.0:
        raise ParameterError(Fault("level", f"{level:g} is not a probability.", "more than 0 and less than 1"))
    if result.posterior is None:
        problem = f"the joint was identified by the method '{result.method}', which does not say how sure it is."
        raise ParameterError(Fault("result", problem, remedy="Identify it by the method 'posterior'."))
    random, posterior, seen = np.random.default_rng([seed, 3]), result.posterior, with_signs_of(assembly, result)
    values = drawn_values(posterior, result, lambda theta: seen.frf(theta_elsewhere(seen, result, theta)), random)
    predicted = predicted_frf(assembly, result)
    values = with_model_error(values, [predicted], posterior.model_error, random)
    lower, upper = np.quantile(np.abs(values), ends_of(level), axis=0)
    return PredictedBand(assembly.frequency, lower, upper, level, result.warning)


def theta_elsewhere(assembly: Assembly, result: Identification, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an assembly's parameters (n, n_params) for samples (n, p) of the identified joint."""
    samples: list[dict[str, float]] = []
    for row in theta.tolist():
        values = zip(result.parameters.values(), row, strict=True)
        samples.append({**result.known, **{k: v for p, at in values for k, v in p.with_tied(at).items()}})
    return np.stack([assembly.vector(joint_values(assembly, sample)) for sample in samples])


def drawn_values(
    posterior: Posterior,
    result: Identification,
    function: Callable[[NDArray[np.float64]], NDArray[_Number]],
    random: np.random.Generator,
) -> NDArray[_Number]:
    """Return a function's values (n, m) at samples of a posterior, drawn by their weights.

    With the form "laplace" they are linear in the normal coordinates about the posterior mode.

    Parameters
    ----------
    posterior : Posterior
        That of `result`.
    result : Identification
    function : callable
        Takes parameters (n, p) of the result, in SI, and returns values (n, m).
    random : numpy.random.Generator
    """
    draws = random.choice(len(posterior.weight), _SETTINGS.draws, p=posterior.weight)
    if posterior.mode is None:
        return function(posterior.theta[draws])
    scales = ParameterScales([parameter.definition for parameter in result.parameters.values()])
    centre = normal_from_unit(scales.to_unit(posterior.mode))
    steps = _SETTINGS.step * np.eye(len(centre))
    near = unit_from_normal(centre + np.concatenate([steps, -steps]))
    ahead, behind = np.split(function(scales.from_unit(near)), 2)
    jacobian = (ahead - behind) / (2.0 * _SETTINGS.step)
    moved = normal_from_unit(posterior.fraction[draws]) - centre
    return np.asarray(function(posterior.mode[np.newaxis]) + moved @ jacobian)
