"""What one standard deviation of each error of a model adds to its FRFs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.frf import Frf
from dovetail.frf.quantity import conversion
from dovetail.identification.posterior.model_error import KINDS, ModelError, Resonances, fit_resonances

__all__ = ["background_shapes", "error_shapes", "hat_functions"]


@dataclass(frozen=True)
class Settings:
    """How errors of neighbouring resonances are related, and which of their effects are not linear."""

    individual_magnitude: float = 0.3
    """Independent error of each resonance's magnitude and phase, over the error shared with its neighbours."""
    individual: float = 0.6
    """Independent error of each natural frequency, over the error shared with its neighbours. With hat functions, whose
    squares are 2/3 on average, the root mean square over all resonances is the size of the error."""
    moved: tuple[float, ...] = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)
    """Displacements of resonances, in sizes of the error, at which the effect beyond the linear term is computed. It
    shows in a peak far above the noise that is misplaced or too broad."""
    damped: tuple[float, float] = (0.1, 2.0)
    """Error of damping above which this effect is computed, and the largest change of its logarithm for that."""
    hat_functions: int = 6
    """Number of hat functions over the frequency axis: resonances nearer than a fifth of it have similar errors."""
    background_powers: tuple[float, ...] = (-2.0, 0.0, 2.0, 4.0)
    """Of the frequency, in the receptance that resonances outside the band add: a free body below, and the first terms
    of the series of those above."""


_SETTINGS = Settings()


def error_shapes(
    frfs: Sequence[Frf], values: Sequence[NDArray[np.complex128]], size: ModelError
) -> dict[str, NDArray[np.complex128]]:
    """Return the changes of one structure's FRFs by one standard deviation of each error, by the kind of error.

    Parameters
    ----------
    frfs, values
        As in `fit_resonances`.
    size : ModelError

    Returns
    -------
    dict of str to (n_errors, n_lines) complex array
        The lines of all responses, concatenated. Errors of natural frequencies and damping belong to the structure and
        are shared by all responses; those of magnitude and phase are separate for each response. "higher" is the effect
        of a misplaced or too broad resonance beyond the linear term.

    Notes
    -----
    Neighbouring resonances have mostly the same error: those of natural frequencies and of the FRF's magnitude and
    phase vary smoothly over the frequency axis, as six hat functions. In addition, each resonance has an independent
    error, which also moves the antiresonances.
    """
    axes = [frf.frequency for frf in frfs]
    counts = [len(frequency) for frequency in axes]
    if not any(size.to_dict().values()):
        return {kind: np.zeros((0, sum(counts)), dtype=np.complex128) for kind in KINDS}
    band = float(min(axis[0] for axis in axes)), float(max(axis[-1] for axis in axes))
    resonances, hats = fit_resonances(frfs, values), [hat_functions(frequency, band) for frequency in axes]
    if size.background:
        hats = [np.ones((1, len(frequency))) for frequency in axes]
    level, alone = size.natural_frequency, _SETTINGS.individual * size.natural_frequency
    displaced, together = resonances.displaced(level), hat_functions(resonances.poles.real, band)
    of_response = zip(hats, values, resonances.terms, strict=True)
    shapes = [np.concatenate([hat * frf, _SETTINGS.individual_magnitude * terms]) for hat, frf, terms in of_response]
    if size.background:
        shapes = [frf[np.newaxis] for frf in values]
    scaled = np.concatenate([_in_response(shape, index, counts) for index, shape in enumerate(shapes)])
    higher = _higher(resonances, size)
    added = [_in_response(background_shapes(frf), index, counts) for index, frf in enumerate(frfs)]
    background = size.background * np.concatenate(added) if size.background else np.zeros((0, sum(counts)))
    return {
        "natural_frequency": np.concatenate([together @ displaced, resonances.displaced(alone)]),
        "damping": size.damping * resonances.damped,
        "magnitude": size.magnitude * scaled,
        "phase": 1j * size.phase * scaled,
        "higher": np.concatenate([higher, 1j * higher]),
        "background": np.concatenate([background, 1j * background]),
    }


def background_shapes(frf: Frf) -> NDArray[np.complex128]:
    """Return what resonances outside the band add to an FRF (4, n_freq): powers of the frequency in its receptance.

    They are orthogonal, and their root mean square is the median amplitude of the FRF.
    """
    powers = (frf.frequency / frf.frequency[-1]) ** np.array([_SETTINGS.background_powers]).T
    columns = powers * np.abs(conversion(frf.frequency, "receptance", frf.quantity))
    orthogonal = np.linalg.qr((columns / np.linalg.norm(columns, axis=1, keepdims=True)).T)[0].T
    return np.asarray(np.sqrt(len(frf.frequency)) * float(np.median(frf.amplitude)) * orthogonal, dtype=np.complex128)


def _higher(resonances: Resonances, size: ModelError) -> NDArray[np.complex128]:
    """Return the nonlinear changes of the FRFs (n, n_lines) by errors of natural frequencies and damping.

    Their weights give the covariance under normally distributed errors, by quadrature.
    """
    moved, (least, most) = np.array(_SETTINGS.moved), _SETTINGS.damped
    density = np.exp(-(moved**2) / 2.0)
    weight = np.sqrt(density / (1.0 + density.sum()))  # 1 for those that are not moved
    shapes = []
    for part, sizes in zip(weight.tolist(), moved.tolist(), strict=True):
        shapes.append(part * resonances.displaced_beyond(sizes * size.natural_frequency))
        if size.damping >= least:
            shapes.append(part * resonances.damped_beyond(float(np.clip(sizes * size.damping, -most, most))))
    return np.concatenate(shapes)


def _in_response(errors: NDArray[np.complex128], index: int, counts: Sequence[int]) -> NDArray[np.complex128]:
    """Pad errors (n, n_freq) of one response with zeros for the lines of the others: (n, n_lines)."""
    return np.pad(errors, ((0, 0), (sum(counts[:index]), sum(counts[index + 1 :]))))


def hat_functions(frequency: NDArray[np.float64], band: tuple[float, float]) -> NDArray[np.float64]:
    """Return six hat functions (6, n_freq), each 1 at one of six evenly spaced frequencies and 0 at the others.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    band : (float, float)
        Hz; the first and the last of the six.
    """
    low, high = band
    if low == high:  # a single line, at the first of the six
        return np.outer(np.eye(_SETTINGS.hat_functions)[0], np.ones(len(frequency)))
    peaks = np.linspace(low, high, _SETTINGS.hat_functions)
    return np.stack([np.interp(frequency, peaks, height) for height in np.eye(_SETTINGS.hat_functions)])
