"""Readers and writers of file formats: universal files, tables of text, MATLAB, HDF5, NumPy, LabVIEW and CutPro."""
