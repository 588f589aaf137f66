"""The conformance kit: run it over a component of your own, in a test, in Python or by ``dovetail check-plugin``."""

from dovetail.testing.kit import check_component, check_names
from dovetail.testing.outcomes import CheckResult
from dovetail.testing.parametrisation import ConformanceCheck, conformance

__all__ = ["CheckResult", "ConformanceCheck", "check_component", "check_names", "conformance"]
