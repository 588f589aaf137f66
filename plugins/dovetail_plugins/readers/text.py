"""Tables in text files; their headers and columns are found by Dovetail."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dovetail import Fault, Frf, FrfReader, FrfToWrite, MeasurementError, decode_text

_OTHER_TEXTS = re.compile(rb"\s*-1[ \t]*\r?\n *(\d+[ \t]*\r?\n|58b )|(\xef\xbb\xbf)?\s*LabVIEW Measurement")
"""Beginnings of universal and of LabVIEW files."""
_CONTROL = re.compile(rb"[\x01-\x08\x0e-\x1f]")
_WIDE = (b"\xff\xfe", b"\xfe\xff")
"""Byte order marks of UTF-16."""


class TextReader(FrfReader):
    """Tables with commas, semicolons, tabs or blanks between their columns."""

    name = "text"
    summary = "Tables in text files: .csv, .tsv, .txt and others"
    suffixes = (".csv", ".tsv", ".txt", ".txf", ".asc", ".dat")
    default_for = suffixes
    written = (".csv",)
    read = staticmethod(decode_text)

    def sniff(self, content: bytes) -> bool:
        """Look for digits, and for no bytes that text does not contain."""
        is_text = content[:2] in _WIDE or not (_CONTROL.search(content) or b"\x00" in content)
        return is_text and re.search(rb"\d", content) is not None and not _OTHER_TEXTS.match(content)

    def write(self, content: FrfToWrite, path: Path) -> bytes:
        """Return a CSV file with every digit of the numbers, and the FRF's other data in comments.

        Raises
        ------
        MeasurementError
            A number that is not finite.
        """
        frf = content.frf
        columns = {"frequency_Hz": frf.frequency}
        if frf.has_phase:
            columns |= {"real": content.values.real, "imag": content.values.imag}
        else:
            columns |= {"amplitude": np.abs(content.values)}
        for name, array in (("coherence", frf.coherence), ("variance", content.variance)):
            if array is not None:
                columns[name] = array
        table = np.column_stack(list(columns.values()))
        if not np.all(np.isfinite(table)):
            problem = f"{frf.label} holds numbers that are not finite: nothing is written."
            raise MeasurementError(Fault(str(path), problem))
        rows = "\n".join(",".join(map(repr, row)) for row in table.tolist())
        return f"{_comments(content)}{','.join(columns)}\n{rows}\n".encode()

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a table as `write` does, and one with units, decimal commas and the phase."""
        frf = Frf(np.array([10.0, 20.0, 30.0]), np.array([1.0, 2.0j, 3.0]), "mobility", note="bench")
        files = folder / "own.csv", folder / "other.txt"
        files[0].write_bytes(self.write(FrfToWrite(frf, frf.unit, 1.0), files[0]))
        rows = "Frequency [Hz]\tMagnitude [um/N]\tPhase [deg]\n10,5\t1,25\t-30,5\n20,5\t2,25\t-60,5\n"
        files[1].write_text(f"Date: 2026-01-01\n\n{rows}", encoding="utf-8")
        return files


def _comments(content: FrfToWrite) -> str:
    frf = content.frf
    comments: dict[str, str] = {"quantity": frf.quantity, "unit": content.unit}
    if frf.averages is not None:
        comments["averages"] = str(frf.averages)
    return "".join(f"# {name}: {text}\n" for name, text in (comments | content.texts).items())
