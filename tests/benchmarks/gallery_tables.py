"""Tables of the gallery's pages: how like two FRFs are, and what a result says in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

import dovetail


def frac(first: NDArray[np.complex128], second: NDArray[np.complex128]) -> float:
    """Return the frequency response assurance criterion of two FRFs of shape (n_lines,)."""
    powers = np.vdot(first, first).real * np.vdot(second, second).real
    return float(abs(np.vdot(first, second)) ** 2 / powers)


def magnitude_error(model: NDArray[np.complex128], frf: NDArray[np.complex128]) -> float:
    """Return the median over the lines of the difference of magnitudes, as a part of the larger one."""
    separate = np.abs(np.log(np.abs(model) / np.abs(frf)))
    return float(1 - np.exp(-np.median(separate)))


def rows(header: str, lines: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; the header's cells are separated by bars."""
    titles = header.split("|")
    table = [titles, ["---"] * len(titles), *lines]
    return "".join(f"| {' | '.join(cell.strip() for cell in line)} |\n" for line in table)


def named(result: dovetail.Identification, assembly: dovetail.Assembly) -> dict[str, float]:
    """Return the identified values by the names of the assembly's parameters."""
    return {parameter.name: float(value) for parameter, value in zip(assembly.parameters, result.theta, strict=True)}


def predictions(
    assembly: dovetail.Assembly, theta: Mapping[str, float], measured: Sequence[dovetail.Frf], derivatives: int = 0
) -> list[tuple[float, float]]:
    """Return FRAC and magnitude error of each response over the assembly's band, of FRFs derived so often by time."""
    band = assembly.frequency[0], assembly.frequency[-1]
    frequency = measured[0].frequency
    inside = (frequency >= band[0]) & (frequency <= band[1])
    on_lines = assembly.on(frequency[inside])
    models = on_lines.frfs(on_lines.vector(theta))
    slope = frequency[inside] ** derivatives
    pairs = [(model * slope, frf.values[inside] * slope) for model, frf in zip(models, measured, strict=True)]
    return [(frac(*pair), magnitude_error(*pair)) for pair in pairs]


def pairs(compared: Sequence[tuple[float, float]]) -> list[str]:
    """Return the cells of FRAC and magnitude error of several responses."""
    return [f"{likeness:.3f}, {percent(error)}" for likeness, error in compared]


def percent(error: float) -> str:
    """Return a relative error in per cent."""
    return f"{100 * error:.0f} %"


def interval_of_band(band: tuple[float, float]) -> str:
    """Return a band in words."""
    return f"{band[0]:.0f} to {band[1]:.0f} Hz"


def word(result: dovetail.Identification) -> str:
    """Return the word for how well the model fits."""
    return "not judged" if result.adequacy is None else result.adequacy.word


def sentence(result: dovetail.Identification) -> str:
    """Return what the program says of the errors of the model."""
    return "" if result.adequacy is None else result.adequacy.sentence + "\n"
