"""The ways to identify a joint: the network's answer, the refined fit, many local searches, the posterior.

Each takes an assembly, measurements on its frequencies, a trained network or None, and its own options by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError, ParameterError, did_you_mean, listing
from dovetail.frf import Frf
from dovetail.identification.fitting import Objective, multistart, refine
from dovetail.identification.misspecification import check_misspecification
from dovetail.identification.network.preprocessing import accelerance_amplitudes
from dovetail.identification.network.trained_network import TrainedNetwork
from dovetail.identification.posterior import MODEL_ERROR, Form, laplace_posterior, sample_posterior
from dovetail.identification.provenance import provenance
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification

__all__ = ["METHODS"]

_CANNOT_TELL = (
    "This model cannot tell whether the measurement is like what it was trained on, since it is of an earlier version "
    "or takes several responses: use the method 'refined' to be sure."
)


def by_network(assembly: Assembly, measured: tuple[Frf, ...], trained: TrainedNetwork | None = None) -> Identification:
    """Identify the joint from one measured FRF with the network alone.

    Raises
    ------
    ParameterError
        There is no network.
    MeasurementError
        The network has no finite answer.
    """
    if trained is None:
        problem = "the method 'network' needs a trained model."
        raise ParameterError(Fault(assembly.name, problem, remedy="Train one with dovetail.train, or use 'refined'."))
    theta = trained.predict_parameters(accelerance_amplitudes(measured))[0]
    if not np.isfinite(theta).all():
        lost = [p.name for p, value in zip(assembly.parameters, theta, strict=True) if not np.isfinite(value)]
        raise MeasurementError(
            f"{measured[0].label}: the network has no finite value for {listing(lost)}: this FRF is far from all it "
            "was trained on. Check its quantity and units."
        )
    origin = provenance(assembly, measured, trained.evaluation)
    verdict = None
    if trained.novelty is not None:
        verdict = trained.novelty.check(measured[0], assembly.accelerance_amplitude(theta).astype(np.float64))
    result = reconstruct(assembly, theta, measured, method="network", provenance=origin, misspecification=verdict)
    return result if verdict is not None else replace(result, warnings=(*result.warnings, _CANNOT_TELL))


def by_refined_fit(
    assembly: Assembly, measured: tuple[Frf, ...], trained: TrainedNetwork | None = None, *, seed: int | None = None
) -> Identification:
    """Fit the joint to the measured FRF, from the ranges alone or from a network's answer as well.

    Parameters
    ----------
    assembly : Assembly
    measured : tuple of Frf
        One for each response, on the assembly's frequencies.
    trained : TrainedNetwork, optional
        Its answer is one more start.
    seed : int, optional
        Of the other starts; the description's by default.
    """
    return _refined(assembly, measured, trained, seed, MODEL_ERROR)


def _refined(
    assembly: Assembly, measured: tuple[Frf, ...], trained: TrainedNetwork | None, seed: int | None, model_error: float
) -> Identification:
    """Fit the joint, and say whether a model with this relative error can have made the measurement."""
    starts = []
    if trained is not None:
        guess = trained.predict_parameters(accelerance_amplitudes(measured))[0]
        starts = [guess] if np.isfinite(guess).all() else []
    settings = assembly.description.identification
    fit = refine(assembly, measured, starts, seed=settings.seed if seed is None else seed)
    origin = provenance(assembly, measured, trained.evaluation if trained is not None else None)
    verdict = check_misspecification(assembly, measured, fit, model_error)
    return reconstruct(
        assembly, fit.theta, measured, method="refined", provenance=origin, fit=fit, misspecification=verdict
    )


def by_multistart(
    assembly: Assembly,
    measured: tuple[Frf, ...],
    _trained: TrainedNetwork | None = None,
    *,
    starts: int = 64,
    seconds: float | None = None,
    objective: Objective = "frf",
    seed: int | None = None,
) -> Identification:
    """Fit the joint to the measured FRF by many local searches.

    Parameters
    ----------
    assembly : Assembly
    measured : tuple of Frf
        One for each response, on the assembly's frequencies.
    _trained : TrainedNetwork, optional
        Not asked.
    starts : int
        Points of the Latin hypercube.
    seconds : float, optional
        Time after which no further step is taken.
    objective : {"frf", "weighted"}
        Sum of the squared differences of the FRFs as they are, or over their random error.
    seed : int, optional
        Of the Latin hypercube; the description's by default.
    """
    fit = multistart(
        assembly,
        measured,
        starts=starts,
        seconds=seconds,
        objective=objective,
        seed=assembly.description.identification.seed if seed is None else seed,
    )
    origin = provenance(assembly, measured, None) | {"objective": objective}
    verdict = check_misspecification(assembly, measured, fit, explain=False)
    return reconstruct(
        assembly, fit.theta, measured, method="multistart", provenance=origin, fit=fit, misspecification=verdict
    )


_FORMS = {"samples": sample_posterior, "laplace": laplace_posterior}


def by_posterior(
    assembly: Assembly,
    measured: tuple[Frf, ...],
    trained: TrainedNetwork | None = None,
    *,
    form: Form = "samples",
    samples: int = 400,
    model_error: float = MODEL_ERROR,
    seed: int | None = None,
) -> Identification:
    """Fit the joint to the measured FRF, and tell how far each parameter is known.

    Parameters
    ----------
    assembly : Assembly
    measured : tuple of Frf
        One for each response, on the assembly's frequencies.
    trained : TrainedNetwork, optional
        Its answer is one more start of the fit.
    form : {"samples", "laplace"}
        Samples of the posterior, or a Gaussian at its most probable place: faster, and straight.
    samples : int
    model_error : float
        Relative error of natural frequencies that the model is allowed.
    seed : int, optional
        The description's by default.
    """
    if form not in _FORMS:
        problem = f"'{form}' is no form of the posterior."
        raise ParameterError(Fault("form", problem, ", ".join(_FORMS), did_you_mean(form, _FORMS)))
    fitted = _refined(assembly, measured, trained, seed, model_error)
    assert fitted.fit is not None
    posterior = _FORMS[form](
        assembly,
        measured,
        fitted.fit,
        samples=samples,
        model_error=model_error,
        seed=assembly.description.identification.seed if seed is None else seed,
    )
    origin = {**fitted.provenance, "posterior_form": form, "model_error": model_error}
    warnings = (*fitted.warnings, *posterior.warnings)
    return replace(fitted, method="posterior", posterior=posterior, provenance=origin, warnings=warnings)


METHODS: Mapping[str, Callable[..., Identification]] = {
    "network": by_network,
    "refined": by_refined_fit,
    "multistart": by_multistart,
    "posterior": by_posterior,
}
"""By the word after ``--method``."""
