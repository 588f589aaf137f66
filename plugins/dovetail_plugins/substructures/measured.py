"""A part that is known by its measured receptance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from dovetail import ComponentConfig, FileName, Node, StructuralMatrices, SubstructureModel, read_receptance

__all__ = ["Measured"]


class Measured(SubstructureModel):
    """One point with x and rz, such as the flange of a spindle that ``dovetail spindle`` has measured."""

    name = "measured"
    summary = "Part known by its measured receptance at one point, in x and rz"

    class Config(ComponentConfig):
        """The file with the receptance."""

        file: Annotated[str, FileName()]

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
