"""Readers of files with which finite element programs export a model."""
