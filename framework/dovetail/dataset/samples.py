"""A dataset on disk: parameter vectors and their FRFs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import FRF_TOLERANCE, Assembly, largest_frf_difference
from dovetail.dataset.metadata import check_attributes, check_metadata, read_metadata
from dovetail.dataset.storage import ARRAYS, READING_ERRORS, Storage, StoredFrfs, read_array, read_flags
from dovetail.description import fingerprint
from dovetail.errors import DatasetError, Fault
from dovetail.plain_text import html_table

FORMAT = 1
"""Number of the format of a dataset; another one is refused."""

_PROBES = 64
"""Number of FRFs that are computed again before a training; 0.1 s for the reference assembly."""
_SLACK = 1e-9
"""Tolerance of the ranges, relative to their larger end, for the rounding of logarithms."""


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
        if not self.path.exists():
            problem = "this is not a dataset: there is no such folder."
            raise DatasetError(Fault(str(path), problem, remedy="Make one by 'dovetail generate'."))
        try:
            self.attributes: dict[str, Any] = dict(read_metadata(self.path, "group").get("attributes", {}))
            if self.attributes.get("dovetail_dataset") != FORMAT:
                raise DatasetError(Fault(str(path), f"this is not a dovetail dataset of format {FORMAT}."))
            check_attributes(self.path, self.attributes)
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
        except READING_ERRORS as error:
            raise DatasetError(Fault(str(path), f"this is not a readable dovetail dataset ({error}).")) from error

    def __len__(self) -> int:
        return len(self.parameters)

    def __repr__(self) -> str:
        return f"Dataset({str(self.path)!r}, {len(self)} samples, {len(self.frequency)} lines)"

    def _repr_html_(self) -> str:
        band = f"{self.frequency[0]:g} to {self.frequency[-1]:g} Hz"
        head = ("assembly", "samples", "lines", "band", "seed", "stored", "complete")
        sizes = (str(len(self)), str(len(self.frequency)), band, str(self.seed))
        name = str(self.attributes.get("name", ""))
        return html_table(repr(self), [head, (name, *sizes, self.storage, "yes" if self.complete else "no")])

    @property
    def accelerance(self) -> StoredFrfs:
        """(n_samples, n_responses n_freq) complex64 accelerance [m/(N s^2)], where it is stored with its phase.

        Raises
        ------
        DatasetError
            Only amplitudes are stored.
        """
        if self.storage != "complex":
            remedy = "Generate it again with `storage='complex'`."
            raise DatasetError(Fault(str(self.path), "it contains amplitudes without phases.", remedy=remedy))
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
        """Check that the dataset is complete and was made from the description of this assembly.

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
                    remedy="Generate it again, or use the description inside it.",
                )
            )
        if not self.complete:
            remedy = "Finish it with `resume=True`; the shards of a dataset are joined by 'dovetail merge'."
            raise DatasetError(Fault(str(self.path), "its generation was interrupted.", remedy=remedy))
        self.amplitude.check_chunks()
        self.require_same_frfs(assembly, _PROBES)

    def _require_own_description(self, assembly: Assembly) -> None:
        """Check shapes, frequencies, parameters and fingerprint against the assembly's description."""
        lines = len(assembly.description.responses) * len(assembly.frequency)
        shape = len(self), len(assembly.parameters)
        problem = ""
        if self.parameters.shape != shape or self.amplitude.shape != (len(self), lines):
            problem = f"its parameters have the shape {self.parameters.shape} and its FRFs {self.amplitude.shape}"
        elif not np.array_equal(self.frequency, assembly.frequency):
            problem = "its frequencies are not those of its description"
        elif not self._has_own_fingerprint():
            problem = "its description does not match its fingerprint"
        else:
            lower = np.array([parameter.lower for parameter in assembly.parameters])
            upper = np.array([parameter.upper for parameter in assembly.parameters])
            slack = _SLACK * np.maximum(np.abs(lower), np.abs(upper))
            outside = ~((self.parameters >= lower - slack) & (self.parameters <= upper + slack))
            if outside.any():
                row, column = np.argwhere(outside)[0]
                first = assembly.parameters[int(column)]
                problem = (
                    f"{int(outside.any(axis=1).sum())} of its {len(self)} parameter vectors are outside the ranges, "
                    f"the first in row {row + 1}: {first.name} = {self.parameters[row, column]:g} {first.unit}"
                )
        if problem:
            raise DatasetError(Fault(str(self.path), f"{problem}.", remedy="Generate it again, or restore a copy."))

    def _has_own_fingerprint(self) -> bool:
        try:
            return bool(fingerprint(self.description) == self.attributes["fingerprint"])
        except (ValueError, AttributeError, RecursionError):
            return False

    def require_same_frfs(self, assembly: Assembly, probes: int = 3) -> None:
        """Check that the dataset matches its description, and that the assembly still gives the same FRFs.

        Of the stored FRFs, `probes` from the first to the last are computed again.

        Raises
        ------
        DatasetError
            The FRFs differ because the code of a model has changed; or frequencies, parameters or shapes do not match.
        """
        self._require_own_description(assembly)
        chunk = self.amplitude.chunks[0]
        samples = np.flatnonzero(np.repeat(self.amplitude.complete_chunks(), chunk)[: len(self)])
        rows = samples[np.unique(np.linspace(0, len(samples) - 1, probes).astype(int))] if len(samples) else samples
        amplitudes = [self.amplitude[int(row)] for row in rows]
        difference = largest_frf_difference(assembly, self.parameters[rows], amplitudes)
        if difference > FRF_TOLERANCE:
            problem = "its FRFs are not those that the assembly gives now"
            maker = f"dovetail-frf {self.attributes.get('dovetail_version', '')}"
            raise DatasetError(
                Fault(
                    str(self.path),
                    f"{problem} (they differ by up to {100 * difference:.2g} %): the code of a model has changed.",
                    remedy=f"Generate it again, or use the version that made it ({maker} and its plugins).",
                )
            )
