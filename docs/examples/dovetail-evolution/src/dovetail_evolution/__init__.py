"""Differential evolution for Dovetail."""

import dovetail
from dovetail_evolution.method import Evolution


@dovetail.hookimpl
def dovetail_components():
    """Return what this package offers."""
    return [Evolution]
