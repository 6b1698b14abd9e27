"""What a diagnosis without a cause would have shown: the smallest sizes, an effect a row."""

from __future__ import annotations

from collections.abc import Sequence

from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.smallest import Smallest
from beamstiff.errors import listed
from beamstiff.report.tables import Column, Table, scale_of, table

HIDDEN = 3  # places that a row names
TITLE = "Smallest sizes that most campaigns like this one would have shown"


def smallest_table(result: Diagnosis) -> Table:
    """Return, an effect a row, how large it would have had to be where it shows best, and where worst."""
    by_effect: dict[str, list[Smallest]] = {}
    for one in result.smallest:
        by_effect.setdefault(one.key.partition(":")[0], []).append(one)
    columns = ("parameter", "where it shows best", "where worst", "not at a realistic size at")
    made = table(TITLE, "effect", *(Column(name, left=True) for name in columns))
    for effect, some in by_effect.items():
        seen = sorted((one for one in some if not one.hidden), key=lambda one: one.size)
        name = seen[0].parameter.name if seen else "-"
        ends = [_said(seen[at]) for at in (0, -1)] if seen else ["-", "-"]
        made.add_row(effect, name, ends[0], ends[1] if len(seen) > 1 else "-", _places(some))
    return made


def _said(one: Smallest) -> str:
    factor, unit = scale_of([one.size], one.parameter.unit)
    place = one.key.partition(":")[2]
    return f"{factor * one.size:.2g} {unit}" + ("" if place == "null" else f" at {place}")


def _places(some: Sequence[Smallest]) -> str:
    """Return where an effect would have shown at no realistic size."""
    names = [one.key.partition(":")[2] for one in some if one.hidden]
    return "all" if len(names) == len(some) else listed(names, HIDDEN) or "-"
