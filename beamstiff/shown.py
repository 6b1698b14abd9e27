"""What draws and describes itself: in a terminal by rich, in Jupyter, and by `plot()`.

The one place that reaches up to `report/`, when it is asked to (an exception in the import contract).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console, ConsoleOptions, RenderResult


class Shown:
    """A robot or a result, which knows how to show itself."""

    __slots__ = ()

    def plot(self, **options: Any) -> Figure:
        """Return a figure, see `beamstiff.plot`: Jupyter shows it, ``savefig("name.png")`` writes it."""
        from beamstiff.report.shown import plot

        return plot(self, **options)

    def __rich_console__(self, _: Console, options: ConsoleOptions) -> RenderResult:
        """Show tables and notes where rich prints."""
        from beamstiff.report.shown import console, told_with_notes

        plain = console(options.max_width)  # names from files are no markup
        for part in told_with_notes(self):
            yield from plain.render(part, options)

    def __str__(self) -> str:
        """Return the same as text."""
        from beamstiff.report.shown import as_text

        return as_text(self)

    def __repr__(self) -> str:
        """Return what it is in a line: the tables are for `print`."""
        from beamstiff.report.shown import line

        return f"<{type(self).__name__}: {line(self)}>"

    def _repr_html_(self) -> str:
        """Return the same for Jupyter."""
        from beamstiff.report.shown import as_html

        return as_html(self)
