"""Element matrices from the published formulas, by shape functions and quadrature; no code of Dovetail is used.

Every function takes real or complex parameters and is analytic in them, so that a complex step differentiates it.
DOFs are full numbers of `dense_solve`; x and rz as in Dovetail, rz = dx/ds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
"""Exact for polynomials up to the seventh degree; the mass matrix needs the sixth."""
_DIFFERENCE = np.array([[1.0, -1.0], [-1.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Element:
    """Matrices over some DOFs: M, K, C and D of Z = K + iD + i omega C - omega^2 M (Eqs. 1-3).

    Parameters
    ----------
    dofs : sequence of int
    M, K, C, D : (d, d) or (n_freq, d, d) arrays or 0
    """

    dofs: Sequence[int]
    M: Any = 0.0
    K: Any = 0.0
    C: Any = 0.0
    D: Any = 0.0


def spring(one: int, other: int, stiffness: Any, damping: Any = 0.0, loss: Any = 0.0) -> Element:
    """A spring, a damper and a structural damper between two DOFs."""
    k, c, d = (np.asarray(value)[..., np.newaxis, np.newaxis] * _DIFFERENCE for value in (stiffness, damping, loss))
    return Element((one, other), K=k, C=c, D=d)


def inertia(dof: int, value: Any) -> Element:
    """A mass or a rotary inertia."""
    return Element((dof,), M=np.array([[value]]))


def round_section(outer: Any, inner: Any, poisson: float) -> tuple[Any, Any, Any]:
    """Area, second moment and Cowper's shear coefficient of a circle (J. Appl. Mech. 33 (1966) 335-340, table 1)."""
    area, second = np.pi * (outer**2 - inner**2) / 4, np.pi * (outer**4 - inner**4) / 64
    hole = (inner / outer) ** 2
    numerator = 6 * (1 + poisson) * (1 + hole) ** 2
    return area, second, numerator / ((7 + 6 * poisson) * (1 + hole) ** 2 + (20 + 12 * poisson) * hole)


def rectangular_section(width: float, height: float, poisson: float) -> tuple[float, float, float]:
    """The same of a rectangle that bends in the direction of its height."""
    return width * height, width * height**3 / 12, 10 * (1 + poisson) / (12 + 11 * poisson)


def beam_element(dofs: Sequence[int], length: float, section: tuple[Any, Any, Any], material: Mapping[str, float]):
    """Friedman and Kosmatka's element (Comput. Struct. 47 (1993) 473-481), from its shape functions.

    With Phi = 12 E I / (kappa G A L^2) and xi = s / L, displacement and rotation between the nodes are the cubic and
    the quadratic that solve the static equations of Timoshenko's beam. K = int E I N_theta'^T N_theta' + kappa G A
    gamma^T gamma ds with gamma = N_w' - N_theta, M = int rho A N_w^T N_w + rho I N_theta^T N_theta ds, D = eta K.
    """
    area, second, shear = section
    young, density = material["young"], material["density"]
    shear_stiffness = shear * area * young / (2 * (1 + material["poisson"]))
    phi = 12 * young * second / (shear_stiffness * length**2)
    K, M = np.zeros((2, 4, 4), dtype=np.result_type(phi, float))
    for point, weight in zip((1 + _POINTS) / 2, _WEIGHTS * length / 2, strict=True):
        w, theta, curvature, gamma = _shape_functions(point, length, phi)
        K += weight * (young * second * np.outer(curvature, curvature) + shear_stiffness * np.outer(gamma, gamma))
        M += weight * density * (area * np.outer(w, w) + second * np.outer(theta, theta))
    return Element(dofs, M, K, D=material["loss_factor"] * K)


def _shape_functions(xi: float, length: float, phi: Any) -> tuple[Any, Any, Any, Any]:
    """N_w, N_theta, dN_theta/ds and gamma at a point, each over (x1, rz1, x2, rz2)."""
    bent = 2 * xi**3 - 3 * xi**2
    w = [
        bent - phi * xi + 1 + phi,
        length * (xi**3 - (2 + phi / 2) * xi**2 + (1 + phi / 2) * xi),
        -(bent - phi * xi),
        length * (xi**3 - (1 - phi / 2) * xi**2 - phi / 2 * xi),
    ]
    theta = [
        6 / length * (xi**2 - xi),
        3 * xi**2 - (4 + phi) * xi + 1 + phi,
        -6 / length * (xi**2 - xi),
        3 * xi**2 - (2 - phi) * xi,
    ]
    curvature = [6 / length * (2 * xi - 1), 6 * xi - 4 - phi, -6 / length * (2 * xi - 1), 6 * xi - 2 + phi]
    gamma = [-phi / length, -phi / 2, phi / length, -phi / 2]
    w, theta, curvature, gamma = (np.array(row) / (1 + phi) for row in (w, theta, curvature, gamma))
    return w, theta, curvature / length, gamma
