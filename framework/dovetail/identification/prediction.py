"""The identified joint in another assembly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError, listing
from dovetail.frf import Frf
from dovetail.identification.posterior import LEVEL, model_errors
from dovetail.identification.posterior.prior import fraction_of, quantile_of
from dovetail.identification.reconstruction import sought
from dovetail.identification.result import Identification
from dovetail.interfaces import Parameter

__all__ = ["Band", "joint_values", "predict", "predict_band"]


def predict(assembly: Assembly, result: Identification | Mapping[str, float]) -> Frf:
    """Predict the FRF of an assembly with a joint that was identified in another.

    Parameters
    ----------
    assembly : Assembly
        Another tool, say, in the same holder and joint. What its description fixes stays as it is.
    result : Identification or mapping of str to float
        The identified joint; or SI values by name, bare or as ``joint.parameter``.

    Returns
    -------
    Frf
        In the quantity and on the frequencies of `assembly`, at the first of its responses; ``assembly.at(1)`` in its
        place gives the FRF at the second.

    Raises
    ------
    ParameterError
        The assembly seeks a parameter that `result` does not hold, or holds in another unit.

    Notes
    -----
    A parameter is matched by joint and name; failing that by its name alone, if only one joint on either side has it.
    Parameters that the identified assembly's description fixed belong to the joint and go with it.
    """
    values = joint_values(assembly, result)
    response, label = assembly.description.response, f"{assembly.name}, predicted"
    return Frf(assembly.frequency, assembly.frf(values), response.quantity, label=label, rotation=response.rotation)


def joint_values(assembly: Assembly, result: Identification | Mapping[str, float]) -> dict[str, float]:
    """Return what an identified joint gives for the parameters that an assembly seeks.

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
    names = sought(assembly)
    matched: dict[str, float] = {}
    faults, missing = [], []
    for parameter, (joint, name) in zip(assembly.parameters, names, strict=True):
        shared = sum(other == name for _, other in names) > 1
        value = _match(values, joint, name, shared)
        if value is None:
            missing.append(parameter.name)
        elif value.unit not in (None, parameter.unit):
            faults.append(
                Fault(f"parameter {parameter.name}", f"it was identified in {value.unit}.", f"{parameter.unit}")
            )
        else:
            matched[parameter.name] = value.value
    if missing:
        noun, them = ("parameter", "it") if len(missing) == 1 else ("parameters", "them")
        problem = f"assembly '{assembly.name}' needs {them}, and the identification does not hold {them}."
        held = listing((str(value) for value in values), 20)
        where = f"{noun} {listing(missing, 20)}"
        faults.insert(0, Fault(where, problem, held, f"Fix {them} in the description, or identify {them}."))
    if faults:
        raise ParameterError(*faults)
    return matched


@dataclass(frozen=True)
class _Value:
    joint: str | None
    name: str
    value: float
    unit: str | None = None

    def __str__(self) -> str:
        return f"{self.joint}.{self.name}" if self.joint else self.name


def _values(result: Identification | Mapping[str, float]) -> list[_Value]:
    if not isinstance(result, Identification):
        return [_Value(*_parted(name), float(value)) for name, value in result.items()]
    identified = [_Value(p.joint, _parted(p.name)[1], p.value, p.unit) for p in result.parameters.values()]
    return identified + [_Value(*_parted(name), value) for name, value in result.known.items()]


def _parted(name: str) -> tuple[str | None, str]:
    joint, dot, bare = name.rpartition(".")
    return (joint if dot else None), bare


def _match(values: list[_Value], joint: str, name: str, shared: bool) -> _Value | None:
    """Return the value for a joint's parameter; `shared` says that several joints sought have one of this name."""
    alike = [value for value in values if value.name == name]
    exact = [value for value in alike if value.joint == joint]
    if exact:
        return exact[0]
    return alike[0] if len(alike) == 1 and not shared else None


_DRAWN = 400
_STEP = 1e-4
"""Of the normal quantiles, for derivatives by differences."""


@dataclass(frozen=True, eq=False)
class Band:
    """Between which amplitudes an FRF lies.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    lower, upper : (n_freq,) arrays
        Amplitudes in the quantity of the assembly's response.
    level : float
        Probability, line by line.
    """

    frequency: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    level: float


def predict_band(assembly: Assembly, result: Identification, *, level: float = LEVEL, seed: int = 0) -> Band:
    """Predict between which amplitudes the FRF of another assembly with the identified joint lies.

    Parameters
    ----------
    assembly : Assembly
        As in `predict`.
    result : Identification
        By the method "posterior".
    level : float
        Probability, line by line.
    seed : int

    Returns
    -------
    Band
        From the posterior's samples, and with the same error allowed to this assembly's model as to the one that the
        joint was identified in. With the form "laplace" the FRF is taken to be linear about the most probable place:
        the Gaussian holds only there, and its samples by themselves do not reproduce the measurement.

    Raises
    ------
    ParameterError
        The result has no posterior, or does not hold what the assembly needs.
    """
    posterior = result.posterior
    if posterior is None:
        problem = f"the joint was identified by the method '{result.method}', which does not say how sure it is."
        raise ParameterError(Fault("result", problem, remedy="Identify it by the method 'posterior'."))
    random = np.random.default_rng([seed, 3])
    chosen = random.choice(len(posterior.weight), _DRAWN, p=posterior.weight)
    if posterior.mode is None:
        values = _frfs(assembly, result, posterior.theta[chosen])
    else:
        values = _linear(assembly, result, posterior.fraction[chosen], posterior.mode)
    errors = model_errors(assembly.frequency, [predict(assembly, result).values], posterior.model_error)
    amplitude = np.abs(values + random.standard_normal((len(values), len(errors))) @ errors)
    lower, upper = np.quantile(amplitude, [(1.0 - level) / 2.0, (1.0 + level) / 2.0], axis=0)
    return Band(assembly.frequency, lower, upper, level)


def _frfs(assembly: Assembly, result: Identification, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
    return assembly.frf(np.stack([_joint(assembly, result, one) for one in theta]))


def _linear(
    assembly: Assembly, result: Identification, fraction: NDArray[np.float64], mode: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return FRFs of samples by the derivatives at the most probable place, in the Gaussian's coordinates."""
    ranges = [Parameter(name, p.unit, p.lower, p.upper, p.scale) for name, p in result.parameters.items()]
    centre = quantile_of(np.array([one.to_unit(value) for one, value in zip(ranges, mode, strict=True)]))
    steps = np.concatenate([_STEP * np.eye(len(mode)), -_STEP * np.eye(len(mode))])
    near = fraction_of(centre + steps)
    theta = np.stack([one.from_unit(near[:, index]) for index, one in enumerate(ranges)], axis=1)
    ahead, behind = np.split(_frfs(assembly, result, theta), 2)
    at_mode = _frfs(assembly, result, mode[np.newaxis])
    return np.asarray(at_mode + (quantile_of(fraction) - centre) @ ((ahead - behind) / (2.0 * _STEP)))


def _joint(assembly: Assembly, result: Identification, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return one sample of the joint as a parameter vector of the assembly."""
    given = dict(zip(result.parameters, theta.tolist(), strict=True))
    known = joint_values(assembly, {**result.known, **_named(result, given)})
    return assembly.vector(known)


def _named(result: Identification, values: dict[str, float]) -> dict[str, float]:
    """Return values by joint and parameter."""
    joints = {name: parameter.joint for name, parameter in result.parameters.items()}
    return {f"{joints[name]}.{name.rpartition('.')[2]}": value for name, value in values.items()}
