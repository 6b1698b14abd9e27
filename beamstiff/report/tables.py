"""Tables for people, as rich tables: the same look everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy

from rich import box
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

MOST_ROWS = 40
SMALL = {"rad": (1e3, "mrad"), "m": (1e3, "mm")}


class _Table(Table):
    """A table whose title may be wider than its columns: it breaks where the line ends, not before."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        if self.title:
            yield Text(str(self.title), style="bold")
        bare = copy(self)
        bare.title = None
        yield from Table.__rich_console__(bare, console, options)


def table(title: str, *columns: str, left: int = 1) -> Table:
    """Return an empty table, its first `left` columns aligned left and the others right."""
    result = _Table(
        title=title,
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        show_edge=False,
    )
    for at, column in enumerate(columns):
        result.add_column(column, justify="left" if at < left else "right")
    return result


def add_rows(into: Table, rows: Iterable[Sequence[str]], most: int = MOST_ROWS) -> None:
    """Add rows, the first `most` of them; a last one says how many are left out."""
    all_rows = list(rows)
    for row in all_rows[:most]:
        into.add_row(*row)
    if len(all_rows) > most:
        into.add_row(f"... {len(all_rows) - most} more")


def number(value: float) -> str:
    """Return a number as tables show it: four digits.

    Examples
    --------
    >>> number(1723456.0), number(0.0), number(-0.0123456)
    ('1.723e+06', '0', '-0.01235')
    """
    return f"{value:.4g}"


def small(values: Sequence[float], unit: str) -> tuple[list[str], str]:
    """Return numbers as tables show them, and their unit: small angles in mrad, lengths in mm.

    Examples
    --------
    >>> small([0.0001481, 4.4e-05], "rad"), small([0.02], "m"), small([1.5], "kg")
    ((['0.1481', '0.044'], 'mrad'), (['20'], 'mm'), (['1.5'], 'kg'))
    """
    factor, shown = SMALL[unit] if unit in SMALL and max(map(abs, values)) < 1.0 else (1.0, unit)
    return [number(factor * value) for value in values], shown


def millimetres(lengths: Iterable[float]) -> list[str]:
    """Return lengths in metres as millimetres with three decimals.

    Examples
    --------
    >>> millimetres([1.2345678, -1e-9])
    ['1234.568', '0.000']
    """
    return [f"{round(1e3 * length, 3) + 0.0:.3f}" for length in lengths]


def counted(count: int, what: str) -> str:
    """Return a number of things.

    Examples
    --------
    >>> counted(1, "test"), counted(12, "pose")
    ('1 test', '12 poses')
    """
    return f"{count} {what}{'' if count == 1 else 's'}"
