"""A measurement file as text: what stands before the header, its cells, their line numbers, their numbers."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from beamstiff.errors import BeamstiffError, shown, suggest
from beamstiff.measure.columns import fail
from beamstiff.se3 import Array

METADATA = (
    "sigma_position",
    "sigma_rotation",
    "sigma_load",
    "unloaded_reading",
    "history",
    "orientation",
    "decimal",
    "camera",
    "pixel_noise",
    "focal_length",
    "tag_size",
)
CHOICES = {
    "unloaded_reading": ("independent", "shared"),
    "history": ("unloaded", "continuous"),
    "decimal": ("point", "comma"),
    "camera": ("on robot", "fixed"),
}
SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}
_KEY_VALUE = re.compile(r"(?P<key>[A-Za-z_][\w .-]{0,59}?)\s*:\s*(?P<value>.*)", re.ASCII)

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_MISSING = {"nan", "na", "n/a", "null", "none", "-", "--", "#n/a", "?", "inf", "-inf", "+inf", "infinity"}
# what a number may be made of; float() also takes nan, inf, 1_000 and digits of other scripts
_PLAIN = b"0123456789+-.eE \t"


@dataclass(frozen=True)
class RawTable:
    """The text of a table, cut into cells."""

    source: str
    metadata: dict[str, tuple[str, int]]
    separator: str
    header: list[str]
    header_line: int
    cells: list[list[str]]
    lines: list[int]

    def fail_in_row(self, row: int, column: str, message: str) -> NoReturn:
        """Raise the error of a cell, its row counted from 0."""
        fail(self.source, self.lines[row], column, message)

    def fail_in_header(self, column: str, message: str) -> NoReturn:
        """Raise the error of a header cell, or of the header as a whole where `column` is empty."""
        fail(self.source, self.header_line, column, message)

    def fail_in_metadata(self, key: str, message: str) -> NoReturn:
        """Raise the error of a ``# key: value`` line."""
        fail(self.source, self.metadata[key][1], key, message)


def split_table(text: str, source: str) -> RawTable:
    """Return the metadata, header and cells of a table's text.

    Empty lines are skipped, and so are comments (``#``) after the header. Cells are separated by commas, or
    by semicolons or tabs where the header has these and no comma.
    """
    lines = re.split(r"\r\n|\n|\r", text.removeprefix("\ufeff"))
    metadata: dict[str, tuple[str, int]] = {}
    header_line = 0
    for number, line in enumerate(lines, start=1):
        stripped = line.strip().lstrip('"').lstrip()
        if stripped.startswith("#"):
            _read_comment(stripped, metadata, source, number)
        elif line.strip(',;\t "'):
            header_line = number
            break
    if not header_line:
        what = "only comments" if metadata or text.strip() else "an empty file"
        raise BeamstiffError(
            f"{source}: found {what}, expected a header with column names and rows of measurements"
        )
    header_text = lines[header_line - 1]
    bare = re.sub(r'"[^"]*"', "", header_text)
    separator = next((mark for mark in SEPARATORS if mark in bare), ",")
    header = _cut(header_text, separator, source, header_line)
    cells: list[list[str]] = []
    numbers: list[int] = []
    width = len(header)
    blank = ",;\t \xa0"
    quoted = '"' in text
    for number, line in enumerate(lines[header_line:], start=header_line + 1):
        if line.lstrip().startswith("#"):
            _read_late_comment(line, source, number)
            continue
        row = _cut(line, separator, source, number) if quoted and '"' in line else line.split(separator)
        if len(row) != width or not row[0]:
            if not line.strip(blank):
                continue
            if len(row) != width:
                _ragged(row, header, separator, source, number)
        cells.append(row)
        numbers.append(number)
    return RawTable(source, metadata, separator, header, header_line, cells, numbers)


def choice(key: str, raw: RawTable) -> str | None:
    """Return what a table declares of a key of `CHOICES`; None where it declares nothing."""
    if key not in raw.metadata:
        return None
    value = raw.metadata[key][0]
    for one in CHOICES[key]:
        if value.lower() == one.lower():
            return one
    options = " or ".join(CHOICES[key])
    raw.fail_in_metadata(key, f"found {shown(value)}, expected {options}{suggest(value, CHOICES[key])}")


def decimal_comma(raw: RawTable) -> bool:
    """Return whether a table declares decimal commas; refused where commas separate its cells."""
    comma = choice("decimal", raw) == "comma"
    if comma and raw.separator == ",":
        raw.fail_in_metadata(
            "decimal", "found comma in a table separated by commas, expected semicolons between cells"
        )
    return comma


def _read_comment(line: str, metadata: dict[str, tuple[str, int]], source: str, number: int) -> None:
    """Read `# key: value`; a spreadsheet may have put quotes around it and separators after it."""
    match = _KEY_VALUE.fullmatch(line.lstrip("#").strip(',;\t "'))
    if match is None:
        return
    key, value = match["key"], match["value"].strip()
    if key in METADATA:
        if key in metadata:
            fail(source, number, key, f"found again, already said in line {metadata[key][1]}, expected once")
        metadata[key] = value, number
        return
    if meant := _meant(key):
        fail(source, number, key, f"unknown key (did you mean '{meant}'?)")
    before = f"{metadata[key][0]}; " if key in metadata else ""
    metadata[key] = before + value, number


def _meant(key: str) -> str | None:
    """Return the key that has a meaning and is meant though spelled otherwise: it must not be passed over."""
    plain = re.sub(r"[\W_]+", "", key).lower()
    for known in METADATA:
        if _edits(plain, known.replace("_", "")) <= (2 if len(known) > 7 else 1):
            return known
    if plain.startswith("sigma"):
        return "sigma_rotation" if "rot" in plain else "sigma_position"
    return None


def _edits(a: str, b: str) -> int:
    """Return how many letters must be put in, taken out or replaced to make `b` of `a` (Levenshtein)."""
    row = list(range(len(b) + 1))
    for i, letter in enumerate(a, start=1):
        previous, row[0] = row[0], i
        for j, other in enumerate(b, start=1):
            previous, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, previous + (letter != other))
    return row[-1]


def _read_late_comment(line: str, source: str, number: int) -> None:
    match = _KEY_VALUE.fullmatch(line.lstrip().lstrip("#").strip(',;\t "'))
    if match is not None and (match["key"] in METADATA or _meant(match["key"])):
        fail(source, number, match["key"], "found after the header, expected before it")


def _cut(line: str, separator: str, source: str, number: int) -> list[str]:
    """Return the cells of one line; a quoted cell ends in the line it begins in."""
    try:
        rows = list(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True))
    except csv.Error as error:
        reason = "a quote that does not end" if "unexpected end" in str(error) else str(error)
        fail(source, number, "", f"found {reason}, expected cells separated by a {SEPARATORS[separator]}")
    return [cell.strip() for cell in rows[0]] if rows else [""]


def _ragged(row: list[str], header: list[str], separator: str, source: str, number: int) -> None:
    hint = ""
    if len(header) == 1 and ":" in header[0]:
        hint = (
            "; no table begins so: a header names columns (q1,fx,dx), and what else is stated stands behind #"
        )
    elif separator == "," and len(row) > len(header):
        hint = "; write decimal points, not commas"
    other = next(
        (mark for mark in SEPARATORS if mark != separator and len(row) == 1 and mark in row[0]), None
    )
    if other:
        hint = f"; the header is separated by a {SEPARATORS[separator]}, this row by a {SEPARATORS[other]}"
    ends = f"({shown(header[0])} to {shown(header[-1])})"
    fail(source, number, "", f"found {len(row)} cells, expected {len(header)} as in the header {ends}{hint}")


class RowError(BeamstiffError):
    """A cell that holds no number, or numbers that are no orientation; `row` is their place."""

    def __init__(self, row: int, message: str) -> None:
        self.row = row
        super().__init__(message)


def numbers(
    cells: Sequence[str], *, may_be_empty: bool, decimal_comma: bool = False, by_profile: bool = False
) -> Array:
    """Return the numbers of a column, NaN exactly where a cell is empty; 1,5 is one if `decimal_comma`.

    `by_profile`: whether a profile states decimal and unit, and not the file itself.
    """
    if decimal_comma:
        if any("." in cell for cell in cells):
            return _one_by_one(cells, may_be_empty, decimal_comma, by_profile)
        cells = [cell.replace(",", ".") for cell in cells]
    if "".join(cells).encode("utf-8", "replace").translate(None, _PLAIN):
        return _one_by_one(cells, may_be_empty, decimal_comma, by_profile)
    try:
        values = np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
    except ValueError:
        return _one_by_one(cells, may_be_empty, decimal_comma, by_profile)
    if not np.isfinite(values).all():
        return _one_by_one(cells, may_be_empty, decimal_comma, by_profile)
    return values


def _one_by_one(cells: Sequence[str], may_be_empty: bool, decimal_comma: bool, by_profile: bool) -> Array:
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        text = cell.strip()
        if not text:
            if not may_be_empty:
                raise RowError(row, "found an empty cell, expected a number")
            continue
        if decimal_comma:
            if "." in text and "," in text:
                raise RowError(row, f"found {shown(text)}, expected a number with one decimal comma")
            if "." in text:
                raise RowError(row, f"found {shown(text)}, expected a decimal comma as declared")
            text = text.replace(",", ".")
        if not _NUMBER.fullmatch(text):
            expected = _expected(text, may_be_empty, by_profile)
            raise RowError(row, f"found {shown(cell.strip())}, expected {expected}")
        values[row] = float(text)
        if not np.isfinite(values[row]):
            raise RowError(row, f"found {shown(text)}, expected a finite number")
    return values


def _expected(text: str, may_be_empty: bool, by_profile: bool) -> str:
    if re.fullmatch(r"[+-]?\d+,\d+", text):
        declare = "`decimal: comma` in the profile" if by_profile else "'# decimal: comma' before the header"
        return f"a number with a decimal point (or declare {declare})"
    if text.lower() in _MISSING:
        if may_be_empty:
            return "a number, or an empty cell where there is none"
        return "a finite number: correct the row, or delete it"
    if re.fullmatch(r"[+-]?[\d.]+\s*[A-Za-zµ°*/]+", text):
        where = "under `units` of the profile" if by_profile else "in the header, like dx [mm]"
        return f"a number; its unit stands {where}"
    return "a number"
