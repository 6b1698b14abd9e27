"""`beamstiff exam`: the diagnosis on simulated campaigns whose effect is withheld."""

from pathlib import Path
from typing import Annotated

import typer

from beamstiff.cli.options import Html, Processes, Scheduler, argument, flag, option
from beamstiff.cli.output import Outputs, progress, written
from beamstiff.cli.parse import parse_names, robot_file


def exam(
    robot: Annotated[
        str | None,
        argument(
            "[ROBOT]",
            "Use only this robot: YAML file, or the name of a bundled one; default: two serial robots, arms "
            "of random proportions and the closed-loop ir663.",
        ),
    ] = None,
    plan: str | None = option(
        "CSV",
        "Use only these poses and loads (a table of measurements, or a plan), to see what they could find.",
    ),
    cases: int = typer.Option(100, help="Number of cases.", min=1),
    seed: int = typer.Option(0, help="Seed of all draws; the same seed draws the same cases.", min=0),
    processes: Processes = 1,
    scheduler: Scheduler = None,
    classes: list[str] | None = option(
        "NAME,...",
        "Only cases of these kinds (null, single, pair, outside, removed) or single effects "
        "(backlash, ...), in equal shares.",
    ),
    sets: str | None = option(
        "FOLDER", "Use the campaigns of a folder with a labels.json instead of simulated ones."
    ),
    crowded: bool = flag(
        "--crowded", "Use machines with three to six effects at once and with errors of geometry."
    ),
    out: str | None = option(
        "FILE", "Write every case's result as a line of JSON; an interrupted exam continues there."
    ),
    reports: str | None = option("FOLDER", "Write the report of every diagnosis there."),
    figure: str | None = option("FILE", "Draw the reliability diagram (.png, .svg or .pdf)."),
    compare: bool = typer.Option(
        True, "--compare/--no-compare", help="Also run a plain regression (best BIC) as a control."
    ),
    html: Html = None,
) -> None:
    """Examine the diagnosis on simulated campaigns.

    The diagnosis does not see the effects. A simulator that shares no equations with the library
    draws a robot, its fault (an effect, none, two, one outside the library, or one whose class is
    removed from the library), a campaign, its noise, and the noise that the table states. The label
    is sealed by its SHA-256, the rows are diagnosed, the report is sealed, and then the label is
    opened. The table shows each result beside its target, the worst class first.

    \b
    Examples:
      beamstiff exam --cases 2160 --seed 7 --processes 4 --out results.jsonl --html report.html
      beamstiff exam robot.yaml --plan plan.csv --cases 200
      beamstiff exam --cases 60 --classes null,backlash,hysteresis
      beamstiff exam robot.yaml --crowded --cases 20
      beamstiff exam --crowded --cases 100 --seed 7 --out results.jsonl --json table.json
      beamstiff exam --cases 2160 --scheduler tcp://10.0.0.5:8786 --out results.jsonl
    """
    from beamstiff.errors import OptionError, counted
    from beamstiff.exam.table import by_design
    from beamstiff.functions.examine import check_kept, examine, reports_of
    from beamstiff.report.exam import examination_told, reliability_figure

    if crowded and (figure or html):
        raise OptionError("crowded", "found --figure or --html, which are of single effects, expected --json")
    inputs: list[str | Path] = [] if robot is None else [robot_file(robot)]
    inputs += [] if plan is None else [plan]
    if sets is not None and Path(sets).is_dir():
        inputs += [path for path in Path(sets).iterdir() if path.is_file()]
    kept = {} if out is None else {"--out": out}
    kept |= {f"--reports {Path(path).name}": path for path in reports_of(reports, sets, cases)}
    outputs = Outputs(inputs, seed=seed, elsewhere=kept, figure=figure, html=html)
    check_kept(out, reports, sets, cases)
    with progress("examining", "MofNCompleteColumn", "TimeRemainingColumn", total=cases) as tell:
        found = examine(
            robot,
            plan,
            cases=cases,
            classes=parse_names(classes, "--classes", "null,backlash"),
            sets=sets,
            crowded=crowded,
            compare=compare,
            reports=reports,
            out=out,
            seed=seed,
            processes=processes,
            scheduler=scheduler,
            progress=None if tell is None else lambda _: tell(advance=1),
        )
    if out is not None:
        written(out, f"a line a case, {counted(len(found.records), 'case')}")
    outputs.result(found.notes, examination_told(found), found.to_dict())
    if crowded:
        return
    records = list(found.records)
    outputs.draw("figure", lambda: reliability_figure(by_design(records)[0]))
    examined = robot or sets or "Robots of the exam"
    outputs.page("exam", records, examined, facts=found.to_dict(), plan=plan is not None)
