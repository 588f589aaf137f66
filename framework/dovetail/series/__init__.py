"""Several tests of one joint: shared parameters, laws over covariates, scatter from test to test."""

from dovetail.series.description import SeriesDescription
from dovetail.series.identification import identify_series
from dovetail.series.left_out import LeftOutTest, leave_one_out
from dovetail.series.prediction import PredictedTest, predict_test
from dovetail.series.reading import read_series
from dovetail.series.result import SeriesIdentification

__all__ = [
    "LeftOutTest",
    "PredictedTest",
    "SeriesDescription",
    "SeriesIdentification",
    "identify_series",
    "leave_one_out",
    "predict_test",
    "read_series",
]
