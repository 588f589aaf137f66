"""Rows of tables in CSV and XLSX files, whose contents are not trusted."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from dovetail import DovetailError, Fault, read_bounded

_LARGEST_FILE = 20_000_000
"""Bytes of a file, and of the unpacked contents of a workbook: a channel has about 200."""
_FORMATS = "CSV (.csv) or a workbook (.xlsx)"
_MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_RELATION = "{http://schemas.openxmlformats.org/officeDocument/2006/relationships}id"


def read_rows(path: Path, sheet: str, beginning: str) -> list[list[str]]:
    """Return the cells of a table, row by row, without empty rows.

    Parameters
    ----------
    path : Path
        CSV or XLSX.
    sheet : str
        Of a workbook; empty for its only one, or the only one whose name begins with `beginning`.
    beginning : str

    Raises
    ------
    DovetailError
        The file cannot be read, or there is no such sheet, or there are several.
    """
    content = read_bounded(path, _LARGEST_FILE)
    if path.suffix.lower() == ".xlsx":
        return _workbook_rows(path, content, sheet, beginning)
    if path.suffix.lower() != ".csv":
        raise DovetailError(Fault(str(path), f"'{path.suffix}' is not the ending of a table.", _FORMATS))
    try:
        return csv_rows(content)
    except (UnicodeDecodeError, csv.Error) as error:
        raise DovetailError(Fault(str(path), f"this is not a table: {error}.", _FORMATS)) from None


def csv_rows(content: bytes) -> list[list[str]]:
    """Return the cells of a table in CSV, without empty rows.

    Raises
    ------
    UnicodeDecodeError, csv.Error
        It is not such a table.
    """
    stream = io.StringIO(content.decode("utf-8-sig"), newline="")
    rows = [[cell.strip() for cell in row] for row in csv.reader(stream)]
    return [row for row in rows if any(row)]


def plain_number(cell: str) -> float:
    """Return the number in a cell.

    Raises
    ------
    ValueError
        It is not a number, or has digits of another script or underscores, which Python would read.
    """
    return float(cell if cell.isascii() and "_" not in cell else "not a number")


def _workbook_rows(path: Path, content: bytes, sheet: str, beginning: str) -> list[list[str]]:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(member.file_size for member in archive.infolist()) > _LARGEST_FILE:
                raise DovetailError(Fault(str(path), f"the workbook unpacks to more than {_LARGEST_FILE / 1e6:g} MB."))
            sheets = _sheets(archive)
            name = _chosen(path, list(sheets), sheet, beginning)
            return list(_rows(_tree(archive, sheets[name]), _shared_texts(archive)))
    except DovetailError:
        raise
    except Exception as error:  # zipfile, zlib and ElementTree each raise their own on a damaged file
        raise DovetailError(Fault(str(path), f"the workbook cannot be read: {error}.", _FORMATS)) from None


def _tree(archive: zipfile.ZipFile, name: str) -> Any:
    """Return the root of an XML file without entities of its own."""
    from xml.etree import ElementTree

    content = archive.read(name)
    if b"<!DOCTYPE" in content:
        raise ValueError("it defines entities")
    return ElementTree.fromstring(content)


def _sheets(archive: zipfile.ZipFile) -> dict[str, str]:
    """Return the file of each sheet by the sheet's name."""
    relations = _tree(archive, "xl/_rels/workbook.xml.rels")
    target_of = {relation.get("Id"): str(relation.get("Target")) for relation in relations}
    sheets = _tree(archive, "xl/workbook.xml").iter(f"{_MAIN}sheet")
    files = {str(sheet.get("name")): target_of[sheet.get(_RELATION)] for sheet in sheets}
    return {name: file.lstrip("/") if file.startswith("/") else f"xl/{file}" for name, file in files.items()}


def _chosen(path: Path, names: Sequence[str], sheet: str, beginning: str) -> str:
    if sheet and sheet not in names:
        raise DovetailError(Fault(str(path), f"the workbook has no sheet '{sheet}'.", ", ".join(names)))
    matching = [sheet] if sheet else [name for name in names if name.lower().startswith(beginning.lower())]
    if not sheet and len(names) == 1:
        matching = list(names)
    if len(matching) != 1:
        which = f"several sheets begin with '{beginning}'" if matching else f"no sheet begins with '{beginning}'"
        remedy = "Name the sheet with 'channel_sheet' or 'impact_sheet'."
        raise DovetailError(Fault(str(path), f"{which}.", ", ".join(matching or names), remedy))
    return matching[0]


def _shared_texts(archive: zipfile.ZipFile) -> list[str]:
    if "xl/sharedStrings.xml" not in archive.namelist():
        return []
    entries = _tree(archive, "xl/sharedStrings.xml").iter(f"{_MAIN}si")
    return ["".join(part.text or "" for part in entry.iter(f"{_MAIN}t")) for entry in entries]


def _rows(tree: Any, shared: Sequence[str]) -> Iterator[list[str]]:
    for row in tree.iter(f"{_MAIN}row"):
        cells: list[str] = []
        for cell in row.iter(f"{_MAIN}c"):
            column = _column(str(cell.get("r") or ""), len(cells))
            cells += [""] * (column + 1 - len(cells))
            cells[column] = _text(cell, shared).strip()
        if any(cells):
            yield cells


def _column(reference: str, following: int) -> int:
    """Return the number of the column in a reference such as ``"AB12"``, from 0."""
    letters = re.fullmatch(r"([A-Z]{1,3})\d+", reference)
    if letters is None:
        return following
    number = 0
    for letter in letters[1]:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number - 1


def _text(cell: Any, shared: Sequence[str]) -> str:
    if cell.get("t") == "inlineStr":
        return "".join(part.text or "" for part in cell.iter(f"{_MAIN}t"))
    value = cell.find(f"{_MAIN}v")
    text = "" if value is None else str(value.text or "")
    return shared[int(text)] if cell.get("t") == "s" else text
