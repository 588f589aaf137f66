"""FRFs of one structure as sums of resonances and a background."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import AAA

from dovetail.frf.frequency_response import Frf, conversion


@dataclass(frozen=True)
class Settings:
    """What counts as a resonance."""

    tolerance: float = 1e-6
    """Relative error of the rational function whose poles are the resonances."""
    most_terms: int = 60
    """Largest number of terms of that function; a resonance takes two."""
    most_lines: int = 8192
    """Largest number of lines to which that function is fitted; it shows resonances between them too."""
    pole_limits: tuple[float, float] = (0.5, 1.2)
    """Factors of the lowest and the highest frequency beyond which a pole belongs to the background."""
    largest_damping: float = 0.6
    """Largest ratio of a pole's imaginary part to its real part for a resonance."""
    negligible: float = 2e-13
    """Residue of a pole, over distance and size of the values, below which it may be spurious; `AAA` removes those
    below half as much."""
    same_pole: float = 0.5
    """Distance, in imaginary parts of a pole, within which a pole from other frequencies is the same one."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class Resonances:
    """Resonances of FRFs, whose receptances are sums ``r / (f - p) - conj(r) / (f + conj(p))``, and a background.

    Parameters
    ----------
    poles : (n,) complex array
        Natural frequencies [Hz], ascending; the imaginary part is the real part times half the loss factor.
    terms : tuple of (n, n_freq) complex arrays
        Contribution of each resonance to the FRF of each response, in its quantity; 0 if it is beyond the response's
        frequencies.
    near : tuple of (n, n_freq) complex arrays
        The first of its two terms, which is large near the resonance.
    relative : tuple of (n, n_freq) complex arrays
        p / (f - p), the inverse relative distance of each frequency from each pole.
    """

    poles: NDArray[np.complex128]
    terms: tuple[NDArray[np.complex128], ...]
    near: tuple[NDArray[np.complex128], ...]
    relative: tuple[NDArray[np.complex128], ...]

    def pole_shift(self, change: float) -> NDArray[np.complex128]:
        """Return the change of the FRFs by a relative change of each pole, to first order.

        Parameters
        ----------
        change : float
            Relative change of the poles.

        Returns
        -------
        (n, n_lines) complex array
            The lines of all responses, concatenated. Where the pole moves by more than its distance from the line, the
            change is limited to the resonance's own contribution.
        """
        steps = [change * relative for relative in self.relative]
        pairs = zip(self.near, steps, strict=True)
        return np.concatenate([near * step / np.maximum(1.0, np.abs(step)) for near, step in pairs], axis=1)

    def pole_shift_remainder(self, change: float) -> NDArray[np.complex128]:
        """Return the nonlinear part (n, n_lines) of the change of the FRFs by a relative change of each pole."""
        return self._moved(np.full(len(self.poles), change)) - self.pole_shift(change)

    @property
    def damping_slope(self) -> NDArray[np.complex128]:
        """The derivative (n, n_lines) of the FRFs by the logarithm of each resonance's damping ratio."""
        ratio = 1j * (self.poles.imag / self.poles.real)[:, np.newaxis]
        pairs = zip(self.near, self.relative, strict=True)
        return np.concatenate([ratio * near * relative for near, relative in pairs], axis=1)

    def damping_remainder(self, change: float) -> NDArray[np.complex128]:
        """Return the nonlinear change of the FRFs (n, n_lines) by a change of the logarithm of each damping ratio."""
        return self._moved(1j * self.poles.imag / self.poles * np.expm1(change)) - change * self.damping_slope

    def _moved(self, changes: NDArray[Any]) -> NDArray[np.complex128]:
        """Return the changes of the FRFs (n, n_lines) by relative changes (n,) of the poles, one at a time."""
        steps = [changes[:, np.newaxis] * relative for relative in self.relative]
        pairs = zip(self.near, steps, strict=True)
        return np.concatenate([near * step / (1.0 - step) for near, step in pairs], axis=1)


def fit_resonances(frfs: Sequence[Frf], values: Sequence[NDArray[np.complex128]]) -> Resonances:
    """Find the resonances in FRFs of one structure.

    Parameters
    ----------
    frfs : sequence of Frf
        Their frequencies and quantities, one for each response.
    values : sequence of (n_freq,) complex arrays
        The FRF of each response, instead of the values in `frfs`.

    Returns
    -------
    Resonances
        Without poles if the FRFs have no resonance.

    Notes
    -----
    The poles are those of a rational function fitted to a mixture of the FRFs with the same frequencies (AAA:
    Nakatsukasa, Sete and Trefethen, The AAA algorithm for rational approximation, 2018). Poles from FRFs with different
    frequencies are the same resonance if their distance is less than a quarter of its width. The residues follow by
    linear least squares. Both are fitted to mobilities, in which distant resonances have similar heights, so that the
    result does not depend on the quantity.
    """
    axes = [frf.frequency for frf in frfs]
    derivatives = [conversion(frf.frequency, "mobility", frf.quantity) for frf in frfs]
    mobilities = [np.asarray(frf / factor, np.complex128) for frf, factor in zip(values, derivatives, strict=True)]
    packed = (tuple(map(np.ndarray.tobytes, arrays)) for arrays in (axes, mobilities))
    poles, residues_of_each = _poles_and_residues(*packed)
    near, terms, relative = [], [], []
    for frequency, residues, derivative in zip(axes, residues_of_each, derivatives, strict=True):
        distance, mirrored = frequency - poles[:, np.newaxis], frequency + np.conj(poles)[:, np.newaxis]
        factor = derivative * conversion(frequency, "receptance", "mobility")
        near.append(factor * residues[:, np.newaxis] / distance)
        terms.append(near[-1] - factor * np.conj(residues)[:, np.newaxis] / mirrored)
        relative.append(poles[:, np.newaxis] / distance)
    return Resonances(poles, tuple(terms), tuple(near), tuple(relative))


@lru_cache(maxsize=2)  # one fit of an assembly is often judged by its resonances, in many places
def _poles_and_residues(
    frequencies: tuple[bytes, ...], mobilities: tuple[bytes, ...]
) -> tuple[NDArray[np.complex128], list[NDArray[np.complex128]]]:
    """Return the poles of all FRFs and the residues of each, 0 where a pole is beyond its frequencies."""
    axes = [np.frombuffer(axis) for axis in frequencies]
    frfs = [np.frombuffer(mobility, dtype=np.complex128) for mobility in mobilities]
    poles, residues = _common_poles(axes, frfs), list[NDArray[np.complex128]]()
    for frequency, mobility in zip(axes, frfs, strict=True):
        within = _is_within(poles, frequency)
        residues.append(np.zeros(len(poles), dtype=np.complex128))
        residues[-1][within] = _residues(frequency, mobility, poles[within])
    poles.setflags(write=False)
    return poles, residues


def _common_poles(
    axes: Sequence[NDArray[np.float64]], values: Sequence[NDArray[np.complex128]]
) -> NDArray[np.complex128]:
    """Return the poles of all FRFs, each once."""
    groups: dict[bytes, tuple[NDArray[np.float64], list[NDArray[np.complex128]]]] = {}
    for frequency, frf in zip(axes, values, strict=True):
        if len(frequency) > 1:
            groups.setdefault(frequency.tobytes(), (frequency, []))[1].append(frf)
    poles = np.empty(0, dtype=np.complex128)
    for frequency, frfs in groups.values():
        candidates = _poles(frequency, frfs)
        is_new = np.abs(candidates[:, np.newaxis] - poles) > _SETTINGS.same_pole * candidates.imag[:, np.newaxis]
        poles = np.concatenate([poles, candidates[is_new.all(axis=1)]])
    return np.sort_complex(poles)


def _poles(frequency: NDArray[np.float64], values: Sequence[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    """Return the poles of FRFs; each FRF is mixed in with a different phase, so that no two cancel a resonance."""
    sizes = [float(np.abs(frf).std()) or 1.0 for frf in values]
    mixture = sum(np.exp(1j * index) * frf / size for index, (frf, size) in enumerate(zip(values, sizes, strict=True)))
    some = slice(None, None, -(-len(frequency) // _SETTINGS.most_lines))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # measured parts have noise, which no rational function meets
        tolerance, most_terms = _SETTINGS.tolerance, _SETTINGS.most_terms
        rational = AAA(frequency[some], mixture[some], rtol=tolerance, max_terms=most_terms, clean_up=False)
        if _may_be_spurious(rational, frequency[some], mixture[some]):
            rational.clean_up()
        poles = rational.poles()
    underdamped = (poles.imag > 0.0) & (poles.imag < _SETTINGS.largest_damping * poles.real)
    return np.sort_complex(poles[_is_within(poles, frequency) & underdamped])


def _may_be_spurious(rational: AAA, frequency: NDArray[np.float64], values: NDArray[np.complex128]) -> bool:
    """Return whether `AAA.clean_up`, whose modules take half a second to load, may find a pole to remove."""
    distances = np.abs(np.subtract.outer(rational.poles(), frequency)).min(axis=1, initial=np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.exp(np.mean(np.log(np.abs(values))))
        return not (np.abs(rational.residues()) / distances > _SETTINGS.negligible * mean).all()


def _is_within(poles: NDArray[np.complex128], frequency: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which poles are resonances of an FRF with these frequencies; the others are background."""
    lowest, highest = _SETTINGS.pole_limits * frequency[[0, -1]]
    return np.asarray((poles.real > lowest) & (poles.real < highest))


def _residues(
    frequency: NDArray[np.float64], mobility: NDArray[np.complex128], poles: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return the residues (n,) of one receptance, fitted together with a free body, a spring and a mass in parallel."""
    near, mirrored = 1.0 / (frequency - poles[:, np.newaxis]), 1.0 / (frequency + np.conj(poles)[:, np.newaxis])
    background = (frequency / frequency[-1]) ** np.array([[-2.0], [0.0], [2.0]])
    shapes = np.concatenate([near - mirrored, 1j * (near + mirrored), background])
    shapes = shapes * conversion(frequency, "receptance", "mobility")
    columns = np.concatenate([shapes.real, shapes.imag], axis=1).T
    lengths = np.linalg.norm(columns, axis=0)
    target = np.concatenate([mobility.real, mobility.imag])
    coefficients = np.linalg.lstsq(columns / lengths, target, rcond=1e-12)[0] / lengths
    return np.asarray(coefficients[: len(poles)] + 1j * coefficients[len(poles) : 2 * len(poles)])
