"""How sure a predicted FRF is: the posterior of the joint passed through to another assembly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError
from dovetail.identification.posterior import LEVEL, model_errors
from dovetail.identification.posterior.coordinates import fraction_of, quantile_of
from dovetail.identification.prediction import joint_values, predict
from dovetail.identification.result import Identification
from dovetail.interfaces import Parameter

__all__ = ["Band", "predict_band"]

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
        found = f"the joint was identified by the method '{result.method}', which does not say how sure it is."
        raise ParameterError(Fault("result", found, remedy="Identify it by the method 'posterior'."))
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
