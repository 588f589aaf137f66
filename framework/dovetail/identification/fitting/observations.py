"""What was measured: one FRF for each response of an assembly, their lines one behind the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.identification.fitting.random_error import estimated_variance, isolated_lines, known_variance
from dovetail.identification.fitting.residuals import LogAmplitude, SideBySide, Weighted, parted

__all__ = ["Measured", "missed", "one_for_each"]

_Residual = TypeVar("_Residual", Weighted, LogAmplitude)


def one_for_each(assembly: Assembly, measured: Frf | Sequence[Frf]) -> tuple[Frf, ...]:
    """Return the measured FRFs, one for each response of the assembly in its order.

    Raises
    ------
    MeasurementError
        There are more or fewer.
    """
    given = (measured,) if isinstance(measured, Frf) else tuple(measured)
    labels = assembly.description.response_labels
    if len(given) == len(labels):
        return given
    wanted = "; ".join(f"{number}. {label}" for number, label in enumerate(labels, start=1))
    problem = f"{_counted(len(given), 'measured FRF')} {'was' if len(given) == 1 else 'were'} given"
    expected = f"'{assembly.name}' has {_counted(len(labels), 'response')}"
    remedy = "Give one FRF for each response, in this order."
    raise MeasurementError(Fault("measured", f"{problem}, and {expected}.", wanted, remedy))


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


@dataclass(frozen=True, eq=False)
class Measured:
    """Measured FRFs as residuals are made of: arrays over all lines of all responses, one response behind the other.

    Parameters
    ----------
    frfs : tuple of Frf
        One for each response, in its quantity, on the assembly's frequencies.
    """

    frfs: tuple[Frf, ...]

    @staticmethod
    def of(assembly: Assembly, measured: Frf | Sequence[Frf]) -> Measured:
        """Take one FRF, or one for each response, of any quantities.

        Raises
        ------
        MeasurementError
            There are more or fewer than responses.
        """
        pairs = zip(one_for_each(assembly, measured), assembly.description.responses, strict=True)
        return Measured(tuple(frf.to(response.quantity) for frf, response in pairs))

    @property
    def counts(self) -> tuple[int, ...]:
        """Lines of each response."""
        return tuple(len(frf.frequency) for frf in self.frfs)

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(n_lines,) Hz."""
        return np.concatenate([frf.frequency for frf in self.frfs])

    def at(self, lines: NDArray[np.intp]) -> Measured:
        """Return the values at some lines (increasing numbers); a response without any of them is left out."""
        each = zip(self.frfs, parted(lines, self.counts), strict=True)
        return Measured(
            tuple(
                Frf(frf.frequency[own], frf.values[own], frf.quantity, has_phase=frf.has_phase, rotation=frf.rotation)
                for frf, own in each
                if len(own)
            )
        )

    def split(self, lines: NDArray[Any]) -> list[NDArray[Any]]:
        """Return an array (..., n_lines) response by response."""
        return np.split(lines, np.cumsum(self.counts)[:-1], axis=-1)

    def known_variances(self) -> list[NDArray[np.float64] | None]:
        """Return the random error of each response where its measurement tells it."""
        return [known_variance(frf) for frf in self.frfs]

    def variance(
        self, known: Sequence[NDArray[np.float64] | None], explained: NDArray[np.complex128] | None = None
    ) -> NDArray[np.float64]:
        """Return E|error|^2 (n_lines,) of each line: known, or told from the scatter.

        Parameters
        ----------
        known : sequence of (n_freq,) array or None
            Of each response.
        explained : (n_lines,) array, optional
            What a model says these lines are.
        """
        said = [None] * len(self.frfs) if explained is None else self.split(explained)
        return np.concatenate(
            [
                _estimated(frf, values) if variance is None else variance
                for frf, variance, values in zip(self.frfs, known, said, strict=True)
            ]
        )

    def weighted(self, variance: NDArray[np.float64], used: NDArray[np.bool_]) -> Weighted | SideBySide[Weighted]:
        """Return the residuals over their standard deviation, of the lines `used`."""
        parts = zip(self.frfs, self.split(variance), self.split(used), strict=True)
        return _side_by_side([Weighted.against(*part) for part in parts], self.counts)

    def logarithms(self, variance: NDArray[np.float64]) -> LogAmplitude | SideBySide[LogAmplitude]:
        """Return the residuals of the amplitudes' logarithms."""
        parts = zip(self.frfs, self.split(variance), strict=True)
        return _side_by_side([LogAmplitude(*part) for part in parts], self.counts)

    def squares(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return |difference|^2 (n_lines,) from FRFs (n_lines,); twice that of amplitudes where there is no phase."""
        parts = zip(self.frfs, self.split(values), strict=True)
        return np.concatenate([np.abs(missed(frf, own)) ** 2 * (1.0 if frf.has_phase else 2.0) for frf, own in parts])

    def isolated(self, size: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which lines (n_lines,) stand alone in their response, by the size of their residuals."""
        return np.concatenate([isolated_lines(own) for own in self.split(size)])

    def residuals_of(self, used: NDArray[np.bool_]) -> int:
        """Return how many numbers the lines `used` consist of: two where there is a phase."""
        pairs = zip(self.frfs, self.split(used), strict=True)
        return sum((2 if frf.has_phase else 1) * int(np.count_nonzero(own)) for frf, own in pairs)


def missed(frf: Frf, values: NDArray[np.complex128]) -> NDArray[Any]:
    """Return how far values (n_freq,) are from a measured FRF: complex, or amplitudes where it has no phase."""
    return values - frf.values if frf.has_phase else np.abs(values) - frf.amplitude


def _estimated(frf: Frf, explained: NDArray[np.complex128] | None) -> NDArray[np.float64]:
    return estimated_variance(frf, explained if explained is None or frf.has_phase else np.abs(explained))


def _side_by_side(residuals: list[_Residual], counts: tuple[int, ...]) -> _Residual | SideBySide[_Residual]:
    return residuals[0] if len(residuals) == 1 else SideBySide(tuple(residuals), counts)
