"""A dataset on disk: parameter vectors and their FRFs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import FRF_TOLERANCE, Assembly, largest_frf_difference
from dovetail.dataset.metadata import check_metadata, read_metadata
from dovetail.dataset.storage import ARRAYS, Storage, StoredFrfs, read_array, read_flags
from dovetail.errors import DatasetError, Fault

__all__ = ["FORMAT", "Dataset"]

FORMAT = 1


class Dataset:
    """A Zarr group made by `generate`.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    parameters : (n_samples, n_params) array
        SI.
    frequency : (n_freq,) array
        Hz.
    amplitude : StoredFrfs
        (n_samples, n_responses n_freq) float32, of the accelerance [m/(N s^2)], the lines of a second response behind
        those of the first. It is read from disk when it is indexed, as in ``dataset.amplitude[:10]``.
    storage : "amplitude" or "complex"
        What is stored of each FRF.
    complete : bool
        Whether every chunk was written.

    Raises
    ------
    DatasetError
        There is no dataset at `path`, or it is damaged or of another format.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        import zarr

        self.path = Path(path)
        try:
            self.attributes: dict[str, Any] = dict(read_metadata(self.path, "group").get("attributes", {}))
            if self.attributes.get("dovetail_dataset") != FORMAT:
                raise DatasetError(Fault(str(path), f"this is not a dovetail dataset of format {FORMAT}."))
            self.storage: Storage = self.attributes.get("storage", "amplitude")
            if self.storage not in get_args(Storage):
                raise DatasetError(Fault(str(path), f"it stores '{self.storage}', which this version cannot read."))
            check_metadata(self.path, *ARRAYS[self.storage])
            self._group = zarr.open_group(self.path, mode="r", zarr_format=3, use_consolidated=False)
            self.parameters: NDArray[np.float64] = read_array(self.path, self._group, "parameters")
            self.frequency: NDArray[np.float64] = read_array(self.path, self._group, "frequency")
            self._written = read_flags(self.path, self._group, "written")
            self._frfs = self._group[ARRAYS[self.storage][0]]
            self.amplitude = StoredFrfs(self.path, self._frfs, self._written, magnitude=True)
            self.complete = bool(self._written.all())
        except (OSError, KeyError, ValueError, TypeError) as error:
            raise DatasetError(Fault(str(path), f"this is not a readable dovetail dataset ({error}).")) from error

    def __len__(self) -> int:
        return len(self.parameters)

    def __repr__(self) -> str:
        return f"Dataset({str(self.path)!r}, {len(self)} samples, {len(self.frequency)} lines)"

    @property
    def accelerance(self) -> StoredFrfs:
        """(n_samples, n_responses n_freq) complex64 accelerance [m/(N s^2)], where it is stored with its phase.

        Raises
        ------
        DatasetError
            Only amplitudes are stored.
        """
        if self.storage != "complex":
            remedy = "Generate it anew with --storage complex."
            raise DatasetError(Fault(str(self.path), "it holds amplitudes, without phases.", remedy=remedy))
        return StoredFrfs(self.path, self._frfs, self._written)

    @property
    def description(self) -> str:
        """The description it was made from, as text."""
        return str(self.attributes["description"])

    @property
    def seed(self) -> int:
        """The seed of its samples."""
        return int(self.attributes["seed"])

    def require(self, assembly: Assembly) -> None:
        """Check that the dataset is complete and holds FRFs of this assembly.

        Raises
        ------
        DatasetError
        """
        if self.attributes["fingerprint"] != assembly.description.fingerprint:
            raise DatasetError(
                Fault(
                    str(self.path),
                    f"it was made from another description ('{self.attributes['name']}') than '{assembly.name}': "
                    "frequencies, substructures, joints or response differ.",
                    remedy="Generate it anew, or take the description that it holds.",
                )
            )
        if not self.complete:
            raise DatasetError(
                Fault(str(self.path), "its generation was interrupted.", remedy="Finish it with --resume.")
            )
        self.amplitude.check_chunks()
        self.require_same_frfs(assembly)

    def require_same_frfs(self, assembly: Assembly) -> None:
        """Check that an assembly of the same description still computes the FRFs that the dataset holds.

        The first, the middle and the last FRF that are written are computed again.

        Raises
        ------
        DatasetError
            They differ: the code of a model has changed.
        """
        chunk = self.amplitude.chunks[0]
        samples = np.flatnonzero(np.repeat(self.amplitude.complete_chunks(), chunk)[: len(self)])
        rows = sorted({int(samples[index]) for index in (0, len(samples) // 2, -1)}) if len(samples) else []
        amplitudes = [self.amplitude[row] for row in rows]
        difference = largest_frf_difference(assembly, self.parameters[rows], amplitudes)
        if difference > FRF_TOLERANCE:
            problem = "its FRFs are not those that the assembly gives now"
            maker = f"dovetail-frf {self.attributes.get('dovetail_version', '')}"
            raise DatasetError(
                Fault(
                    str(self.path),
                    f"{problem} (they differ by up to {100 * difference:.2g} %): the code of a model has changed.",
                    remedy=f"Generate it anew, or go back to what made it ({maker} and its plugins).",
                )
            )
