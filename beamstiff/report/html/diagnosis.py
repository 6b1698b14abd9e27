"""The report of a diagnosis: the verdict in words, the robot, and the evidence."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.notes import in_words
from beamstiff.diagnosis.predictions import predictions
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.report import diagnosis as shown
from beamstiff.report import diagnosis_words as words
from beamstiff.report.calibrated_text import (
    as_described,
    changes_table,
    changes_text,
    described_rigid,
    drives_table,
    far_stiffness,
    reflectors_moved,
)
from beamstiff.report.diagnosis_tables import drift_tables, hidden_text, smallest_table, steps, steps_table
from beamstiff.report.diagnosis_text import remainder_text, summary, verdict
from beamstiff.report.html.charts import SHARE, bars
from beamstiff.report.html.drift_curves import drift_curves
from beamstiff.report.html.joint_curves import joint_curves
from beamstiff.report.html.page import Page
from beamstiff.report.html.parts import Fact, Figure, Section
from beamstiff.report.html.places import line_of
from beamstiff.report.html.provenance import Provenance
from beamstiff.report.html.robot_view import RobotView, Shown, robot_view
from beamstiff.report.html.rows import Compared, minded, row_figures
from beamstiff.report.identification import far_off_text
from beamstiff.report.next_action import proposed, separations
from beamstiff.report.tables import Table, number
from beamstiff.report.verdict import rounded

DEGREES = 180.0 / np.pi
DRIVES = "drives"  # the place of what all drives have
NOTHING_LEFT = 1e-5  # mm: no reading is as good


def diagnosis_html(result: Diagnosis, provenance: Provenance) -> str:
    """Return the report of a diagnosis as one HTML page."""
    baseline = result.baseline
    without, beside = predictions(result)
    compared = Compared(baseline.nominal, baseline.rows, baseline.measured, without, baseline.used, beside)
    said = summary(result).splitlines()
    if result.decomposition is not None and result.decomposition.gap_shows:
        said += remainder_text(result.decomposition).splitlines()
    said += filter(None, [changes_text(result, "under Fitted parameters")])
    with_them = "with the causes" if result.decomposition is not None else f"with {words.causes(result)}"
    rows = row_figures(compared, ("fitted model", with_them))
    return Page(
        title="Diagnosis",
        robot=baseline.nominal.name,
        verdict=verdict(result),
        summary=[*minded(baseline.rows, baseline.nominal), *said],
        facts=list(_facts(result)),
        view=_view(result),
        sections=[
            *(_which(result), _next(result), *_curves(result), _where(result), _how_far(result)),
            *rows,
            *_others(result),
        ],
        provenance=provenance,
        data=result.to_dict(),
    ).html()


def _facts(result: Diagnosis) -> Iterator[Fact]:
    also, found = words.second(result), words.several(result)
    if found:
        yield Fact("Causes close", words.closed(found), "of the gap above noise, on held-out data")
    elif law := result.law:
        yield Fact(
            "Outside the library", words.percent(law.closes), "of the gap above noise, on held-out data"
        )
        yield Fact("With it", f"{1e3 * law.rms_after:.3f} mm", "RMS, what it looks like added")
    else:
        of = {"none": "that nothing is beyond noise", "unknown": "that these data show no known cause"}
        yield Fact(
            "How sure", words.sure(result), f"probability {of.get(result.verdict.effect, 'of the cause')}"
        )
    if result.recalibration is not None:
        name = "Rigid robot" if described_rigid(result) else "Uncalibrated"
        fitted = "frame and reflectors" if reflectors_moved(result) else "measuring frame"
        yield Fact(name, f"{rounded(1e3 * as_described(result)[1])} mm", f"RMS, {fitted} fitted")
    yield Fact("Gap", f"{1e3 * result.rms:.3f} mm", f"RMS, model fitted, {words.tested(result)}")
    if found:
        yield Fact("With the causes", f"{1e3 * found[-1].rms_after:.3f} mm", "the same, their effects added")
    elif result.verdict.shrink is not None and not words.one_posture(result):
        plural, added = ("", "its effect") if also is None else ("s", "their effects")
        left = f"{1e3 * result.verdict.shrink.after:.3f} mm"
        yield Fact(f"With the cause{plural}", left, f"the same, {added} added")
    yield Fact("Noise", f"{1e3 * result.noise:.3f} mm", "noise floor of the RMS")


def _view(result: Diagnosis) -> RobotView | None:
    baseline, shown = result.baseline, []
    rows = baseline.rows
    nothing = result.verdict.effect == "none"  # shares would be of noise
    places = [] if nothing else result.where.get("components", [])
    shares = {item["component"]: float(item["share"]) for item in places}
    if DRIVES in shares:  # all of them
        shares |= {one.name: shares[DRIVES] for one in baseline.robot.actuated}
    # what the readings miss is drawn at the reflector, or where the frame is that they are read in
    of_the_frame = "frame-misalignment" in {one.effect for one in words.told(result)}
    for worst in result.where.get("poses", []):
        own = np.flatnonzero(rows.pose == worst["pose"])
        at = int(own[np.argmax(np.linalg.norm(rows.wrench[own], axis=1))])
        gap = rounded(worst["rms_mm"]) if worst["rms_mm"] > NOTHING_LEFT else "0"
        name = f"{line_of(rows, at)}: gap {gap} mm"
        marks = {"readings": baseline.robot.fixed[0] if of_the_frame else str(rows.point[at])}
        shown.append(Shown(name, rows.q[at], rows.wrench[at], str(rows.load_point[at]), shares, marks))
    share = "share of the gap" if shares else ""
    if DRIVES in shares:
        share += f" (of all drives together {words.percent(shares[DRIVES])})"
    return robot_view(baseline.robot, shown, share, gravity=baseline.absolute)


def _which(result: Diagnosis) -> Section:
    large = shown.sizes_table(
        result, f"How large: {'their' if len(words.told(result)) > 1 else 'its'} parameters"
    )
    legend = " ".join(shown.names_text(result))
    tables = [*([large] if large.rows else []), *drift_tables(result)]
    found, law = result.decomposition, result.law
    if found is not None and (found.causes or law):
        causes = (*found.causes, *([law] if law else []))
        names = [one.looks_like if one.nameless else in_words([one.key]) for one in causes]
        values, ends = zip(*((one.closes, one.closes_interval) for one in causes), strict=True)
        drawn = bars(names, values, "blue", "share of the gap closed", ends, **SHARE)
        said = " ".join([shown.probability_text(found), *shown.next_best_text(result)])
        caption = f"What each cause closes, added to those above it. {said}"
        figure = Figure("which", "Causes", caption, *drawn, steps_table(result))
    else:
        first = shown.likely(result, shown.SHOWN)
        names = [shown.in_full(one, result) for one in first]
        drawn = bars(names, [one.probability for one in first], "blue", "probability", **SHARE)
        caption, table = "Probability of the likeliest explanations.", "The candidates"
        figure = Figure(
            "which", "Which effect", caption, *drawn, shown.candidates_table(result, first, table)
        )
    plural = "s" * (found is not None and len(found.causes) > 1)
    return Section("which", f"Which cause{plural}", figures=[figure], tables=tables, footnote=legend)


def _curves(result: Diagnosis) -> Iterator[Section]:
    if figures := list(joint_curves(result)):
        yield Section("curves", "Errors that follow a joint's angle", figures=figures)
    if figures := list(drift_curves(result)):
        yield Section("drift", "What drifts", figures=figures)


def _where(result: Diagnosis) -> Section:
    places = shown.notable(result)
    first = places[: shown.SHOWN]
    figures = []
    if first and result.verdict.effect != "none":
        names, ends = [item["component"] for item in first], [tuple(item["interval"]) for item in first]
        title = "share of the gap above noise"
        drawn = bars(names, [item["share"] for item in first], "orange", title, ends, **SHARE)
        table = shown.places_table(places, "The places")
        share = shown.SUMMED if shown.by_causes(result) else shown.ACCOUNTS
        caption = f"{share.partition(': ')[2].capitalize()}."
        figures.append(Figure("where", "Where on the robot", caption, *drawn, table))
    parts = list[tuple[str, str, Mapping[str, float]]]()
    for name, values in result.where.get("joints", {}).items():
        turns = _turns(result, name)
        head = f"{name}, {'deg' if turns else 'mm'}"
        parts.append((f"By {name}", head, _for_people(values, turns)))
    regions = result.where.get("regions", {})
    parts += [(f"By {axis} in the base frame", axis, values) for axis, values in regions.items()]
    tables = [shown.gap_tables(result)]
    tables += [
        replace(shown.gap_table(values, title, head), open=False) for title, head, values in parts if values
    ]
    text = "Errors of the fitted model without the causes, by direction, load, joint value and region."
    return Section("where", "Where the gap is", figures=figures, tables=tables, tables_text=text)


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
    if words.one_posture(result):
        text = "All rows are of one posture: none can be held out to test the reduction."
        return Section("how-far", "How far the gap closes", [text])
    some = steps(result)
    drawn = bars(
        [step.model for step in some],
        [1e3 * step.error for step in some],
        "green",
        "RMS gap, mm",
        rangemode="tozero",
    )
    caption = "Position gap on held-out data."
    if result.decomposition is None:
        caption += " The least with effects of the library: all at once or one alone, whichever leaves less."
    rows = [[step.model, f"{1e3 * step.error:.4f}"] for step in some]
    table = Table("What is left", ("model", "mm"), rows)
    figure = Figure("how-far", "What is left", caption, *drawn, table)
    return Section("how-far", "How far the gap closes", figures=[figure])


def _others(result: Diagnosis) -> Iterator[Section]:
    fitted = [drives_table(result, "Fitted stiffness")]
    if result.recalibration is not None:
        fitted.append(changes_table(result.recalibration, "Calibrated geometry, change from the robot file"))
    if fitted := [one for one in fitted if one.rows]:
        texts = [far] if (far := far_off_text(far_stiffness(result))) else []
        yield Section("parameters", "Fitted parameters", texts, tables=fitted, open=False)
    nothing = result.verdict.effect == "none"
    hidden = [smallest_table(result)] if nothing else []
    hidden += [made] if (made := shown.untestable_table(result, "Not testable")).rows else []
    texts = [said] if nothing and (said := hidden_text(result)) else []
    yield Section("untestable", "What these data cannot show", texts, tables=hidden, open=False)
    limits = list(result.notes)
    limits += [f"outlier, excluded from the fit: {row}" for row in result.outliers]
    yield Section("limits", "What limits the conclusions", items=limits)


def _next(result: Diagnosis) -> Section:
    following = []
    for item in result.next:
        q = {name: value * (DEGREES if _turns(result, name) else 1e3) for name, value in item["q"].items()}
        joints = ", ".join(f"{name} = {number(value)}" for name, value in q.items())
        wrench = ", ".join(number(value + 0.0) for value in item["wrench"])
        following.append([joints, wrench, item["point"], in_words(item["separates"])])
    columns: tuple[str, ...] = ("joint variables, deg or mm", "wrench, N and N m", "reflector", "separates")
    if not any(item["separates"] for item in result.next):
        columns, following = columns[:-1], [row[:-1] for row in following]
    wanted = bool(following) and result.verdict.effect != "none"
    title = proposed(result).replace("the", "The", 1) if wanted else ""
    tables = [Table(title, columns, following, 4, open=False)] if wanted else []
    return Section("next", "What to measure next", separations(result), tables=tables)
