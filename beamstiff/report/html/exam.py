"""The report of an exam: targets and results, how far probabilities hold, the worst class."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from beamstiff.errors import counted
from beamstiff.exam import score
from beamstiff.exam.names import EFFECTS, FAILED, NONE, UNKNOWN
from beamstiff.exam.rates import Figure as Rate
from beamstiff.exam.record import Record
from beamstiff.exam.score import calibration_error, reliability
from beamstiff.exam.table import Row, by_design, controls, effect_figures, headline
from beamstiff.report import exam as told
from beamstiff.report.html.charts import SHARE, confusion_figure, error_bars, named_rows
from beamstiff.report.html.page import Page
from beamstiff.report.html.parts import (
    MARGIN,
    Fact,
    Figure,
    Section,
    axis,
    chart_layout,
    css,
    label,
    plain_layout,
    scatter,
)
from beamstiff.report.html.places import LEGEND
from beamstiff.report.html.provenance import Provenance

Records = Sequence[Record]
HOVER = "%{text}<extra></extra>"
ORDER = (*EFFECTS, NONE, UNKNOWN, FAILED, "removed", "outside")
MARKS = {
    "aim": ("aim met", "circle", "green"),
    "required": ("target met", "circle", "blue"),
    "missed": ("missed", "x", "hot"),
    None: ("no target", "circle-open", "muted"),
}


def exam_html(
    records: Records,
    examined: str,
    provenance: Provenance,
    facts: Mapping[str, Any],
    plan: bool = False,
    notes: Sequence[str] = (),
) -> str:
    """Return the report of an exam, or of what one campaign (`plan`) could find, as one HTML page."""
    rich, lean = by_design(records)
    main = rich or lean
    rows = [row for row in headline(main, lean=not rich) if row.figure.count]
    broken = any(record.error is not None for record in records)
    failures = [told.failures_table(records)] if broken else []
    return Page(
        title="Exam of a plan" if plan else "Exam of the diagnosis",
        robot=examined,
        verdict=told.plan_verdict(records) if plan else told.exam_verdict(rows, records),
        summary=list(_summary(main, lean if rich else [], rows)),
        facts=list(_facts(main)),
        view=None,
        sections=[
            *([_plan(records)] if plan else []),
            _asked(rows),
            _reliability(main),
            _effects(main),
            _confusion(main),
            _sorts(records, lean if rich else []),
            _controls(main),
            Section("failures", "Where the diagnosis broke off", tables=failures),
            Section("notes", "Notes", items=notes),
        ],
        provenance=provenance,
        data=facts,
    ).html()


def _plan(records: Records) -> Section:
    """Return what a campaign could find: effects, the hardest to find first."""
    singles = score.by_effect(score.of_kind(records, "single"))
    if not singles:
        return Section("plan", "What this plan could find")
    rates = {effect: score.coverage(cases) for effect, cases in singles.items()}
    names = sorted(rates, key=lambda effect: (rates[effect].value or 0.0, effect))
    title = "The verdict's set holds the truth"
    caption = f"How often {title[0].lower()}{title[1:]}, with its 95 % interval, the hardest to find first."
    figure = _rates("plan-covered", title, caption, names, [rates[name] for name in names])
    tables = [next(told.plan_tables(records))]
    return Section("plan", "What this plan could find", figures=[figure], tables=tables)


def _rates(key: str, title: str, caption: str, names: Sequence[str], rates: Sequence[Rate]) -> Figure:
    """Return shares with their intervals, a row a name."""
    texts = [f"{name}: {told.share(one)} of {one.count}" for name, one in zip(names, rates, strict=True)]
    values, places, said = [one.value for one in rates], list(range(len(rates))), list(map(label, texts))
    traces = [_intervals(rates), scatter(values, places, title, HOVER, ("circle", "blue", 10), text=said)]
    layout = named_rows(names, "share of the cases, 95 %", tickformat=".0%", range=[-0.02, 1.02])
    return Figure(key, title, caption, traces, layout)


def _summary(main: Records, lean: Records, rows: Sequence[Row]) -> Iterator[str]:
    yield (
        "Each machine was simulated with a withheld effect, by a program that shares no equations with the "
        "diagnosis, and diagnosed from its rows alone."
    )
    missed = []
    for row in (row for row in rows if row.met == "missed"):
        least = "at least" if row.better == "high" else "at most"
        missed.append(
            f"{row.name} {_text(row, row.figure.value)} (target {least} {_text(row, row.required)})"
        )
    if missed:
        yield f"Missed: {'; '.join(missed)}."
    if worst := score.worst_first(main):
        effect, cases = worst[0]
        found = effect_figures(cases)
        yield (
            f"The worst class is {effect}: the verdict's set holds the truth in "
            f"{told.share(found['covered'])} of {counted(len(cases), 'case')}, exactly right are "
            f"{told.share(found['exact'])}."
        )
    if lean:
        yield f"Lean designs, {counted(len(lean), 'case')}, are scored separately, with lower targets."
    if broken := sum(record.error is not None for record in main):
        yield f"The diagnosis broke off in {counted(broken, 'case')}, which count as wrong."


def _facts(main: Records) -> Iterator[Fact]:
    singles = score.clear_singles(main)
    for name, figure, meaning in (
        ("False alarms", score.false_alarms(main), "of machines with nothing wrong"),
        ("Exact", score.exact(singles), "cause and place, one effect, gap above the noise"),
        ("Set holds the truth", score.coverage(singles), "the verdict or one of its look-alikes is right"),
    ):
        if figure.value is not None:
            yield Fact(name, told.share(figure), f"{meaning}; {counted(figure.count, 'case')}")
    error = calibration_error(main)
    if error.value is not None:
        yield Fact("Calibration error", f"{error.value:.3f}", "probability said against share that is right")


def _asked(rows: Sequence[Row]) -> Section:
    shares = [row for row in rows if row.share]
    traces = [_intervals([row.figure for row in shares])]
    for key, (name, symbol, colour) in MARKS.items():
        if own := [at for at, row in enumerate(shares) if row.met == key]:
            x = [shares[at].figure.value for at in own]
            texts = [label(f"{shares[at].name}: {told.share(shares[at].figure)}") for at in own]
            traces.append(scatter(x, own, name, HOVER, (symbol, colour, 11), text=texts))
    asked = [at for at, row in enumerate(shares) if row.required is not None]
    if asked:
        x, hover = [shares[at].required for at in asked], "target: %{x:.0%}<extra></extra>"
        traces.append(scatter(x, asked, "target", hover, ("line-ns-open", "ink", 20)))
        traces[-1]["marker"]["line"] = {"width": 2}
    names = [row.name for row in shares]
    layout = named_rows(names, "share of the cases", tickformat=".0%", range=[-0.02, 1.02])
    layout |= {"showlegend": True, "margin": MARGIN | {"t": LEGEND + 30}, "height": layout["height"] + 60}
    caption = "Result with its 95 % interval; the vertical line is the target."
    table = told.headline_table(rows, "Targets and results")
    figure = Figure("asked-shares", "Shares", caption, traces, layout, table)
    return Section("asked", "Targets and results", figures=[figure])


def _intervals(figures: Sequence[Rate]) -> dict[str, Any]:
    x: list[float | None] = []
    y: list[float | None] = []
    for at, one in enumerate(figures):
        x += [one.low, one.high, None]
        y += [at, at, None]
    return scatter(x, y, "95 %", line={"color": css("muted"), "width": 4})


def _reliability(records: Records) -> Section:
    bins = reliability(records)
    if not bins:
        return Section("reliability", "Probabilities")
    right = [item.right.value or 0.0 for item in bins]
    texts = [
        f"{item.low:.1f} to {item.high:.1f}: {told.share(item.right)} of {item.right.count} right"
        for item in bins
    ]
    said = [item.said for item in bins]
    ends = [(one.right.low or 0.0, one.right.high or 0.0) for one in bins]
    mark, error = ("circle", "blue", 9), error_bars(right, ends, "blue")
    traces = [
        scatter([0, 1], [0, 1], "as said", line={"color": css("muted"), "width": 1}),
        scatter(said, right, "examined, 95 %", HOVER, mark, text=texts, error_y=error),
    ]
    x, y = axis("probability said of the verdict", **SHARE), axis("share of verdicts that are right", **SHARE)
    layout = chart_layout(430, LEGEND, x, y)
    table = replace(told.reliability_table(records), open=False)
    caption = "On the line, a verdict called 80 % sure is right in 80 % of the cases."
    counts = {
        "type": "bar",
        "x": [0.5 * (one.low + one.high) for one in bins],
        "y": [one.right.count for one in bins],
        "width": [0.95 * (one.high - one.low) for one in bins],
        "text": texts,
        "textposition": "none",
        "hovertemplate": HOVER,
        "marker": {"color": css("blue")},
        "name": "cases",
    }
    how_many = plain_layout(430, xaxis=x, yaxis=axis("cases"), showlegend=False)
    said_of = "Cases by the probability said."
    figures = [
        Figure("reliability-right", "Reliability", caption, traces, layout, table),
        Figure("reliability-cases", "How often said", said_of, [counts], how_many),
    ]
    return Section("reliability", "How far probabilities can be trusted", figures=figures)


def _effects(records: Records) -> Section:
    worst = score.worst_first(records)
    if not worst:
        return Section("effects", "By effect")
    figures = []
    names = [effect for effect, _ in worst]
    cases = "Single effects, gap at least the noise, the worst first."
    for key, title, caption in (
        ("covered", "The verdict's set holds the truth", cases),
        ("exact", "Cause and place exactly right", "The same cases, in the same order."),
    ):
        rates = [effect_figures(some)[key] for _, some in worst]
        figures.append(_rates(f"effects-{key}", title, caption, names, rates))
    tables = [told.effects_table(records), told.bands_table(records)]
    return Section("effects", "By effect, the worst first", figures=figures, tables=tables)


def _confusion(records: Records) -> Section:
    counts = score.confusion(records)
    if not counts:
        return Section("confusion", "Confusion")
    given = {name for row in counts.values() for name in row} | set(counts)
    order = (*ORDER, *sorted(given - set(ORDER)))
    table = replace(told.confusion_table(records), open=False)
    text = (
        "Of cases whose gap is at least the noise. Of removed the effect was taken from the library, "
        "outside are in no library."
    )
    figure = confusion_figure(counts, order, table)
    return Section("confusion", "What was mistaken for what", [text], [figure])


def _sorts(records: Records, lean: Records) -> Section:
    tables = [told.groups_table(records)]
    if lean:
        rows = [row for row in headline(lean, lean=True) if row.figure.count]
        table = told.headline_table(rows, f"Lean designs: {counted(len(lean), 'case')}")
        tables.append(replace(table, open=False))
    return Section("sorts", "By sort of case", tables=tables)


def _controls(records: Records) -> Section:
    text = "What chance and simple methods get exactly right, for comparison."
    return Section("controls", "Controls", [text], tables=[told.control_table(controls(records))])


def _text(row: Row, value: float | None) -> str:
    if value is None:
        return "-"
    return f"{100 * value:.1f} %" if row.share else f"{value:.3f}"
