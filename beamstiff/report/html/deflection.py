"""The report of a prediction: how far every load moves the tool, and the deformed robot."""

from collections.abc import Iterator

import numpy as np

from beamstiff.errors import counted
from beamstiff.functions.predict import Prediction
from beamstiff.measure.table import DISPLACEMENT, Measurements
from beamstiff.report.deflection import UNITS, deflection_text, deflection_verdict
from beamstiff.report.html.charts import along
from beamstiff.report.html.page import Page
from beamstiff.report.html.parts import Fact, Figure, Section
from beamstiff.report.html.places import MARKS, Sizes, line_of, over_places, rows_table
from beamstiff.report.html.provenance import Provenance
from beamstiff.report.html.robot_view import robot_view, worst_postures
from beamstiff.report.html.rows import Compared, row_figures
from beamstiff.report.tables import number
from beamstiff.se3 import Array


def deflection_html(found: Prediction, provenance: Provenance) -> str:
    """Return the report of predicted displacements as one HTML page."""
    robot, loads, predicted = found.robot, found.rows, found.displacement
    texts = deflection_text(found)
    if found.preload and found.pose is None:
        texts.append("With gravity and K_C; the shape that is drawn is the linear one, without them.")
    moved = 1e3 * np.linalg.norm(predicted[:, :3], axis=1)
    used = loads.measured_mask & (loads.kind == "displacement")
    if used.any():
        measured = np.where(used, loads.displacement, 0.0)
        rows = row_figures(Compared(robot, loads, measured, predicted, used), ("the model", ""))
    else:
        sizes = Sizes(robot, loads, {"moved": moved}, ("the tool",), "displacement")
        more = [(f"{name}, {UNITS[k]}", 1e3 * predicted[:, k]) for k, name in enumerate(DISPLACEMENT)]
        table = rows_table(sizes, [*more, ("displacement, mm", moved)])
        rows = [*over_places(sizes), Section("rows", "The rows", tables=[table], open=False)]
    worst = int(np.argmax(moved))
    return Page(
        title="Deflection",
        robot=robot.name,
        verdict=deflection_verdict(found),
        summary=[
            f"{counted(len(loads), 'row')}; the largest displacement is that of {line_of(loads, worst)}.",
            *texts,
        ],
        facts=list(_facts(moved, predicted)),
        view=robot_view(
            robot,
            worst_postures(loads, moved),
            "share of the strain energy",
            gravity=found.pose is not None,
            model="the linear model",
        ),
        sections=[_displacements(loads, predicted), *rows, Section("notes", "Notes", items=found.notes)],
        provenance=provenance,
        data=found.to_dict(),
        papers="",
    ).html()


def _facts(moved: Array, predicted: Array) -> Iterator[Fact]:
    yield Fact("Largest", f"{number(moved.max())} mm", "displacement of the point read")
    yield Fact("RMS", f"{number(np.sqrt((moved**2).mean()))} mm", "over all rows")
    turned = 1e3 * np.linalg.norm(predicted[:, 3:], axis=1)
    yield Fact("Turns", f"{number(turned.max())} mrad", "at most")
    yield Fact("Rows", str(len(moved)), "postures under loads")


def _displacements(loads: Measurements, predicted: Array) -> Section:
    """Return the displacement of every row, by component."""
    figures = list[Figure]()
    x = np.arange(1.0, len(loads) + 1)
    texts = [line_of(loads, at) for at in range(len(loads))]
    for first, what, unit in ((0, "Displacement", "mm"), (3, "Rotation", "mrad")):
        values = {DISPLACEMENT[k]: 1e3 * predicted[:, k] for k in range(first, first + 3)}
        axes = ("row, as in the table", f"{what.lower()}, {unit}")
        off = "Loaded minus unloaded" if loads.kind == "displacement" else "Off the undeformed machine"
        caption = f"{off}, in the base frame."
        title = f"{what}, row by row"
        figures.append(along(f"moved-{first}", title, caption, x, values, axes, texts, marks=MARKS))
    return Section("displacement", "How far the tool moves", figures=figures)
