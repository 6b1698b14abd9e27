"""The header of a list of points: which of its columns a profile names, and whether their units agree."""

from collections.abc import Callable, Sequence

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.measure.columns import QUANTITIES, bare_name, fail, unit_fault, unit_in
from beamstiff.measure.profiles import JOINTS, Profile
from beamstiff.measure.wrench import STANDARD_GRAVITY
from beamstiff.units import UNITS, unit_factor

LEAST_UNITS = 3  # that a row of units has: those of a position
Cutter = Callable[[str], list[str]]  # cuts a line into cells


def with_row_of_units(header: Sequence[str], rows: Sequence[Sequence[str]]) -> tuple[list[str], bool]:
    """Return a header with the units of a row of units below it, and whether there is one.

    >>> with_row_of_units(["Name", "X", "A1", "m"], [["", "mm", "deg", "kg"], ["P1", "1.5", "30", "4"]])
    (['Name', 'X [mm]', 'A1 [deg]', 'm [kg]'], True)
    """
    below = [cell.strip(" []()") for cell in (rows[0] if rows else ())]
    stated = [cell for cell in below if cell]
    if len(stated) < LEAST_UNITS or any(unit_fault(cell, (*UNITS,)) for cell in stated):
        return list(header), False
    cells = zip(header, [*below, *[""] * len(header)], strict=False)
    return [f"{cell} [{unit}]" if unit and unit_in(cell) is None else cell for cell, unit in cells], True


def named_places(
    profile: Profile, header: Sequence[str], text: str, cutters: dict[str, Cutter], name: str, line: int
) -> list[int]:
    """Return where the columns of a profile stand in a header, counted from 0.

    `text`: the header's line. `cutters`: what cuts it, by the name of the separator. A column may be named
    without its unit in brackets. Refused where there is none of this name, or its unit is another than the
    profile states.
    """
    places: list[int] = []
    for ours, column in profile.columns.items():
        if not isinstance(column, str):
            places.append(column - 1)
            continue
        at = _place(column, header)
        if at is None:
            fail(name, line, ours, _missing(column, header, profile, text, cutters))
        if fault := _other_unit(ours, header[at], profile):
            fail(name, line, ours, fault)
        places.append(at)
    return places


def _place(column: str, header: Sequence[str]) -> int | None:
    """Return where a column stands: as it is written, or the only one of the name without its unit."""
    if column in header:
        return header.index(column)
    bare = [at for at, cell in enumerate(header) if bare_name(cell) == column]
    return bare[0] if len(bare) == 1 else None


def _missing(
    column: str, header: Sequence[str], profile: Profile, text: str, cutters: dict[str, Cutter]
) -> str:
    missing = f"there is no column {column!r} in the header"
    named = [one for one in profile.columns.values() if isinstance(one, str)]
    for separator, cut in cutters.items():
        cells = [cell.strip() for cell in cut(text)]
        if profile.separator != (separator,) and all(_place(one, cells) is not None for one in named):
            return f"{missing} as separated, but with `separator: {separator}` there is"
    names = {bare_name(cell): cell for cell in header} | {cell: cell for cell in header}
    hint = suggest(column, names)
    return f"{missing}, which has {listed([shown(cell) for cell in header], 12)}{hint}"


def _other_unit(ours: str, cell: str, profile: Profile) -> str:
    """Return that a header cell states another unit than the profile; empty where it does not."""
    said, unit = unit_in(cell), profile.unit_of(ours)
    if said is None or unit is None:
        return ""
    kinds = (QUANTITIES[ours],) if ours in QUANTITIES else ("angle", "length")
    kinds = (*kinds, "mass") if ours == "fz" else kinds
    if unit_fault(said, kinds) or _size(said, kinds) == _size(unit, kinds):
        return ""  # no unit, but a remark, or the same
    key = next((key for key in (ours, QUANTITIES.get(ours, JOINTS)) if key in profile.units), ours)
    alone = "" if key == ours else f" (or of this column alone, `{ours}: {said}`)"
    return (
        f"found the unit {shown(unit)} in the profile, but {shown(cell)} in the header, expected `units: "
        f"{{{key}: {said}}}`{alone}; if the header is wrong, state columns by their numbers, and `skip`"
    )


def _size(unit: str, kinds: Sequence[str]) -> tuple[float, float, bool]:
    """Return factor and offset of a unit, and whether it is an angle; a mass counts by its weight."""
    for kind in kinds:
        if not unit_fault(unit, (kind,)):
            factor, offset = unit_factor(unit, kind)
            weight = STANDARD_GRAVITY if kind == "mass" else 1.0
            return round(factor * weight, 15), offset, kind == "angle"
    raise BeamstiffError(f"found the unit {shown(unit)}, expected one of {listed(kinds)}")
