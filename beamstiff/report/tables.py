"""Tables for people, as rich tables: the same look everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich import box
from rich.table import Table

MOST_ROWS = 40


def table(title: str, *columns: str, left: int = 1) -> Table:
    """Return an empty table, its first `left` columns aligned left and the others right."""
    result = Table(
        title=title,
        title_justify="left",
        title_style="bold",
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
