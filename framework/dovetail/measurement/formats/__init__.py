"""Files by their formats: universal files, tables, MATLAB, HDF5, NumPy and CutPro."""
