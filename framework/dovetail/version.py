"""The version, defined only here: the distribution, reports and model bundles take it from this file."""

__version__ = "0.1.0"
