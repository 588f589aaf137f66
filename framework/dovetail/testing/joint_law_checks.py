"""Checks of joints: the dynamic stiffness over frequency, mostly of joints that define it themselves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.testing.linear_algebra import asymmetry, least_eigenvalue, relative_difference
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimens import FREQUENCY, JointSpecimen

_ROUNDING = 1e-9
"""Relative to the largest entry."""
_VECTORS = 64
"""Number of parameter vectors at which all lines are computed, half of them corners."""
_FEW = 4
"""Parameter vectors where few suffice."""
_TOWARDS_REST = np.array([1e-1, 1e-4, 1e-7, 1e-10])
"""Frequencies [Hz] that decrease by a constant factor."""
_SETTLING = 0.98
"""Ratio of the last change over such a factor to the first: 0.98 for f^0.0015; slower convergence counts as log f."""


def check_dynamic_stiffness_is_symmetric_and_passive(specimen: JointSpecimen) -> None:
    """A dynamic stiffness of its own is symmetric, and adds no energy, anywhere in the ranges."""
    _only_with_own_law(specimen)
    theta = specimen.some(_VECTORS)
    Z = specimen.stiffness(specimen.lines, theta)
    if asymmetry(Z) > _ROUNDING:
        raise Nonconformity("dynamic_stiffness is not symmetric.", "Fill [row, column] and [column, row] equally.")
    least = least_eigenvalue(Z.imag)
    if least.min() < -_ROUNDING:
        row, line = np.unravel_index(int(least.argmin()), least.shape)
        problem = (
            f"at {specimen.lines[line]:.4g} Hz the imaginary part of dynamic_stiffness is not positive semi-definite, "
            f"so the joint adds energy, for {specimen.shown(theta[row])}."
        )
        raise Nonconformity(problem, "With exp(i omega t) a damper is + i omega c, and a lossy spring k (1 + i eta).")


def check_the_law_has_a_limit_at_rest(specimen: JointSpecimen) -> None:
    """A dynamic stiffness of its own converges to a finite limit as the frequency approaches zero."""
    _only_with_own_law(specimen)
    Z = specimen.stiffness(_TOWARDS_REST, specimen.some(_VECTORS))
    if not np.isfinite(Z).all():
        raise Nonconformity("near 0 Hz the dynamic stiffness is not finite.", _LIMIT)
    changes = np.abs(np.diff(Z, axis=1)).max(axis=(2, 3))
    rounding = _ROUNDING * np.abs(Z).max(axis=(1, 2, 3))
    if (changes[:, -1] > _SETTLING * changes[:, 0] + rounding).any():
        problem = "towards 0 Hz the dynamic stiffness changes more and more, or by the same for each decade."
        raise Nonconformity(problem, _LIMIT)


_LIMIT = "Give the law a limit at rest; a power f^alpha has one, 1 / f and log f have none."


def check_dynamic_stiffness_treats_lines_and_vectors_alone(specimen: JointSpecimen) -> None:
    """Each line and vector gives the same result alone and in batches: unsorted, repeated, or very large."""
    theta = specimen.some(_FEW)
    Z = specimen.stiffness(FREQUENCY, theta)
    for line in range(len(FREQUENCY)):
        single = specimen.stiffness(FREQUENCY[line : line + 1], theta[:1])
        _compare(single[0, 0], Z[0, line], f"at {FREQUENCY[line]:.4g} Hz in a single line")
    shuffled = np.array([5, 0, 8, 0, 3, 3, 1])
    _compare(specimen.stiffness(FREQUENCY[shuffled], theta), Z[:, shuffled], "at unsorted lines")
    many = np.concatenate([np.linspace(21.0, 1999.0, 500), FREQUENCY])
    _compare(specimen.stiffness(many, theta[:1])[:, 500:], Z[:1], "among 500 other lines")
    others = np.concatenate([specimen.some(300), theta])
    _compare(specimen.stiffness(FREQUENCY[:2], others)[-len(theta) :], Z[:, :2], "among 300 other vectors")


def check_frequency_may_be_any_array(specimen: JointSpecimen) -> None:
    """Frequencies may be integers, in single precision, or in read-only arrays."""
    _only_with_own_law(specimen)
    theta, whole = specimen.some(_FEW), np.array([1500, 20, 333])
    read_only = whole.astype(np.float64)
    read_only.flags.writeable = False
    wanted = specimen.stiffness(whole.astype(np.float64), theta)
    for kind, frequency in {
        "of whole numbers": whole,
        "in single precision": whole.astype(np.float32),
        "that is read-only": read_only,
        "with other numbers between": np.repeat(whole.astype(np.float64), 2)[::2],
    }.items():
        answer: NDArray[np.complex128] = specimen.component.dynamic_stiffness(frequency, theta.copy())
        if relative_difference(answer, wanted) > _SINGLE:
            problem = f"for an array {kind} dynamic_stiffness gives other results than for the same numbers."
            raise Nonconformity(problem, "Begin with frequency = numpy.asarray(frequency, dtype=float).")


_SINGLE = 1e-5
"""Relative to the largest entry, for frequencies in single precision."""


def _compare(answer: NDArray[np.complex128], wanted: NDArray[np.complex128], where: str) -> None:
    if answer.shape != wanted.shape or relative_difference(answer, wanted) > _ROUNDING:
        problem = f"{where} dynamic_stiffness differs from that for few lines and vectors."
        raise Nonconformity(problem, "Use the axes (n, n_freq, d, d) of theta and frequency.")


def _only_with_own_law(specimen: JointSpecimen) -> None:
    if not specimen.own_law:
        raise NotApplicable("dynamic_stiffness follows from the matrices, which are checked.")
