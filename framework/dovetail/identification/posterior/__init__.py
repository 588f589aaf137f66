"""Samples of the parameters given the measurement."""
