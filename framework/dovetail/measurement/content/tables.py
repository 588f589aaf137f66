"""FRFs in tables of text, with commas, semicolons, tabs or blanks between the columns.

A table has comments (``# quantity: mobility``) or any other lines, a header with the names of the columns, perhaps a
row of units, the rows of numbers, and perhaps lines of text below. `read_header` assigns the columns to the fields of
the FRF, and `decode_table` reads the numbers.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, argument, did_you_mean
from dovetail.frf import MOST_AVERAGES, Quantity
from dovetail.interfaces import Statement
from dovetail.measurement.content.column_names import (
    FIELD_NAMES,
    FIELD_WORDS,
    NUMERIC_FIELDS,
    VALUE_FIELDS,
    assign_fields,
    check_same_signal,
    column_word,
    combine_values,
    names_and_units,
    quantities_in,
    taken_for,
)
from dovetail.measurement.content.part_units import check_parts
from dovetail.measurement.content.text_tables import TextTable, find_rows, find_table, read_rows
from dovetail.measurement.free_text import FieldClaim, FreeText, read_texts
from dovetail.measurement.frf_units import UnitMeaning, UnitReading, meaning_of_unit, read_unit
from dovetail.measurement.named_points import DOF
from dovetail.measurement.point_statements import PointStatement, points_of_column, title_points
from dovetail.measurement.quantity_words import axis_unit_in_name, unit_in_name
from dovetail.measurement.recording import (
    ReadOptions,
    Recording,
    parse_quantity,
    point_fields,
)
from dovetail.measurement.statements import check_axis, fields_of, meaning_of_file

_COMMENT = re.compile(r"[#%]\s*(quantity|unit|averages|note|response|force)\s*[:=]\s*(.*?)\s*$", re.IGNORECASE)
_NEXT_KEY = re.compile(r"[,;]\s+[^\W\d_]+\s*[:=]")
_DECIBEL = re.compile(r"db(?:\s*(?:re|ref)?\.?:?\s*(?:1(?:\.0*)?\s*)?(?=\D)(.*))?", re.IGNORECASE)
_PURE = ("", "-", "1", "none")
_HEADERS = (
    "frequency_Hz,real,imag | frequency_Hz,amplitude,phase_deg | frequency_Hz,amplitude, "
    "each with or without a last column coherence"
)
SAY_COLUMNS = "Say what each column holds: `columns=['frequency', 'real', 'imag', 'skip']`."
_SKIP = "skip"
_LONGEST = 1000
_PLAIN = ("real", "imag", "amplitude")
"""Names that state no more than a part."""


class Header(NamedTuple):
    """The meaning of a table's columns.

    Parameters
    ----------
    columns : mapping of str to int
        From the fields of the FRF to columns.
    names : tuple of str
        Of the columns, without their units.
    unit : str
        Of the values; empty if none is given.
    comments : mapping of str to str
        Statements in the lines above: quantity, averages, note, response, force.
    taken : sequence of str
        Sentences on what each column is taken for.
    statements : sequence of Statement
        What the header states.
    claims : sequence of FieldClaim
        Units of the coherence and the variance.
    points : sequence of PointStatement
        What the names of the columns say of the FRF's points.
    """

    columns: Mapping[str, int]
    names: tuple[str, ...]
    unit: str
    comments: Mapping[str, str]
    taken: Sequence[str]
    statements: Sequence[Statement]
    claims: Sequence[FieldClaim] = ()
    points: Sequence[PointStatement] = ()


def decode_table(path: Path, text: str, options: ReadOptions) -> Recording:
    """Return the FRF in a table.

    Raises
    ------
    MeasurementError
        A header that is not understood, or a line that does not fit it.
    """
    if options.chooses:
        problem = f"{options.chooses} chooses one of several FRFs; a {path.suffix} file holds one FRF."
        raise MeasurementError(Fault(str(path), problem))
    lines = text.split("\n")
    table = _table(str(path), lines, options)
    where = "the argument columns" if options.columns else f"{path}:{table.line + 1}"
    header = read_header(where, table.header, table.units, options.names, _comments_above(str(path), table))
    wanted = sorted(header.columns.values())
    numbers, rows = read_rows(table, header.names, wanted, header.columns.get("values"))
    arrays = {field: rows[wanted.index(column)] for field, column in header.columns.items()}
    if "values" in arrays and not arrays["values"].imag.any():
        name = header.names[header.columns["values"]]
        problem = f"'{name}' holds real numbers only: amplitudes, or the real parts alone."
        remedy = f"If they are amplitudes, say so: {argument('names', {'amplitude': name})}."
        raise MeasurementError(Fault(where, problem, "complex numbers in one column, or real and imag in two", remedy))

    def locate(index: int) -> str:
        return f"{path}:{numbers[index]}"

    return recording_of(path, header, arrays, locate, _texts_around(path, table, options))


def _texts_around(path: Path, table: TextTable, options: ReadOptions) -> FreeText:
    """Return what the lines around a table state, without the comments that are read by their keys."""
    is_own = table.header[0] == "frequency_Hz" and {"quantity", "unit"} <= {*_comments_above(str(path), table)}

    def is_read(line: str) -> bool:
        match = _own_comment(line)
        if match is None or is_own:  # a note that Dovetail wrote is a remark
            return match is not None
        return (
            DOF.fullmatch(match[2]) is not None
            if match[1].lower() in ("response", "force")
            else match[1].lower() != "note"
        )

    around, between = (
        [("", line, f"{path}:{number}") for number, line in lines if number > table.line or not is_read(line)]
        for lines in (table.around, table.between)
    )
    above, unclear = (read_texts(texts, options.skip) if texts else FreeText() for texts in (around, between))
    mentions = [*unclear.mentions, *unclear.statements]  # units of columns that the line does not name
    titles = [point for _, text, _ in around for point in title_points(text)]
    claims, points = [*above.claims, *unclear.claims], [*above.points, *titles]
    return replace(above, mentions=[*above.mentions, *mentions], claims=claims, points=points)


def _table(path: str, lines: Sequence[str], options: ReadOptions) -> TextTable:
    """Return the table below a header, or the rows of the columns that the caller names."""
    if not options.columns:
        return find_table(path, lines, lambda cells: _is_header(cells, options.names), _HEADERS, SAY_COLUMNS)
    wanted = check_columns(options)
    return find_rows(path, lines, options.columns, wanted)


def check_columns(options: ReadOptions) -> list[int]:
    """Return the indices of those columns named by the caller that are read.

    Raises
    ------
    MeasurementError
        A name that is not a field of an FRF, or names given in two ways.
    """
    if options.names:
        raise MeasurementError(Fault("the argument names", "the argument columns names the columns already."))
    names, units = names_and_units(options.columns)
    for name, unit in zip(names, units, strict=True):
        if name != _SKIP and column_word(name, unit) not in FIELD_WORDS:
            accepted = ", ".join((*NUMERIC_FIELDS, _SKIP))
            hint = did_you_mean(name, (*NUMERIC_FIELDS, _SKIP))
            raise MeasurementError(Fault("the argument columns", f"'{name}' is not a field of an FRF.", accepted, hint))
    _field_columns("the argument columns", ",".join(options.columns), names, units, {})
    return [column for column, name in enumerate(names) if name != _SKIP]


def recording_of(
    path: Path,
    header: Header,
    arrays: Mapping[str, NDArray[Any]],
    locate: Callable[[int], str],
    free_text: FreeText | None = None,
) -> Recording:
    """Build the recording from columns that have been read.

    Parameters
    ----------
    path : Path
    header : Header
    arrays : mapping of str to (n_freq,) array
        From the fields of the FRF to their numbers.
    locate : callable
        Returns the place of a line.
    free_text : FreeText, optional
        What the text around the columns states.

    Raises
    ------
    MeasurementError
        A negative amplitude, or statements of the file that contradict each other.
    """
    fields = {field: array if field == "values" else array.real for field, array in arrays.items()}
    free_text = free_text or FreeText()
    _check_quantities(path, header)
    names = {field: header.names[column] for field, column in header.columns.items()}
    meaning, mentions = meaning_of_file(header.statements, free_text)
    claims, averages = [*header.claims, *free_text.claims], _averages(header.comments)
    fields["frequency"] = fields["frequency"] * check_axis(meaning, mentions, SAY_COLUMNS)
    if claims or {"coherence", "variance"} & set(names):
        check_parts(names, claims, meaning.unit, str(path), averages, fields["frequency"])
    values, has_phase = combine_values(fields, locate)
    return Recording(
        where=str(path),
        label=path.name,
        frequency=fields["frequency"],
        values=values,
        has_phase=has_phase,
        coherence=fields.get("coherence"),
        locate=locate,
        how_to_state_quantity="a line '# quantity: accelerance' before the header",
        averages=averages,
        variance=fields.get("variance"),
        taken=header.taken,
        mentions=[one for one in mentions if not ("db" in header.columns and one.text.lower() == "db")],
        **fields_of(meaning),
        **point_fields(header.comments, [*free_text.points, *header.points]),
    )


def _check_quantities(path: Path, header: Header) -> None:
    """Refuse comments, units and column names that state several quantities."""
    word = header.comments.get("quantity", "")
    named = [header.names[column] for field, column in header.columns.items() if field in VALUE_FIELDS]
    quantities: list[Quantity] = []
    if word:
        quantities.append(parse_quantity(word.lower(), header.comments["quantity stands in"]))
    if header.unit and (reading := read_unit(header.unit)) is not None and reading.quantity is not None:
        quantities.append(reading.quantity)
    quantities += [
        quantity for motions in (False, True) for name in named for quantity in quantities_in(name, motions=motions)
    ]
    if len(each := list(dict.fromkeys(quantities))) > 1:
        problem = f"the file contradicts itself: {' and '.join(each)}."
        remedy = f"{SAY_COLUMNS} And what they are: `quantity=` or `unit=`."
        raise MeasurementError(Fault(str(path), problem, remedy=remedy))


def _averages(comments: Mapping[str, str]) -> int | None:
    if "averages" not in comments:
        return None
    text = comments["averages"]
    digits = text.lstrip("0")
    if not (digits.isdecimal() and len(digits) < 10 and 1 <= int(digits) <= MOST_AVERAGES):
        problem = f"{text[:40]!r} is not a number of averages."
        raise MeasurementError(Fault(comments["averages stands in"], problem, "a whole number of 1 or more"))
    return int(digits)


def _is_header(cells: Sequence[str], chosen: Mapping[str, str]) -> bool:
    """Return whether one of the cells is the frequency, by its name or by the caller's choice."""
    names, units = names_and_units(cells)
    if "frequency" in chosen:
        return chosen["frequency"] in names
    return any(column_word(name, unit) in FIELD_NAMES["frequency"] for name, unit in zip(names, units, strict=True))


def read_header(
    where: str, cells: Sequence[str], below: Sequence[str], chosen: Mapping[str, str], comments: Mapping[str, str]
) -> Header:
    """Return the meaning of a table's columns.

    Parameters
    ----------
    where : str
        The line of the header.
    cells : sequence of str
        Of the header.
    below : sequence of str
        Cells of a row of units, or empty.
    chosen : mapping of str to str
        From fields of the FRF to names of columns, as the caller specifies them.
    comments : mapping of str to str
        Statements in the lines above.

    Raises
    ------
    MeasurementError
        Names or units that are not understood, or units that differ.
    """
    names, units = names_and_units(cells)
    for column, cell in enumerate(below):
        unit = re.sub(r"^[\[(](.*)[\])]$", r"\1", cell)
        if units[column] and unit and unit != units[column]:
            problem = f"'{cells[column][:60]}' has the unit '{unit[:40]}' in the row below."
            raise MeasurementError(Fault(where, problem, "one unit", f"{SAY_COLUMNS} And their unit: `unit=`."))
        units[column] = units[column] or unit
    columns = _field_columns(where, ",".join(cells), names, units, chosen)
    unit = _unit(where, units, columns, comments.get("unit", ""))
    signals = check_same_signal(where, {field: names[index] for field, index in columns.items() if field not in chosen})
    return Header(
        columns=columns,
        names=tuple(names),
        unit=unit,
        comments=comments,
        taken=taken_for({field: names[column] for field, column in columns.items()}, names, units),
        statements=_statements(where, names, columns, units[columns["frequency"]], unit, comments),
        claims=[
            FieldClaim(field, units[columns[field]], where)
            for field in ("coherence", "variance")
            if field in columns and units[columns[field]]
        ],
        points=[point for signal in signals for point in points_of_column(signal)],
    )


def _statements(
    where: str,
    names: Sequence[str],
    columns: Mapping[str, int],
    axis: str,
    unit: str,
    comments: Mapping[str, str],
) -> list[Statement]:
    """Return what the header and the comments above it state."""
    name = names[columns["frequency"]]
    in_name = "Hz" if name.lower().endswith("_hz") else axis_unit_in_name(name)
    statements = [Statement("axis unit", unit, where) for unit in dict.fromkeys((axis, in_name)) if unit]
    statements += [Statement("unit", unit, where)] if unit else []
    labels = [names[columns[field]] for field in VALUE_FIELDS - {"db"} if field in columns]
    labels += [re.sub(r"(?i)[\W_]*db\b", " ", names[columns["db"]]).strip()] if "db" in columns else []
    labels = [label for label in labels if label not in _PLAIN]
    statements += [Statement("label", label, where) for label in labels]
    statements += [Statement("unit", unit, where) for label in labels if (unit := unit_in_name(label))]
    if word := comments.get("quantity", ""):
        statements.append(Statement("quantity", word, comments["quantity stands in"]))
    return statements


def _own_comment(line: str) -> re.Match[str] | None:
    """Return the match of a comment that is read by its key, unless it has further keys."""
    match = _COMMENT.match(line.strip()[:_LONGEST])
    is_one = match is None or match[1].lower() not in ("response", "force") or not _NEXT_KEY.search(match[2])
    return match if is_one else None


def _comments_above(path: str, table: TextTable) -> dict[str, str]:
    """Return the statements in the comments above a table, and their lines."""
    comments: dict[str, str] = {}
    for number, line in enumerate(table.lines[: table.line]):
        if match := _own_comment(line):
            key = match[1].lower()
            if comments.get(key, match[2]) != match[2] and key != "note":
                problem = f"the file contradicts itself: {key} {comments[key][:40]!r} and {match[2][:40]!r}."
                raise MeasurementError(Fault(f"{path}:{number + 1}", problem, remedy="Keep one of the two lines."))
            comments[key] = match[2]
            comments[f"{key} stands in"] = f"{path}:{number + 1}"
    return comments


def _field_columns(
    where: str, line: str, names: Sequence[str], units: Sequence[str], chosen: Mapping[str, str]
) -> dict[str, int]:
    """Return the column of each field of the FRF; other columns are refused unless the caller names the columns."""
    columns = [(name, unit) for name, unit in zip(names, units, strict=True) if name not in ("", _SKIP)]
    words = {name: column_word(name, unit) for name, unit in columns}
    shown = line if len(line) <= 60 else f"{line[:60]}..."
    over_time = any(name.lower().startswith("time") for name in names)
    remedy = "'dovetail frf' estimates an FRF from signals over time." if over_time else SAY_COLUMNS
    unclear = MeasurementError(Fault(where, f"the header {shown!r} is not understood.", _HEADERS, remedy))
    if len(words) < len(columns):
        raise MeasurementError(Fault(where, f"the header {shown!r} has a name twice.", _HEADERS, SAY_COLUMNS))
    named = {field for field in NUMERIC_FIELDS if set(words.values()) & set(FIELD_NAMES[field])}
    if not chosen and not ("frequency" in named and named & (VALUE_FIELDS - {"phase_deg", "phase_rad"})):
        raise unclear
    assigned = assign_fields(where, dict(columns), chosen, words)
    fields = {field: name for field, name in assigned.items() if field in NUMERIC_FIELDS}
    if not chosen and set(words) != set(fields.values()):
        raise unclear
    return {field: list(names).index(name) for field, name in fields.items()}


def _unit(where: str, units: Sequence[str], columns: Mapping[str, int], comment_unit: str) -> str:
    """Return the unit of the values that columns and comments state; they must agree."""
    named = {units[columns[part]] for part in ("values", "real", "imag", "amplitude", "db") if part in columns}
    bare = {match[1] or "" if (match := _DECIBEL.fullmatch(label)) else label for label in (*named, comment_unit)}
    labels = {label.strip() for label in bare if label.strip().lower() not in _PURE}
    meanings = {_meaning(label, where): label for label in sorted(labels)}
    if len(meanings) > 1:
        both = " and ".join(sorted(labels))
        raise MeasurementError(Fault(where, f"the values are in different units: {both}.", "one unit", SAY_COLUMNS))
    return next(iter(meanings.values()), "")


def _meaning(label: str, where: str) -> UnitReading | UnitMeaning:
    """Return the meaning of a unit of a motion, alone or per load."""
    reading = read_unit(label)
    return reading if reading is not None and reading.kind == "motion" else meaning_of_unit(label, where)
