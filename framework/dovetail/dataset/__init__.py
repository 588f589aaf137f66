"""Datasets: Latin hypercube samples and their FRFs, streamed to disk."""

from dovetail.dataset.dataset import Dataset
from dovetail.dataset.generation import generate
from dovetail.dataset.sampling import latin_hypercube

__all__ = ["Dataset", "generate", "latin_hypercube"]
