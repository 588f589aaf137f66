"""Several tests of one joint: shared parameters, laws over covariates, scatter from test to test."""

from dovetail.series.description import SeriesDescription
from dovetail.series.identification import identify_series
from dovetail.series.reading import read_series
from dovetail.series.result import SeriesIdentification

__all__ = ["SeriesDescription", "SeriesIdentification", "identify_series", "read_series"]
