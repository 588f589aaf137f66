"""A rubber mount for Dovetail."""

import dovetail
from dovetail_rubber_mount.joint import RubberMount


@dovetail.hookimpl
def dovetail_components():
    """Return what this package offers."""
    return [RubberMount]
