"""Natural frequencies, damping ratios and shapes of an assembly's modes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import DIRECTIONS
from dovetail.synthesis import Graph, Point, Poles

__all__ = ["VibrationMode", "vibration_modes"]


@dataclass(frozen=True, eq=False)
class VibrationMode:
    """A mode of a damped assembly.

    Parameters
    ----------
    natural_frequency : float
        Hz: the magnitude of the pole over 2 pi.
    damping_ratio : float
        Of the critical damping: minus the pole's real part over its magnitude.
    shapes : mapping of str to (n_nodes, 2) complex array
        By the part's name: displacement x and rotation rz of its nodes, scaled so that the receptance between two DOFs
        has the residue x_o x_i at the pole.
    """

    natural_frequency: float
    damping_ratio: float
    shapes: Mapping[str, NDArray[np.complex128]]

    @property
    def pole(self) -> complex:
        """The pole [1/s], with a positive imaginary part."""
        turn = np.sqrt(1.0 - self.damping_ratio**2)
        return complex(2.0 * np.pi * self.natural_frequency * (-self.damping_ratio + 1j * turn))

    def contribution(self, output: Point, force: Point, frequency: float) -> float:
        """Return the magnitude of the mode's own part of a receptance [m/N].

        Parameters
        ----------
        output, force : Point
            Name of the part and index of the DOF.
        frequency : float
            Hz.
        """
        residue = self.shapes[output[0]].flat[output[1]] * self.shapes[force[0]].flat[force[1]]
        distance = abs(2.0j * np.pi * frequency - self.pole)
        return float(abs(residue) / max(distance, np.finfo(np.float64).tiny))


def vibration_modes(graph: Graph, poles: Poles) -> Iterator[VibrationMode]:
    """Yield the modes of some poles of a graph."""
    numbers = {name: graph.substructure_dofs(name) for name in graph.substructures}
    for s, shape in zip(poles.values.tolist(), poles.shapes, strict=True):
        moved = np.append(shape, 0.0)  # what is held has the number -1
        shapes = {name: moved[dofs].reshape(-1, len(DIRECTIONS)) for name, dofs in numbers.items()}
        yield VibrationMode(abs(s) / (2.0 * np.pi), -s.real / abs(s), shapes)
