"""Checks of readers of matrices, beyond those of all readers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import DIRECTIONS, MatrixReader, RecordedModel
from dovetail.matrix_files import decode_matrices
from dovetail.registry.catalogue import HEAD
from dovetail.testing.file_reader_checks import FileReaderSpecimen
from dovetail.testing.outcomes import Nonconformity


@dataclass(frozen=True, eq=False)
class MatrixReaderSpecimen(FileReaderSpecimen):
    """A reader of matrices, and files of its format."""

    component: MatrixReader

    def recorded(self, name: Path, content: bytes) -> RecordedModel:
        """Return what a file contains, as `dovetail.read_matrices` does."""
        return decode_matrices(name, content, self.component)

    def arrays(self, name: Path, content: bytes) -> Sequence[NDArray[Any]]:
        """Return the entries of the matrices and the coordinates."""
        model = self.recorded(name, content)
        values = [matrix.values for matrix in model.matrices.values()]
        full = [np.asarray(each.toarray() if hasattr(each, "toarray") else each) for each in values]
        rows = [] if model.table is None else [model.table.rows]
        return [*full, *rows, np.array(list(model.points.values()))]


def check_sample_files_are_read(specimen: MatrixReaderSpecimen) -> str:
    """`sniff` accepts each sample; it contains square matrices, a table of DOFs for them, or coordinates."""
    contents = []
    for name, content in specimen.files:
        if not specimen.component.sniff(content[:HEAD]):
            raise Nonconformity(f"sniff rejects its own sample '{name}'.", "Test the first bytes only.")
        try:
            model = specimen.recorded(name, content)
        except DovetailError as error:
            raise Nonconformity(f"the sample '{name}': {error.faults[0].problem}") from None
        _check_model(name, model)
        contents += [*model.matrices, *(["table"] if model.table else []), *(["points"] if model.points else [])]
    return ", ".join(contents)


def _check_model(name: Path, model: RecordedModel) -> None:
    """Raise a Nonconformity if parts of a model do not fit each other."""
    sizes = {np.shape(matrix.values) for matrix in model.matrices.values()}
    if not sizes and model.table is None and not model.points:
        raise Nonconformity(f"read found nothing in '{name}'.", "Return matrices, a table of DOFs or coordinates.")
    if any(len(size) != 2 or size[0] != size[1] for size in sizes):
        raise Nonconformity(f"the matrices of '{name}' have the shapes {sorted(sizes)}.", "Return square ones.")
    if strange := set(model.axes) - set(DIRECTIONS):
        raise Nonconformity(f"'axes' names the direction {min(strange)!r}.", f"Use {', '.join(DIRECTIONS)}.")
    if model.table is not None and sizes:
        try:
            model.table.checked(min(size[0] for size in sizes))
        except DovetailError as error:
            raise Nonconformity(f"the table of '{name}': {error.faults[0].problem}") from None
