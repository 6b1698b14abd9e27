"""Tables for people: described once, drawn by the console and by pages of a report."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

from rich import box
from rich import table as rich_table
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.text import Text

MOST_ROWS = 40
WIDEST, NARROWEST = 100, 30  # columns of a table where there is no terminal to fit into; of text in it
BETWEEN = 3  # columns between two of a table
SMALL = {"rad": (1e3, "mrad"), "m": (1e3, "mm"), "rad/N": (1e6, "mrad/kN")}


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    head: str  # with its unit
    left: bool = False  # aligned left; else right, as numbers are
    only: str = ""  # where it is drawn alone: "page" or "console"; empty for both


@dataclass
class Table:
    """A table as text, whoever draws it."""

    title: str
    # given as text, the first `left` of them are aligned left and the others right
    columns: Sequence[Column | str]
    # a cell for each column, also for those that are not drawn
    rows: list[list[str]] = field(default_factory=list)
    left: int = 1
    open: bool = True  # on a page: shown at once; else behind its title
    most: int | None = None  # on the console so many rows; a last line says how many are left out

    @property
    def heads(self) -> list[Column]:
        """The columns with their alignment."""
        return [
            one if isinstance(one, Column) else Column(one, left=at < self.left)
            for at, one in enumerate(self.columns)
        ]

    def add_row(self, *cells: str) -> None:
        """Add a row; cells that are missing at its end are empty."""
        self.rows.append([*cells, *[""] * (len(self.columns) - len(cells))])

    def drawn(self, where: str) -> tuple[list[Column], list[list[str]]]:
        """Return the columns that are drawn on the "page" or "console", and their cells."""
        kept = [at for at, one in enumerate(self.heads) if one.only in ("", where)]
        return [self.heads[at] for at in kept], [[row[at] for at in kept] for row in self.rows]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw on a console; a title wider than the columns breaks where the line ends, not before."""
        columns, rows = self.drawn("console")
        made = rich_table.Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        made.show_header = any(column.head for column in columns)
        widths = [None] * len(columns) if console.is_terminal else _widths(columns, rows)
        for column, width in zip(columns, widths, strict=True):
            justify: Literal["left", "right"] = "left" if column.left else "right"
            overflow: Literal["ellipsis", "fold"] = "ellipsis" if width is None else "fold"
            made.add_column(column.head, justify=justify, max_width=width, overflow=overflow)
        for row in rows[: self.most]:
            made.add_row(*row)
        if self.most is not None and len(rows) > self.most:
            made.add_row(f"... {len(rows) - self.most} more")
        if self.title:
            yield Text(self.title, style="bold")
        yield from made.__rich_console__(console, options)


def _widths(columns: Sequence[Column], rows: Sequence[Sequence[str]]) -> list[int | None]:
    """Return how wide columns may be at most, None: as they are. The widest text makes room, no number."""
    texts = zip(*([column.head for column in columns], *rows), strict=True)
    widths = [max(cell_len(line) for text in column for line in text.split("\n")) for column in texts]
    result: list[int | None] = [None] * len(columns)
    texts_at = [at for at, column in enumerate(columns) if column.left]
    beyond = sum(widths) + BETWEEN * (len(widths) - 1) - WIDEST
    if beyond > 0 and texts_at:
        widest = max(texts_at, key=lambda at: widths[at])
        result[widest] = max(widths[widest] - beyond, NARROWEST)
    return result


def table(
    title: str, *columns: Column | str, left: int = 1, rows: Iterable[Sequence[str]] | None = None
) -> Table:
    """Return a table, `left` columns aligned left; of `rows` a console shows the first `MOST_ROWS`."""
    made = Table(title, columns, left=left, most=None if rows is None else MOST_ROWS)
    for row in rows or ():
        made.add_row(*row)
    return made


def below(head: str, name: str) -> str:
    r"""Return a cell with a name below its head, one of them possibly empty: tables have to fit a console.

    >>> below("backlash at q2", "half_width"), below("", "half_width"), below("none", "")
    ('backlash at q2\n  half_width', '  half_width', 'none')
    """
    return "\n  ".join((head, name)) if head and name else head or f"  {name}"


def spaced(parts: Iterable[RenderableType]) -> Iterator[RenderableType]:
    """Yield what is printed, each with an empty line behind it."""
    for part in parts:
        yield part
        yield ""


def number(value: float) -> str:
    """Return a number as tables show it: four digits.

    >>> number(1723456.0), number(0.0), number(-0.0123456)
    ('1.723e+06', '0', '-0.01235')
    """
    return f"{value:.4g}"


def worth(value: float, std: float) -> tuple[str, str]:
    """Return a value with the digits that its standard deviation leaves it, and the latter with two.

    What is held has no standard deviation: a 0 is ``-``.

    >>> worth(1364333.2, 139420.2), worth(1.257e-06, 1.996e-08), worth(0.0, 2e-3)
    (('1.36e+06', '1.4e+05'), ('1.257e-06', '2e-08'), ('0', '0.002'))
    >>> worth(1.2345678, 0.0)
    ('1.235', '-')
    """
    if std == 0.0:
        return number(value), "-"
    if not (math.isfinite(value) and math.isfinite(std) and value and std > 0.0):
        return number(value), f"{std:.2g}"
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2
    return f"{value:.{min(max(digits, 1), 6)}g}", f"{std:.2g}"


def scale_of(values: Sequence[float], unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which tables show numbers: small angles in mrad, lengths in mm."""
    return SMALL[unit] if unit in SMALL and max(map(abs, values)) < 1.0 else (1.0, unit)


def nice(value: float) -> float:
    """Return a number cut to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))


def millimetres(lengths: Iterable[float]) -> list[str]:
    """Return lengths in metres as millimetres with three decimals.

    >>> millimetres([1.2345678, -1e-9])
    ['1234.568', '0.000']
    """
    return [f"{round(1e3 * length, 3) + 0.0:.3f}" for length in lengths]


def times_off(ratio: float) -> str:
    """Return in words how a stiffness changed by a ratio.

    >>> times_off(0.0055), times_off(1.26)
    ('180 times softer', '1.3 times stiffer')
    """
    how, factor = ("softer", 1.0 / ratio) if ratio < 1.0 else ("stiffer", ratio)
    return f"{float(f'{factor:.2g}'):g} times {how}"
