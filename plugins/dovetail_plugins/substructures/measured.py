"""A part that is known by its measured receptance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    ComponentConfig,
    FileName,
    Node,
    ReceptanceMatrix,
    StructuralMatrices,
    SubstructureModel,
    read_receptance,
    write_receptance,
)

__all__ = ["Measured"]


class Measured(SubstructureModel):
    """One point with x and rz, such as the flange of a spindle that ``dovetail spindle`` has measured."""

    name = "measured"
    summary = "Part known by its measured receptance at one point, in x and rz"

    class Config(ComponentConfig):
        """The file with the receptance.

        Attributes
        ----------
        file : str
            Written by ``dovetail spindle`` or `dovetail.write_receptance`; taken from the description's folder.
        """

        file: Annotated[str, FileName()]

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:
        """Return a file with the receptance of a rigid body on a lossy spring in x and in rz."""
        frequency = np.linspace(10.0, 2500.0, 2000)
        inertia = (2.0 * np.pi * frequency) ** 2
        values = np.zeros((len(frequency), 2, 2), dtype=np.complex128)
        values[:, 0, 0] = 1.0 / (1e7 * (1.0 + 0.05j) - 0.3 * inertia)
        values[:, 1, 1] = 1.0 / (1e4 * (1.0 + 0.05j) - 1e-4 * inertia)
        write_receptance(ReceptanceMatrix(frequency, values), folder / "part.npz")
        return ({"file": str(folder / "part.npz")},)

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self._known = read_receptance(config.file)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The one point, at position 0."""
        return (Node("m1", 0.0),)

    def matrices(self) -> StructuralMatrices | None:
        """Return None: a measurement has no matrices."""
        return None

    def receptance(self, frequency: NDArray[np.float64], dofs: Sequence[int]) -> NDArray[np.complex128]:
        """Return the measured receptance between `dofs`, on other lines by interpolation."""
        chosen = np.asarray(dofs, dtype=np.intp)
        part: NDArray[np.complex128] = self._known.at(frequency)[:, chosen[:, None], chosen]
        return part
