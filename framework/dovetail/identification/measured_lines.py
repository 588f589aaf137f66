"""Measured FRFs, one for each response of an assembly, each on its own lines within the assembly's band."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.description import Description, Place, direction_name
from dovetail.errors import Fault, Importance, MeasurementError, Note, listing
from dovetail.frf import Frf
from dovetail.frf.resonance_peaks import resonance_peaks
from dovetail.frf.resonances import fit_resonances
from dovetail.inference.fitting import refine
from dovetail.interfaces import Progress
from dovetail.measurement import ModelDof, Role, check_roles, find_gaps, find_missing_ends, on_grid, within_band
from dovetail.measurement.roles import PHASE_ERROR, SUSPICIOUS, contradictions, power_delivered
from dovetail.problem import Problem
from dovetail.problem.merged_lines import MOST_LINES, every_nth_line, merged_lines
from dovetail.problem.observations import one_per_response
from dovetail.problem.random_error import random_error_variance

_RECIPROCITY, _EXCESS = 0.05, 3.0
"""Relative difference of two reciprocal FRFs that is reported, and its ratio to the one that random errors explain."""
_LINES_OF_WIDTH = 2.0
"""Lines within the half-power width of a resonance below which this is reported."""
_SHARP = 0.75
"""Amplitude two lines from a peak, over that of the peak, below which it may be as narrow as two lines: one that is has
0.45 to 0.62, by where the lines lie."""
_FEWEST_OF_PEAK = 5
"""Lines of a measurement in which a peak has a width."""
_MOST_GAPS = 5
"""Largest number of gaps that a warning lists."""
_MUCH = 0.1
"""Share of the band without lines from which this decides what the result is worth."""


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
        The FRFs on their lines within the band, or fewer instead of them.
    all_lines : MeasuredLines, optional
        With all lines within the band, where `frfs` have fewer.
    start : (n_params,) array, optional
        SI values that fit `frfs`.
    unweighted : tuple of Frf or None
        The same with their own random error, if the user weights the lines otherwise.
    """

    described: Assembly
    whole: tuple[Frf, ...]
    frfs: tuple[Frf, ...]
    all_lines: MeasuredLines | None = None
    start: NDArray[np.float64] | None = None
    unweighted: tuple[Frf, ...] | None = None

    @staticmethod
    def of(assembly: Assembly, measured: Frf | Sequence[Frf]) -> MeasuredLines:
        """Return the lines of one FRF, or of one for each response.

        Raises
        ------
        MeasurementError
            There are more or fewer FRFs than responses, or the DOFs in a file are not those of its response; or names
            all that have too few lines within the band.
        """
        whole = check_measured(assembly.description, measured)
        select = partial(within_band, left_out=assembly.description.left_out)
        return MeasuredLines(assembly, whole, _each(select, whole, _axes(assembly)))

    @cached_property
    def assembly(self) -> Assembly:
        """The assembly on the measured lines of each response."""
        return self.described.on(*(frf.frequency for frf in self.frfs))

    @cached_property
    def problem(self) -> Problem:
        """The problem of these lines."""
        return Problem.of(self.assembly, self.frfs, self.unweighted)

    @property
    def per_group(self) -> int:
        """How many neighbouring lines become one so that at most `MOST_LINES` are fitted."""
        return -(-sum(len(frf.frequency) for frf in self.frfs) // MOST_LINES)

    @property
    def every_nth(self) -> MeasuredLines:
        """The same with every n-th line only, where there are more than can be fitted."""
        if self.per_group == 1:
            return self
        few = tuple(every_nth_line(frf, self.per_group) for frf in self.frfs)
        own = self.unweighted and tuple(every_nth_line(frf, self.per_group) for frf in self.unweighted)
        return replace(self, frfs=few, all_lines=self, unweighted=own)

    def merged(self, seed: int, progress: Progress) -> MeasuredLines:
        """Return the means of neighbouring lines, where there are more than can be fitted.

        Of amplitudes, and of lines with the user's weights, every n-th line is returned.

        Parameters
        ----------
        seed : int
            Of a fit to every n-th line, about which the others are averaged.
        progress : Progress
        """
        few = self.every_nth
        if few is self or self.unweighted is not None:
            return few
        theta = refine(few.problem, seed=seed, progress=progress).theta
        frfs = tuple(
            merged_lines(alone, len(thinned.frequency), theta) if thinned.has_phase else thinned
            for alone, thinned in zip(self.problem.each_response, few.frfs, strict=True)
        )
        return MeasuredLines(self.described, self.whole, frfs, self, theta)

    @property
    def record(self) -> dict[str, Any]:
        """What the provenance of a result records of the measurement."""
        first, *others = self.whole
        further = {"further_measurements": [frf.label for frf in others]} if others else {}
        about = {"measurement": first.label, "measurement_note": first.note, "measured_quantity": first.quantity}
        return {**about, **further}

    @property
    def band(self) -> tuple[float, float]:
        """The description's first and last frequency [Hz]."""
        frequency = self.described.frequency
        return float(frequency.min()), float(frequency.max())

    def resampled(self, assembly: Assembly) -> tuple[Frf, ...]:
        """Interpolate the measurements to the frequencies of an assembly.

        Raises
        ------
        MeasurementError
            Names all that do not cover these frequencies, or whose lines are too far apart.
        """
        return _each(on_grid, one_per_response(assembly.description, self.whole), _axes(assembly))

    def amplitudes_on(self, assembly: Assembly) -> NDArray[np.float64]:
        """Return the accelerance's amplitudes of all resampled responses, in one row (1, n_responses n_freq)."""
        return np.concatenate([frf.to("accelerance").amplitude for frf in self.resampled(assembly)])[np.newaxis]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about parts of the band without lines, and about FRFs that are not reciprocal or not passive."""
        if self.all_lines is not None:
            return (*self.all_lines.warnings, self._fewer_lines)
        messages: list[str] = []
        for frf, alone, where in self._responses:
            missing, (first, last) = find_missing_ends(frf, alone.frequency), frf.frequency[[0, -1]]
            if missing:
                ends = " and from ".join(f"{low:.6g} to {high:.6g} Hz" for low, high in missing)
                message = (
                    f"The measurement{where} has no lines from {ends}: it was compared from "
                    f"{first:.6g} to {last:.6g} Hz only."
                )
                messages.append(Note(message, self._importance(missing)))
            gaps = self._gaps(frf)
            if gaps:
                message = f"The measurement{where} lacks lines between {_listed(gaps)}: nothing was compared there."
                messages.append(Note(message, self._importance(gaps)))
        return (*messages, *self._reciprocity_warnings(), *self._power_warnings())

    @property
    def _fewer_lines(self) -> str:
        """Warning about lines that were merged or left out."""
        assert self.all_lines is not None
        count, fitted = (sum(len(frf.frequency) for frf in lines.frfs) for lines in (self.all_lines, self))
        are_means = self.unweighted is None and all(frf.has_phase for frf in self.frfs)
        how = "as means of neighbouring ones" if are_means else "evenly chosen"
        return f"The measurement has {count:,} lines: {fitted:,} were fitted, {how}."

    def _power_warnings(self) -> Iterable[str]:
        """Yield a warning for each drive point that delivers power, unless its calibration turns the phase."""
        chains = self.described.description.calibrations
        for frf, alone, where in self._responses:
            response = alone.description.response
            if not response.is_drive_point or response.name in chains:
                continue
            share = power_delivered(frf, random_error_variance(frf), turn=PHASE_ERROR)
            if share > SUSPICIOUS:
                yield Note(
                    f"As measured, the structure delivers {100.0 * share:.0f} % of the power{where}, where it is "
                    "driven, which no passive structure does: perhaps the force was at another point than the sensor, "
                    "or a phase is wrong.",
                    Importance.DECISIVE,
                )

    def _importance(self, missing: Sequence[tuple[float, float]]) -> Importance:
        """Return how much it matters that parts of the band were not measured."""
        low, high = self.band
        share = sum(above - below for below, above in missing) / (high - low)
        return Importance.DECISIVE if share >= _MUCH else Importance.LIMITING

    def narrow_resonances(self, fitted: Sequence[NDArray[np.complex128]]) -> Iterable[str]:
        """Yield a warning for each measurement with peaks that are narrower than two of its lines.

        Parameters
        ----------
        fitted : sequence of (n_freq,) complex arrays
            The model's FRF on the lines of each measurement; its poles have the width.
        """
        for (frf, _, where), values in zip(self._responses, fitted, strict=True):
            if len(frf.frequency) < _FEWEST_OF_PEAK:
                continue
            spacing, peaks = np.gradient(frf.frequency), _sharp_peaks(frf)
            narrow = list[str]()
            for pole in fit_resonances([frf], [values]).poles if peaks.size else ():
                lines = float(np.interp(pole.real, frf.frequency, spacing))
                is_measured = np.min(np.abs(peaks - pole.real)) < max(lines, 2.0 * pole.imag)
                if is_measured and 2.0 * pole.imag < _LINES_OF_WIDTH * lines:
                    narrow.append(f"{pole.real:.5g} Hz ({2.0 * pole.imag:.2g} Hz wide, lines every {lines:.2g} Hz)")
            if narrow:
                yield (
                    f"The measurement{where} has resonances narrower than two of its lines, "
                    f"at {listing(narrow, _MOST_GAPS)}: their damping and height depend on one or two values. "
                    "Measure with a finer resolution."
                )

    def _reciprocity_warnings(self) -> Iterable[str]:
        """Yield a warning for each pair of reciprocal FRFs that differ by more than their random error.

        FRFs with a calibration are left out: they may differ.
        """
        calibrated = self.described.description.calibrations
        for (first, one, one_place), (second, other, other_place) in combinations(self._responses, 2):
            first_response, second_response = one.description.response, other.description.response
            exchanged = (first_response.terms, first_response.force_terms) == (
                second_response.force_terms,
                second_response.terms,
            )
            if (
                not exchanged
                or first_response.is_drive_point
                or {first_response.name, second_response.name} & calibrated.keys()
            ):
                continue
            difference, explained = _difference_of_reciprocals(first.to("receptance"), second.to("receptance"))
            if difference > max(_RECIPROCITY, _EXCESS * explained):
                yield Note(
                    f"The measurements{one_place} and{other_place} should be equal by reciprocity. Half of their lines "
                    f"differ by {100 * difference:.2g} % or more, and random errors explain {100 * explained:.2g} %: a "
                    "gain, a sensor or a point is not what the description says, or the structure is not linear.",
                    Importance.DECISIVE,
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
        """Return the gaps of a measurement except the bands that the description leaves out."""
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


def check_measured(description: Description, measured: Frf | Sequence[Frf]) -> tuple[Frf, ...]:
    """Return the measured FRFs, one for each described response, whose files do not contradict the responses.

    Raises
    ------
    MeasurementError
        There are more or fewer, or they do.
    """
    frfs = one_per_response(description, measured)
    check_roles(roles_of(description, frfs), substructures=moving_parts(description), passive=False)
    return frfs


def roles_of(description: Description, frfs: Sequence[Frf]) -> list[Role]:
    """Return what FRFs are used as, of which there is one for each response."""
    return [
        Role(frf, _model_dof(description, response), _model_dof(description, response.force or response))
        for frf, response in zip(frfs, description.responses, strict=True)
    ]


def _sharp_peaks(frf: Frf) -> NDArray[np.float64]:
    """Return the peaks [Hz] from which the amplitude falls steeply within two lines, on both sides."""
    peaks, amplitude = resonance_peaks(frf), frf.to("accelerance").amplitude
    at = np.array([int(np.argmin(np.abs(frf.frequency - peak))) for peak in peaks], dtype=np.intp)
    sides = np.maximum(amplitude[np.maximum(at - 2, 0)], amplitude[np.minimum(at + 2, len(amplitude) - 1)])
    return peaks[sides < _SHARP * amplitude[at]]


def batch_contradictions(description: Description, measured: Sequence[Frf | Sequence[Frf] | None]) -> dict[int, Fault]:
    """Return which measurements of a batch have other DOFs than most, as the first of the contradictions of each.

    Parameters
    ----------
    description : Description
    measured : sequence
        An FRF each, or one for each response; None for one that cannot be read.

    Returns
    -------
    mapping of int to Fault
        By the number in the sequence. Those that contradict the responses by themselves are left out.
    """
    find, sound = partial(contradictions, substructures=moving_parts(description)), dict[int, list[Role]]()
    for number, given in enumerate(measured):
        frfs = (given,) if isinstance(given, Frf) else tuple(given or ())
        if len(frfs) == len(description.responses):
            roles = roles_of(description, frfs)
            if not any(find(roles)):
                sound[number] = roles
    if not sound:
        return {}
    dofs = {number: tuple(role.dofs for role in roles) for number, roles in sound.items()}
    usual, _ = Counter(dofs.values()).most_common(1)[0]
    reference = next(roles for number, roles in sound.items() if dofs[number] == usual)
    others = {number: roles for number, roles in sound.items() if dofs[number] != usual}
    found = {number: next(find([*reference, *roles]), None) for number, roles in others.items()}
    return {number: fault for number, fault in found.items() if fault is not None}


def moving_parts(description: Description) -> dict[str, bool]:
    """Return the names of all substructures, and whether they move."""
    return {name: not model.grounded for name, model in description.substructures.items()}


def _axes(assembly: Assembly) -> list[NDArray[np.float64]]:
    """Return the frequencies of each response."""
    return [alone.frequency for alone in assembly.each_response]


def _model_dof(description: Description, place: Place) -> ModelDof:
    nodes = description.substructures[place.substructure].nodes
    label, position, directions = nodes[place.node].label, nodes[place.node].position, nodes[place.node].directions
    in_space = not set(directions) <= {"x", "rz"}
    words, direction = description.point_label(place), direction_name(place.direction) if in_space else ""
    labels = tuple(other.label for other in nodes)
    return ModelDof(words, place.rotation, place.substructure, label, labels, position, direction)


def _each(
    prepare: Callable[[Frf, NDArray[np.float64]], Frf], frfs: Sequence[Frf], axes: Iterable[NDArray[np.float64]]
) -> tuple[Frf, ...]:
    """Prepare each FRF for its response's frequencies; raise the faults of all FRFs together."""
    prepared, faults = [], list[Fault]()
    for frf, frequency in zip(frfs, axes, strict=True):
        try:
            prepared.append(prepare(frf, frequency))
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
