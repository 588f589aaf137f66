"""The numeric elimination: compiled once for all assemblies, it interprets a program over blocks of frequencies.

Real and imaginary parts are kept apart so that the inner loops over a block vectorise; samples run on all threads.
"""

from __future__ import annotations

import numba
import numpy as np

__all__ = ["drive_point_receptance"]

_BLOCK = 32
"""Frequencies per block: the working set of a block stays in the first-level cache."""


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, inline="never")
def _load(block_re, block_im, lines, omega, static_re, static_im, joint_slot, K, D, C, M):  # type: ignore[no-untyped-def]
    """Fill a block with the static part, and add the joints' entries K - omega^2 M + i (D + omega C)."""
    for slot in range(block_re.shape[0]):
        for line in range(lines):
            block_re[slot, line] = static_re[slot, line]
            block_im[slot, line] = static_im[slot, line]
    for entry in range(joint_slot.shape[0]):
        slot = joint_slot[entry]
        stiffness, structural, viscous, mass = K[entry], D[entry], C[entry], M[entry]
        for line in range(lines):
            w = omega[line]
            block_re[slot, line] += stiffness - w * w * mass
            block_im[slot, line] += structural + w * viscous


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, inline="never")
def _run(block_re, block_im, left_re, left_im, lines, diagonal, start, column, update_start, update):  # type: ignore[no-untyped-def]
    """Eliminate pivot by pivot."""
    for pivot in range(start.shape[0] - 1):
        d = diagonal[pivot]
        first = start[pivot]
        count = start[pivot + 1] - first
        for line in range(lines):
            a, b = block_re[d, line], block_im[d, line]
            scale = 1.0 / (a * a + b * b)
            block_re[d, line] = a * scale
            block_im[d, line] = -b * scale
        for index in range(count):
            slot = column[first + index]
            for line in range(lines):
                a, b = block_re[slot, line], block_im[slot, line]
                c, e = block_re[d, line], block_im[d, line]
                left_re[index, line] = a * c - b * e
                left_im[index, line] = a * e + b * c
        for step in range(update_start[pivot], update_start[pivot + 1]):
            target, left, right = update[step, 0], update[step, 1], column[first + update[step, 2]]
            for line in range(lines):
                a, b = left_re[left, line], left_im[left, line]
                c, e = block_re[right, line], block_im[right, line]
                block_re[target, line] -= a * c - b * e
                block_im[target, line] -= a * e + b * c


@numba.njit(cache=True, error_model="numpy", parallel=True)
def drive_point_receptance(  # type: ignore[no-untyped-def]
    omega, static_re, static_im, joint_slot, K, D, C, M, diagonal, start, column, update_start, update, result
):
    """Write the receptance 1 / d_last of every sample and frequency to `result`.

    Parameters
    ----------
    omega : (n_freq,) array
        rad/s.
    static_re, static_im : (n_slots, n_freq) arrays
        What the substructures contribute to each slot.
    joint_slot : (n_entries,) int array
        Slots to which joints contribute.
    K, D, C, M : (n, n_entries) arrays
        What they contribute, by sample.
    diagonal, start, column, update_start, update : arrays
        The `Program`.
    result : (n, n_freq) complex array
        Written.
    """
    samples, frequencies = result.shape
    slots, last = static_re.shape[0], diagonal[-1]
    widest = 1
    for pivot in range(start.shape[0] - 1):
        widest = max(widest, start[pivot + 1] - start[pivot])
    for sample in numba.prange(samples):
        block_re = np.empty((slots, _BLOCK))
        block_im = np.empty((slots, _BLOCK))
        left_re = np.empty((widest, _BLOCK))
        left_im = np.empty((widest, _BLOCK))
        for first in range(0, frequencies, _BLOCK):
            stop = min(first + _BLOCK, frequencies)
            lines = stop - first
            _load(
                block_re, block_im, lines, omega[first:stop], static_re[:, first:stop], static_im[:, first:stop],
                joint_slot, K[sample], D[sample], C[sample], M[sample],
            )  # fmt: skip
            _run(block_re, block_im, left_re, left_im, lines, diagonal, start, column, update_start, update)
            for line in range(lines):
                a, b = block_re[last, line], block_im[last, line]
                scale = 1.0 / (a * a + b * b)
                result[sample, first + line] = complex(a * scale, -b * scale)
