"""The report of a corrected path: where the tool would go, where it will, and what was changed for it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from beamstiff.compensation.path import difference
from beamstiff.compensation.rewrite import Compensated, size_of
from beamstiff.report.compensation import (
    UNCORRECTED,
    compensation_table,
    compensation_text,
    compensation_verdict,
    expected_mm,
    told,
    uncorrected_table,
)
from beamstiff.report.html.charts import along
from beamstiff.report.html.page import Page
from beamstiff.report.html.parts import Fact, Figure, Section, label, numbers
from beamstiff.report.html.places import MARKS
from beamstiff.report.html.provenance import Provenance
from beamstiff.report.html.robot_view import RobotView
from beamstiff.report.html.still_view import Deviations, still_view
from beamstiff.report.tables import Table, number
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

POSES = 5  # along the path, that the robot is shown in
MOST = 500  # targets that are drawn and listed
LEAST = 1e-7  # mm: what logarithmic axes show of no error
AXES = ("x", "y", "z")
NOWHERE = "The robot can follow none of the targets: nothing can be said of its errors."
BEFORE, AFTER = "without compensation", "compensated, as written"


def compensation_html(result: Compensated, robot: Robot, provenance: Provenance) -> str:
    """Return the report of a path corrected for the controller's robot, as one HTML page."""
    count = len(result.known)
    # evenly chosen, the first and the last among them
    some = np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(int))
    said = [f"{MOST} of {count} targets are shown, evenly chosen."] if len(some) < count else []
    return Page(
        title="Compensation",
        robot=robot.name,
        verdict=compensation_verdict(result),
        summary=[compensation_text(result) if result.known.any() else NOWHERE, *said],
        facts=list(_facts(result)),
        view=_view(result, robot, some),
        sections=[
            _uncorrected(result),
            *([_errors(result, some), _changes(result, some)] if result.known.any() else []),
            Section("targets", "The targets", tables=[_targets(result, some)], open=False),
            Section("notes", "Notes", items=result.notes),
        ],
        provenance=provenance,
        data=result.to_dict(),
    ).html()


def _facts(result: Compensated) -> Iterator[Fact]:
    found, known = result.correction, result.known
    if known.any():
        before, after = size_of(found.before[known]), size_of(result.after[known])
        meaning, differs = f"RMS; at most {told(before.max_mm)} mm", result.differs_mm
        if differs is not None:
            meaning = f"RMS against a measured base; {told(differs)} mm or more if the robot touched off"
        yield Fact("Before", f"{told(before.rms_mm)} mm", meaning)
        expected, meaning = expected_mm(result), f"RMS; at most {told(after.max_mm)} mm, numbers rounded"
        if expected is not None:
            meaning = "RMS, as the real robot's file left on held-out postures, noise included"
        yield Fact("After", f"{told(after.rms_mm if expected is None else expected)} mm", meaning)
        moved = 1e3 * np.linalg.norm(found.commands[:, :3, 3] - found.path.poses[:, :3, 3], axis=1)
        yield Fact("Commands move", f"{told(moved.max())} mm", "at most")
    yield Fact("Corrected", f"{int(found.corrected.sum())} of {len(found.path)}", "targets")


def _view(result: Compensated, robot: Robot, some: Array) -> RobotView | None:
    found, known = result.correction, result.known
    own = some[known[some]]
    if not own.size:
        return None
    targets = found.targets[own, :3, 3]
    still = np.zeros_like(targets)
    names = [_name(result, row) for row in own.tolist()]
    size = {BEFORE: found.before[own, :3], AFTER: result.after[own, :3]}
    texts = {
        key: [
            f"{name}: {1e3 * far:.3g} mm"
            for name, far in zip(names, np.linalg.norm(off, axis=1), strict=True)
        ]
        for key, off in size.items()
    }
    commands = found.commands[own, :3, 3] - targets
    deviations = [
        Deviations("path", "targets", "muted", targets, still, names, path=True, dash="dash"),
        Deviations("commands", "commands", "green", targets, commands, names, path=True, dash="dot"),
        Deviations("before", BEFORE, "orange", targets, size[BEFORE], texts[BEFORE], path=True),
        Deviations("after", AFTER, "blue", targets, size[AFTER], texts[AFTER], path=True),
    ]
    stops = own[np.unique(np.linspace(0, own.size - 1, POSES).astype(int))].tolist()
    before, after = (1e3 * np.linalg.norm(gap[:, :3], axis=1) for gap in (found.before, result.after))
    postures = [(f"{_name(result, row)}: {before[row]:.3g} mm before", found.q[row]) for row in stops]
    numbers = [[_name(result, row), number(before[row]), number(after[row])] for row in stops]
    table = Table("The postures shown", ("target", "before, mm", "after, mm"), numbers, open=False)
    caption = (
        "The tool's path in the base frame: as programmed, as predicted without compensation, as "
        "predicted with the corrected commands, and these commands. Deviations are magnified."
    )
    return still_view(robot, postures, deviations, "Magnification of the deviations", caption, table)


def _name(result: Compensated, row: int) -> str:
    path = result.correction.path
    return f"{path.names[row]} (line {path.line(row)})"


def _uncorrected(result: Compensated) -> Section:
    reasons = result.correction.reasons
    texts = ["These have no command of their own and stay as they are."] if reasons else []
    tables = [uncorrected_table(result)] if reasons else []
    return Section("uncorrected", UNCORRECTED, texts, tables=tables)


def _errors(result: Compensated, some: Array) -> Section:
    figures = list[Figure]()
    for part, columns, factor, unit in (
        ("Position", slice(0, 3), 1e3, "mm"),
        ("Orientation", slice(3, 6), 180 / np.pi, "deg"),
    ):
        if part == "Orientation" and not result.correction.turned.any():
            continue
        values = {
            BEFORE: factor * np.linalg.norm(result.correction.before[some, columns], axis=1),
            AFTER: factor * np.linalg.norm(result.after[some, columns], axis=1),
        }
        values = {name: np.where(size < LEAST, LEAST, size) for name, size in values.items()}
        axes = ("way along the path, mm", f"error, {unit}")
        key, title = f"error-{part.lower()}", f"{part} along the path"
        caption = "Predicted error of the tool at its targets."
        figures.append(along(key, title, caption, "way", values, axes, "targets", lines=True, log=True))
    names = [label(_name(result, row)) for row in some.tolist()]
    way = numbers(1e3 * result.correction.path.way[some])
    title = "Predicted error along the path"
    return Section("errors", title, figures=figures, shared={"targets": names, "way": way})


def _changes(result: Compensated, some: Array) -> Section:
    moved, turned = np.hsplit(difference(result.correction.commands, result.correction.path.poses)[some], 2)
    figures = []
    for key, title, values, unit in (
        ("change-position", "Commands move", 1e3 * moved, "mm"),
        ("change-orientation", "Commands turn", np.degrees(turned), "deg"),
    ):
        if key == "change-position" or np.any(values):
            by = {f"about {a}" if unit == "deg" else f"along {a}": values[:, k] for k, a in enumerate(AXES)}
            axes = ("way along the path, mm", f"change, {unit}")
            caption = "Command less target, base frame."
            figures.append(along(key, title, caption, "way", by, axes, "targets", lines=True, marks=MARKS))
    return Section("changes", "What was changed", figures=figures)


def _targets(result: Compensated, some: Array) -> Table:
    title = f"All numbers of {len(some)} targets"
    return replace(compensation_table(result, some.tolist()), title=title, open=False)
