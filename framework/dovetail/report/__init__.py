"""The report of an identification and its figures."""

from dovetail.report.report import write_report
from dovetail.report.truth import Truth, read_truth

__all__ = ["Truth", "read_truth", "write_report"]
