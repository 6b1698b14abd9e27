"""`beamstiff identify`: joint stiffness from measured displacements."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from beamstiff.cli.data import doubted, read_tables
from beamstiff.cli.group import INTERRUPTED
from beamstiff.cli.identify_options import (
    at_least,
    chosen,
    parse_bounds,
    parse_errors,
    parse_priors,
    parse_ties,
)
from beamstiff.cli.options import (
    DataFiles,
    Debug,
    Html,
    Json,
    Processes,
    Quiet,
    RobotFile,
    Scheduler,
    parse_names,
    robot_file,
)
from beamstiff.cli.output import (
    check_once,
    check_outputs,
    effects_text,
    people,
    say,
    source_of,
    working,
    write_figure,
    write_json,
)
from beamstiff.errors import BeamstiffError
from beamstiff.outputs import write_output

if TYPE_CHECKING:
    from beamstiff.identification.bootstrap import Bootstrap
    from beamstiff.identification.minimise import Effort, Progress
    from beamstiff.identification.problem import Components
    from beamstiff.identification.reduce import Reduced
    from beamstiff.identification.result import Identification
    from beamstiff.identification.statement import Statement
    from beamstiff.robot.description import Robot

USES = ("both", "position", "rotation")


def identify(
    context: typer.Context,
    robot: RobotFile,
    data: DataFiles,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "--parameters",
            metavar="NAME,...",
            help="Stiffness values to identify, such as J12.torsional (a joint's), screw2 (a strut's) or "
            "arm.E (a beam's modulus); default: what the robot lists under `identify`.",
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="NAME",
            help="trust-region, levenberg-marquardt, linear, slsqp, mma, lbfgs, bobyqa; global: isres, crs2, "
            "esch, mlsl, genetic.",
        ),
    ] = "trust-region",
    fix: Annotated[
        list[str] | None,
        typer.Option("--fix", metavar="NAME,...", help="Parameters that stay as they are in the robot."),
    ] = None,
    tie: Annotated[
        list[str] | None,
        typer.Option("--tie", metavar="NAME,NAME,...", help="Parameters that keep their ratio; repeatable."),
    ] = None,
    bound: Annotated[
        list[str] | None,
        typer.Option(
            "--bound",
            metavar="NAME=LOW:HIGH",
            help="Least and largest value, either may be empty; repeatable.",
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(
            "--prior",
            metavar="NAME=VALUE:FACTOR",
            help="Known beforehand, to within a factor at one standard deviation (1.5); repeatable.",
        ),
    ] = None,
    loss: Annotated[
        str,
        typer.Option(
            "--loss", metavar="NAME", help="linear (least squares); against bad rows soft_l1, huber, cauchy."
        ),
    ] = "linear",
    use: Annotated[
        str, typer.Option("--use", metavar="WHAT", help="Readings that count: position, rotation or both.")
    ] = "both",
    input_error: Annotated[
        list[str] | None,
        typer.Option(
            "--input-error",
            metavar="NAME=VALUE,...",
            help="Standard deviations of what the table gives: load (a balance), force, moment (a sensor), "
            "angle, length (joint readings), hold_angle, hold_length (drives that move between the two "
            "readings); they add to the noise.",
        ),
    ] = None,
    folds: Annotated[
        int, typer.Option("--folds", metavar="N", help="Folds of the held-out gap; 0 for none.")
    ] = 5,
    bootstrap: Annotated[
        int,
        typer.Option(
            "--bootstrap", metavar="N", help="Intervals from N fits to poses drawn again; 0 for none."
        ),
    ] = 0,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of all that is drawn at random.")] = 0,
    evaluations: Annotated[
        int, typer.Option("--evaluations", metavar="N", help="At most; mostly of the global methods.")
    ] = 20_000,
    population: Annotated[
        int | None,
        typer.Option("--population", metavar="N", help="Of the global methods; default theirs."),
    ] = None,
    searches: Annotated[
        int,
        typer.Option(
            "--searches", metavar="N", help="Of a global method, with seeds from --seed on; the best counts."
        ),
    ] = 1,
    processes: Processes = 1,
    scheduler: Scheduler = None,
    json: Json = None,
    out: Annotated[
        str | None,
        typer.Option("--out", metavar="FILE", help="Write the robot with the identified stiffness as YAML."),
    ] = None,
    reduce: Annotated[
        str | None,
        typer.Option(
            "--reduce",
            metavar="FILE",
            help="Write the reduced robot as YAML: springs that only act together are one, what cannot be "
            "identified is left out.",
        ),
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure",
            metavar="FILE",
            help="Draw measured against predicted displacements (.png, .svg or .pdf).",
        ),
    ] = None,
    html: Html = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Identify joint stiffness from measured displacements, with uncertainty.

    DATA holds displacements dx dy dz (rx ry rz), loaded minus unloaded, in the base frame; the
    start are the robot's present values. Weighted least squares; rotations count where the table
    says sigma_rotation. The uncertainty is one standard deviation; where the data do not bound a
    stiffness from above, a lower bound is given instead. The held-out gap is that of poses left
    out of the fit. Springs that only act together are named, with the sum that is known of them
    and the measurement that would tell them apart. Ctrl-C ends with the best values so far.

    \b
    Examples:
      beamstiff identify ir663 examples/data/ir663_compliance_xx.csv
      beamstiff identify robot.yaml one.csv two.csv --parameters J1.torsional,J2.torsional \\
          --json found.json --out identified.yaml --figure fit.png
      beamstiff identify robot.yaml data.csv --method genetic --seed 3 --bound J1.radial=1e7:1e10
      beamstiff identify robot.yaml data.csv --method crs2 --searches 8 --processes 4
      beamstiff identify robot.yaml data.csv --loss huber --bootstrap 1000 --reduce small.yaml
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.identification.identify import identify as fit
    from beamstiff.identification.minimise import GLOBAL, METHODS, Effort
    from beamstiff.identification.objective import LOSSES
    from beamstiff.identification.separate import with_separations
    from beamstiff.identification.statement import state_identification
    from beamstiff.measure.rows import concatenate
    from beamstiff.measure.usable import counted_once
    from beamstiff.parallel import check_places
    from beamstiff.report.identification import (
        combinations_text,
        identification_table,
        identification_text,
    )
    from beamstiff.robot.reader import load_robot
    from beamstiff.robot.stiffness import check_stiffness

    chosen("--method", method, list(METHODS))
    chosen("--loss", loss, list(LOSSES))
    chosen("--use", use, USES)
    for option, value, least in (("--folds", folds, 0), ("--bootstrap", bootstrap, 0), ("--seed", seed, 0)):
        at_least(option, value, least)
    if folds == 1:
        raise BeamstiffError("--folds: found 1, expected 2 or more, or 0 for none")
    at_least("--evaluations", evaluations, 1)
    at_least("--population", population, 5)
    at_least("--searches", searches, 1)
    if searches > 1 and method not in GLOBAL:
        raise BeamstiffError(f"--searches: found the method {method}, expected {', '.join(GLOBAL)}")
    description = load_robot(robot)
    check_stiffness(description)
    check_once(data)
    names = parse_names(parameters)
    by_itself: list[str] = []
    if names is None and not description.identify:
        from beamstiff.diagnosis.notes import chosen_for
        from beamstiff.diagnosis.residual.baseline import fitted_names

        names, by_itself = list(fitted_names(description)) or None, list(chosen_for(description))
    what: dict[str, Any] = {
        "parameters": names,
        "fixed": parse_names(fix, "--fix") or [],
        "ties": parse_ties(tie),
        "bounds": parse_bounds(description, bound),
        "priors": parse_priors(description, prior),
        "errors": parse_errors(input_error),
        "loss": loss,
        "components": use,
    }
    check_outputs([robot_file(robot), *data], json, out=out, reduce=reduce, figure=figure, html=html)
    if figure is not None:
        from beamstiff.report.figures import check_format

        check_format(figure)
    source = source_of(context, html, [robot_file(robot), *data], seed)
    if bootstrap or searches > 1:
        check_places(processes, scheduler)
    elif processes > 1 or scheduler is not None:
        say("note: one search is one process: what is spread are --bootstrap and --searches", quiet)
    tables, notes = read_tables(data, description)
    whole, measured = description, counted_once(concatenate(tables))
    if whole.effects:
        from beamstiff.diagnosis.apply import without_effects

        with doubted(notes), working("taking the robot's effects off the readings", quiet):
            description, measured = without_effects(whole, measured)
    effort = Effort(evaluations, seed, population, searches, processes, scheduler)
    with (
        doubted(notes),
        working(f"identifying from {len(measured)} rows", quiet, still=True),
        _bar(evaluations * searches, quiet) as tell,
    ):
        found = fit(description, measured, method=method, folds=folds, effort=effort, progress=tell, **what)
    drawn, stopped = None, found.interrupted
    if not stopped:
        try:
            with working("looking for what would tell more", quiet):
                found = with_separations(found, description, measured, cast("Components", use), seed)
            if bootstrap:
                with working(f"fitting {bootstrap} draws of the poses", quiet):
                    drawn = _draw(
                        state_identification(description, measured, **what), found, bootstrap, effort
                    )
        except KeyboardInterrupt:
            stopped = True  # the values are there, and shown

    found = replace(found, notes=(*notes, *by_itself, *found.notes))
    for note in found.notes:
        say(f"note: {note}", quiet)
    console = people(quiet, json)
    intervals = None if drawn is None else drawn.intervals
    title = f"{description.name}: identified stiffness"
    console.print(identification_table(found, description, title, intervals))
    console.print()
    for line in (*combinations_text(found), identification_text(found, measured, folds), _method(found)):
        console.print(line)
    if whole.effects:
        console.print(f"Beside the robot's effects, as they are: {effects_text(whole.effects)}.")
        found = replace(found, robot=found.robot.model_copy(update={"effects": whole.effects}))
    reduced = None
    if reduce is not None:
        reduced = _reduce(description, measured, found, use)
        reduced = replace(reduced, robot=reduced.robot.model_copy(update={"effects": whole.effects}))
        write_output(reduce, _yaml(reduced.robot, _reduced_head(reduced, found, data)))
    if out is not None:
        write_output(out, _yaml(found.robot, _head(found, data)))
    if figure is not None:
        from beamstiff.report.parity import parity_figure

        write_figure(parity_figure(measured, found.predicted, description.name), figure)
    facts = _facts(found, drawn, reduced)
    if html is not None and source is not None:
        from beamstiff.report.html.identification import identification_html

        write_output(html, identification_html(found, description, measured, source, folds, facts))
    write_json(facts, json)
    if stopped:
        raise typer.Exit(INTERRUPTED)


@contextmanager
def _bar(most: int, quiet: bool) -> Iterator[Progress | None]:
    """Show on stderr how far a search is, if it is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True, quiet=quiet)
    if quiet or not console.is_terminal:
        yield None
        return
    columns = (
        TextColumn("identifying"),
        BarColumn(),
        TextColumn("{task.completed} evaluations, cost {task.fields[cost]:.4g}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("search", total=most, cost=float("inf"))
        yield lambda count, cost: bar.update(task, completed=count, cost=cost)


def _draw(statement: Statement, found: Identification, repetitions: int, effort: Effort) -> Bootstrap:
    """Return the bootstrap about what was found."""
    from beamstiff.identification.bootstrap import bootstrap

    statement = statement.holding(found.stiffness).weighed(found.stiffness)
    return bootstrap(
        statement,
        statement.theta(found.stiffness),
        repetitions,
        effort.seed,
        processes=effort.processes,
        scheduler=effort.scheduler,
    )


def _reduce(robot: Robot, measured: Any, found: Identification, use: str) -> Reduced:
    from beamstiff.identification.degeneracy import find_degeneracy
    from beamstiff.identification.problem import state_problem
    from beamstiff.identification.reduce import reduce_model

    names = [item.name for item in found.parameters]
    problem = state_problem(robot, measured, names, cast("Components", use))
    values = dict(zip(names, found.stiffness.tolist(), strict=True))
    return reduce_model(robot, find_degeneracy(problem), values, names)


def _facts(found: Identification, drawn: Bootstrap | None, reduced: Reduced | None) -> dict[str, Any]:
    import numpy as np

    facts = found.to_dict()
    if drawn is not None:
        facts["bootstrap"] = {
            "repetitions": len(drawn.stiffness),
            "poses": drawn.poses,
            "undetermined": drawn.undetermined,
            "intervals": {
                name: [limit if np.isfinite(limit) else None for limit in ends]
                for name, ends in drawn.intervals.items()
            },
        }
    if reduced is not None:
        facts["reduced"] = {
            "lumped": [
                {
                    "kept": one.kept,
                    "value": one.value,
                    "rigid": _are(one.gone, np.inf),
                    "free": _are(one.gone, 0),
                }
                for one in reduced.lumped
            ],
            "held": list(reduced.held),
        }
    return facts


def _are(gone: Any, value: float) -> list[str]:
    return [name for name, became in gone.items() if became == value]


def _method(found: Identification) -> str:
    from beamstiff.report.tables import counted

    return f"{found.method}, {counted(found.evaluations, 'evaluation')}: {found.message.rstrip('.')}."


def _sources(data: Sequence[str]) -> str:
    # one line: a comment must not end early
    return str(BeamstiffError(", ".join(Path(path).name for path in data)))


def _head(found: Identification, data: Sequence[str]) -> str:
    names = ", ".join(item.name for item in found.parameters)
    head = f"# Stiffness of {names} identified by beamstiff from {_sources(data)}.\n"
    if unbounded := [item.name for item in found.parameters if not item.identifiable]:
        head += f"# Not bounded from above by the data, written as fitted: {', '.join(unbounded)}.\n"
    return head


def _reduced_head(reduced: Reduced, found: Identification, data: Sequence[str]) -> str:
    head = _head(found, data).splitlines(keepends=True)[0]
    head += "# Reduced: under other loads and at other points than those measured it may differ.\n"
    for one in reduced.lumped:
        became = ", ".join(f"{name} {'rigid' if value else 'free'}" for name, value in one.gone.items())
        head += f"# {one.kept} stands for the whole of a group; {became}.\n"
    if reduced.held:
        head += f"# Held, not identifiable: {', '.join(reduced.held)}.\n"
    return head


def _yaml(robot: Robot, head: str) -> str:
    from beamstiff.robot.writer import robot_to_yaml

    return head + robot_to_yaml(robot)
