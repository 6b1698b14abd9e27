"""Tables and figures of an exam of the diagnosis: targets and results, the worst class first."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from textwrap import wrap
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from rich.console import RenderableType

from beamstiff.errors import counted
from beamstiff.exam import score
from beamstiff.exam.crowded.record import CrowdedRecord
from beamstiff.exam.crowded.score import by_data, figures, is_main_exact, names_of, pairs_of, with_main
from beamstiff.exam.names import EFFECTS, FAILED, NONE, UNKNOWN
from beamstiff.exam.rates import Figure
from beamstiff.exam.record import Record
from beamstiff.exam.score import calibration_error, reliability
from beamstiff.exam.table import Row, banded, by_design, controls, effect_figures, groups, headline
from beamstiff.functions.examine import Examination
from beamstiff.report.figures import BLUE, GREY, ORANGE, new_figure, plain
from beamstiff.report.tables import Table, spaced, table
from beamstiff.report.verdict import Verdict

Records = Sequence[Record]

MARKS = {"aim": "aim met", "required": "met", "missed": "MISSED", None: ""}
FEW = 20  # cases, of which no share says whether a figure is reached
MOST_FAILURES = 20
SIZES = tuple(row.name for row in headline([]) if not row.share)  # figures that are no shares of cases
SHARES = ("detected", "exact", "family", "place", "covered", "unknown")


def _seen(rows: Iterable[Row]) -> list[Row]:
    """Return the rows that have a case; all where none has."""
    known = list(rows)
    return [row for row in known if row.figure.count] or known


def examination_told(found: Examination) -> Iterator[RenderableType]:
    """Yield what a terminal shows of an exam, by what was examined."""
    records = list(found.records)
    if "crowded" in found.settings:
        yield from spaced(crowded_tables(records))
    elif found.settings.get("plan") is not None:
        yield from plan_verdict(records).lines()
        yield from spaced(plan_tables(records))
    else:
        yield from exam_verdict(headline(by_design(records)[0]), records).lines()
        yield from spaced(exam_tables(records))


def exam_tables(records: Records) -> Iterator[Table]:
    """Return all tables of an exam, in the order in which people read them; lean designs stand apart."""
    told, lean = by_design(records)
    yield headline_table(_seen(headline(told)), f"Diagnosis examined: {_cases(told)}")
    if lean:
        title = f"Lean designs, ten poses with one load each: {_cases(lean)}"
        yield headline_table(_seen(headline(lean, lean=True)), title)
    yield from (effects_table(told), groups_table(records), bands_table(told))
    yield from (reliability_table(told), confusion_table(told), control_table(controls(told)))
    if any(record.error is not None for record in records):
        yield failures_table(records)


def exam_verdict(rows: Iterable[Row], records: Sequence[Any]) -> Verdict:
    """Return the headline: how many of the targets are met."""
    asked = [row for row in rows if row.met is not None and row.figure.count >= FEW]
    cases = counted(len(records), "case")
    if not asked:
        return Verdict(f"{cases}: too few to judge the targets", action="Ask for more of them (--cases).")
    missed = [row.name for row in asked if row.met == "missed"]
    met = len(asked) - len(missed)
    action = f"Look at what is missed first: {missed[0]}." if missed else ""
    return Verdict(f"{met} of {len(asked)} targets met, in {cases}", action=action)


def plan_verdict(records: Records) -> Verdict:
    """Return the headline: how often a plan would find an effect exactly."""
    singles = score.of_kind(records, "single")
    exact = score.exact(singles)
    right = 0 if exact.value is None else round(exact.value * len(singles))
    cases = counted(len(singles), "case")
    said = f"In {right} of {cases} the effect would be found exactly, at realistic sizes as drawn"
    action = "Effects that are seldom found want other postures or loads (beamstiff plan)."
    return Verdict(said, action=action)


def crowded_tables(records: Sequence[CrowdedRecord]) -> Iterator[Table]:
    """Return the figures of an exam of crowded machines, each beside that of the controls, and the misses."""
    who = names_of(records)
    heads = [head for one in who for head in (one, "cases")]
    for group, some in by_data(records).items():
        kinds = Counter(record.label.kind for record in some)
        title = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
        result = table(f"Crowded machines, {group}: {title}", "figure", "target", "", *heads)
        for found in figures(some):
            row = found[who[0]]
            pairs = (cell for one in found.values() for cell in (_reached(one), str(one.figure.count)))
            result.add_row(row.name, _asked(row, row.required or None), mark(row), *pairs)
        yield result
    misses = table("Largest cause not named first", "case", "truth", "closes", "named", left=2)
    for label, reply in with_main(pairs_of(records, who[0])):
        if not is_main_exact(label, reply):
            said = " ".join(reply.named) or reply.verdict
            misses.add_row(str(label.case), label.causes[0].key, f"{label.causes[0].closes:.2f}", said)
    yield misses


def plan_tables(records: Records) -> Iterator[Table]:
    """Return what a campaign could find: effects, the hardest to find first; then by size, and nulls."""
    title = f"What this plan could find: {_cases(records)}, sizes all over the realistic range"
    heads = ("effect", "cases", "diagnosis/noise", "gap seen", "exact", "set holds it", "set size")
    result = table(title, *heads)
    singles = score.by_effect(score.of_kind(records, "single"))
    rates = {effect: score.coverage(cases).value for effect, cases in singles.items()}
    for effect in sorted(rates, key=lambda one: (-1.0 if rates[one] is None else rates[one], one)):
        cases, found = singles[effect], effect_figures(singles[effect])
        gaps = sorted(record.gap for record in cases)
        shares = (share(found[name]) for name in ("detected", "exact", "covered"))
        middle = f"{gaps[len(gaps) // 2]:.2g}"
        result.add_row(effect, str(len(cases)), middle, *shares, _plain(found["set_size"]))
    yield from (result, bands_table(records))
    rows = [row for row in headline(records) if row.figure.count]
    yield headline_table(rows, f"{score.false_alarms(records).count} nulls among them")


def mark(row: Row) -> str:
    """Return whether a figure meets its target, in words."""
    return "too few cases" if row.met is not None and row.figure.count < FEW else MARKS[row.met]


def headline_table(rows: Iterable[Row], title: str) -> Table:
    """Return the figures, each with its 95 % interval, beside what is required and aimed at."""
    result = table(title, "figure", "result", "95 %", "cases", "target", "aim", "")
    for row in rows:
        asked = (_asked(row, value) for value in (row.required, row.aim))
        result.add_row(row.name, _reached(row), _interval(row), str(row.figure.count), *asked, mark(row))
    return result


def _asked(row: Row, value: float | None) -> str:
    return "" if value is None else f"{'>=' if row.better == 'high' else '<='} {value:g}"


def _reached(row: Row) -> str:
    return share(row.figure) if row.share else _plain(row.figure)


def control_table(rows: Iterable[Row]) -> Table:
    """Return the controls: what chance and plain methods get exactly right."""
    result = table("Controls: exact cause and place, single effects", "control", "result", "95 %", "cases")
    for row in rows:
        result.add_row(row.name, share(row.figure), _interval(row), str(row.figure.count))
    return result


def failures_table(records: Records) -> Table:
    """Return the cases in which the diagnosis broke off, and why."""
    failed = [record for record in records if record.error is not None]
    result = table(f"The diagnosis broke off: {len(failed)}", "case", "robot", "truth", "why", left=4)
    for record in failed[:MOST_FAILURES]:
        truth = " ".join(record.label.truths) or NONE
        result.add_row(str(record.label.case), record.label.robot, truth, str(record.error))
    return result


def effects_table(records: Records) -> Table:
    """Return a row for each effect, gap at least the noise, the worst first."""
    return _figures_table("By effect, gap >= 1 sigma, the worst first", "effect", score.worst_first(records))


def bands_table(records: Records) -> Table:
    """Return a row for each band of gap over noise, single effects."""
    return _figures_table("By gap over noise, single effects", "diagnosis/noise", banded(records))


def _figures_table(title: str, head: str, groups: Iterable[tuple[str, Records]]) -> Table:
    names = ("seen", "exact", "family", "place", "set holds it", "unknown", "set size", "shrink differs")
    result = table(title, head, "cases", *names)
    for name, cases in groups:
        found = effect_figures(cases)
        sizes = (_plain(found[one]) for one in ("set_size", "shrink_difference"))
        result.add_row(name, str(len(cases)), *(share(found[one]) for one in SHARES), *sizes)
    return result


def groups_table(records: Records) -> Table:
    """Return the main figures by design, robot, readings, data and claimed noise."""
    heads = ("singles", "exact", "family", "set holds it", "of names", "set size", "calibration")
    title = "By sort of case (singles with gap >= 1 sigma)"
    result = table(title, "cases", "all", "nulls", "alarms", *heads)
    of = (score.exact, score.right_family, score.coverage, score.coverage_of_names)
    for name, cases in groups(records).items():
        singles, nulls = score.clear_singles(cases), score.false_alarms(cases)
        counts = (str(len(cases)), str(nulls.count), share(nulls), str(len(singles)))
        sizes = (_plain(score.set_size(singles)), _plain(calibration_error(cases)))
        result.add_row(name, *counts, *(share(one(singles)) for one in of), *sizes)
    return result


def reliability_table(records: Records) -> Table:
    """Return, for verdicts by their probability, how many are right."""
    result = table("Reliability of the probabilities", "said", "mean said", "right", "95 %", "cases")
    for item in reliability(records):
        said = (f"{item.low:.1f} to {item.high:.1f}", f"{item.said:.3f}")
        right = (share(item.right), _interval(Row("", item.right)), str(item.right.count))
        result.add_row(*said, *right)
    return result


def confusion_table(records: Records) -> Table:
    """Return how often each effect (rows, the truth) got each verdict; empty columns are left out.

    Columns carry the effects' numbers, by which the rows are counted.
    """
    rows = score.confusion(records)
    order = (*EFFECTS, NONE, UNKNOWN, FAILED)
    given = {verdict for row in rows.values() for verdict in row}
    columns = [name for name in (*order, *sorted(given - set(order))) if name in given]
    number = {effect: str(at) for at, effect in enumerate(EFFECTS, start=1)}
    heads = (number.get(name, name) for name in columns)
    result = table("Confusion, gap >= 1 sigma: truth down, verdict across", "", "truth", *heads, left=2)
    truths = [name for name in (*order, "removed", "outside") if name in rows]
    for truth in [*truths, *sorted(set(rows) - set(truths))]:
        counts = (str(rows[truth][name]) if rows[truth][name] else "." for name in columns)
        result.add_row(number.get(truth, ""), truth, *counts)
    return result


def reliability_figure(records: Records) -> Drawing:
    """Draw the share of right verdicts over the probability said, with 95 % intervals and the counts."""
    bins = reliability(records)
    figure = new_figure(5.2, 5.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[4, 1])
    plain(above)
    plain(below)
    ends = [(item.right.low or 0.0, item.right.high or 0.0) for item in bins]
    _said_and_right(above, [item.said for item in bins], [item.right.value or 0.0 for item in bins], ends)
    above.set(xlim=(0, 1), ylim=(0, 1), ylabel="share of verdicts that are right", title="Reliability")
    x, width = [item.low for item in bins], [item.high - item.low for item in bins]
    below.bar(x, [item.right.count for item in bins], width=width, align="edge", color=BLUE)
    below.set(xlabel="probability said of the verdict", ylabel="cases")
    return figure


def exam_figure(told: Mapping[str, Any], title: str = "") -> Drawing:
    """Draw an exam from its table, as ``--json`` writes it: targets and results, reliability, single effects.

    Lean designs are left out where others are there.

    `told`: of `table_dict`: ``headline``, ``reliability``, ``effects``.
    """
    rows = {
        name: row
        for name, row in told["headline"].get("rich, all", told["headline"].get("all", {})).items()
        if name not in SIZES and None not in (row["required"], row["value"], row["low"])
    }
    figure = new_figure(12.0, 6.4)
    figure.suptitle(title or f"The diagnosis examined: {told['cases']} cases")
    asked, right = figure.subplots(1, 2, width_ratios=(1.1, 1))
    _draw_reached(asked, rows)
    required = [row["required"] for row in rows.values()]
    asked.plot(required, range(len(rows)), "|", color="black", ms=18, mew=2, label="target")
    asked.set(title="Targets and results", xlabel="share of the cases, 95 %")
    asked.legend(loc="center left", frameon=False)
    bins = told["reliability"]
    shares = [one["right"] for one in bins]
    ends = [(one["low"], one["high"]) for one in shares]
    _said_and_right(right, [one["said"] for one in bins], [one["value"] for one in shares], ends)
    for one in bins:
        text, at = str(one["right"]["count"]), (one["said"], 0.01)
        right.annotate(text, at, ha="center", fontsize="x-small", color=GREY)
    right.set(xlim=(0, 1.02), ylim=(0, 1.02), title="Reliability (numbers: cases)")
    right.set(xlabel="probability said of the verdict", ylabel="share of verdicts that are right")
    plain(right)
    return figure


def _said_and_right(
    axes: Axes, said: Sequence[float], right: Sequence[float], ends: Sequence[tuple[float, float]]
) -> None:
    """Draw the share that is right over the probability said, and the line on which they are the same."""
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=1, label="as said")
    if right:
        between = [(value - low, high - value) for value, (low, high) in zip(right, ends, strict=True)]
        yerr = list(zip(*between, strict=True))
        axes.errorbar(said, right, yerr=yerr, fmt="o", color=BLUE, capsize=3, label="examined, 95 %")
    axes.legend(loc="upper left", frameon=False)


def _draw_reached(axes: Axes, rows: Mapping[str, Mapping[str, Any]]) -> None:
    """Draw results with their intervals, a row a name, the first on top; a missed target as a cross."""
    for at, row in enumerate(rows.values()):
        label, colour, mark = ("missed", ORANGE, "X") if row["met"] == "missed" else ("met", BLUE, "o")
        axes.plot([row["low"], row["high"]], [at, at], color=colour, linewidth=2)
        known = axes.get_legend_handles_labels()[1]
        axes.plot(row["value"], at, mark, color=colour, label="" if label in known else label)
    axes.set_yticks(range(len(rows)), ["\n".join(wrap(name, 34)) for name in rows])
    axes.set(xlim=(-0.02, 1.02), ylim=(len(rows) - 0.4, -0.6))
    plain(axes)


def _cases(records: Records) -> str:
    broken = sum(record.error is not None for record in records)
    return counted(len(records), "case") + (f", {broken} of them broke off" if broken else "")


def share(figure: Figure) -> str:
    """Return a share of cases in per cent."""
    return "-" if figure.value is None else f"{100 * figure.value:.1f} %"


def _plain(figure: Figure) -> str:
    return "-" if figure.value is None else f"{figure.value:.3f}"


def _interval(row: Row) -> str:
    low, high = row.figure.low, row.figure.high
    if low is None or high is None:
        return ""
    return f"{100 * low:.1f} to {100 * high:.1f}" if row.share else f"{low:.3f} to {high:.3f}"
