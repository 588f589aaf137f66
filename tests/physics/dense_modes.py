"""Natural frequencies of a whole assembly, densely, without its rigid-body modes; no code of Dovetail is used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from dense_solve import DenseAssembly, merged_entries
from element_formulas import Element
from scipy.linalg import eigh

__all__ = ["natural_frequencies"]

_DEPENDENT = 1e-9
"""Relative singular value below which elements' strains are linearly dependent; rounding leaves 1e-14, and chains of
seventy springs go down to 1e-3."""
_SHIFT = 30.0
"""Hz; makes K + s M of a free structure positive. Rayleigh quotients with K follow, so that it changes no result."""


def natural_frequencies(
    assembly: DenseAssembly, theta: Sequence[float], *, rigid: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Elastic natural frequencies [Hz], and their change by relative changes of one in the elements' K and M.

    Massless DOFs are condensed statically (Guyan, AIAA J. 3 (1965) 380). A rigid-body mode is a motion that strains
    no element, so that their number is that of the DOFs less the rank of all elements' strains.
    """
    numbers, elements = assembly.numbering(rigid=rigid), assembly.elements(theta)
    size = int(numbers.max(initial=-1)) + 1
    (K, K_magnitude), (M, M_magnitude) = (_constant_sum(elements, numbers, size, name) for name in "KM")
    strains, massive = _strains(elements, numbers, np.diag(K_magnitude)), np.diag(M) > 0
    idle = _nullity(strains[:, ~massive])
    rigid_body_modes = _nullity(strains) - idle
    motion = _static_motion(K, massive, idle)
    reduced_K, reduced_M = motion.T @ K @ motion, M[np.ix_(massive, massive)]
    shift = (2 * np.pi * _SHIFT) ** 2
    _, shapes = eigh(reduced_M, reduced_K + shift * reduced_M)
    shapes = motion @ shapes[:, ::-1][:, rigid_body_modes:]
    stiffness, mass = (np.einsum("im,ij,jm->m", shapes, matrix, shapes) for matrix in (K, M))
    rounding = sum(
        np.einsum("im,ij,jm->m", abs(shapes), magnitude, abs(shapes)) / energy
        for magnitude, energy in ((K_magnitude, stiffness), (M_magnitude, mass))
    )
    frequencies = np.sqrt(np.maximum(stiffness, 0) / mass) / (2 * np.pi)
    return frequencies, frequencies * rounding / 2


def _constant_sum(elements: Sequence[Element], numbers: np.ndarray, size: int, name: str) -> tuple[Any, Any]:
    """L^T K L or L^T M L, and the same of the magnitudes."""
    total, magnitude = np.zeros((2, size, size))
    for element in elements:
        matrix = np.broadcast_to(getattr(element, name), (len(element.dofs),) * 2)
        distinct, L = merged_entries(element, numbers)
        total[np.ix_(distinct, distinct)] += L.T @ matrix @ L
        magnitude[np.ix_(distinct, distinct)] += L.T @ abs(matrix) @ L
    return total, magnitude


def _strains(elements: Sequence[Element], numbers: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Rows whose common null space is that of K: what each element's stiffness resists, however softly.

    Columns are in units of the DOFs' whole stiffness. Rows have the length one before DOFs are merged or held, so that
    what this leaves of a row that is not strained any more is rounding.
    """
    unit = np.sqrt(np.where(stiffness > 0, stiffness, 1.0))
    rows = [np.zeros((0, len(unit)))]
    for element in elements:
        K = np.broadcast_to(element.K, (len(element.dofs),) * 2)
        scale = np.sqrt(np.diag(K))
        safe = np.where(scale > 0, scale, 1.0)
        values, vectors = np.linalg.eigh(K / np.outer(safe, safe))
        resisted = (vectors[:, values > _DEPENDENT] * scale[:, np.newaxis]).T
        reduced = numbers[list(element.dofs)]
        length = np.linalg.norm(resisted / np.where(reduced >= 0, np.append(unit, 1.0)[reduced], safe), axis=1)
        distinct, L = merged_entries(element, numbers)
        row = np.zeros((len(resisted), len(unit)))
        row[:, distinct] = (resisted @ L) / unit[distinct] / length[:, np.newaxis]
        rows.append(row)
    return np.concatenate(rows)


def _nullity(strains: np.ndarray) -> int:
    rank = np.linalg.matrix_rank(strains, tol=_DEPENDENT) if strains.size else 0
    return strains.shape[1] - int(rank)


def _static_motion(K: np.ndarray, massive: np.ndarray, idle: int) -> np.ndarray:
    """Motion of all DOFs by those with mass, (d, n): massless ones follow statically, `idle` motions of them rest."""
    motion = np.zeros((len(K), int(massive.sum())))
    motion[massive] = np.eye(motion.shape[1])
    scale = np.sqrt(np.diag(K)[~massive])
    scale = 1 / np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(K[np.ix_(~massive, ~massive)] * np.outer(scale, scale))
    basis = scale[:, np.newaxis] * vectors[:, idle:]
    motion[~massive] = -(basis / values[idle:]) @ (basis.T @ K[np.ix_(~massive, massive)])
    return motion
