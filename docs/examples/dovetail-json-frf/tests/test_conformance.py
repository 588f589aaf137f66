"""The component does what its contract says."""

from dovetail_json_frf import JsonFrf

from dovetail.testing import conformance


@conformance(JsonFrf)
def test_conformance(check):
    check()
