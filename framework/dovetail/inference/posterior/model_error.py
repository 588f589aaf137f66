"""Effects of small errors of a model on its FRFs: resonances that are misplaced, too high or too broad.

The FRFs of one structure are split into resonances and a background (`fit_resonances`). From these follows the change
of the FRFs by one standard deviation of each error of the model (`error_shapes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.frf import Frf
from dovetail.frf.resonances import Resonances, fit_resonances
from dovetail.frf.single_mode import background_shapes

MODEL_ERROR = 5e-4
"""Relative error of natural frequencies (standard deviation) that a model is allowed by default."""


@dataclass(frozen=True)
class Settings:
    """Sizes of the model's errors, and the limits of what counts as a resonance.

    Natural frequencies are stationary with respect to the mode shapes; modal constants and damping are not. The ratios
    of their errors are the largest that a four times finer mesh shows for the bundled assemblies (docs/uncertainty.md).
    """

    damping: float = 100.0
    """Typical relative error of damping ratios, over that of natural frequencies."""
    magnitude: float = 20.0
    """Typical relative error of magnitudes, over that of natural frequencies."""
    phase: float = 2.0
    """Typical error of phases [rad], over that of natural frequencies."""
    largest: float = 0.3
    """Largest typical error of damping, magnitude and phase, however wrong natural frequencies are."""
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


_SETTINGS = Settings()


@dataclass(frozen=True)
class ModelError:
    """How wrong a model is: standard deviations of its errors.

    Parameters
    ----------
    natural_frequency : float
        Relative.
    damping : float
        Of damping ratios, relative.
    magnitude : float
        Of the FRF's magnitude, relative.
    phase : float
        Of the FRF's phase [rad].
    other : float
        Of each average over neighbouring lines, relative to its magnitude: errors that none of these explains.
    quantities : float
        Of each quantity of a known part, given as the relative error of natural frequencies that changes the FRFs as
        much. Intervals allow for it; no measurement shows it.
    background : float
        Of a smooth addition to each FRF, as by resonances outside the band, relative to the median amplitude. It is
        estimated for a single resonance only; magnitude and phase are then wrong by the same amount on all lines.

    Notes
    -----
    A size that a measurement does not determine is NaN in what is reported, never in what intervals allow for.
    """

    natural_frequency: float
    damping: float = 0.0
    magnitude: float = 0.0
    phase: float = 0.0
    other: float = 0.0
    quantities: float = 0.0
    background: float = 0.0

    @property
    def sizes_of_modes(self) -> tuple[float, float]:
        """Errors of natural frequencies and of damping ratios."""
        return self.natural_frequency, self.damping

    def times(self, factor: float) -> ModelError:
        """Return a copy in which the errors that have a shape are larger by a factor."""
        return replace(self, **{kind: factor * getattr(self, kind) for kind in KINDS})

    def at_least(self, least: ModelError) -> ModelError:
        """Return the larger of two errors, size by size."""
        return ModelError(**{name: max(size, getattr(least, name)) for name, size in asdict(self).items()})

    def within(self, limit: ModelError) -> bool:
        """Return whether no size that is known is larger than that of another error."""
        return not any(size > getattr(limit, name) for name, size in asdict(self).items())

    @property
    def unknown(self) -> tuple[str, ...]:
        """Names of the kinds of errors whose size the measurement does not determine."""
        return tuple(name for name, size in asdict(self).items() if np.isnan(size))

    def describe(self) -> str:
        """Return the sizes in words; those that are 0 or unknown are left out."""
        words = []
        if self.natural_frequency > 0.0:
            words.append(f"natural frequencies are off by {100.0 * self.natural_frequency:.2g} %")
        for name, size in (("damping", self.damping), ("amplitudes", self.magnitude)):
            if size > 0.0:  # nothing is known of damping where none was measured, nor of amplitudes without an FRF
                words.append(f"{name} {_off(words, name)}by {_percent_or_factor(size)}")
        if self.phase > 0.0 or (self.magnitude > 0.0 and self.phase == 0.0):
            words.append(f"phases {_off(words, 'phases')}by {_degrees(self.phase)} degrees")
        if self.background > 0.0:
            words.append(
                f"a smooth background that the model lacks is {_percent_or_factor(self.background)} of the FRF"
            )
        if self.other > 0.0:
            rest = "what none of these explains" if words else "what no single error explains"
            words.append(f"{'and ' if words else ''}{rest} is {_percent_or_factor(self.other)} of the FRF")
        return ", ".join(words)

    def to_dict(self) -> dict[str, float | None]:
        """Return the sizes by their names; None for those that are unknown."""
        return {name: None if np.isnan(size) else size for name, size in asdict(self).items()}


def _off(before: list[str], name: str) -> str:
    """Return the verb of the first error in a sentence."""
    if before:
        return ""
    return "is off " if name == "damping" else "are off "


def _degrees(phase: float) -> str:
    """Return an error of the phase [rad] in degrees, at most 180: no two phases are further apart."""
    return "180" if phase >= np.pi else f"{np.degrees(phase):.2g}"


def _percent_or_factor(size: float) -> str:
    """Return a relative error in per cent, or as a factor if it is 1 or more."""
    return f"{100.0 * size:.2g} %" if size < 1.0 else f"a factor of {np.exp(size):.2g}"


KINDS = tuple(field.name for field in fields(ModelError) if field.name not in ("other", "quantities", "background"))
"""Names of the errors that have a shape."""


def typical_model_error(natural_frequency: float) -> ModelError:
    """Return the typical sizes of all errors for a given relative error of natural frequencies."""
    ratios = {"damping": _SETTINGS.damping, "magnitude": _SETTINGS.magnitude, "phase": _SETTINGS.phase}
    sizes = {name: min(ratio * natural_frequency, _SETTINGS.largest) for name, ratio in ratios.items()}
    return ModelError(natural_frequency, **sizes)


TYPICAL = typical_model_error(MODEL_ERROR)
"""Errors that a model is allowed if the measurement shows none."""


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
    level, alone = size.natural_frequency, _SETTINGS.individual * size.natural_frequency
    displaced, together = resonances.pole_shift(level), hat_functions(resonances.poles.real, band)
    by_response = zip(hats, values, resonances.terms, strict=True)
    shapes = [np.concatenate([hat * frf, _SETTINGS.individual_magnitude * terms]) for hat, frf, terms in by_response]
    if size.background:  # a single resonance, whose gain and phase are those of all lines
        shapes = [frf[np.newaxis] for frf in values]
    scaled = np.concatenate([_in_response(shape, index, counts) for index, shape in enumerate(shapes)])
    higher = _higher(resonances, size)
    kinds = {
        "natural_frequency": np.concatenate([together @ displaced, resonances.pole_shift(alone)]),
        "damping": size.damping * resonances.damping_slope,
        "magnitude": size.magnitude * scaled,
        "phase": 1j * size.phase * scaled,
        "higher": np.concatenate([higher, 1j * higher]),
    }
    if size.background:
        added = [_in_response(background_shapes(frf), index, counts) for index, frf in enumerate(frfs)]
        background = size.background * np.concatenate(added)
        kinds["background"] = np.concatenate([background, 1j * background])
    return kinds


def _higher(resonances: Resonances, size: ModelError) -> NDArray[np.complex128]:
    """Return the nonlinear changes of the FRFs (n, n_lines) by errors of natural frequencies and damping.

    Their weights give the covariance under normally distributed errors, by quadrature.
    """
    moved, (least, most) = np.array(_SETTINGS.moved), _SETTINGS.damped
    density = np.exp(-(moved**2) / 2.0)
    weight = np.sqrt(density / (1.0 + density.sum()))  # 1 for those that are not moved
    shapes = []
    for part, sizes in zip(weight.tolist(), moved.tolist(), strict=True):
        shapes.append(part * resonances.pole_shift_remainder(sizes * size.natural_frequency))
        if size.damping >= least:
            shapes.append(part * resonances.damping_remainder(float(np.clip(sizes * size.damping, -most, most))))
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


def with_model_error(
    values: NDArray[np.complex128], predicted: Sequence[Frf], model_error: ModelError, random: np.random.Generator
) -> NDArray[np.complex128]:
    """Return samples of FRFs (n, n_lines) with draws of the errors that the model is allowed.

    Parameters
    ----------
    values : (n, n_lines) complex array
        Of all responses, one after another.
    predicted : sequence of Frf
        The FRF of each response, about which the errors are linear.
    model_error : ModelError
    random : numpy.random.Generator
    """
    shapes = error_shapes(predicted, [frf.values for frf in predicted], model_error)
    errors = np.concatenate(list(shapes.values()))
    values = values + random.standard_normal((len(values), len(errors))) @ errors
    scatter = random.standard_normal((*values.shape, 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
    return np.asarray(values + model_error.other * np.abs(values) * scatter)
