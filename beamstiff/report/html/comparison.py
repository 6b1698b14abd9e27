"""The report of models side by side: the error of each on held-out rows, where, and under which load."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from beamstiff.errors import counted
from beamstiff.identification.models.side_by_side import Judged, Models
from beamstiff.identification.models.split import KINDS
from beamstiff.model.protocol import StructuralModel
from beamstiff.report.compare import (
    held_out_levels,
    loads_table,
    models_table,
    models_text,
    models_verdict,
    ranked,
    whole,
    widest_plane,
)
from beamstiff.report.html.charts import intervals, log_axis
from beamstiff.report.html.page import Page
from beamstiff.report.html.parts import Fact, Figure, Section, axis, chart_layout, css, label, scatter
from beamstiff.report.html.places import LEGEND, Sizes, over_places, rows_table
from beamstiff.report.html.provenance import Provenance
from beamstiff.report.html.robot_view import RobotView, robot_view, worst_postures
from beamstiff.report.tables import Table
from beamstiff.robot.description import Robot

KIND_MARKS = (("circle-open", "muted"), ("circle", "blue"), ("square", "orange"), ("triangle-up", "green"))
LOOKS = tuple(
    (symbol, colour)
    for symbol in ("circle", "square-open", "triangle-up")
    for colour in ("blue", "orange", "green", "muted")
)


def comparison_html(models: Models, robot: Robot, provenance: Provenance) -> str:
    """Return the report of a comparison for a robot as it was given, as one HTML page."""
    answered = ranked(models)
    keys = {f"model{at + 1}": one for at, one in enumerate(answered) if one.name != "rigid"}
    errors, names = {key: 1e3 * one.error for key, one in keys.items()}, [one.name for one in keys.values()]
    sizes = Sizes(robot, models.table, errors, names, "error")
    more = [(f"error {one.name}, mm", 1e3 * one.error) for one in answered]
    table = rows_table(sizes, [*more, ("kind", models.split.kind.astype(float))])
    kinds = "; ".join(f"{at}: {kind}" for at, kind in enumerate(KINDS))
    return Page(
        title="Comparison of models",
        robot=robot.name,
        verdict=models_verdict(models),
        summary=list(_summary(models)),
        facts=list(_facts(models)),
        view=_view(models),
        sections=[
            _side_by_side(models),
            _by_load(models),
            Section("about", "What came out of each", items=models_text(models)),
            *over_places(sizes, joints=False, planes=(widest_plane(models.position),)),
            Section("rows", "The rows", [f"Kinds: {kinds}."], tables=[table], open=False),
            Section("notes", "Notes", items=models.notes),
        ],
        provenance=provenance,
        data=models.to_dict(),
    ).html()


def _summary(models: Models) -> Iterator[str]:
    split = models.split
    counts = np.bincount(split.kind, minlength=len(KINDS))
    parts = [f"{counts[k]} {kind}" for k, kind in enumerate(KINDS) if k and counts[k]]
    yield (
        f"All models were fitted to the same {counted(int(split.fitted.sum()), 'row')} and tested on "
        f"{int((~split.fitted).sum())} held-out ones ({', '.join(parts)})."
    )
    if models.noise is not None:
        yield f"The noise floor is {1e3 * models.noise:.4f} mm RMS: no model can be expected to do better."
    failed = [one.name for one in models.judged if one.model is None]
    if failed:
        yield f"Not fitted: {', '.join(failed)}; the reasons are below."


def _facts(models: Models) -> Iterator[Fact]:
    unseen = ~models.split.fitted
    for one in ranked(models)[:3]:
        rms, largest = one.rms(unseen), one.largest(unseen)
        if rms is not None and largest is not None:
            outside = int((one.outside & unseen).sum())
            more = f"; {outside} outside its training range" if outside else ""
            meaning = f"RMS, held out; at most {1e3 * largest:.3f} mm{more}"
            yield Fact(one.name, f"{1e3 * rms:.4f} mm", meaning)
    if models.noise is not None:
        yield Fact("Noise", f"{1e3 * models.noise:.4f} mm", "noise floor of the RMS")


def _view(models: Models) -> RobotView | None:
    """Return the best of the models that are robots, at the rows that it predicts worst."""
    for one in ranked(models):
        if isinstance(one.model, StructuralModel):
            shown, name = worst_postures(models.table, 1e3 * one.error, "error "), f"the {one.name} model"
            return robot_view(one.model.robot, shown, "share of the strain energy", model=name)
    return None


def _side_by_side(models: Models) -> Section:
    unseen = ~models.split.fitted
    best = ranked(models)
    values = [1e3 * (one.rms(unseen) or 0.0) for one in best]
    names, ends = [one.name for one in best], [(None, None)] * len(best)
    traces, layout = intervals(names, values, ends, "held-out RMS, mm")
    if models.noise is not None:
        ends_of_line, looks = [-0.6, len(best) - 0.4], {"color": css("orange"), "dash": "dash"}
        hover = "noise floor: %{x:.4g} mm<extra></extra>"
        traces.append(scatter([1e3 * models.noise] * 2, ends_of_line, "noise floor", hover, line=looks))
    partly = [one.name for one in best if not whole(models, one)]
    noise = "; dashed: noise floor" if models.noise is not None else ""
    caption = f"Root mean square position error over the held-out rows, the best first{noise}."
    if partly:
        caption += f" Of fewer rows, where it has an answer: {', '.join(partly)}."
    kinds = [k for k in range(len(KINDS)) if (models.split.kind == k).any()]
    figures = [Figure("models", "Held-out rows", caption, traces, layout), _by_kind(models, best, kinds)]
    table = models_table(models, "Position error, RMS / max, mm")
    return Section("models", "Models side by side", figures=figures, tables=[table])


def _by_kind(models: Models, best: Sequence[Judged], kinds: Sequence[int]) -> Figure:
    traces, places, names = [], list(range(len(best))), [label(one.name) for one in best]
    for k, (symbol, colour) in zip(kinds, KIND_MARKS, strict=False):
        values = _millimetres(one.rms(models.split.kind == k) for one in best)
        hover = "%{text}: %{y:.4g} mm"
        traces.append(scatter(places, values, KINDS[k], hover, (symbol, colour, 10), text=names))
    x, y = axis(tickvals=places, ticktext=names), log_axis("RMS, mm", traces)
    layout = chart_layout(420, LEGEND + 10, x, y)
    caption = "Fitted rows beside held-out rows: a model that overfits does well on the fitted rows only."
    return Figure("kinds", "By what was held out", caption, traces, layout)


def _millimetres(values: Iterable[float | None]) -> list[float | None]:
    return [None if value is None else 1e3 * value for value in values]


def _by_load(models: Models) -> Section:
    split, levels = models.split, held_out_levels(models)
    if len(levels) < 2:
        return Section("loads", "By load")
    traces, loads = [], [float(f"{split.loads[at]:.5g}") for at in levels]
    for one, (symbol, colour) in zip(ranked(models), LOOKS, strict=False):
        values = _millimetres(one.rms(rows) for rows in levels.values())
        hover, line = "%{y:.4g} mm under %{x} " + split.unit, {"color": css(colour), "width": 1.5}
        traces.append(scatter(loads, values, label(one.name), hover, (symbol, colour, 9), line))
    x, y = axis(f"load, {split.unit}"), log_axis("held-out RMS, mm", traces)
    layout = chart_layout(420, LEGEND + 30, x, y)
    table: Table = loads_table(models)
    figure = Figure("loads-rms", "Errors by load", "Of held-out rows.", traces, layout, table)
    return Section("loads", "By load", figures=[figure])
