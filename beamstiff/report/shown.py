"""One way to show anything: `plot` draws a robot or a result, `told_with_notes` yields what is printed."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping
from functools import singledispatch
from html import escape
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console, RenderableType
from rich.text import Text

from beamstiff.calibration.result import Calibration
from beamstiff.compensation.rewrite import Compensated
from beamstiff.diagnosis.changes import RunComparison
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.verify import Verification
from beamstiff.errors import BeamstiffError, counted, listed, suggest
from beamstiff.functions.campaign import CampaignState
from beamstiff.functions.checks import robot_notes
from beamstiff.functions.examine import Examination
from beamstiff.functions.fitted import worse_notes
from beamstiff.functions.plan import MeasurementPlan
from beamstiff.functions.predict import Prediction
from beamstiff.functions.stiffness import TcpStiffness
from beamstiff.identification.models.side_by_side import Models
from beamstiff.identification.result import Identification
from beamstiff.measure.table import Measurements
from beamstiff.report.campaign import campaign_told
from beamstiff.report.campaign_state import campaign_state_told
from beamstiff.report.changes import changes_told
from beamstiff.report.compare import models_figure, models_told
from beamstiff.report.compensation import compensation_figure, compensation_told
from beamstiff.report.deflection import deflection_figure, deflection_told
from beamstiff.report.diagnosis import diagnosis_figure, diagnosis_tables
from beamstiff.report.exam import examination_told
from beamstiff.report.figures import BLUE, new_figure, plain
from beamstiff.report.geometry import calibration_figure, calibration_told
from beamstiff.report.identification import identification_told
from beamstiff.report.overview import describe
from beamstiff.report.overview_tables import overview_tables
from beamstiff.report.residuals import residual_figure
from beamstiff.report.skeleton import draw_in_space
from beamstiff.report.stiffness import stiffness_tables
from beamstiff.report.tables import Table, spaced
from beamstiff.report.verification import verification_summary
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import reference_posture
from beamstiff.shown import Shown

if TYPE_CHECKING:
    from xarray import Dataset

WIDTH = 110  # characters, in Jupyter
PRE = '<pre style="white-space:pre;overflow-x:auto;line-height:1.2;font-family:monospace">{code}</pre>'


def console(width: int = WIDTH) -> Console:
    """Return a console that takes names as they are: no markup, no emoji codes, no guessed colours."""
    plain: dict[str, Any] = {"markup": False, "emoji": False, "highlight": False, "no_color": True}
    return Console(file=io.StringIO(), width=width, record=True, **plain)


def as_text(thing: object) -> str:
    """Return what rich prints as plain text."""
    page = console()
    for part in told_with_notes(thing):
        page.print(part)
    return "\n".join(one.rstrip() for one in page.export_text().rstrip().splitlines())


def as_html(thing: object) -> str:
    """Return the tables, sentences and notes as HTML, all from files escaped; trees as rich prints them."""
    made = []
    for part in told_with_notes(thing):
        if isinstance(part, Table):
            made.append(_html_table(part))
        elif isinstance(part, str | Text):
            head = isinstance(part, Text) and "bold" in str(part.style)
            lines = "<br>".join(escape(one) for one in str(part).strip().splitlines())
            made.append(f"<p><strong>{lines}</strong></p>" if head else f"<p>{lines}</p>" if lines else "")
        else:
            page = console()
            page.print(part)
            made.append(page.export_html(inline_styles=True, code_format=PRE))
    return "\n".join(filter(None, made))


def _html_table(one: Table) -> str:
    columns, rows = one.drawn("page")
    sides = [f' style="text-align:{"left" if column.left else "right"}"' for column in columns]

    def line(kind: str, texts: Iterable[str]) -> str:
        cells = (f"<{kind}{s}>{escape(text)}</{kind}>" for s, text in zip(sides, texts, strict=True))
        return f"<tr>{''.join(cells)}"

    heads, body = line("th", [column.head for column in columns]), "".join(line("td", row) for row in rows)
    caption = f'<caption style="text-align:left"><strong>{escape(one.title)}</strong></caption>'
    return f"<table>{caption}<thead>{heads}</thead><tbody>{body}</tbody></table>"


@singledispatch
def line(thing: object) -> str:
    """Return what a robot or a result is, in a line."""
    for part in told(thing):
        text = part.title if isinstance(part, Table) else part
        if isinstance(text, str | Text) and (said := str(text).strip()):
            return said.splitlines()[0]
    return type(thing).__name__


@line.register
def _(thing: Robot) -> str:
    parts = [(thing.nodes, "node"), (thing.beams, "beam"), (thing.rigids, "rigid"), (thing.joints, "joint")]
    return f"{thing.name}, {', '.join(counted(len(some), what) for some, what in parts if some)}"


@singledispatch
def plot(thing: object, **options: Any) -> Figure:
    """Draw a robot or a result.

    Parameters
    ----------
    thing : robot, result or map (xarray.Dataset)
        A Robot, Identification, Calibration, Models, Diagnosis, CampaignState, Prediction or Compensated; of
        other results there are tables only.
    **options
        Of a robot: ``q``, actuated joint values by name, rad or m (default: the posture that
        ``beamstiff show`` calls the reference), and ``shares``, 0 to 1 by part, which colour it. Of an
        identification: ``measured``, to draw the residuals over load and posture instead of values.
        Of a map: ``quantities``, names (default: all of one number a pose).

    Returns
    -------
    matplotlib.figure.Figure
        Jupyter shows it; ``savefig("name.png")`` writes it.

    Raises
    ------
    BeamstiffError
        When nothing is known of how to draw it.

    Examples
    --------
    >>> from beamstiff import load_robot, plot
    >>> plot(load_robot("ir663"), q={"q2": 0.1, "q8": 0.8}).axes[0].get_title()
    'ir663'
    """
    if type(thing).__name__ == "Dataset" and "reason" in getattr(thing, "variables", ()):
        from beamstiff.report.workspace import map_figure  # loads what maps alone need

        return map_figure(cast("Dataset", thing), **options)
    drawn = sorted(kind.__name__ for kind in plot.registry if kind is not object)
    tables = ", of which there are tables only (print)" if isinstance(thing, Shown) else ""
    raise BeamstiffError(
        f"plot: found {type(thing).__name__}{tables}, expected a robot or a result that is drawn: "
        f"{listed(drawn, len(drawn))} or a map"
    )


@singledispatch
def told(thing: object) -> Iterable[RenderableType]:
    """Return the tables and sentences that describe a robot or a result."""
    return [type(thing).__name__]  # not its repr, which is made of this


def told_with_notes(thing: object) -> Iterator[RenderableType]:
    """Yield what describes a robot or a result, then its notes, which commands print on stderr."""
    said = ""
    for part in told(thing):
        said += f"{part}\n" if isinstance(part, str | Text) else ""
        yield part
    for note in dict.fromkeys(notes_of(thing)):
        if note[1:] not in said:  # a doubt of the verdict begins with a capital
            yield f"Mind: {note}" + ("" if note.endswith(("?", ".")) else ".")


@singledispatch
def notes_of(thing: object) -> Iterable[str]:
    """Return what to know of a robot or a result, a sentence each."""
    notes: Iterable[str] = getattr(thing, "notes", ())
    return notes


@plot.register
def _(
    thing: Robot, q: Mapping[str, float] | None = None, shares: Mapping[str, float] | None = None
) -> Figure:
    names = [item.name for item in thing.actuated]
    values = dict(zip(names, reference_posture(thing), strict=True))
    for name, value in (q or {}).items():
        if name not in values:
            raise BeamstiffError(
                f"plot: {name!r} is no actuated variable{suggest(name, names)}, expected {listed(names, 9)}"
            )
        values[name] = float(value)
    figure = new_figure(6.0, 5.0)
    axes = figure.add_subplot(projection="3d")
    draw_in_space(axes, thing, np.array([values[name] for name in names]), shares or {})
    axes.set(title=thing.name.replace("$", r"\$"))
    return figure


@plot.register
def _(thing: Identification, measured: Measurements | None = None) -> Figure:
    if measured is not None:
        return residual_figure(thing, measured, thing.robot.name.replace("$", r"\$"))
    figure = new_figure(6.4, 1.2 + 0.35 * len(thing.parameters))
    axes = figure.subplots()
    for at, item in enumerate(thing.parameters[::-1]):
        low, high = item.interval or (item.lower_bound or 0.0, np.inf)
        if item.value is not None:
            axes.plot(item.value, at, "o", color=BLUE)
        if low > 0 and np.isfinite(high):
            axes.plot([low, high], [at, at], color=BLUE)
        elif low > 0:  # nothing bounds it from above
            axes.plot([low, 10 * low], [at, at], ":>", color=BLUE, markevery=[1])
    names, what = [f"{one.name}, {one.unit}" for one in thing.parameters], "stiffness, with its 95 % interval"
    axes.set_yticks(range(len(names)), names[::-1])
    axes.set(xscale="log", xlabel=what, ylim=(-0.7, len(names) - 0.3))
    plain(axes)
    return figure


def _of_campaign(thing: CampaignState) -> Figure:
    if thing.diagnosis is None:
        raise BeamstiffError("plot: this campaign has no batch yet, of which there is nothing to draw")
    return diagnosis_figure(thing.diagnosis)


plot.register(Diagnosis, diagnosis_figure)
plot.register(CampaignState, _of_campaign)
plot.register(Prediction, deflection_figure)
plot.register(Compensated, compensation_figure)
plot.register(Models, lambda thing: models_figure(thing, ""))
plot.register(
    Calibration,
    lambda thing: calibration_figure(thing, f"{thing.robot.name}: calibrated geometry".replace("$", r"\$")),
)
told.register(Robot, lambda thing: spaced(overview_tables(describe(thing, samples=100))))
told.register(Identification, identification_told)
told.register(Diagnosis, diagnosis_tables)
told.register(Compensated, compensation_told)
told.register(Models, models_told)
told.register(Prediction, deflection_told)
told.register(MeasurementPlan, campaign_told)
told.register(TcpStiffness, stiffness_tables)
told.register(Calibration, calibration_told)
told.register(Verification, verification_summary)
told.register(Examination, examination_told)
told.register(RunComparison, changes_told)
told.register(CampaignState, lambda thing: campaign_state_told(thing.to_dict()))
notes_of.register(Robot, robot_notes)
notes_of.register(Models, lambda thing: [*thing.notes, *worse_notes(thing)])
