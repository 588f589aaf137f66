"""Readers and writers of file formats: universal files, tables, MATLAB, HDF5, NumPy and CutPro."""
