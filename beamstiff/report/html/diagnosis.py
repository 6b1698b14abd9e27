"""The report of a diagnosis: the verdict in words, the robot, and the evidence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamstiff.diagnosis.held_out.prediction import shift
from beamstiff.diagnosis.result import Candidate, Diagnosis, Estimate
from beamstiff.report.diagnosis import (
    causes,
    causes_of,
    headline,
    named,
    one_posture,
    proposed,
    second,
    separations,
    sized,
    summary,
    tested,
    told,
)
from beamstiff.report.html.bars import bars
from beamstiff.report.html.page import Page, render
from beamstiff.report.html.parts import Fact, Figure, Section
from beamstiff.report.html.places import line_of
from beamstiff.report.html.provenance import Provenance
from beamstiff.report.html.robot_view import RobotView, Shown, robot_view
from beamstiff.report.html.rows import Compared, minded, row_figures
from beamstiff.report.tables import Table, number
from beamstiff.robot.fields import stiffness_text
from beamstiff.se3 import Array

SHOWN = 8  # candidates and places in figures; tables hold all
DEGREES = 180.0 / np.pi
LEAST = 0.0005  # probability of a candidate in the table
PARTS_OF_GAP = {
    "directions": "By direction",
    "loads": "By load",
    "history": "Loading and unloading",
    "time": "Over time",
}


def diagnosis_html(result: Diagnosis, provenance: Provenance) -> str:
    """Return the report of a diagnosis as one HTML page."""
    baseline = result.baseline
    compared = Compared(
        baseline.nominal,
        baseline.rows,
        baseline.measured,
        baseline.predicted,
        baseline.used,
        _with_cause(result),
    )
    rows = row_figures(compared, ("fitted model", f"with {causes(result)}"))
    return render(
        Page(
            title="Diagnosis",
            robot=baseline.nominal.name,
            verdict=headline(result),
            summary=[*minded(baseline.rows, baseline.nominal), *summary(result).splitlines()],
            facts=list(_facts(result)),
            view=_view(result),
            sections=[_which(result), _where(result), _how_far(result), *rows.sections, *_others(result)],
            provenance=provenance,
            data=result.to_dict(),
            shared=rows.shared,
        )
    )


def _with_cause(result: Diagnosis) -> Array | None:
    """Return what the model says with the verdict's effects in it; None where the verdict has none."""
    if not result.fits:
        return None
    columns = [[one.hypothesis.shape.columns for one in fit.shapes] for fit in result.fits]
    return result.linear.predicted + shift(result.linear, result.fits, columns)


def _facts(result: Diagnosis) -> Iterator[Fact]:
    also, sure = second(result), f"{100 * result.verdict.probability:.0f} %"
    if also is not None:
        sure += f" and {100 * also.probability:.0f} %"
    yield Fact("How sure", sure, "probability of the verdict")
    yield Fact("Gap", f"{1e3 * result.rms:.3f} mm", f"RMS, model fitted, {tested(result)}")
    if result.verdict.shrink is not None and not one_posture(result):
        yield Fact(
            "With the cause", f"{1e3 * result.verdict.shrink.after:.3f} mm", "the same, its effect added"
        )
    yield Fact("Noise", f"{1e3 * result.noise:.3f} mm", "what noise alone would leave")


def _view(result: Diagnosis) -> RobotView | None:
    baseline, shown = result.baseline, []
    rows = baseline.rows
    shares = {item["component"]: float(item["share"]) for item in result.where.get("components", [])}
    for worst in result.where.get("poses", []):
        own = np.flatnonzero(rows.pose == worst["pose"])
        at = int(own[np.argmax(np.linalg.norm(rows.wrench[own], axis=1))])
        name = f"pose {worst['pose']}: gap {worst['rms_mm']:.3g} mm ({line_of(rows, at)})"
        shown.append(Shown(name, rows.q[at], rows.wrench[at], str(rows.load_point[at]), shares))
    return robot_view(baseline.robot, shown, "share of the gap", gravity=baseline.absolute)


def _which(result: Diagnosis) -> Section:
    first = [
        one for at, one in enumerate(result.candidates) if at < SHOWN or one.effect in ("none", "unknown")
    ]
    traces, layout = bars(
        [named(one) for one in first],
        [one.probability for one in first],
        "blue",
        "probability",
        range=[0, 1.02],
        tickformat=".0%",
    )
    likely = [one for one in result.candidates if one.probability >= LEAST or one in first]
    columns = ("effect", "component", "probability", "shape", "gap after", "closes", "90 %")
    figure = Figure(
        "which",
        "Which effect",
        "Probability of the likeliest explanations, and of none and unknown.",
        traces,
        layout,
        Table("The candidates", columns, [_candidate(one, result) for one in likely], left=2),
    )
    sizes = [
        [named(one), name, value, std, realistic, _plausible(item), unit]
        for one in told(result)
        for item in one.estimates
        for name, value, std, realistic, unit in [sized(item)]
    ]
    large = Table(
        "How large: its parameters",
        ("effect", "parameter", "value", "std", "realistic", "plausible", "unit"),
        sizes,
        left=2,
    )
    return Section("which", "Which cause", figures=[figure], tables=[large] if sizes else [])


def _plausible(item: Estimate) -> str:
    if item.plausible:
        return "yes"
    return "no, negative" if item.positive and item.value < 0 else "no, larger than that"


def _candidate(one: Candidate, result: Diagnosis) -> list[str]:
    effect, component = causes_of(one, result)
    head = [effect, component, f"{100 * one.probability:.1f} %", one.shape]
    if one.shrink is None or one_posture(result):
        return [*head, "-", "-", "-"]
    low, high = one.shrink.interval
    return [
        *head,
        f"{1e3 * one.shrink.after:.3f} mm",
        f"{100 * one.shrink.shrink:.0f} %",
        f"{100 * low:.0f} to {100 * high:.0f} %",
    ]


def _where(result: Diagnosis) -> Section:
    places: Sequence[Mapping[str, Any]] = result.where.get("components", [])
    first = places[:SHOWN]
    figures = []
    if first and result.verdict.effect != "none":
        traces, layout = bars(
            [item["component"] for item in first],
            [item["share"] for item in first],
            "orange",
            "share of the explainable gap",
            [tuple(item["interval"]) for item in first],
            range=[0, 1.02],
            tickformat=".0%",
        )
        rows = [
            [
                item["component"],
                f"{100 * item['share']:.1f} %",
                f"{100 * item['interval'][0]:.0f} to {100 * item['interval'][1]:.0f} %",
            ]
            for item in places
        ]
        table = Table("The places", ("place", "share", "90 %"), rows)
        caption = "Share of the explainable gap that each place could make, with its 90 % interval."
        figures.append(Figure("where", "Where on the robot", caption, traces, layout, table))
    tables = [
        Table(title, (key, "mm"), _rms(result.where[key]))
        for key, title in PARTS_OF_GAP.items()
        if result.where.get(key)
    ]
    tables += [
        Table(f"By {name}", (f"{name}, {'deg' if turns else 'mm'}", "mm"), _rms(_for_people(values, turns)))
        for name, values in result.where.get("joints", {}).items()
        for turns in [_turns(result, name)]
    ]
    tables += [
        Table(f"By {axis} in the base frame", (axis, "mm"), _rms(values))
        for axis, values in result.where.get("regions", {}).items()
    ]
    text = "Position gap of the fitted model by direction, load, joint reading and region, RMS in mm."
    return Section("where", "Where the gap is", figures=figures, tables=tables, tables_text=text)


def _rms(values: Mapping[str, float]) -> list[list[str]]:
    return [[name, f"{value:.3f}"] for name, value in values.items()]


def _turns(result: Diagnosis, name: str) -> bool:
    """Return whether a joint variable is an angle."""
    return next(one.kind for one in result.baseline.nominal.variables if one.name == name) == "angle"


def _for_people(by_level: Mapping[str, float], turns: bool) -> dict[str, float]:
    """Return values by level, ``-0.5 to 0.3`` in rad or m, by level in deg or mm."""
    factor = DEGREES if turns else 1e3
    return {
        " to ".join(number(factor * float(end)) for end in level.split(" to ")): value
        for level, value in by_level.items()
    }


def _how_far(result: Diagnosis) -> Section:
    left = {"fitted model": result.rms}
    if one_posture(result):
        return Section("how-far", "How far the gap closes", ["No posture is left to try that on."])
    if result.verdict.shrink is not None:
        left[f"with {causes(result)}"] = result.verdict.shrink.after
    left |= {"any law of any place": result.ceiling, "noise alone": result.noise}
    traces, layout = bars(
        list(left),
        [1e3 * value for value in left.values()],
        "green",
        "RMS gap, mm",
        rangemode="tozero",
    )
    figure = Figure(
        "how-far",
        "What is left",
        "Position gap on postures that were not fitted. No cause can be expected to leave less than any law "
        "of any place.",
        traces,
        layout,
        Table("What is left", ("model", "mm"), [[name, f"{1e3 * v:.4f}"] for name, v in left.items()]),
    )
    return Section("how-far", "How far the gap closes", figures=[figure])


def _others(result: Diagnosis) -> Iterator[Section]:
    baseline = result.baseline
    fitted = [
        [name, _stiffness(baseline.nominal.parameter(name)), _stiffness(baseline.robot.parameter(name))]
        for name in baseline.fitted
    ]
    if fitted:
        text = (
            "Fitted to the same rows before anything was blamed; `beamstiff identify` gives their intervals."
        )
        table = Table("Stiffness values, SI", ("parameter", "as given", "fitted"), fitted)
        yield Section("parameters", "Parameters of the model", [text.replace("`", "")], tables=[table])
    following = [
        [
            ", ".join(
                f"{name} = {number(value * (DEGREES if _turns(result, name) else 1e3))}"
                for name, value in item["q"].items()
            ),
            ", ".join(number(value + 0.0) for value in item["wrench"]),
            item["point"],
            ", ".join(item["separates"]),
        ]
        for item in result.next
    ]
    columns = ("joint variables, deg or mm", "wrench, N and N m", "reflector", "separates")
    tables = [Table(proposed(result), columns, following, 4, open=False)] if following else []
    yield Section("next", "What to measure next", separations(result), tables=tables)
    hidden = [[one.effect, one.component or "-", one.why] for one in result.untestable]
    yield Section(
        "untestable",
        "What these data cannot show",
        tables=[Table("Not testable", ("effect", "component", "why"), hidden, 3)] if hidden else [],
    )
    limits = list(result.notes)
    limits += [f"nothing explains this row, which was left out: {row}" for row in result.outliers]
    yield Section("limits", "What limits the conclusions", items=limits)
    features = [[name, number(float(value))] for name, value in result.features.items()]
    yield Section(
        "evidence",
        "What the verdict rests on",
        ["Logarithms of evidence and ratios from which the probability of the verdict was calibrated."],
        tables=[Table("Evidence", ("quantity", "value"), features, open=False)] if features else [],
    )


def _stiffness(value: float) -> str:
    text = stiffness_text(value)
    return text if isinstance(text, str) else number(text)
