"""Identification of a joint from a measured FRF: training, the network, results, bundles, prediction."""

from dovetail.identification.bands import Band, predict_band
from dovetail.identification.bundle import load_model
from dovetail.identification.fitting import Fit
from dovetail.identification.foreign import Foreign
from dovetail.identification.identifier import Identifier
from dovetail.identification.identify import identify
from dovetail.identification.metrics import Evaluation, ParameterMetrics
from dovetail.identification.posterior import Posterior, Verdict
from dovetail.identification.prediction import predict
from dovetail.identification.result import AtPoint, Identification, IdentifiedParameter, Mode
from dovetail.identification.training import train

__all__ = [
    "AtPoint",
    "Band",
    "Evaluation",
    "Fit",
    "Foreign",
    "Identification",
    "IdentifiedParameter",
    "Identifier",
    "Mode",
    "ParameterMetrics",
    "Posterior",
    "Verdict",
    "identify",
    "load_model",
    "predict",
    "predict_band",
    "train",
]
