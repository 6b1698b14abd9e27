"""The report of an identification: what is known of each stiffness, what is not, and the residual."""

from collections.abc import Iterator, Sequence

import numpy as np

from beamstiff.identification.result import Identification
from beamstiff.measure.table import Measurements
from beamstiff.report.html.charts import correlation_figure, intervals
from beamstiff.report.html.page import Page
from beamstiff.report.html.parts import Fact, Figure, Section
from beamstiff.report.html.provenance import Provenance
from beamstiff.report.html.robot_view import RobotView, robot_view, worst_postures
from beamstiff.report.html.rows import Compared, minded, row_figures
from beamstiff.report.identification import (
    combinations_table,
    combinations_text,
    front_table,
    identification_table,
    identification_text,
    identification_verdict,
    method_text,
)
from beamstiff.report.residuals import AFTER, BEFORE, before_fit
from beamstiff.robot.description import Robot

MOST_NAMED = 30  # parameters whose correlation is drawn


def identification_html(
    found: Identification,
    robot: Robot,
    measured: Measurements,
    provenance: Provenance,
    folds: int = 5,
    files: Sequence[str] = (),
) -> str:
    """Return the report of an identification of the `robot` as it was before, as one HTML page."""
    used = measured.measured_mask
    before = before_fit(found, measured)
    predicted = (found.predicted, None) if before is None else (before, found.predicted)
    displacement = np.where(used, measured.displacement, 0.0)
    compared = Compared(found.robot, measured, displacement, predicted[0], used, predicted[1])
    rows = row_figures(compared, (AFTER, "") if before is None else (BEFORE, AFTER))
    fronts = [] if found.front is None else [front_table(found.front)]
    return Page(
        title="Identification",
        robot=robot.name,
        verdict=identification_verdict(found, measured, files),
        summary=[*minded(measured, robot), *identification_text(found, measured, folds).splitlines()],
        facts=list(_facts(found)),
        view=_view(found, measured),
        sections=[
            _parameters(found, robot),
            _degeneracies(found),
            Section("front", "Position against rotation", tables=fronts),
            *rows,
            Section("notes", "Notes", items=found.notes),
            Section("method", "Method", texts=[method_text(found)]),
        ],
        provenance=provenance,
        data=found.to_dict(),
    ).html()


def _facts(found: Identification) -> Iterator[Fact]:
    if found.rms > 0:  # 0 where rotations alone were read
        yield Fact("Gap", f"{1e3 * found.rms:.3f} mm", "RMS in position, over the rows fitted")
    if found.rms_held_out is not None:
        yield Fact("Held out", f"{1e3 * found.rms_held_out:.3f} mm", "RMS, on held-out poses")
    if found.rms_held_out_load is not None:
        yield Fact("Other loads", f"{1e3 * found.rms_held_out_load:.3f} mm", "RMS, on held-out loads")
    yield Fact("Against noise", f"{np.sqrt(found.chi_square):.2f} times", "1: noise explains the residual")


def _view(found: Identification, measured: Measurements) -> RobotView | None:
    gap = np.linalg.norm(np.nan_to_num(measured.displacement - found.predicted)[:, :3], axis=1)
    shown = worst_postures(measured, 1e3 * gap, "gap ")
    return robot_view(found.robot, shown, "share of the strain energy")


def _parameters(found: Identification, robot: Robot) -> Section:
    names = [item.name for item in found.parameters]
    ends = list[tuple[float | None, float | None]]()
    for item in found.parameters:
        low, high = item.interval or (item.lower_bound, None)
        ends.append((low, high if high is not None and np.isfinite(high) else None))
    figures = []
    for at, unit in enumerate(dict.fromkeys(item.unit for item in found.parameters)):
        own = [k for k, item in enumerate(found.parameters) if item.unit == unit]
        values = [found.parameters[k].value for k in own]
        drawn = intervals([names[k] for k in own], values, [ends[k] for k in own], f"stiffness, {unit}")
        caption = "Identified value and 95 % interval; an arrow where the data set no upper end."
        figures.append(Figure(f"parameters-{at + 1}", f"Stiffness, {unit}", caption, *drawn))
    correlation = [correlation_figure(names, found.correlation)] if 1 < len(names) <= MOST_NAMED else []
    tables = [identification_table(found, robot)]
    return Section("parameters", "The stiffness values", figures=[*figures, *correlation], tables=tables)


def _degeneracies(found: Identification) -> Section:
    texts = [text for text in combinations_text(found) if isinstance(text, str) and text]
    tables = [told] if (told := combinations_table(found)).rows else []
    return Section("degeneracies", "Identifiable only in combination", items=texts, tables=tables)
