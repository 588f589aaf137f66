"""The posterior: the refined fit, and samples of all parameters that explain the measurement as well."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError, did_you_mean
from dovetail.frf import Frf
from dovetail.identification.methods import refined
from dovetail.identification.posterior import MODEL_ERROR, Form, laplace_posterior, sample_posterior
from dovetail.identification.result import Identification

if TYPE_CHECKING:
    from dovetail.identification.identifier import Identifier

__all__ = ["identify"]

_FORMS = {"samples": sample_posterior, "laplace": laplace_posterior}


def identify(
    assembly: Assembly,
    measured: tuple[Frf, ...],
    identifier: Identifier | None = None,
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
    identifier : Identifier, optional
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
        found = f"'{form}' is no form of the posterior."
        raise ParameterError(Fault("form", found, ", ".join(_FORMS), did_you_mean(form, _FORMS)))
    fitted = refined.fitted(assembly, measured, identifier, seed, model_error)
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
