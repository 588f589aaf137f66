"""Identification of a joint from a measured FRF: training, the network, results, bundles, prediction."""

from dovetail.identification.adequacy import Adequacy, Cause
from dovetail.identification.adequacy.adequacy import AtPoint
from dovetail.identification.fitting import Fit
from dovetail.identification.identifier import Batch, Identifier, identify_many, load_model, train
from dovetail.identification.identify import identify
from dovetail.identification.parameters import IdentifiedParameter, TableRow
from dovetail.identification.posterior import ModelError, Posterior, Verdict
from dovetail.identification.prediction import Band, predict, predict_band
from dovetail.identification.provenance import Evaluation, ParameterMetrics
from dovetail.identification.result import Identification, MatchedMode, ModalIdentification, Mode
from dovetail.identification.result_file import load_result

__all__ = [
    "Adequacy",
    "AtPoint",
    "Band",
    "Batch",
    "Cause",
    "Evaluation",
    "Fit",
    "Identification",
    "IdentifiedParameter",
    "Identifier",
    "MatchedMode",
    "ModalIdentification",
    "Mode",
    "ModelError",
    "ParameterMetrics",
    "Posterior",
    "TableRow",
    "Verdict",
    "identify",
    "identify_many",
    "load_model",
    "load_result",
    "predict",
    "predict_band",
    "train",
]
