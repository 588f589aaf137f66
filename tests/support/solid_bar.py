"""A bar of eight-node hexahedra: the kind of sparse model that a finite element program exports."""

from __future__ import annotations

from itertools import product

import numpy as np
import scipy.sparse as sp

_CORNERS = np.array(list(product((-1, 1), repeat=3)))
_GAUSS = 1 / np.sqrt(3)


def _shape(point, size):
    """Shape functions (8,) and their derivatives (8, 3) of a box element."""
    factors = 1 + _CORNERS * point
    values = factors.prod(axis=1) / 8
    slopes = np.stack(
        [_CORNERS[:, axis] * np.delete(factors, axis, axis=1).prod(axis=1) / 8 for axis in range(3)], axis=1
    )
    return values, slopes * 2 / np.asarray(size)


def element(size, young, poisson, density):
    """Stiffness and consistent mass (24, 24) of a box of the given sides."""
    lame, shear = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    elasticity = np.zeros((6, 6))
    elasticity[:3, :3] = lame
    elasticity += np.diag([2 * shear] * 3 + [shear] * 3)
    stiffness, mass, volume = np.zeros((24, 24)), np.zeros((24, 24)), np.prod(size) / 8
    for point in product((-_GAUSS, _GAUSS), repeat=3):
        values, slopes = _shape(np.array(point), size)
        strain = np.zeros((6, 24))
        for row, axes in enumerate(((0,), (1,), (2,), (0, 1), (1, 2), (0, 2))):
            for axis in axes:
                other = axes[1 - axes.index(axis)] if len(axes) == 2 else axis
                strain[row, axis::3] += slopes[:, other]
        motion = np.kron(values, np.eye(3))
        stiffness += volume * strain.T @ elasticity @ strain
        mass += volume * density * motion.T @ motion
    return stiffness, mass


def solid_bar(length, side, along, across, *, young=210e9, poisson=0.3, density=7800.0):
    """Return nodes (n, 3), M and K (3n, 3n) of a square bar along the first axis, free."""
    counts = (along, across, across)
    size = (length / along, side / across, side / across)
    stiffness, mass = element(size, young, poisson, density)
    grid = np.arange(np.prod([count + 1 for count in counts])).reshape([count + 1 for count in counts])
    nodes = np.array(list(product(*(np.arange(count + 1) * step for count, step in zip(counts, size, strict=True)))))
    nodes[:, 1:] -= side / 2
    corners = [
        grid[tuple(slice((c + 1) // 2, (c + 1) // 2 + n) for c, n in zip(k, counts, strict=True))].ravel()
        for k in _CORNERS
    ]
    dofs = (3 * np.stack(corners, axis=1)[:, :, None] + np.arange(3)).reshape(-1, 24)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
    shape = (3 * len(nodes),) * 2
    K = sp.coo_array((np.tile(stiffness.ravel(), len(dofs)), (rows, columns)), shape=shape).tocsc()
    M = sp.coo_array((np.tile(mass.ravel(), len(dofs)), (rows, columns)), shape=shape).tocsc()
    return nodes, M, K


def with_rigid_sections(nodes, M, K, positions):
    """Tie the nodes of some cross-sections to one point each, with six DOFs; those come first, in order.

    Returns
    -------
    M, K : sparse arrays over 6 DOFs a section (ux, uy, uz, rx, ry, rz) and the other nodes' displacements
    """
    tied = [np.flatnonzero(np.abs(nodes[:, 0] - position) < 1e-9) for position in positions]
    slave = np.concatenate(tied)
    free = np.setdiff1d(np.arange(len(nodes)), slave)
    entries = []
    for section, members in enumerate(tied):
        for node in members:
            _, y, z = nodes[node]
            x = nodes[node, 0] - positions[section]
            spin = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
            for axis in range(3):
                entries.append((3 * node + axis, 6 * section + axis, 1.0))
                entries += [(3 * node + axis, 6 * section + 3 + turn, spin[axis, turn]) for turn in range(3)]
    entries += [(3 * n + a, 6 * len(tied) + 3 * i + a, 1.0) for i, n in enumerate(free) for a in range(3)]
    rows, columns, values = zip(*entries, strict=True)
    T = sp.coo_array((values, (rows, columns)), shape=(3 * len(nodes), 6 * len(tied) + 3 * len(free))).tocsc()
    return (T.T @ M @ T).tocsc(), (T.T @ K @ T).tocsc()
