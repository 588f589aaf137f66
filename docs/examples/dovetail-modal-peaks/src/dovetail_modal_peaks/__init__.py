"""Modal peaks for Dovetail."""

import dovetail
from dovetail_modal_peaks.reducer import ModalPeaks


@dovetail.hookimpl
def dovetail_components():
    """Return what this package offers."""
    return [ModalPeaks]
