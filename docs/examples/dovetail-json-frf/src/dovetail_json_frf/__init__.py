"""JSON exports for Dovetail."""

import dovetail
from dovetail_json_frf.reader import JsonFrf


@dovetail.hookimpl
def dovetail_components():
    """Return what this package offers."""
    return [JsonFrf]
