"""The cells of a text that a profile names: its lines cut into cells, these read as numbers in SI."""

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.errors import BeamstiffError, listed, shown
from beamstiff.measure.columns import LABELS, QUANTITIES, Column, fail, to_si, unit_fault
from beamstiff.measure.orientation import Orientation, Quaternion, named_orientation
from beamstiff.measure.profile_headers import named_places, with_row_of_units
from beamstiff.measure.profiles import ANGLES, QUATERNION, SEPARATORS, Profile
from beamstiff.measure.text import RowError, numbers
from beamstiff.measure.wrench import STANDARD_GRAVITY
from beamstiff.se3 import Array, vector_from_rotation
from beamstiff.units import UNITS

LEAST_MASS = 0.01  # kg: an unloaded scale may read as much below zero
JOINED = "\x1f"  # ASCII's unit separator, in the place of several separators
DECIMAL_COMMAS = (
    "decimal commas need another separator: export with one, and state it and `decimal: comma` in the profile"
)
_CLOCK = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d(?:\.\d+)?))?")
_DATED = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d(:\d\d(\.\d+)?)?")
DAY = 86400.0  # s
_WHOLE, _DIGITS = re.compile(r"[+-]?[0-9]+"), re.compile(r"[0-9]+")


@dataclass(frozen=True)
class Cells:
    """The cells that a profile names, by our columns, the lines that they stand in, what it does not name."""

    columns: Mapping[str, Sequence[str]]
    lines: Sequence[int]
    unused: Sequence[str] = ()  # columns of the header


def profile_cells(text: str, profile: Profile, name: str) -> Cells:
    """Return the cells of a text that the profile names, in its order."""
    cut = _cutter(profile.separator)
    lines: list[int] = []
    rows: list[list[str]] = []
    first, unused = "", list[str]()
    for number, line in enumerate(text.splitlines(), start=1):
        plain = line.strip()
        if number <= profile.skip or not plain or plain.startswith(profile.comment):
            continue
        first = first or plain
        lines.append(number)
        rows.append([cell.strip() for cell in cut(plain)])
    if not rows:
        raise BeamstiffError(f"{name}: found no points, expected rows with {listed(profile.columns)}")
    if any(isinstance(column, str) for column in profile.columns.values()):
        line_of_header = lines.pop(0)
        header, has_units = with_row_of_units(rows.pop(0), rows)
        if has_units:
            del lines[0], rows[0]
        cutters = {separator: _cutter((separator,)) for separator in SEPARATORS}
        wanted = named_places(profile, header, first, cutters, name, line_of_header)
        unused = [cell for at, cell in enumerate(header) if cell and at not in wanted]
        _check_surplus(rows, lines, header, profile, name)
    else:
        wanted = [int(column) - 1 for column in profile.columns.values()]
        numeric = [at for at, ours in zip(wanted, profile.columns, strict=True) if ours not in LABELS]
        if "comma" in profile.separator and _numbers_in_two(rows, numeric, max(wanted)):
            fail(name, lines[0], "", f"found only digits behind every comma: {DECIMAL_COMMAS}")
    for number, cells in zip(lines, rows, strict=True):
        if len(cells) <= max(wanted):
            fail(
                name,
                number,
                "",
                f"found {len(cells)} cells separated by {_called(profile.separator)}, expected at least "
                f"{max(wanted) + 1}",
            )
    if not rows:
        raise BeamstiffError(f"{name}: found a header without points")
    columns = {ours: [cells[at] for cells in rows] for ours, at in zip(profile.columns, wanted, strict=True)}
    return Cells(columns, lines, unused)


def _cutter(separators: Sequence[str]) -> Callable[[str], list[str]]:
    """Return what cuts a line into cells; in quotes nothing separates."""
    if separators == ("whitespace",):
        return str.split
    marks = [SEPARATORS.get(one, one) for one in separators if one != "whitespace"]
    if len(separators) == 1 and len(marks[0]) == 1:
        return lambda line: next(csv.reader([line], delimiter=marks[0]))
    either = "|".join(map(re.escape, sorted(marks, key=len, reverse=True)))  # :: before :
    if "whitespace" in separators:
        either = rf"\s*(?:{either})\s*|\s+"  # blanks beside another separator are part of it
    between = re.compile(rf'("[^"]*")|{either}')

    def cut(line: str) -> list[str]:
        joined = between.sub(lambda found: found[1] or JOINED, line)
        return next(csv.reader([joined], delimiter=JOINED, skipinitialspace=True))

    return cut


def _called(separators: Sequence[str]) -> str:
    return " or ".join(one if one in SEPARATORS else shown(one) for one in separators)


def _check_surplus(
    rows: Sequence[list[str]], lines: Sequence[int], header: Sequence[str], profile: Profile, name: str
) -> None:
    """Refuse a row with more cells than the header names, but for empty ones at its end."""
    for number, cells in zip(lines, rows, strict=True):
        if len(cells) > len(header) and any(cells[len(header) :]):
            hint = f"; {DECIMAL_COMMAS}" if "comma" in profile.separator else ""
            ends = f"({shown(header[0])} to {shown(header[-1])})"
            found = f"found {len(cells)} cells, expected {len(header)} as in the header {ends}"
            fail(name, number, "", f"{found}{hint}")


def _numbers_in_two(rows: Sequence[Sequence[str]], numeric: Sequence[int], highest: int) -> bool:
    """Return whether commas cut every number in two, as they do with decimal commas.

    Then, from the first number on, whole numbers and bare digits take turns: twice as many cells as numbers.
    Further columns of a list are not so many, or not such.
    """
    if not numeric:
        return False
    start = min(numeric)
    stop = next(at for at in range(start, start + len(numeric) + 1) if at not in numeric)
    for cells in rows:
        halves = cells[start : 2 * stop - start]
        if len(halves) < 2 * (stop - start) or len(cells) <= highest + 1:
            return False
        if not all(_WHOLE.fullmatch(cell) for cell in (*halves[::2], *(cells[at] for at in numeric))):
            return False
        if not all(_DIGITS.fullmatch(cell) for cell in halves[1::2]):
            return False
    return True


def profile_values(cells: Cells, profile: Profile, name: str) -> dict[str, Array]:
    """Return the numbers of the columns that are no labels, in SI, orientations as rotation vectors a b c."""
    values: dict[str, Array] = {}
    for column, texts in cells.columns.items():
        if column in LABELS:
            continue
        if column == "t" and (since := clock_times(texts)) is not None:
            values[column] = since
            continue
        comma = profile.decimal == "comma"
        try:
            raw = numbers(texts, may_be_empty=column in QUANTITIES, decimal_comma=comma, by_profile=True)
        except RowError as error:
            fail(name, cells.lines[error.row], column, str(error))
        unit = profile.unit_of(column) or ""
        if column == "fz" and profile.hung_mass:
            mass = to_si(raw, Column(column, "mass", unit))
            if (mass < -LEAST_MASS).any():
                row = int(np.argmax(mass < -LEAST_MASS))
                fail(
                    name,
                    cells.lines[row],
                    column,
                    f"found {shown(texts[row])} {unit}, expected no negative mass",
                )
            values[column] = 0.0 - STANDARD_GRAVITY * np.where(mass < 0, 0.0, mass)  # no -0.0
        else:
            values[column] = (
                raw if column in QUATERNION else to_si(raw, Column(column, _kind(column, profile), unit))
            )
    return _turned(values, profile, name, cells.lines)


def clock_times(cells: Sequence[str]) -> Array | None:
    """Return times of day or dates with times as s since midnight of the first day (n,); None: they are not.

    A time of day that is more than half a day before the one above it is of the next day.

    >>> clock_times(["23:59:58.5", "0:00:01"]), clock_times(["2026-11-12 08:00"]), clock_times(["8.5"])
    (array([86398.5, 86401. ]), array([28800.]), None)
    """
    texts = [cell.strip() for cell in cells]
    if texts and all(map(_DATED.fullmatch, texts)):
        days, clocks = zip(*((text[:10], text[11:]) for text in texts), strict=True)
        try:
            day = np.array(days, dtype="datetime64[D]").astype(float) * DAY
        except ValueError:
            return None
        since: Array = day - day[0] + np.array([_seconds(clock) for clock in clocks])
        return since
    if not texts or not all(map(_CLOCK.fullmatch, texts)):
        return None
    found = np.array([_seconds(text) for text in texts])
    found += DAY * np.cumsum(np.diff(found, prepend=found[0]) < -0.5 * DAY)
    return found


def _seconds(clock: str) -> float:
    hours, minutes, *seconds = clock.split(":")
    return 3600.0 * int(hours) + 60.0 * int(minutes) + sum(map(float, seconds))


def mass_notes(profile: Profile) -> list[str]:
    """Return what to know of a profile's column of masses, if it has one."""
    if not profile.hung_mass:
        return []
    column = profile.columns["fz"]
    called = f"column {column}" if isinstance(column, int) else column
    return [f"{called}: masses, taken as weight along -z of the base"]


def in_si(column: str, profile: Profile) -> str:
    """Return the header cell of a column, with the SI unit of its values."""
    kind = _kind(column, profile) if column not in ANGLES else "angle"
    return f"{column} [{UNITS[kind].replace('**', '^')}]"


def number_text(value: float) -> str:
    """Return a number as a cell holds it, every digit of it; NaN is an empty cell."""
    return "" if value != value else repr(float(value))


def _kind(column: str, profile: Profile) -> str:
    if column in QUANTITIES or column in QUATERNION:
        return QUANTITIES.get(column, "number")
    return "length" if unit_fault(profile.unit_of(column) or "", ("angle",)) else "angle"


def _turned(values: dict[str, Array], profile: Profile, name: str, lines: Sequence[int]) -> dict[str, Array]:
    """Return the values with every orientation as a rotation vector a b c."""
    group: tuple[str, ...]
    convention: Orientation
    if profile.orientation is not None:
        group, convention = ANGLES, named_orientation(profile.orientation)
    elif "qw" in values:
        group, convention = QUATERNION, Quaternion()
    else:
        return values
    table = np.stack([values[key] for key in group], axis=1)
    vectors = np.full((len(table), 3), np.nan)
    known = ~np.isnan(table).any(axis=1)
    try:
        vectors[known] = vector_from_rotation(convention.rotations(table[known]))
    except RowError as error:
        fail(name, lines[int(np.flatnonzero(known)[error.row])], group[0], str(error))
    kept = {key: value for key, value in values.items() if key not in group}
    return kept | dict(zip(ANGLES, vectors.T, strict=True))
