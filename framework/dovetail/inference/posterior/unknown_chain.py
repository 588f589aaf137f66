"""A posterior in which gain and phase of the measurement are unknown too, whatever they do to the FRF.

Errors of the model are linearised about its best fit. A gain or a phase that is far off multiplies the FRF instead, and
the linear form would let errors of the fitted FRF take the place of a model that vanishes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.variants import with_unknown_chains
from dovetail.frf import Frf
from dovetail.frf.single_mode import background_shapes
from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.distribution import Posterior
from dovetail.inference.posterior.model_error import TYPICAL, ModelError
from dovetail.interfaces import Parameter
from dovetail.problem import Problem

_INFORMATION = 1e3
"""Fisher information of the chain's fractions with which the sampler begins to explore."""


@dataclass(frozen=True, eq=False)
class UnknownChain:
    """A problem with unknown gain and phase of each measurement, and its fit.

    Parameters
    ----------
    problem : Problem
    fit : Fit
    model_error : ModelError
        What is left of it.
    columns : (p,) int array
        Of the parameters that are not the chain's.
    """

    problem: Problem
    fit: Fit
    model_error: ModelError
    columns: NDArray[np.intp]

    @staticmethod
    def of(problem: Problem, fit: Fit, model_error: ModelError) -> UnknownChain | None:
        """Return the problem with unknown chains; None if errors are not common to all lines, or chains are known.

        Gains and phases have normal priors with the sizes of `model_error`.
        """
        gain = Parameter.with_normal_prior(
            "gain", "1", 1.0, model_error.magnitude, "log", "Measured over true amplitude"
        )
        phase = Parameter.with_normal_prior("phase", "rad", 0.0, model_error.phase, "linear", "Of the measured FRF")
        assembly, target = problem.assembly, problem.observations
        unknown, added = with_unknown_chains(assembly, (gain, phase))
        if not added:
            return None
        names = [parameter.name for parameter in unknown.parameters]
        columns = np.array([names.index(parameter.name) for parameter in assembly.parameters], dtype=np.intp)
        theta = unknown.vector(dict.fromkeys(added, 0.0) | {name: 1.0 for name in added if name.endswith(".gain")})
        theta[columns] = fit.theta
        values = target.split(problem.frf_at(fit.theta))
        pairs = zip(target.frfs, values, target.split(fit.variance), strict=True)
        for response, factor in zip(assembly.description.responses, (_factor(*pair) for pair in pairs), strict=True):
            for name, value in ((f"{response.name}.gain", abs(factor)), (f"{response.name}.phase", np.angle(factor))):
                if name in added:
                    theta[names.index(name)] = value
        lower, upper = np.transpose([(parameter.lower, parameter.upper) for parameter in unknown.parameters])
        information = _INFORMATION * np.eye(len(names))
        information[np.ix_(columns, columns)] = fit.information
        left = replace(model_error, magnitude=TYPICAL.magnitude, phase=TYPICAL.phase)
        there = replace(fit, theta=np.clip(theta, lower, upper), information=information)
        return UnknownChain(problem.with_assembly(unknown), there, left, columns)

    def without(self, posterior: Posterior) -> Posterior:
        """Return a posterior of this assembly without the chains: they are marginalised.

        Its error of the model is without the background, which belongs to the measured FRFs only.
        """
        names = tuple(posterior.names[column] for column in self.columns)
        return replace(
            posterior,
            names=names,
            theta=posterior.theta[:, self.columns],
            fraction=posterior.fraction[:, self.columns],
            estimate=posterior.estimate[self.columns],
            mode=None if posterior.mode is None else posterior.mode[self.columns],
            unreliable=tuple(name for name in posterior.unreliable if name in names),
            normal=tuple(name for name in posterior.normal if name in names),
            model_error=replace(self.model_error, background=0.0),
        )


def _factor(frf: Frf, values: NDArray[np.complex128], variance: NDArray[np.float64]) -> complex:
    """Return the complex factor by which a model's values (n_freq,) fit an FRF best, with a background added."""
    columns = np.vstack([values, background_shapes(frf)]) / np.sqrt(variance)
    sizes = np.linalg.norm(columns, axis=1)
    found = np.linalg.lstsq((columns / sizes[:, np.newaxis]).T, frf.values / np.sqrt(variance), rcond=1e-12)[0]
    return complex(found[0] / sizes[0])
