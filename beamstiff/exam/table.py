"""The exam's table: each figure with what is required and aimed at, over all cases and groups of them."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal

from beamstiff.exam import score
from beamstiff.exam.rates import Figure
from beamstiff.exam.record import Record
from beamstiff.exam.score import brier, calibration_error, reliability

Records = Sequence[Record]


@dataclass(frozen=True)
class Row:
    """A figure of the table; none is required, or aimed at, where nothing is asked."""

    name: str
    figure: Figure  # what was reached
    required: float | None = None
    aim: float | None = None
    better: Literal["high", "low"] = "high"  # which way is good
    share: bool = True  # whether it is a share, shown as such

    @property
    def met(self) -> Literal["aim", "required", "missed"] | None:
        """What the value reaches; None where nothing is asked or there is no case."""
        value = self.figure.value
        if value is None or self.required is None:
            return None
        sign = 1 if self.better == "high" else -1
        if self.aim is not None and sign * value >= sign * self.aim:
            return "aim"
        return "required" if sign * value >= sign * self.required else "missed"


ALARMS = "false alarms on null data"
COVERED = "verdict set holds the truth"
PROMISED = "promised against true shrink, median difference at >= 1.5 sigma"
COVERED_NAMES = "the same, of verdicts that name an effect"


def headline(records: Records, lean: bool = False) -> list[Row]:
    """Return the figures that the exam asks for; of `lean` designs no false alarms, and true sets, alone."""
    singles = score.clear_singles(records)
    rows = [
        Row(ALARMS, score.false_alarms(records), 0.05, 0.02, "low"),
        Row("gap seen, single effect, gap >= 1 sigma", score.detection(singles)),
        Row("exact cause and place, single effect, gap >= 1 sigma", score.exact(singles), 0.90, 0.97),
        Row("family", score.right_family(singles), 0.97, 0.99),
        Row("place", score.right_place(singles)),
        Row(COVERED, score.coverage(singles), 0.97, 0.99),
        Row(COVERED_NAMES, score.coverage_of_names(singles), 0.97, 0.99),
        Row("mean size of the set", score.set_size(singles), 1.8, 1.3, "low", share=False),
        Row("called unknown", score.unknowns(singles), better="low"),
        Row("second cause named where there is one", score.false_seconds(singles), better="low"),
        Row("effect outside the library, not given a name", score.not_named(records), 0.92, 0.97),
        Row("own class removed, flagged (unknown, or a set)", score.flagged(records), 0.75, 0.90),
        Row("the same, strictly (unknown, or in the set by name)", score.truly_flagged(records)),
        Row("pairs: both", score.both(records), 0.65, 0.85),
        Row("pairs: nothing false", score.nothing_false(records), 0.96, 0.98),
        Row(PROMISED, score.shrink_difference(records), 0.07, 0.03, "low", share=False),
        Row("expected calibration error", calibration_error(records), 0.05, 0.03, "low", share=False),
        Row("Brier score (0 to 2)", brier(records), better="low", share=False),
    ]
    always = (ALARMS, COVERED_NAMES)
    return [replace(row, required=None, aim=None) if lean and row.name not in always else row for row in rows]


def controls(records: Records) -> list[Row]:
    """Return the controls beside what the diagnosis reached: shuffled labels, and each plain method."""
    singles = score.clear_singles(records)
    rows = [
        Row("exact cause and place", score.exact(singles)),
        Row("labels shuffled", score.shuffled(singles), better="low"),
        Row("chance", Figure(score.chance(singles), None, None, len(singles)), better="low"),
    ]
    for name in dict.fromkeys(name for record in records for name in record.controls):
        for band, low, high in (("gap >= 1 sigma", 1.0, float("inf")), ("0.3 to 1 sigma", 0.3, 1.0)):
            cases = score.between(score.of_kind(records, "single"), low, high)
            rows.append(Row(f"{name}, {band}", score.control_exact(cases, name)))
            rows.append(Row(f"diagnosis, {band}", score.exact(cases)))
        nulls = score.of_kind(records, "null")
        rows.append(Row(f"{name}, right on nulls", score.control_exact(nulls, name)))
    return rows


def by_design(records: Records) -> tuple[list[Record], list[Record]]:
    """Return the cases of all but lean designs, and those of lean ones."""
    lean = [record for record in records if record.label.design == "lean"]
    return [record for record in records if record.label.design != "lean"], lean


def groups(records: Records) -> dict[str, list[Record]]:
    """Return the cases by design; all but lean ones by robot, readings, data, claim and forms as well."""
    found: dict[str, list[Record]] = {}
    for record in records:
        label = record.label
        sorts = [f"{label.design}, all"]
        if label.design != "lean":
            claimed = f"noise claimed: {label.claimed}"
            rest = [label.robot, f"{label.readings} components", label.data, claimed]
            if label.truths:
                rest.append(f"forms of author {label.author}")
            sorts += [f"{label.design}, {sort}" for sort in rest]
        for sort in sorts:
            found.setdefault(sort, []).append(record)
    return dict(sorted(found.items()))


def banded(records: Records) -> list[tuple[str, list[Record]]]:
    """Return singles by gap over noise: below 0.3, to 1, to 3, above."""
    singles = score.of_kind(records, "single")
    return [
        (f"{low:g} to {high:g}" if high < float("inf") else f"above {low:g}", cases)
        for low, high in score.BANDS
        if (cases := score.between(singles, low, high))
    ]


def table_dict(records: Records) -> dict[str, object]:
    """Return all figures as plain data, for JSON; those by effect, band and so on without lean designs."""
    told = by_design(records)[0]
    return {
        "cases": len(records),
        "failed": sum(record.error is not None for record in records),
        "headline": {
            name: _rows(headline(cases, lean=name.startswith("lean")))
            for name, cases in {"all": records, **groups(records)}.items()
        },
        "controls": _rows(controls(told)),
        "effects": [
            {"effect": effect, "count": len(cases), **_figures(cases)}
            for effect, cases in score.worst_first(told)
        ],
        "bands": {name: {"count": len(cases), **_figures(cases)} for name, cases in banded(told)},
        "confusion": {truth: dict(row) for truth, row in score.confusion(told).items()},
        "reliability": [asdict(item) for item in reliability(told)],
    }


_EFFECT: dict[str, Callable[[Records], Figure]] = {
    "detected": score.detection,
    "exact": score.exact,
    "family": score.right_family,
    "place": score.right_place,
    "covered": score.coverage,
    "set_size": score.set_size,
    "unknown": score.unknowns,
    "shrink_difference": score.shrink_difference,
}


def effect_figures(records: Records) -> dict[str, Figure]:
    """Return what is shown of a class of singles: detected, exact, family, place, covered, set size, ..."""
    return {name: figure(records) for name, figure in _EFFECT.items()}


def _figures(records: Records) -> dict[str, object]:
    return {name: asdict(figure) for name, figure in effect_figures(records).items()}


def _rows(rows: list[Row]) -> dict[str, object]:
    return {row.name: row_dict(row) for row in rows}


def row_dict(row: Row) -> dict[str, object]:
    """Return a figure as plain data."""
    return {**asdict(row.figure), "required": row.required, "aim": row.aim, "met": row.met}
