"""Natural frequencies, damping ratios and shapes of an assembly's modes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.structure import without_window
from dovetail.interfaces import NodeDofs
from dovetail.synthesis import DampedModes, Graph, Point, Poles
from dovetail.synthesis.joint_evaluation import Theta

Terms = Sequence[tuple[float, Point]]
"""DOFs whose weighted sum is a motion, with their weights."""


@dataclass(frozen=True, eq=False)
class VibrationMode:
    """A mode of a damped assembly.

    Parameters
    ----------
    natural_frequency : float
        Hz: the magnitude of the pole over 2 pi.
    damping_ratio : float
        Of the critical damping: minus the pole's real part over its magnitude.
    shapes : mapping of str to (n_nodes, n_directions) complex array
        By the part's name: the motion of its nodes in their directions, scaled so that the receptance between two DOFs
        has the residue x_o x_i at the pole. One row, (1, n_dofs), for a part whose nodes differ in their directions.
    """

    natural_frequency: float
    damping_ratio: float
    shapes: Mapping[str, NDArray[np.complex128]]

    @property
    def pole(self) -> complex:
        """The pole [1/s], with a positive imaginary part."""
        turn = np.sqrt(1.0 - self.damping_ratio**2)
        return complex(2.0 * np.pi * self.natural_frequency * (-self.damping_ratio + 1j * turn))

    def contribution(self, output: Terms, force: Terms, frequency: float) -> float:
        """Return the magnitude of the mode's own part of a receptance [m/N].

        Parameters
        ----------
        output, force : sequences of (float, Point)
            Weights, names of the part and indices of the DOF.
        frequency : float
            Hz.
        """
        moved, pushed = (
            sum(weight * self.shapes[part].flat[dof] for weight, (part, dof) in terms) for terms in (output, force)
        )
        residue = moved * pushed
        distance = abs(2.0j * np.pi * frequency - self.pole)
        return float(abs(residue) / max(distance, np.finfo(np.float64).tiny))


class SeenPoles:
    """Poles of the structure itself, without the effect of a window through which it is seen.

    Parameters
    ----------
    graph : Graph
    """

    def __init__(self, graph: Graph) -> None:
        self._graph, self._modes = graph, DampedModes(graph)
        every = {name: NodeDofs.from_nodes(part.nodes).directions for name, part in graph.substructures.items()}
        self._rows = {name: len(each) if len(set(each)) == 1 else 1 for name, each in every.items()}

    def at(self, theta: Theta, vectors: int, count: int) -> Iterator[Poles]:
        """Return the poles of the `count` lowest modes for each of some parameter vectors, by joint."""
        seen = without_window(self._graph, theta)
        poles = self._modes.at(seen, count, differentiate=False, must_be_stable=True)
        return poles if seen else repeat(next(poles), vectors)

    def frequencies(self, theta: Theta, vectors: int, count: int) -> NDArray[np.float64]:
        """Return the natural frequencies (n, count) [Hz] for each of n parameter vectors; NaN where there are fewer."""
        every = np.full((vectors, count), np.nan)
        for row, poles in zip(every, self.at(theta, vectors, count), strict=False):
            found = natural_frequencies(poles)
            row[: len(found)] = found
        return every

    def modes(self, theta: Theta, count: int) -> tuple[VibrationMode, ...]:
        """Return the `count` lowest modes for one parameter vector, by joint."""
        (poles,) = self.at(theta, 1, count)
        every = {name: range(len(self._graph.substructure_dofs(name))) for name in self._graph.substructures}
        motions = [(name, *self._graph.motion(name, dofs)) for name, dofs in every.items()]
        modes = []
        for s, shape in zip(poles.values.tolist(), poles.shapes, strict=True):
            moved = np.append(shape, 0.0)  # what is held has the number -1
            parts = {name: moved[dofs] if L is None else L @ moved[dofs] for name, dofs, L in motions}
            shapes = {name: part.reshape(self._rows[name], -1) for name, part in parts.items()}
            modes.append(VibrationMode(abs(s) / (2.0 * np.pi), -s.real / abs(s), shapes))
        return tuple(modes)


def natural_frequencies(poles: Poles) -> NDArray[np.float64]:
    """Return the natural frequencies [Hz] of poles."""
    return np.asarray(np.abs(poles.values) / (2.0 * np.pi))


def lowest_frequencies(graph: Graph, theta: Theta, count: int) -> NDArray[np.float64]:
    """Return the lowest natural frequencies [Hz] for one parameter vector, (1, n_params) of each joint."""
    return natural_frequencies(next(SeenPoles(graph).at(theta, 1, count)))
