"""MATLAB workspaces: version 5 (``save -v6``, ``save -v7``), and version 7.3, which is HDF5."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dovetail import Fault, FrfReader, MeasurementError, RecordedArrays, require_package
from dovetail_plugins.readers.guarded_arrays import read_arrays
from dovetail_plugins.readers.hdf5 import SIGNATURE
from dovetail_plugins.readers.hdf5_file import hdf5_contents
from dovetail_plugins.readers.matlab_file import workspace_contents

_VERSION = slice(124, 128)
_VERSION_5 = (b"\x00\x01IM", b"\x01\x00MI")


class MatlabReader(FrfReader):
    """Variables of a workspace, fields of structs, and frequency response data."""

    name = "matlab"
    summary = "MATLAB workspaces: .mat"
    suffixes = (".mat",)
    default_for = suffixes

    def sniff(self, content: bytes) -> bool:
        """Look for the version."""
        return _is_version_73(content) or content[_VERSION] in _VERSION_5

    def read(self, path: Path, content: bytes) -> RecordedArrays:
        """Return the variables.

        Raises
        ------
        MeasurementError
            Of another version, damaged, or needs more memory or time to read than any FRF.
        DovetailError
            h5py is not installed, which version 7.3 needs.
        """
        if _is_version_73(content):
            require_package("h5py", "hdf5", str(path), load=False)
            return read_arrays(hdf5_contents, path, content, True, separator="/")
        if content[_VERSION] not in _VERSION_5:
            accepted = "version 5 (save -v6, save -v7) or 7.3 (save -v7.3)"
            problem = "this is not a MATLAB workspace of a version that can be read."
            raise MeasurementError(Fault(str(path), problem, accepted))
        return read_arrays(workspace_contents, path, content, separator=".")

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a workspace of version 5."""
        from scipy.io import savemat

        file = folder / "sample.mat"
        frf = np.array([1.0, 2.0j, 3.0])
        savemat(file, {"frequency": np.array([10.0, 20.0, 30.0]), "frf": frf, "unit": "m/s^2/N"})
        return [file]


def _is_version_73(content: bytes) -> bool:
    return SIGNATURE in (content[:8], content[512:520])
