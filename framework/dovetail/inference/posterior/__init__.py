"""The parameters given the measurement: samples, intervals, verdicts."""

from dovetail.inference.posterior.distribution import Form, Posterior
from dovetail.inference.posterior.laplace import laplace_posterior
from dovetail.inference.posterior.likelihood import PRIOR_PRECISION
from dovetail.inference.posterior.model_error import (
    MODEL_ERROR,
    TYPICAL,
    ModelError,
    error_shapes,
    typical_model_error,
    with_model_error,
)
from dovetail.inference.posterior.sampling import sample_posterior
from dovetail.inference.posterior.verdicts import (
    FIXED,
    LEVEL,
    NOT_TRUSTWORTHY,
    Group,
    Verdict,
    VerdictLimits,
    quantiles,
)

__all__ = [
    "FIXED",
    "LEVEL",
    "MODEL_ERROR",
    "NOT_TRUSTWORTHY",
    "PRIOR_PRECISION",
    "TYPICAL",
    "Form",
    "Group",
    "ModelError",
    "Posterior",
    "Verdict",
    "VerdictLimits",
    "error_shapes",
    "laplace_posterior",
    "quantiles",
    "sample_posterior",
    "typical_model_error",
    "with_model_error",
]
