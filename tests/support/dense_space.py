"""A dense solution of beams and bushings in space, from published shape functions and by its own geometry.

Nothing of the plugins' matrices is used. A beam is given by the direction `along` it and the direction `side` of its
own x; an element's strain and kinetic energy are integrated numerically over its shape functions.
"""

from __future__ import annotations

import numpy as np

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)
POINTS, WEIGHTS = (POINTS + 1.0) / 2.0, WEIGHTS / 2.0


def bending_energies(length, young, shear_area_modulus, area, inertia, density):
    """Return K and M (4, 4) for displacement and slope at both ends (Friedman and Kosmatka 1993, eqs. 15 to 18)."""
    L, phi = length, 12.0 * young * inertia / (shear_area_modulus * length**2)
    K, M = np.zeros((4, 4)), np.zeros((4, 4))
    for s, weight in zip(POINTS, WEIGHTS, strict=True):
        w = np.array(
            [
                2 * s**3 - 3 * s**2 - phi * s + 1 + phi,
                L * (s**3 - (2 + phi / 2) * s**2 + (1 + phi / 2) * s),
                -(2 * s**3 - 3 * s**2 - phi * s),
                L * (s**3 - (1 - phi / 2) * s**2 - phi / 2 * s),
            ]
        ) / (1 + phi)
        slope = np.array(
            [
                (6 * s**2 - 6 * s - phi) / L,
                3 * s**2 - (4 + phi) * s + 1 + phi / 2,
                -(6 * s**2 - 6 * s - phi) / L,
                3 * s**2 - (2 - phi) * s - phi / 2,
            ]
        ) / (1 + phi)
        turn = np.array(
            [
                6 / L * (s**2 - s),
                3 * s**2 - (4 + phi) * s + 1 + phi,
                -6 / L * (s**2 - s),
                3 * s**2 - (2 - phi) * s,
            ]
        ) / (1 + phi)
        curvature = (
            np.array([6 / L * (2 * s - 1), 6 * s - (4 + phi), -6 / L * (2 * s - 1), 6 * s - (2 - phi)]) / (1 + phi) / L
        )
        K += weight * L * (young * inertia * np.outer(curvature, curvature))
        K += weight * L * shear_area_modulus * np.outer(slope - turn, slope - turn)
        M += weight * L * density * (area * np.outer(w, w) + inertia * np.outer(turn, turn))
    return K, M


def rod_energies(length, stiffness, mass):
    """Return K and M (3, 3) of a rod, for its two ends and its middle: integrals over quadratic functions."""
    K, M = np.zeros((3, 3)), np.zeros((3, 3))
    for s, weight in zip(POINTS, WEIGHTS, strict=True):
        u = np.array([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
        strain = np.array([4 * s - 3, 4 * s - 1, 4 - 8 * s]) / length
        K += weight * length * stiffness * np.outer(strain, strain)
        M += weight * length * mass * np.outer(u, u)
    return K, M


def torsion_constant(width, height):
    """Return the torsion constant of a rectangle from Prandtl's stress function, as a double Fourier series.

    The sums of 400 and 800 terms each way are extrapolated; the remainder falls with the third power of the number.
    """
    coarse, fine = (_fourier_sum(width, height, terms) for terms in (400, 800))
    return float(256.0 * width * height / np.pi**6 * (8.0 * fine - coarse) / 7.0)


def _fourier_sum(a, b, count):
    odd = 2 * np.arange(count) + 1.0
    m, n = odd[:, None], odd[None, :]
    return (1.0 / (m**2 * n**2 * (m**2 / a**2 + n**2 / b**2))).sum()


class DenseStructure:
    """Masses and springs of nodes with six DOFs each, x, y, z, rx, ry, rz, along the axes of the assembly."""

    def __init__(self, nodes, elements):
        size = 6 * nodes + 2 * elements  # two inner DOFs of each element
        self.M, self.K, self.C = (np.zeros((size, size), dtype=complex) for _ in range(3))
        self.inner = 6 * nodes

    def add_beam(self, first, count, length, along, side, material, section):
        """Add equal elements between nodes `first` and `first` + `count`; `section` is (side, other side) [m]."""
        young, density, poisson, loss = material
        e, v = (np.asarray(one, dtype=float) / np.linalg.norm(one) for one in (along, side))
        w = np.cross(e, v)
        deep, wide = section  # along `side`, and across
        shear, area = young / (2 * (1 + poisson)), deep * wide
        kappa = 10 * (1 + poisson) / (12 + 11 * poisson)
        span = length / count
        inertias = wide * deep**3 / 12, deep * wide**3 / 12
        rows = []
        for offset in (0, 6):
            for direction in (v, w):
                displacement, slope = np.zeros(12), np.zeros(12)
                displacement[offset : offset + 3] = direction
                slope[offset + 3 : offset + 6] = np.cross(e, direction)  # d(u . direction)/ds = (theta x e) . direction
                rows.append((displacement, slope))
        K, M = np.zeros((14, 14)), np.zeros((14, 14))
        for plane, inertia in enumerate(inertias):
            T = np.zeros((4, 14))
            T[:, :12] = [*rows[plane], *rows[2 + plane]]
            stiffness, mass = bending_energies(span, young, kappa * shear * area, area, inertia, density)
            K += T.T @ stiffness @ T
            M += T.T @ mass @ T
        polar, torsion = sum(inertias), torsion_constant(deep, wide)
        for offset, resistance, inertness in ((0, young * area, density * area), (3, shear * torsion, density * polar)):
            T = np.zeros((3, 14))
            T[0, offset : offset + 3] = T[1, 6 + offset : 9 + offset] = e
            T[2, 12 if offset == 0 else 13] = 1.0
            stiffness, mass = rod_energies(span, resistance, inertness)
            K += T.T @ stiffness @ T
            M += T.T @ mass @ T
        for number in range(count):
            dofs = np.array([*range(6 * (first + number), 6 * (first + number) + 12), self.inner, self.inner + 1])
            self.K[dofs[:, None], dofs] += (1 + 1j * loss) * K
            self.M[dofs[:, None], dofs] += M
            self.inner += 2

    def add_body(self, node, mass, tensor, center):
        """Add a rigid body to the motion of a node at its origin."""
        x, y, z = center
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        dofs = slice(6 * node, 6 * node + 6)
        coupling = -mass * cross  # kinetic energy m |v + w x c|^2 / 2 + w J w / 2
        self.M[dofs, dofs] += np.block([[mass * np.eye(3), coupling], [coupling.T, tensor + mass * cross.T @ cross]])

    def add_bushing(self, first, second, stiffness, damping, axes=None, ways=((0, 0, 0), (0, 0, 0))):
        """Add six springs and dampers along the columns of `axes`; `second` is None for the ground.

        They act at points at some ways from the nodes, which move with these as points of rigid bodies.
        """
        R = np.eye(3) if axes is None else np.asarray(axes)
        T = np.zeros((6, 6))
        T[:3, :3] = T[3:, 3:] = R.T
        relative = np.zeros((6, len(self.K)))
        for node, sign, way in ((first, 1.0, ways[0]), (second, -1.0, ways[1])):
            if node is not None:
                there = np.eye(6)
                for axis in range(3):
                    there[:3, 3 + axis] = np.cross(np.eye(3)[axis], way)
                relative[:, 6 * node : 6 * node + 6] += sign * T @ there
        self.K += relative.T @ np.diag(stiffness) @ relative
        self.C += relative.T @ np.diag(damping) @ relative

    def receptance(self, frequency, output, force):
        """Return the receptance between two DOFs, or between combinations of DOFs (d,)."""
        size = len(self.K)
        out, into = (np.eye(size)[one] if np.ndim(one) == 0 else np.asarray(one) for one in (output, force))
        omega = 2 * np.pi * np.asarray(frequency)
        return np.array([out @ np.linalg.solve(self.K + 1j * w * self.C - w**2 * self.M, into) for w in omega])
