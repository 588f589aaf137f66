"""The FRFs of all responses of an assembly, one behind the other, at all lines or at some."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly

__all__ = ["Frfs", "parted"]


@dataclass(frozen=True, eq=False)
class Frfs:
    """FRFs and sensitivities with the lines of each response behind those of the one before.

    Parameters
    ----------
    assemblies : tuple of Assembly
        One for each response.
    """

    assemblies: tuple[Assembly, ...]

    @staticmethod
    def of(assembly: Assembly) -> Frfs:
        """Return those of all responses, at all lines."""
        return Frfs(assembly.each_response)

    @property
    def counts(self) -> tuple[int, ...]:
        """Lines of each response."""
        return tuple(len(one.frequency) for one in self.assemblies)

    def frf(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, n_lines) at parameter vectors (n, n_params)."""
        return _joined([one.frf(theta) for one in self.assemblies], axis=1)

    def frf_jacobian(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_lines) and their derivatives (n, n_lines, n_params)."""
        found = [one.frf_jacobian(theta) for one in self.assemblies]
        return _joined([values for values, _ in found], axis=1), _joined([slopes for _, slopes in found], axis=1)

    def at(self, lines: NDArray[np.intp]) -> Frfs:
        """Return those at some lines (increasing numbers); a response without any of them is left out."""
        each = zip(self.assemblies, parted(lines, self.counts), strict=True)
        return Frfs(tuple(one.on(one.frequency[own]) for one, own in each if len(own)))


def parted(numbers: NDArray[np.intp], counts: tuple[int, ...]) -> list[NDArray[np.intp]]:
    """Part increasing numbers of lines by the response that they belong to, each counted from its own first line."""
    ends = np.cumsum((0, *counts))
    return [numbers[(numbers >= first) & (numbers < end)] - first for first, end in pairwise(ends.tolist())]


def _joined(parts: list[NDArray[np.complex128]], axis: int) -> NDArray[np.complex128]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=axis)
