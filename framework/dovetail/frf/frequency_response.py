"""A frequency response function: frequency axis, complex values, and their quantity; and the agreement of two."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.errors import Fault, MeasurementError, ParameterError
from dovetail.plain_text import html_table, terminal_text

Quantity = Literal["receptance", "mobility", "accelerance"]
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)

_DERIVATIVES: dict[str, int] = {"receptance": 0, "mobility": 1, "accelerance": 2}
_PER_TIME: dict[str, str] = {"receptance": "", "mobility": " s", "accelerance": " s^2"}

LOW_COHERENCE = 0.9
"""Coherence below which two FRFs visibly differ: an amplitude by a factor of 2, or a phase by 37 degrees."""
_WINDOW, _SHORTEST = 200, 3
"""The coherence is averaged over 1/`_WINDOW` of the lines, and over at least `_SHORTEST` of them. A narrower band is
not reported."""
HIGHEST_FREQUENCY = 1e12
"""Hz; far above the frequencies of any structure. Its square times a stiffness is finite."""
LARGEST_VALUE = 1e100
"""In SI; the squares and products of values up to it are finite. The largest of an FRF must exceed its inverse."""
MOST_AVERAGES = 1_000_000
"""More than any test has; a larger number is another quantity."""
_CORRECT = "Correct the unit or the columns, or remove these lines."


def kind_of(rotation: bool, moment: bool) -> str:
    """Return the kind of an FRF, such as ``"displacement per force"``."""
    return f"{'rotation' if rotation else 'displacement'} per {'moment' if moment else 'force'}"


def unit_of(quantity: Quantity, *, rotation: bool = False, moment: bool | None = None) -> str:
    """Return the SI unit of an FRF of this quantity.

    Parameters
    ----------
    quantity : Quantity
    rotation : bool
        Of a rotation instead of a displacement.
    moment : bool, optional
        Per moment instead of force; by default as `rotation`.
    """
    below = ("N m" if (rotation if moment is None else moment) else "N") + _PER_TIME[quantity]
    return f"{'rad' if rotation else 'm'}/{f'({below})' if ' ' in below else below}"


def conversion(frequency: NDArray[np.inexact[Any]], source: Quantity, target: Quantity) -> NDArray[np.complex128]:
    """Return the factor, a power of i omega, that turns `source` into `target`.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz; complex of an FRF under an exponential window.
    source, target : {"receptance", "mobility", "accelerance"}

    Returns
    -------
    (n_freq,) complex array
    """
    power = _DERIVATIVES[target] - _DERIVATIVES[source]
    return np.asarray((2j * np.pi * frequency) ** power, dtype=np.complex128)


def _frozen(values: ArrayLike, dtype: type[np.generic]) -> NDArray[np.generic]:
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def refuse_masked(label: str, arrays: Mapping[str, ArrayLike | None]) -> None:
    """Raise a MeasurementError if a value is masked, since a copy of the array would have its hidden value."""
    for name, given in arrays.items():
        masked = np.flatnonzero(np.ma.getmaskarray(np.ma.asarray(given))) if np.ma.is_masked(given) else np.empty(0)
        if masked.size:
            places = f"place {masked[0] + 1} ({masked.size} in all)"
            raise MeasurementError(f"{label}: {name} has a masked value at {places}; leave it out of all arrays.")


def check_size(
    arrays: Mapping[str, NDArray[np.generic] | None], factor: float, averages: int | None, locate: Callable[[int], str]
) -> None:
    """Check that the values of an FRF are within the range that computations can handle.

    Parameters
    ----------
    arrays : mapping of str to (n_freq,) array or None
        "frequency" [Hz], "value" and "variance" in the file's unit.
    factor : float
        Positive; converts the values to SI.
    averages : int or None
    locate : callable
        Returns the place of the line with an index.

    Raises
    ------
    MeasurementError
        A value or a number of averages is too large, or all values are too small.
    """
    limit = LARGEST_VALUE / factor
    limits = {"frequency": HIGHEST_FREQUENCY, "value": limit, "variance": limit**2}
    for name, array in arrays.items():
        size = np.empty(0) if array is None else np.abs(array)
        beyond = np.flatnonzero(size > limits[name])
        if beyond.size:
            more = f" ({beyond.size} such lines)" if beyond.size > 1 else ""
            problem = f"the {name} is {size[beyond[0]]:.3g}, which no structure has{more}."
            raise MeasurementError(Fault(locate(int(beyond[0])), problem, f"up to {limits[name]:.3g}", _CORRECT))
        if name == "value" and 0.0 < size.max() * factor < 1.0 / LARGEST_VALUE:
            problem = f"the largest value is {size.max():.3g}, which no structure has."
            accepted = f"from {1.0 / LARGEST_VALUE / factor:.3g}"
            raise MeasurementError(Fault(locate(int(size.argmax())), problem, accepted, _CORRECT))
    if averages is not None and not 1 <= averages <= MOST_AVERAGES:
        problem = f"{str(averages)[:40]} is not a number of averages."
        raise MeasurementError(Fault(locate(0), problem, f"1 to {MOST_AVERAGES:,}"))


@dataclass(frozen=True, eq=False)
class Frf:
    """One drive-point or transfer FRF.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz, positive and strictly increasing.
    values : (n_freq,) complex array
        SI, in `quantity`. Only their amplitudes count when `has_phase` is false.
    quantity : {"receptance", "mobility", "accelerance"}
    coherence : (n_freq,) array, optional
        Ordinary coherence of the measurement, from 0 to 1.
    has_phase : bool
        False for a measurement of amplitudes only.
    label : str
        Its source, for figures and reports.
    note : str
        Free text: from its file, or the warning of the result that it was computed from.
    averages : int, optional
        Number of averages behind a measured FRF.
    variance : (n_freq,) array, optional
        E|error|^2 of each complex value, in the square of the values' unit, if it is known otherwise than from
        coherence and averages.
    rotation : bool
        True for a rotation per moment, False for a displacement per force.
    moment : bool, optional
        True for an excitation by a moment, False by a force; by default as `rotation`.
    has_unit : bool
        Whether its file gives a unit, so that a displacement per force is not one of another kind in other words.
    response, force : str
        Names of the DOFs where the motion was measured and where the force acted, such as ``"5+x"``; empty if
        unknown.
    origin : str
        Number of rows of the table it was read from, and the meaning of each column.

    Raises
    ------
    MeasurementError
        Wrong shapes, values that are not finite or too large to compute with, an axis that does not increase, an
        unknown quantity.
    """

    frequency: NDArray[np.float64]
    values: NDArray[np.complex128]
    quantity: Quantity
    coherence: NDArray[np.float64] | None = None
    has_phase: bool = True
    label: str = field(default="FRF")
    note: str = ""
    averages: int | None = None
    variance: NDArray[np.float64] | None = None
    rotation: bool = False
    response: str = ""
    force: str = ""
    origin: str = ""
    moment: bool | None = None
    has_unit: bool = False

    def __post_init__(self) -> None:
        arrays = {name: getattr(self, name) for name in ("frequency", "values", "coherence", "variance")}
        refuse_masked(self.label, arrays)
        object.__setattr__(self, "frequency", _frozen(self.frequency, np.float64))
        object.__setattr__(self, "values", _frozen(self.values, np.complex128))
        for name in ("coherence", "variance"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _frozen(getattr(self, name), np.float64))
        self._check()

    def _check(self) -> None:
        if self.quantity not in QUANTITIES:
            raise MeasurementError(f"'{self.quantity}' is not a quantity; accepted: {', '.join(QUANTITIES)}.")
        if self.frequency.ndim != 1 or self.frequency.size == 0:
            raise MeasurementError(
                f"{self.label}: the frequencies have the shape {self.frequency.shape}, not (n_freq,)."
            )
        if self.values.shape != self.frequency.shape:
            raise MeasurementError(
                f"{self.label}: {self.values.shape} values do not fit {self.frequency.shape} frequencies."
            )
        for plural, values in (("coherences", self.coherence), ("variances", self.variance)):
            if values is not None and values.shape != self.frequency.shape:
                raise MeasurementError(
                    f"{self.label}: {values.shape} {plural} do not fit {self.frequency.shape} frequencies."
                )
        if self.variance is not None and not (np.isfinite(self.variance).all() and np.all(self.variance >= 0)):
            raise MeasurementError(f"{self.label}: a variance is negative or not finite.")
        if self.coherence is not None:
            outside = np.flatnonzero((self.coherence < 0.0) | (self.coherence > 1.0))
            if outside.size:
                found = f"the coherence of line {outside[0] + 1} is {self.coherence[outside[0]]:g}"
                raise MeasurementError(f"{self.label}: {found}; it must be from 0 to 1.")
        if self.averages is not None and self.averages < 1:
            raise MeasurementError(f"{self.label}: {self.averages} averages; it must be at least 1.")
        for name, array in (("frequency", self.frequency), ("value", self.values)):
            bad = np.flatnonzero(~np.isfinite(array))
            if bad.size:
                raise MeasurementError(
                    f"{self.label}: the {name} of line {bad[0] + 1} is not finite ({bad.size} such lines)."
                )
        arrays = {"frequency": self.frequency, "value": self.values, "variance": self.variance}
        check_size(arrays, 1.0, self.averages, lambda index: f"{self.label}  line {index + 1}")
        falling = np.flatnonzero(np.diff(self.frequency) <= 0)
        if falling.size:
            raise MeasurementError(
                f"{self.label}: the frequency does not increase after line {falling[0] + 1} "
                f"({self.frequency[falling[0]]:g} Hz, then {self.frequency[falling[0] + 1]:g} Hz)."
            )
        if self.frequency[0] <= 0:
            raise MeasurementError(
                f"{self.label}: the first frequency is {self.frequency[0]:g} Hz; it must be positive."
            )

    def __repr__(self) -> str:
        note = f"; {self.note}" if self.note else ""
        values = self.quantity if self.has_phase else f"amplitude of the {self.quantity}"
        band = f"{self.frequency.size} lines from {self.frequency[0]:g} to {self.frequency[-1]:g} Hz"
        return f"<Frf: {terminal_text(f'{self.label}, {values}, {band}{note}')}>"

    def _repr_html_(self) -> str:
        rows = [
            ("unit", self.unit),
            ("largest amplitude", f"{self.amplitude.max():.4g} at {self.frequency[self.amplitude.argmax()]:g} Hz"),
            ("mean coherence", "" if self.coherence is None else f"{self.coherence.mean():.3f}"),
            ("averages", str(self.averages or "")),
            ("response", self.response),
            ("force", self.force),
            ("origin", self.origin),
        ]
        return html_table(repr(self), [("", ""), *(row for row in rows if row[1])])

    @property
    def unit(self) -> str:
        """SI unit of the values."""
        return unit_of(self.quantity, rotation=self.rotation, moment=self.moment)

    @property
    def by_moment(self) -> bool:
        """Whether a moment acts instead of a force."""
        return self.rotation if self.moment is None else self.moment

    @property
    def kind(self) -> str:
        """The kind of FRF, such as ``"displacement per force"``."""
        return kind_of(self.rotation, self.by_moment)

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """(n_freq,) magnitude, in the SI unit of the quantity."""
        return np.abs(self.values)

    @property
    def phase(self) -> NDArray[np.float64]:
        """(n_freq,) phase in radians, from -pi to pi."""
        return np.angle(self.values)

    @property
    def random_variance(self) -> NDArray[np.float64] | None:
        """(n_freq,) E|error|^2 of each complex value, or None if it is unknown.

        It is `variance`, or follows from coherence c and n averages: ``|H|^2 (1 - c) / (c (n - 1))``, twice the square
        of the normalised random error of an amplitude (Bendat and Piersol, Random Data, 4th ed., Table 9.6). The table
        has n instead of n - 1 and the true coherence. A measured coherence is estimated from the same n averages as
        H, which costs one of them. The variance is infinite where the coherence is 0, and None for a single average,
        whose coherence is always 1.
        """
        if self.variance is not None:
            return self.variance
        if self.coherence is None or self.averages is None or self.averages < 2:
            return None
        with np.errstate(divide="ignore"):
            ratio = (1 - self.coherence) / (self.coherence * (self.averages - 1))
        return np.where(self.coherence > 0, self.amplitude**2 * ratio, np.inf)

    def to(self, quantity: Quantity) -> Frf:
        """Return the same FRF as another quantity (a factor of i omega for each derivative)."""
        if quantity not in QUANTITIES:
            raise MeasurementError(f"'{quantity}' is not a quantity; accepted: {', '.join(QUANTITIES)}.")
        factor = conversion(self.frequency, self.quantity, quantity)
        values = self.values * (factor if self.has_phase else np.abs(factor))
        variance = None if self.variance is None else self.variance * np.abs(factor) ** 2
        return replace(self, values=values, quantity=quantity, variance=variance)


def in_bands(frequency: NDArray[np.float64], bands: Iterable[tuple[float, float]]) -> NDArray[np.bool_]:
    """Return which frequencies (n_freq,) lie in one of some bands, their ends included; all in Hz."""
    inside = np.zeros(frequency.shape, dtype=np.bool_)
    for low, high in bands:
        inside |= (frequency >= low) & (frequency <= high)
    return inside


def coherence_spectrum(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """Agreement of two complex FRFs, line by line.

    Parameters
    ----------
    first, second : (..., n_freq) complex arrays
        The two FRFs, of the same quantity.

    Returns
    -------
    (..., n_freq) array
        ``|h1 + h2|^2 / (2 (|h1|^2 + |h2|^2))``: 1 where they are equal or both zero, 0 where they are opposite.

    References
    ----------
    Eq. 15 of Processes 14 (2026) 1875, doi:10.3390/pr14121875.
    """
    h1, h2 = np.asarray(first, dtype=np.complex128), np.asarray(second, dtype=np.complex128)
    energy = 2.0 * (np.abs(h1) ** 2 + np.abs(h2) ** 2)
    agreement: NDArray[np.float64] = np.divide(np.abs(h1 + h2) ** 2, energy, out=np.ones_like(energy), where=energy > 0)
    return agreement


def coherence_with_model(measured: Frf, values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the agreement (n_freq,) of a measurement with a model's values; of the amplitudes if it has no phase."""
    if measured.has_phase:
        return coherence_spectrum(measured.values, values)
    return coherence_spectrum(measured.amplitude, np.abs(values))


def poor_bands(frequency: NDArray[np.float64], coherence: NDArray[np.float64]) -> tuple[tuple[float, float], ...]:
    """Return the bands [Hz] in which two FRFs agree poorly, those first that lower the mean coherence most.

    Parameters
    ----------
    frequency, coherence : (n_freq,) arrays

    Returns
    -------
    tuple of (float, float)
        The mean coherence in each is below `LOW_COHERENCE`, as is that of its first and of its last line.
    """
    window = max(_SHORTEST, len(frequency) // _WINDOW)
    padded = np.pad(coherence, (window // 2, (window - 1) // 2), mode="edge")
    lines = np.flatnonzero(np.convolve(padded, np.full(window, 1.0 / window), mode="valid") < LOW_COHERENCE)
    bands = []
    for run in np.split(lines, np.flatnonzero(np.diff(lines) > window) + 1):
        low = run[coherence[run] < LOW_COHERENCE]
        if low.size:
            first, last = int(low[0]), int(low[-1])
            deficit = float(np.sum(LOW_COHERENCE - coherence[first : last + 1]))
            bands.append((-deficit, float(frequency[first]), float(frequency[last])))
    return tuple((low, high) for deficit, low, high in sorted(bands) if deficit < 0.0)


def checked_axis(frequency: ArrayLike) -> NDArray[np.float64]:
    """Return the frequencies of an assembly (n_freq,) as an array.

    Raises
    ------
    ParameterError
        They are not increasing positive numbers.
    """
    axis = np.asarray(frequency, dtype=np.float64)
    accepted = "(n_freq,) numbers in Hz, positive and increasing"
    if axis.ndim != 1:
        raise ParameterError(Fault("frequency", f"its shape is {axis.shape}.", accepted))
    before = np.concatenate([[0.0], axis[:-1]])
    wrong = np.flatnonzero(~(np.isfinite(axis) & (axis > before)))
    if wrong.size:
        first = int(wrong[0])
        problem = f"line {first + 1} is {axis[first]:g} Hz" + (f", after {axis[first - 1]:g} Hz." if first else ".")
        raise ParameterError(Fault("frequency", problem, accepted))
    return axis


def same_axes(some: Sequence[NDArray[np.float64]], others: Sequence[NDArray[np.float64]]) -> bool:
    """Return whether the frequencies of all responses are equal, one to one."""
    return all(one is other or np.array_equal(one, other) for one, other in zip(some, others, strict=True))
