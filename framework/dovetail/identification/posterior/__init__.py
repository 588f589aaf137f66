"""The parameters given the measurement: samples, intervals, verdicts."""

from dovetail.identification.posterior.model_error import MODEL_ERROR, model_errors
from dovetail.identification.posterior.posterior import LEVEL, Posterior, Verdict, quantiles
from dovetail.identification.posterior.sample import sample_posterior

__all__ = ["LEVEL", "MODEL_ERROR", "Posterior", "Verdict", "model_errors", "quantiles", "sample_posterior"]
