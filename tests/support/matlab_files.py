"""MATLAB files of version 7.3, written without MATLAB."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np


def matlab_7_3(path: Path, **variables: object) -> Path:
    """Write what `save -v7.3` writes: a header of 512 bytes, reversed axes, complex compounds, texts as numbers."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            if isinstance(value, str):
                data, kind = np.array([[ord(c)] for c in value], dtype=np.uint16), "char"
            elif np.iscomplexobj(value):
                data = np.zeros(np.transpose(value).shape, dtype=[("real", "<f8"), ("imag", "<f8")])
                data["real"], data["imag"], kind = np.transpose(value).real, np.transpose(value).imag, "double"
            else:
                data, kind = np.transpose(value), "double"
            file.create_dataset(name, data=data).attrs["MATLAB_class"] = np.bytes_(kind)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path
