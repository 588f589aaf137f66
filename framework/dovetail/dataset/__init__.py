"""Datasets: Latin hypercube samples and their FRFs, streamed to disk."""

from dovetail.dataset.generation import complex_accelerance, generate
from dovetail.dataset.merging import merge_datasets
from dovetail.dataset.samples import Dataset
from dovetail.dataset.sampling import latin_hypercube
from dovetail.dataset.storage import Storage, StoredFrfs

__all__ = ["Dataset", "Storage", "StoredFrfs", "complex_accelerance", "generate", "latin_hypercube", "merge_datasets"]
