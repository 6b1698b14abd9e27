"""Tables of the terminal as tables of a page: the same cells."""

from __future__ import annotations

from itertools import takewhile

from rich import table as rich_table

from beamstiff.report.html.parts import Table


def of_rich(
    told: rich_table.Table, caption: str | None = None, shown: bool = True, left: int | None = None
) -> Table:
    """Return what the terminal shows as a table of a page, with its title or another caption.

    As many columns as there, or as are told, are aligned left.

    Examples
    --------
    >>> from beamstiff.report.tables import table
    >>> told = table("Sizes", "part", "mm")
    >>> told.add_row("link 2", "1.2")
    >>> of_rich(told)
    Table(caption='Sizes', columns=('part', 'mm'), rows=[['link 2', '1.2']], left=1, open=True)
    """
    columns = told.columns
    if left is None:
        left = max(1, sum(1 for _ in takewhile(lambda one: one.justify == "left", columns)))
    cells = [[str(cell) for cell in one.cells] for one in columns]
    rows = [list(row) for row in zip(*cells, strict=True)]
    heads = tuple(str(one.header) for one in columns)
    return Table(str(told.title or "") if caption is None else caption, heads, rows, left, shown)
