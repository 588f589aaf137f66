"""FRFs in comma-separated text."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf, Quantity
from dovetail.measurement.recording import MOST_LINES, Recording, known_quantity

__all__ = ["decode", "encode"]

_HEADERS = (
    ("frequency_Hz", "real", "imag"),
    ("frequency_Hz", "amplitude", "phase_deg"),
    ("frequency_Hz", "amplitude"),
)
_COHERENCE = "coherence"
_MOST_COMMENTS = 1000
_QUANTITY = re.compile(r"#\s*quantity\s*[:=]\s*(.*?)\s*$", re.IGNORECASE)


def decode(path: Path, content: bytes, _index: int | None) -> Recording:
    """Return what a CSV file holds.

    Raises
    ------
    MeasurementError
        Not text, a header that is not understood, or a line that does not fit it.
    """
    lines = _lines(path, content)
    header_line, quantity = _preamble(path, lines)
    columns = _columns(f"{path}:{header_line + 1}", lines[header_line])
    numbers, table = _table(path, lines, header_line + 1, columns)
    by_name = dict(zip(columns, table.T, strict=True))
    negative = np.flatnonzero(by_name.get("amplitude", np.zeros(1)) < 0)
    if negative.size:
        found = f"the amplitude {by_name['amplitude'][negative[0]]:.6g} is negative (decibels are not read)."
        raise MeasurementError(Fault(f"{path}:{numbers[negative[0]]}", found, "an amplitude of zero or more"))
    return Recording(
        where=str(path),
        label=path.name,
        frequency=by_name["frequency_Hz"],
        values=_values(by_name),
        has_phase="amplitude" not in by_name or "phase_deg" in by_name,
        quantity=quantity,
        is_stated=quantity is not None,
        coherence=by_name.get(_COHERENCE),
        place=lambda index: f"{path}:{numbers[index]}",
        how_to_state_quantity="a line '# quantity: accelerance' before the header",
    )


def encode(frf: Frf, path: Path, _binary: bool | None) -> bytes:
    """Return a CSV file with the quantity in a comment and every digit of the numbers.

    Raises
    ------
    MeasurementError
        A coherence that is not finite.
    """
    columns = {"frequency_Hz": frf.frequency}
    if frf.has_phase:
        columns |= {"real": frf.values.real, "imag": frf.values.imag}
    else:
        columns |= {"amplitude": frf.amplitude}
    if frf.coherence is not None:
        columns[_COHERENCE] = frf.coherence
    table = np.column_stack(list(columns.values()))
    if not np.all(np.isfinite(table)):
        raise MeasurementError(Fault(str(path), f"{frf.label} holds numbers that are not finite: nothing is written."))
    rows = "\n".join(",".join(map(repr, row)) for row in table.tolist())
    return f"# quantity: {frf.quantity}\n{','.join(columns)}\n{rows}\n".encode()


def _lines(path: Path, content: bytes) -> list[str]:
    if max(content.count(b"\n"), content.count(b"\r")) > MOST_LINES + _MOST_COMMENTS:
        raise MeasurementError(Fault(str(path), "the file has too many lines.", f"at most {MOST_LINES:,} lines"))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MeasurementError(
            Fault(str(path), f"the file is not text: byte {error.start + 1} is not UTF-8.", "comma-separated text")
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _preamble(path: Path, lines: list[str]) -> tuple[int, Quantity | None]:
    """Return the index of the header and the quantity that a comment before it names."""
    quantity: Quantity | None = None
    for number, line in enumerate(lines):
        text = line.strip()
        if text and not text.startswith("#"):
            return number, quantity
        if match := _QUANTITY.match(text[:200]):
            quantity = known_quantity(match[1].lower(), f"{path}:{number + 1}")
    raise MeasurementError(Fault(str(path), "there is no header.", _accepted_headers()))


def _columns(where: str, line: str) -> tuple[str, ...]:
    given = [word.strip().strip('"').lower() for word in line[:200].split(",")]
    for header in _HEADERS:
        for columns in (header, (*header, _COHERENCE)):
            if given == [name.lower() for name in columns]:
                return columns
    shown = line if len(line) <= 60 else f"{line[:60]}..."
    raise MeasurementError(Fault(where, f"the header {shown!r} is not understood.", _accepted_headers()))


def _accepted_headers() -> str:
    headers = " | ".join(",".join(header) for header in _HEADERS)
    return f"{headers}, each with or without a last column {_COHERENCE}"


def _table(path: Path, lines: list[str], first: int, columns: tuple[str, ...]) -> tuple[list[int], NDArray[np.float64]]:
    """Return the line number of each row, from 1, and the (n_freq, n_columns) numbers."""
    numbers: list[int] = []
    rows: list[list[float]] = []
    for number, line in enumerate(lines[first:], start=first + 1):
        if not line.strip():
            continue
        cells = line.split(",", len(columns))
        if len(cells) != len(columns):
            count = line.count(",") + 1
            raise MeasurementError(
                Fault(
                    f"{path}:{number}",
                    f"the line has {count} column{'s' * (count != 1)}, the header {len(columns)}.",
                    ",".join(columns),
                )
            )
        numbers.append(number)
        rows.append([_number(cell, f"{path}:{number}", name) for cell, name in zip(cells, columns, strict=True)])
    if not rows:
        raise MeasurementError(Fault(str(path), "there is no line after the header."))
    return numbers, np.array(rows, dtype=np.float64)


def _number(cell: str, where: str, name: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise MeasurementError(Fault(where, f"{cell.strip()[:40]!r} in column {name} is not a number.")) from None


def _values(by_name: dict[str, NDArray[np.float64]]) -> NDArray[np.float64] | NDArray[np.complex128]:
    if "real" not in by_name and "phase_deg" not in by_name:
        return by_name["amplitude"]
    values = np.empty(by_name["frequency_Hz"].size, dtype=np.complex128)
    if "real" in by_name:
        values.real, values.imag = by_name["real"], by_name["imag"]
        return values
    phase = np.deg2rad(by_name["phase_deg"])
    with np.errstate(invalid="ignore"):  # an infinite phase becomes NaN, and the recording refuses it
        values.real = by_name["amplitude"] * np.cos(phase)
        values.imag = by_name["amplitude"] * np.sin(phase)
    return values
