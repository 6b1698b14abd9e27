"""What a diagnosis without a cause would have shown: the smallest sizes, an effect a row."""

from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.smallest import Smallest
from beamstiff.errors import listed
from beamstiff.report.tables import Column, Table, below, scale_of, table

HIDDEN = 3  # places that are named
TITLE = "Smallest effects that data like these would reveal"


def smallest_table(result: Diagnosis) -> Table:
    """Return, an effect a row, how large it would have had to be where it shows best, and where worst.

    On a console an effect and its parameter stand in one cell, so that the table fits into 80 columns.
    """
    heads = [("effect", "page"), ("effect, its parameter", "console"), ("parameter", "page")]
    heads += [("size where it shows best", ""), ("where it shows worst", "")]
    made = table(TITLE, *(Column(name, left=True, only=only) for name, only in heads))
    for effect, some in _by_effect(result).items():
        if seen := sorted((one for one in some if not one.hidden), key=lambda one: one.size):
            name, last = seen[0].parameter.name, _said(seen[-1]) if len(seen) > 1 else "-"
            made.add_row(effect, below(effect, name), name, _said(seen[0]), last)
    return made


def hidden_text(result: Diagnosis) -> str:
    """Return, in words, which effects of a realistic size these rows would not have shown, and where."""
    each = []
    for effect, some in _by_effect(result).items():
        names = [one.key.partition(":")[2] for one in some if one.hidden]
        if names:
            each.append(effect + (f" at {listed(names, HIDDEN)}" if len(names) < len(some) else ""))
    return f"These rows would show no realistic size of: {'; '.join(each)}." if each else ""


def _by_effect(result: Diagnosis) -> dict[str, list[Smallest]]:
    found: dict[str, list[Smallest]] = {}
    for one in result.smallest:
        found.setdefault(one.key.partition(":")[0], []).append(one)
    return found


def _said(one: Smallest) -> str:
    factor, unit = scale_of([one.size], one.parameter.unit)
    place = one.key.partition(":")[2]
    return f"{factor * one.size:.2g} {unit}" + ("" if place == "null" else f" at {place}")
