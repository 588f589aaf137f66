"""HDF5 files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dovetail import Fault, FrfReader, MeasurementError, RecordedArrays, require_package
from dovetail_plugins.readers.guarded_arrays import read_arrays
from dovetail_plugins.readers.hdf5_file import hdf5_contents

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_STARTS = (0, *(512 << power for power in range(18)))


class Hdf5Reader(FrfReader):
    """Datasets of an HDF5 file, in any groups."""

    name = "hdf5"
    summary = "HDF5 files: .h5, .hdf5"
    suffixes = (".h5", ".hdf5")
    default_for = suffixes

    def sniff(self, content: bytes) -> bool:
        """Look for the signature where it may be."""
        return any(content.startswith(SIGNATURE, start) for start in _STARTS)

    def read(self, path: Path, content: bytes) -> RecordedArrays:
        """Return the datasets.

        Raises
        ------
        MeasurementError
            Not HDF5, damaged, or needs more memory or time to read than any FRF.
        DovetailError
            h5py is not installed.
        """
        if not self.sniff(content):
            raise MeasurementError(Fault(str(path), "this is not an HDF5 file."))
        require_package("h5py", "hdf5", str(path), load=False)
        return read_arrays(hdf5_contents, path, content, False, separator="/", is_matlab=False)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write two datasets with attributes."""
        import h5py

        file = folder / "sample.h5"
        with h5py.File(file, "w", driver="core") as written:
            written["frequency"] = [10.0, 20.0, 30.0]
            written["frf"] = [1.0, 2.0j, 3.0]
            written["frf"].attrs["unit"] = "um/N"
        return [file]
