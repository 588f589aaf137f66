"""Natural frequencies, damping ratios and mode shapes of an assembly, with intervals for an identified joint."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.assembly import Assembly, AssemblySource, SeenPoles, Theta, as_assembly
from dovetail.errors import Fault, ParameterError
from dovetail.identification.parameters import dataframe
from dovetail.identification.prediction import drawn_values, joint_values, theta_elsewhere, with_signs_of
from dovetail.identification.result import Identification
from dovetail.identification.result_file import load_result
from dovetail.inference.posterior import LEVEL
from dovetail.inference.posterior.verdicts import ends_of
from dovetail.plain_text import html_table
from dovetail.synthesis import Poles

_FURTHER = 2
"""Modes above those that are returned, which may lie among them for other values of the parameters."""
_FEWEST = 0.95
"""Part of the samples that must have a mode for an interval; it is overdamped for the others."""


@dataclass(frozen=True, eq=False)
class Modes:
    """The lowest modes of a damped assembly, by increasing natural frequency.

    Parameters
    ----------
    natural_frequency : (n_modes,) array
        Hz: the magnitude of the pole over 2 pi.
    damping_ratio : (n_modes,) array
        Of the critical damping.
    shapes : mapping of str to (n_modes, n_nodes, n_directions) complex array
        By the part's name: displacements and rotations of its nodes, as in `VibrationMode`.
    natural_frequency_interval, damping_ratio_interval : (n_modes, 2) array or None
        Ends of the interval of each; None without a posterior. NaN where a mode is overdamped in more than 5 % of the
        posterior.
    level : float
        Probability of the intervals.
    warning : str
        That of the result which the parameters come from.
    """

    natural_frequency: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    shapes: Mapping[str, NDArray[np.complex128]]
    natural_frequency_interval: NDArray[np.float64] | None = None
    damping_ratio_interval: NDArray[np.float64] | None = None
    level: float = LEVEL
    warning: str = ""

    def __len__(self) -> int:
        return len(self.natural_frequency)

    def __repr__(self) -> str:
        pairs = zip(self.natural_frequency.tolist(), self.damping_ratio.tolist(), strict=True)
        listed = ", ".join(f"{frequency:.5g} Hz ({100.0 * ratio:.3g} %)" for frequency, ratio in pairs)
        return f"<Modes: {f'{self.warning} ' if self.warning else ''}{listed}>"

    def _repr_html_(self) -> str:
        head = ("mode", *self.rows[0]) if len(self) else ("mode",)
        rows = [(str(n), *(f"{value:.5g}" for value in row.values())) for n, row in enumerate(self.rows, 1)]
        return html_table(self.warning or f"<Modes: {len(self)}>", [head, *rows])

    @property
    def rows(self) -> list[dict[str, float]]:
        """Numbers of each mode by their names; frequencies are in Hz."""
        columns = {"natural_frequency_Hz": self.natural_frequency}
        if self.natural_frequency_interval is not None:
            columns |= zip(("frequency_low_Hz", "frequency_high_Hz"), self.natural_frequency_interval.T, strict=True)
        columns["damping_ratio"] = self.damping_ratio
        if self.damping_ratio_interval is not None:
            columns |= zip(("damping_low", "damping_high"), self.damping_ratio_interval.T, strict=True)
        return [dict(zip(columns, row, strict=True)) for row in np.transpose(list(columns.values())).tolist()]

    def to_dataframe(self) -> Any:
        """Return `rows` as a data frame of pandas (an extra), numbered from 1."""
        return dataframe([{"mode": number, **row} for number, row in enumerate(self.rows, 1)], ["mode"])


def modes(
    assembly: AssemblySource,
    theta: Theta | Identification | Path | str = None,
    *,
    count: int = 3,
    level: float = LEVEL,
    seed: int = 0,
) -> Modes:
    """Compute the lowest modes of an assembly, with intervals for the result of an identification.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description; the identified assembly, or another one with the same joint.
    theta : parameter values, or Identification or path
        A result or where it was written, whose joint is matched as in `predict`; or values as in `Assembly.frf`.
    count : int
        Number of modes; there are fewer if the assembly has fewer.
    level : float
        Probability of the intervals.
    seed : int
        Of the samples.

    Returns
    -------
    Modes
        At the best fit. The intervals come from the posterior's samples, each mode followed by its shape, and include
        the errors of natural frequencies and damping that the model is allowed.

    Raises
    ------
    ParameterError
        The values do not fit the assembly, `count` is not positive, or `level` is not a probability.
    DovetailError
        A part is known by its FRFs only, or the structure is not stable.
    """
    if count < 1:
        raise ParameterError(Fault("count", f"{count} modes were asked for.", "1 or more"))
    if not 0.0 < level < 1.0:
        raise ParameterError(Fault("level", f"{level:g} is not a probability.", "more than 0 and less than 1"))
    structure = as_assembly(assembly)
    result = load_result(theta) if isinstance(theta, (str, Path)) else theta
    if not isinstance(result, Identification):
        return _at(structure, structure.vector(result), count)
    structure = with_signs_of(structure, result)
    best = _at(structure, structure.vector(joint_values(structure, result)), count, result.warning)
    return best if result.posterior is None else _with_intervals(best, structure, result, level, seed)


def natural_frequencies(assembly: AssemblySource, theta: Theta = None, *, count: int = 3) -> NDArray[np.float64]:
    """Return the lowest natural frequencies (n_modes,) [Hz] of the damped assembly, as `modes` does."""
    return modes(assembly, theta, count=count).natural_frequency


def damping_ratios(assembly: AssemblySource, theta: Theta = None, *, count: int = 3) -> NDArray[np.float64]:
    """Return the damping ratios (n_modes,) of the lowest modes of the assembly, as `modes` does."""
    return modes(assembly, theta, count=count).damping_ratio


def mode_shapes(
    assembly: AssemblySource, theta: Theta = None, *, count: int = 3
) -> Mapping[str, NDArray[np.complex128]]:
    """Return the shapes (n_modes, n_nodes, n_directions) of the lowest modes by part, as `modes` does."""
    return modes(assembly, theta, count=count).shapes


def _at(assembly: Assembly, theta: NDArray[np.float64], count: int, warning: str = "") -> Modes:
    found = assembly.modes(theta, count)
    names = assembly.description.substructures
    shapes = {name: np.stack([mode.shapes[name] for mode in found]) for name in names} if found else {}
    frequency = np.array([mode.natural_frequency for mode in found])
    return Modes(frequency, np.array([mode.damping_ratio for mode in found]), shapes, warning=warning)


def _with_intervals(best: Modes, assembly: Assembly, result: Identification, level: float, seed: int) -> Modes:
    """Return modes with intervals of their natural frequencies and damping ratios, from the posterior's samples."""
    assert result.posterior is not None
    posterior, count, random = result.posterior, len(best), np.random.default_rng([seed, 7])
    logarithms = _log_numbers(assembly, joint_values(assembly, result), count)
    values = drawn_values(posterior, result, lambda theta: logarithms(theta_elsewhere(assembly, result, theta)), random)
    allowed = np.repeat(posterior.model_error.sizes_of_modes, count)
    values = values + allowed * random.standard_normal(values.shape)
    rare = np.isfinite(values).mean(axis=0) < _FEWEST
    values[:, rare] = 0.0
    ends = np.exp(np.nanquantile(values, ends_of(level), axis=0))
    ends[:, rare] = np.nan
    frequency, damping = ends.reshape(2, 2, count).transpose(1, 2, 0)
    return Modes(best.natural_frequency, best.damping_ratio, best.shapes, frequency, damping, level, best.warning)


def _log_numbers(
    assembly: Assembly, middle: Mapping[str, float], count: int
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return logarithms (n, 2 count) of natural frequencies and damping ratios as a function of theta (n, n_params).

    Each mode is the one whose shape is most like that of the same mode at `middle`.
    """
    seen = SeenPoles(assembly.graph)

    def poles_of(theta: NDArray[np.float64]) -> list[Poles]:
        return list(seen.at(assembly.by_joint(theta), len(theta), count + _FURTHER))

    reference = poles_of(assembly.vector(middle)[np.newaxis])[0].shapes[:count]

    def numbers(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        values = np.full((len(theta), 2, count), np.nan)
        for row, poles in enumerate(poles_of(theta)):
            modes, places = _most_similar(reference, poles.shapes)
            s = poles.values[places]
            with np.errstate(divide="ignore"):  # an undamped mode has the damping 0, in every sample
                values[row, :, modes] = np.log([np.abs(s) / (2.0 * np.pi), -s.real / np.abs(s)]).T
        return values.reshape(len(theta), -1)

    return numbers


def _most_similar(
    shapes: NDArray[np.complex128], others: NDArray[np.complex128]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs of shapes (k, d) and others (m, d) with the largest sum of modal assurance criteria."""
    first, second = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (shapes, others))
    rows, columns = scipy.optimize.linear_sum_assignment(np.abs(first.conj() @ second.T), maximize=True)
    return rows, columns
