"""Measured FRFs, one for each response of an assembly, each on its own lines; their lines are concatenated."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.identification.fitting.random_error import (
    estimated_variance,
    is_too_short,
    isolated_lines,
    known_variance,
    most_likely_parts,
    normal_residuals,
    random_error_variance,
    residual_variance,
)
from dovetail.identification.fitting.residuals import LogAmplitude, StackedResiduals, Weighted, split_by_response
from dovetail.measurement import find_gaps, find_missing_ends, on_grid, within_band

__all__ = ["MeasuredLines", "Observations", "one_per_response"]

_LEAST_DISCREPANCY = 1e-6
"""Relative error of a model that is negligible."""
_RECIPROCITY, _EXCESS = 0.05, 3.0
"""Relative difference of two reciprocal FRFs that is reported, and its ratio to the one that random errors explain."""
_MOST_GAPS = 5
"""Largest number of gaps that a warning lists."""


def one_per_response(assembly: Assembly, measured: Frf | Sequence[Frf]) -> tuple[Frf, ...]:
    """Return the measured FRFs, one for each response of the assembly in its order.

    Raises
    ------
    MeasurementError
        There are more or fewer.
    """
    frfs = (measured,) if isinstance(measured, Frf) else tuple(measured)
    labels = assembly.description.response_labels
    if len(frfs) == len(labels):
        return frfs
    wanted = "; ".join(f"{number}. {label}" for number, label in enumerate(labels, start=1))
    received = f"{_counted(len(frfs), 'measured FRF')} {'was' if len(frfs) == 1 else 'were'} given"
    expected = f"'{assembly.name}' has {_counted(len(labels), 'response')}"
    remedy = "Give one FRF for each response, in this order."
    raise MeasurementError(Fault("measured", f"{received}, and {expected}.", wanted, remedy))


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


@dataclass(frozen=True, eq=False)
class Observations:
    """Measured FRFs as arrays over the lines of all responses, concatenated response by response.

    Parameters
    ----------
    frfs : tuple of Frf
        One for each response, in its quantity, on its frequencies in the assembly.
    """

    frfs: tuple[Frf, ...]

    @staticmethod
    def of(assembly: Assembly, measured: Frf | Sequence[Frf]) -> Observations:
        """Return the observations of one FRF, or of one for each response, in any quantities.

        Raises
        ------
        MeasurementError
            There are more or fewer than responses.
        """
        pairs = zip(one_per_response(assembly, measured), assembly.description.responses, strict=True)
        return Observations(tuple(frf.to(response.quantity) for frf, response in pairs))

    @property
    def counts(self) -> tuple[int, ...]:
        """Lines of each response."""
        return tuple(len(frf.frequency) for frf in self.frfs)

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(n_lines,) Hz."""
        return np.concatenate([frf.frequency for frf in self.frfs])

    @cached_property
    def amplitude(self) -> NDArray[np.float64]:
        """(n_lines,) measured."""
        return np.concatenate([frf.amplitude for frf in self.frfs])

    def at(self, lines: NDArray[np.intp]) -> Observations:
        """Return the observations at some lines (increasing indices), without responses that have none of them."""
        pairs = zip(self.frfs, split_by_response(lines, self.counts), strict=True)
        return Observations(
            tuple(
                Frf(frf.frequency[rows], frf.values[rows], frf.quantity, has_phase=frf.has_phase)
                for frf, rows in pairs
                if len(rows)
            )
        )

    def split(self, lines: NDArray[Any]) -> list[NDArray[Any]]:
        """Split an array (..., n_lines) into those of the responses."""
        return np.split(lines, np.cumsum(self.counts)[:-1], axis=-1)

    @cached_property
    def _known_variances(self) -> list[NDArray[np.float64] | None]:
        return [known_variance(frf) for frf in self.frfs]

    @property
    def variance_known(self) -> bool:
        """Whether the random error of every measurement is known."""
        return all(variance is not None for variance in self._known_variances)

    def variance(self, model: NDArray[np.complex128] | None = None) -> NDArray[np.float64]:
        """Return E|error|^2 (n_lines,) of each line: known, or estimated from the scatter.

        Parameters
        ----------
        model : (n_lines,) array, optional
            A model's values, which improve the estimate.
        """
        models = [None] * len(self.frfs) if model is None else self.split(model)
        responses = zip(self.frfs, self._known_variances, models, strict=True)
        return np.concatenate(
            [_estimated(frf, values) if variance is None else variance for frf, variance, values in responses]
        )

    def assumes(self, variance: NDArray[np.float64]) -> bool:
        """Return whether a response's variance (n_lines,) is assumed, since it has too few lines to estimate it."""
        responses = zip(self.frfs, self._known_variances, self.split(variance), strict=True)
        return any(
            known is None and is_too_short(frf) and np.array_equal(own, estimated_variance(frf))
            for frf, known, own in responses
        )

    def residual_variance(
        self, model: NDArray[np.complex128], used: NDArray[np.bool_], share: float = 1.0
    ) -> NDArray[np.float64]:
        """Return E|error|^2 (n_lines,) of each line: known, or estimated from the residuals of a model.

        Parameters
        ----------
        model : (n_lines,) array
            Values whose residuals are nothing but noise.
        used : (n_lines,) bool array
            Lines that were not left out.
        share : float
            Degrees of freedom over residuals: the part of the random error that a fit leaves in them.
        """
        responses = zip(self.frfs, self._known_variances, self.split(model), self.split(used), strict=True)
        return np.concatenate(
            [
                known if known is not None else _from_residuals(frf, values, lines) / share
                for frf, known, values, lines in responses
            ]
        )

    def by_line(self, residuals: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return whitened residuals (m,) as an array (n_freq, n) for each response, a row for each line.

        Those of noise are normally distributed, even if the variance is itself an estimate from few averages.
        """
        counts = [(len(frf.frequency), 2 if frf.has_phase else 1) for frf in self.frfs]
        ends = np.cumsum([lines * width for lines, width in counts])[:-1]
        parts = zip(self.frfs, np.split(residuals, ends), counts, strict=True)
        return [normal_residuals(frf, part.reshape(shape)) for frf, part, shape in parts]

    def weighted(self, variance: NDArray[np.float64], used: NDArray[np.bool_]) -> StackedResiduals[Weighted]:
        """Return the whitened residuals of the lines `used`."""
        responses = zip(self.frfs, self.split(variance), self.split(used), strict=True)
        return StackedResiduals(tuple(Weighted.against(*response) for response in responses), self.counts)

    def logarithms(self, variance: NDArray[np.float64]) -> StackedResiduals[LogAmplitude]:
        """Return the residuals of the amplitudes' logarithms."""
        pairs = zip(self.frfs, self.split(variance), strict=True)
        return StackedResiduals(tuple(LogAmplitude(*pair) for pair in pairs), self.counts)

    def squares(self, model: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return |difference|^2 (n_lines,) from a model's values; without a phase, twice that of the amplitudes."""
        pairs = zip(self.frfs, self.split(model), strict=True)
        return np.concatenate(
            [np.abs(_difference(frf, values)) ** 2 * (1.0 if frf.has_phase else 2.0) for frf, values in pairs]
        )

    @cached_property
    def level(self) -> NDArray[np.float64]:
        """Median amplitude of each line's response (n_lines,): the reference of errors that are equal on all lines."""
        levels = [float(np.median(frf.amplitude)) or float(frf.amplitude.mean()) for frf in self.frfs]
        return np.repeat(levels, self.counts)

    def discrepancy(
        self,
        model: NDArray[np.complex128],
        magnitude: NDArray[np.float64],
        variance: NDArray[np.float64],
        used: NDArray[np.bool_],
    ) -> tuple[float, float]:
        """Return the most likely errors of a model's values (n_lines,), in addition to the random error.

        They are standard deviations relative to a magnitude (n_lines,), and to the level of each response.
        """
        size, level = (np.maximum(each[used] ** 2, np.finfo(float).tiny) for each in (magnitude, self.level))
        least = _LEAST_DISCREPANCY**2 * float(level.min())
        background, relative = most_likely_parts(self.squares(model)[used], level, size, least, variance[used])
        return float(np.sqrt(relative)), float(np.sqrt(background))

    def isolated(self, size: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which lines (n_lines,) are isolated in their response, by the size of their residuals."""
        return np.concatenate([isolated_lines(sizes) for sizes in self.split(size)])

    def residual_count(self, used: NDArray[np.bool_]) -> int:
        """Return how many residuals the lines `used` have: two each where there is a phase."""
        pairs = zip(self.frfs, self.split(used), strict=True)
        return sum((2 if frf.has_phase else 1) * int(np.count_nonzero(lines)) for frf, lines in pairs)


def _difference(frf: Frf, model: NDArray[np.complex128]) -> NDArray[Any]:
    """Return a model's values (n_freq,) minus the measured ones: complex, or of amplitudes where there is no phase."""
    return model - frf.values if frf.has_phase else np.abs(model) - frf.amplitude


def _estimated(frf: Frf, model: NDArray[np.complex128] | None) -> NDArray[np.float64]:
    return estimated_variance(frf, model if model is None or frf.has_phase else np.abs(model))


def _from_residuals(frf: Frf, model: NDArray[np.complex128], used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the variance of residuals; for amplitudes, whose errors are not symmetric, that of their scatter."""
    return residual_variance(frf, model, used) if frf.has_phase else _estimated(frf, model)


@dataclass(frozen=True, eq=False)
class MeasuredLines:
    """Measured FRFs, one for each response of an assembly, and their lines within its band.

    Parameters
    ----------
    described : Assembly
        On the description's frequencies; the band reaches from the first to the last of them.
    whole : tuple of Frf
        The FRFs as they were given.
    frfs : tuple of Frf
        The FRFs on their lines within the band.
    """

    described: Assembly
    whole: tuple[Frf, ...]
    frfs: tuple[Frf, ...]

    @staticmethod
    def of(assembly: Assembly, measured: Frf | Sequence[Frf]) -> MeasuredLines:
        """Return the lines of one FRF, or of one for each response.

        Raises
        ------
        MeasurementError
            There are more or fewer FRFs than responses; or names all that have too few lines within the band.
        """
        whole = one_per_response(assembly, measured)
        pairs = zip(whole, assembly.each_response, strict=True)
        select = partial(within_band, left_out=assembly.description.left_out)
        return MeasuredLines(assembly, whole, _each(select, pairs))

    @cached_property
    def assembly(self) -> Assembly:
        """The assembly on the measured lines of each response."""
        return self.described.on(*(frf.frequency for frf in self.frfs))

    @property
    def band(self) -> tuple[float, float]:
        """The description's first and last frequency [Hz]."""
        frequency = self.described.frequency
        return float(frequency.min()), float(frequency.max())

    def resampled(self, assembly: Assembly) -> tuple[Frf, ...]:
        """Interpolate the measurements to the frequencies of an assembly, as the features of a network need them.

        Raises
        ------
        MeasurementError
            Names all that do not cover these frequencies, or whose lines are too far apart.
        """
        pairs = zip(one_per_response(assembly, self.whole), assembly.each_response, strict=True)
        return _each(on_grid, pairs)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about parts of the band without lines, and about reciprocal FRFs that differ."""
        messages = []
        for frf, alone, where in self._responses:
            ends = " and from ".join(
                f"{low:.6g} to {high:.6g} Hz" for low, high in find_missing_ends(frf, alone.frequency)
            )
            if ends:
                first, last = frf.frequency[[0, -1]]
                messages.append(
                    f"The measurement{where} has no lines from {ends}: it was compared from "
                    f"{first:.6g} to {last:.6g} Hz only."
                )
            gaps = self._gaps(frf)
            if gaps:
                messages.append(
                    f"The measurement{where} lacks lines between {_listed(gaps)}: nothing was compared there."
                )
        return (*messages, *self._reciprocity_warnings())

    def _reciprocity_warnings(self) -> Iterable[str]:
        """Yield a warning for each pair of reciprocal FRFs that differ by more than their random error.

        FRFs with a calibration are left out: they may differ.
        """
        calibrated = self.described.description.calibrations
        for (first, one, here), (second, other, there) in combinations(self._responses, 2):
            of_first, of_second = one.description.response, other.description.response
            exchanged = (of_first.point, of_first.force_point) == (of_second.force_point, of_second.point)
            if not exchanged or of_first.is_drive_point or {of_first.name, of_second.name} & calibrated.keys():
                continue
            apart, explained = _difference_of_reciprocals(first.to("receptance"), second.to("receptance"))
            if apart > max(_RECIPROCITY, _EXCESS * explained):
                yield (
                    f"The measurements{here} and{there} should be equal by reciprocity. Half of their lines differ by "
                    f"{100 * apart:.2g} % or more, and random errors explain {100 * explained:.2g} %: a gain, a "
                    "sensor or a point is not what the description says, or the structure is not linear."
                )

    @property
    def warnings_of_features(self) -> tuple[str, ...]:
        """Warnings about gaps over which the features of a network were interpolated."""
        return tuple(
            f"The measurement{where} lacks lines between {_listed(gaps)}: the network was given values "
            "interpolated over that."
            for frf, _, where in self._responses
            if (gaps := self._gaps(frf))
        )

    def _gaps(self, frf: Frf) -> list[tuple[float, float]]:
        """Return the gaps of a measurement apart from the bands that the description leaves out."""
        left_out = self.described.description.left_out
        return [
            (below, above)
            for below, above in find_gaps(frf)
            if not any(low < above and high > below for low, high in left_out)
        ]

    @property
    def _responses(self) -> Iterable[tuple[Frf, Assembly, str]]:
        """Measurement and assembly of each response, and words that say which one if there are several."""
        labels = self.described.description.response_labels
        places = [f" at {label}" if len(labels) > 1 else "" for label in labels]
        return zip(self.frfs, self.described.each_response, places, strict=True)


def _each(prepare: Callable[[Frf, NDArray[np.float64]], Frf], pairs: Iterable[tuple[Frf, Assembly]]) -> tuple[Frf, ...]:
    """Prepare each FRF for its response's frequencies; raise the faults of all FRFs together."""
    prepared, faults = [], list[Fault]()
    for frf, alone in pairs:
        try:
            prepared.append(prepare(frf, alone.frequency))
        except MeasurementError as error:
            faults += error.faults
    if faults:
        raise MeasurementError(*faults)
    return tuple(prepared)


def _difference_of_reciprocals(first: Frf, second: Frf) -> tuple[float, float]:
    """Return the median relative difference on common lines, and the one that random errors explain."""
    _, rows, others = np.intersect1d(first.frequency, second.frequency, return_indices=True)
    if not len(rows):
        return 0.0, 0.0
    pair = (first, rows), (second, others)
    values = [
        frf.values[lines] if first.has_phase and second.has_phase else frf.amplitude[lines] for frf, lines in pair
    ]
    size = np.maximum((np.abs(values[0]) + np.abs(values[1])) / 2.0, np.finfo(float).tiny)
    deviation = np.sqrt(sum(random_error_variance(frf)[lines] for frf, lines in pair))
    return float(np.median(np.abs(values[0] - values[1]) / size)), float(np.median(deviation / size))


def _listed(gaps: Sequence[tuple[float, float]]) -> str:
    named = ", ".join(f"{low:.6g} and {high:.6g} Hz" for low, high in gaps[:_MOST_GAPS])
    return f"{named}, and in {len(gaps) - _MOST_GAPS} further places" if len(gaps) > _MOST_GAPS else named
