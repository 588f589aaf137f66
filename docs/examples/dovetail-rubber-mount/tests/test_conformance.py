"""The joint does what its contract says."""

from dovetail_rubber_mount import RubberMount

from dovetail.testing import conformance


@conformance(RubberMount)
def test_conformance(check):
    check()
