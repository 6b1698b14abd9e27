"""What changed between two campaigns: in a line, and parameter by parameter."""

from collections.abc import Iterator, Sequence

from rich.console import RenderableType

from beamstiff.diagnosis.changes import RunComparison
from beamstiff.diagnosis.notes import OFF
from beamstiff.errors import listed
from beamstiff.report.tables import Table, number, table
from beamstiff.report.verdict import Verdict


def changes_told(found: RunComparison, files: Sequence[str] = ("A", "B")) -> Iterator[RenderableType]:
    """Yield what a terminal shows of two campaigns, the files of which are named."""
    yield from changes_verdict(found, files).lines()
    yield changes_table(found)
    if found.changed and not any(one.changed for one in found.changes):
        yield "Which parameter, these data do not say: each by itself might be as before."
    if found.not_compared:
        yield f"Not determined by both campaigns: {listed(found.not_compared)}."


def changes_table(found: RunComparison) -> Table:
    """Return the table of parameters in both campaigns, the surest change first."""
    lines = []
    for one in sorted(found.changes, key=lambda one: one.p):
        values = map(number, (one.a, one.b, one.change, one.std))
        lines.append([one.name, *values, f"{one.p_holm:.2g}", one.unit, "changed" if one.changed else ""])
    heads = ("parameter", "A", "B", "change", "std", "p (Holm)", "unit", "")
    return table("From A to B", *heads, rows=lines)


def changes_verdict(found: RunComparison, files: Sequence[str]) -> Verdict:
    """Return the headline: whether something changed, what, and how sure that is."""
    told = f"p = {found.p:.2g} for all {len(found.changes)} parameters together, level {found.level:g}"
    data = " and ".join(files)
    if not found.changed:
        said = f"No change beyond the uncertainty: {told}"
        if (times := max(found.noise)) > OFF:
            left = f"the residual is {times:.2g} times the stated noise"
            then = f"Both campaigns fit one robot, but {left}: diagnose both, and compare by the robot found."
            return Verdict(said, "doubtful", data, then)
        return Verdict(said, "agrees", data, "Nothing to do: both campaigns fit one robot.")
    names = [one.name for one in sorted(found.changes, key=lambda one: one.p) if one.changed]
    what = f"Something changed ({listed(names, 3)})" if names else "Something changed"
    action = (
        f"Look at {names[0]} on the machine, then fit the later campaign by itself."
        if names
        else ("Measure more: these data do not say which parameter it is.")
    )
    return Verdict(f"{what}: {told}", "differs", data, action)
