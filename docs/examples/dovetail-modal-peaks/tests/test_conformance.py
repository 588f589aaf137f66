"""The component does what its contract says."""

from dovetail_modal_peaks import ModalPeaks

from dovetail.testing import conformance


@conformance(ModalPeaks)
def test_conformance(check):
    check()
