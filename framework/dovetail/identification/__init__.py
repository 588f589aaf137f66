"""Identification of a joint from a measured FRF: training, the network, results, bundles, prediction."""

from dovetail.identification.batch import Batch, identify_many
from dovetail.identification.identifier import Identifier, load_model, train
from dovetail.identification.modal_estimates import Modes, damping_ratios, mode_shapes, modes, natural_frequencies
from dovetail.identification.one_measurement import identify
from dovetail.identification.parameters import IdentifiedParameter, TableRow
from dovetail.identification.prediction import PredictedBand, predict, predict_band
from dovetail.identification.result import Identification, Mode
from dovetail.identification.result_file import load_result
from dovetail.inference.adequacy import Adequacy, Cause
from dovetail.inference.adequacy.verdict import AtPoint
from dovetail.inference.fitting import Fit
from dovetail.inference.posterior import ModelError, Posterior, Verdict, VerdictLimits
from dovetail.network.evaluation import Evaluation, ParameterMetrics

__all__ = [
    "Adequacy",
    "AtPoint",
    "Batch",
    "Cause",
    "Evaluation",
    "Fit",
    "Identification",
    "IdentifiedParameter",
    "Identifier",
    "Mode",
    "ModelError",
    "Modes",
    "ParameterMetrics",
    "Posterior",
    "PredictedBand",
    "TableRow",
    "Verdict",
    "VerdictLimits",
    "damping_ratios",
    "identify",
    "identify_many",
    "load_model",
    "load_result",
    "mode_shapes",
    "modes",
    "natural_frequencies",
    "predict",
    "predict_band",
    "train",
]
