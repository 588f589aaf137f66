"""Solving the problem: fits, posteriors, and how adequate the model is."""
