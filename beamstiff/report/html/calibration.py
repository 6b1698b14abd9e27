"""The report of a geometric calibration: errors before and after, parameters found, and look-alikes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from beamstiff.calibration.result import Calibration
from beamstiff.calibration.validation import in_base_frame
from beamstiff.errors import listed
from beamstiff.measure.table import Measurements
from beamstiff.report.geometry import (
    PER_SI,
    SETUP,
    WITHIN,
    calibration_text,
    calibration_verdict,
    dependent_table,
    errors_table,
    parameters_table,
)
from beamstiff.report.html.charts import along, distribution, intervals
from beamstiff.report.html.page import Page
from beamstiff.report.html.parts import Fact, Figure, Section
from beamstiff.report.html.places import Sizes, line_of, over_places, rows_table
from beamstiff.report.html.provenance import Provenance
from beamstiff.report.html.robot_view import RobotView
from beamstiff.report.html.still_view import Deviations, still_view
from beamstiff.report.tables import Table, number
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

POSES = 5  # that the robot is shown in
BEFORE, AFTER, HELD_OUT = "nominal", "calibrated", "held-out poses"
PARTS = (("position", slice(0, 3), 1e3, "mm"), ("orientation", slice(3, 6), 180 / np.pi, "deg"))


def calibration_html(
    found: Calibration,
    robot: Robot,
    measured: Measurements,
    provenance: Provenance,
    files: Sequence[str] = (),
) -> str:
    """Return the report of a calibration of the `robot` as it was described, as one HTML page."""
    values = {"before": _size(found.nominal_residual), "after": _size(found.residual)}
    sizes = Sizes(found.robot, measured, values, (BEFORE, AFTER), "error")
    return Page(
        title="Calibration",
        robot=robot.name,
        verdict=calibration_verdict(found, measured, files),
        summary=calibration_text(found),
        facts=list(_facts(found)),
        view=_view(found, measured, sizes),
        sections=[
            _errors(found),
            _parameters(found),
            _untold(found),
            *over_places(sizes),
            Section("rows", "The rows", tables=[_rows(found, measured, sizes)], open=False),
            Section("notes", "Notes", items=found.notes),
        ],
        provenance=provenance,
        data=found.to_dict(),
    ).html()


def _facts(found: Calibration) -> Iterator[Fact]:
    for part, _, factor, unit in PARTS:
        for name, errors, meaning in (
            ("Before", found.before, "RMS, robot file, base and reflectors fitted"),
            ("After", found.after, "RMS, calibrated, on the fitted rows"),
            ("Held out", found.held_out, "RMS, on held-out poses"),
        ):
            value = None if errors is None else getattr(errors, f"{part}_rms")
            if value is not None and (part == "position" or found.after.position_rms is None):
                yield Fact(name, f"{factor * value:.3g} {unit}", meaning)
    sought = len(found.identifiability.identified)
    yield Fact(
        "Parameters", f"{sought} of {len(found.identifiability.names)}", "identifiable from these poses"
    )


def _size(gap: Array) -> Array:
    """Return the norm of the position error of every row, mm; NaN where none was measured."""
    return _norm(gap[:, :3], 1e3)


def _norm(gap: Array, factor: float) -> Array:
    seen = np.isfinite(gap).any(axis=1)
    return np.asarray(np.where(seen, factor * np.linalg.norm(np.nan_to_num(gap), axis=1), np.nan))


def _view(found: Calibration, measured: Measurements, sizes: Sizes) -> RobotView | None:
    chosen = sizes.shown
    chosen = chosen[np.isfinite(_size(found.residual)[chosen])]
    stands = found.bases[measured.run if len(found.bases) > 1 else np.zeros(len(measured), dtype=np.intp)]
    back = stands[chosen, :3, :3].swapaxes(-1, -2)
    at = in_base_frame(found, replace(measured, position=found.predicted[:, :3])).position[chosen]
    deviations = []
    for key, name, gap, colour in (
        ("nominal", "residual before", found.nominal_residual, "orange"),
        ("left", "residual after", found.residual, "blue"),
    ):
        own = np.nan_to_num(gap[chosen, :3])
        texts = [
            f"{line_of(measured, row)}: {1e3 * size:.3g} mm {name.partition(' ')[2]}"
            for row, size in zip(chosen.tolist(), np.linalg.norm(own, axis=1).tolist(), strict=True)
        ]
        away = (back @ own[:, :, None])[:, :, 0]
        deviations.append(Deviations(key, name, colour, at, away, texts))
    before, after = sizes.values["before"], sizes.values["after"]
    worst = np.argsort(-np.nan_to_num(after))
    worst = worst[np.isin(worst, chosen)]
    first = worst[np.sort(np.unique(measured.pose[worst], return_index=True)[1])][:POSES].tolist()
    postures, lines = [], []
    for row in first:
        line = line_of(measured, row)
        postures.append((f"{line}: {after[row]:.3g} mm residual", measured.q[row]))
        lines.append([line, number(before[row]), number(after[row])])
    table = Table("The postures shown", ("row", "before, mm", "after, mm"), lines, open=False)
    caption = (
        "The calibrated robot, and at every place that was measured a line from where the robot is predicted "
        "to where it was seen, magnified: before and after the calibration. Lines that all point one way, or "
        "turn with the arm, are a systematic error; lines in random directions are noise."
    )
    return still_view(found.robot, postures, deviations, "Magnification of the residuals", caption, table)


def _errors(found: Calibration) -> Section:
    figures = []
    for part, columns, factor, unit in PARTS:
        gaps = {BEFORE: found.nominal_residual, AFTER: found.residual}
        if found.held_out_residual is not None:
            gaps[HELD_OUT] = found.held_out_residual
        sizes = {name: _norm(gap[:, columns], factor) for name, gap in gaps.items()}
        if not np.isfinite(sizes[AFTER]).any():
            continue
        title, caption = f"Errors in {part}", "Share of the rows whose error is below each size."
        figures.append(distribution(f"errors-{part}", title, caption, sizes, unit))
        rows = np.arange(1.0, len(found.residual) + 1)
        texts, axes = [f"row {row:.0f}" for row in rows], ("row, as in the table", f"error, {unit}")
        caption = (
            "Every reading in its order: steps and drifts come from the measuring system, not from the robot."
        )
        key, title, values = f"order-{part}", f"{title}, row by row", dict(list(sizes.items())[:2])
        figures.append(along(key, title, caption, rows, values, axes, texts, log=True))
    return Section("errors", "Before and after", figures=figures, tables=[errors_table(found)])


def _parameters(found: Calibration) -> Section:
    sought = [item for item in found.parameters if item.identified]
    figures = []
    own = [item for item in sought if item.parameter.group not in SETUP]
    for at, unit in enumerate(dict.fromkeys(item.parameter.unit for item in own)):
        some = [item for item in own if item.parameter.unit == unit]
        shown, factor = PER_SI.get(unit, (unit, 1.0))
        change, names = [factor * item.change for item in some], [item.name for item in some]
        half = [factor * WITHIN * (item.std or 0.0) for item in some]
        ends = [(value - wide, value + wide) for value, wide in zip(change, half, strict=True)]
        drawn = intervals(names, change, ends, f"change, {shown}", log=False)
        caption = "Change against the robot file, with its 95 % interval."
        figures.append(Figure(f"parameters-{at + 1}", f"Changes, {shown}", caption, *drawn))
    text = "Positions and rotations of the measurement setup (base, target) are in the table only."
    texts = [text] if len(own) < len(sought) else []
    return Section("parameters", "Parameters", texts, figures, [parameters_table(found, "What was found")])


def _untold(found: Calibration) -> Section:
    seen = found.identifiability
    texts = []
    if seen.dependent:
        texts.append(
            "In these poses an error of one of these looks like errors of other estimated parameters. It is "
            "held at its nominal value, and its error is attributed to them. More varied poses may "
            "distinguish them."
        )
    if seen.silent:
        texts.append(f"Without influence on the readings: {listed(seen.silent, 40)}.")
    told = dependent_table(found)
    return Section("untold", "Not identifiable", texts, tables=[] if told is None else [told])


def _rows(found: Calibration, measured: Measurements, sizes: Sizes) -> Table:
    used = measured.measured_mask
    names = ("x", "y", "z", "a", "b", "c")
    more = [
        (f"{names[k]} residual, {'mm' if k < 3 else 'mrad'}", 1e3 * found.residual[:, k])
        for k in range(6)
        if used[:, k].any()
    ]
    if used[:, :3].any():
        more += [(f"error {key}, mm", value) for key, value in sizes.values.items()]
        if found.held_out_residual is not None:
            more.append(("error held out, mm", _size(found.held_out_residual)))
    return rows_table(sizes, more)
