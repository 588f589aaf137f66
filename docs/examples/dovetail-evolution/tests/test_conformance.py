"""The component does what its contract says."""

from dovetail_evolution import Evolution

from dovetail.testing import conformance


@conformance(Evolution)
def test_conformance(check):
    check()
