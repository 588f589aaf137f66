"""The parameters given the measurement: samples, intervals, verdicts."""

from dovetail.identification.posterior.laplace import laplace_posterior
from dovetail.identification.posterior.likelihood import PRIOR_PRECISION
from dovetail.identification.posterior.model_error import (
    MODEL_ERROR,
    TYPICAL,
    ModelError,
    error_shapes,
    typical_model_error,
)
from dovetail.identification.posterior.posterior import LEVEL, NOT_BELIEVED, Form, Posterior, Verdict, quantiles
from dovetail.identification.posterior.sampling import sample_posterior

__all__ = [
    "LEVEL",
    "MODEL_ERROR",
    "NOT_BELIEVED",
    "PRIOR_PRECISION",
    "TYPICAL",
    "Form",
    "ModelError",
    "Posterior",
    "Verdict",
    "error_shapes",
    "laplace_posterior",
    "quantiles",
    "sample_posterior",
    "typical_model_error",
]
