"""How sure a predicted FRF is: the posterior of the joint passed through to another assembly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError
from dovetail.identification.posterior import LEVEL, model_errors
from dovetail.identification.prediction import joint_values, predict
from dovetail.identification.result import Identification

__all__ = ["Band", "predict_band"]

_DRAWN = 400


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
        joint was identified in.

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
    theta = posterior.theta[random.choice(len(posterior.weight), _DRAWN, p=posterior.weight)]
    values = assembly.frf(np.stack([_joint(assembly, result, one) for one in theta]))
    errors = model_errors(assembly.frequency, predict(assembly, result).values, posterior.model_error)
    amplitude = np.abs(values + random.standard_normal((len(values), len(errors))) @ errors)
    lower, upper = np.quantile(amplitude, [(1.0 - level) / 2.0, (1.0 + level) / 2.0], axis=0)
    return Band(assembly.frequency, lower, upper, level)


def _joint(assembly: Assembly, result: Identification, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return one sample of the joint as a parameter vector of the assembly."""
    given = dict(zip(result.parameters, theta.tolist(), strict=True))
    known = joint_values(assembly, {**result.known, **_named(result, given)})
    return assembly.vector(known)


def _named(result: Identification, values: dict[str, float]) -> dict[str, float]:
    """Return values by joint and parameter."""
    joints = {name: parameter.joint for name, parameter in result.parameters.items()}
    return {f"{joints[name]}.{name.rpartition('.')[2]}": value for name, value in values.items()}
