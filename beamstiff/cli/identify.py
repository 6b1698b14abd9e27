"""`beamstiff identify`: joint stiffness from measured displacements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import typer

from beamstiff.cli.group import INTERRUPTED
from beamstiff.cli.options import Assembly, DataFiles, Html, Processes, RobotFile, Scheduler, flag, option
from beamstiff.cli.output import Outputs, progress, working, write_robot
from beamstiff.cli.parse import (
    file_names,
    parse_bounds,
    parse_errors,
    parse_known,
    parse_names,
    parse_ties,
    robot_file,
    side_of,
)
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from beamstiff.identification.objective import Loss
    from beamstiff.identification.problem import Components
    from beamstiff.identification.reduced_model import Reduced
    from beamstiff.identification.result import Identification

EVALUATED = "{task.completed} evaluations, cost {task.fields[cost]:.4g}"


def identify(
    robot: RobotFile,
    data: DataFiles,
    parameters: list[str] | None = option(
        "NAME,...",
        "Stiffness values to identify, such as J12.torsional (of a joint), screw2 (of a strut) or arm.E "
        "(modulus of a beam); default: what the robot lists under `identify`.",
    ),
    method: str = option(
        "NAME",
        "trust-region, levenberg-marquardt, linear, slsqp, mma, lbfgs, bobyqa; global: isres, crs2, "
        "esch, mlsl, genetic.",
        "trust-region",
    ),
    fix: list[str] | None = option("NAME,...", "Parameters that keep the robot's values."),
    tie: list[str] | None = option("NAME,NAME,...", "Parameters that keep their ratio; repeatable."),
    bound: list[str] | None = option(
        "NAME=LOW:HIGH", "Smallest and largest allowed value; either may be empty; repeatable."
    ),
    prior: list[str] | None = option(
        "NAME=VALUE:FACTOR",
        "Value known beforehand, and the factor (such as 1.5) that is one standard deviation; repeatable.",
    ),
    loss: str = option(
        "NAME", "linear (least squares), or robust against bad rows: soft_l1, huber, cauchy.", "linear"
    ),
    use: str = option("WHAT", "Readings to use: position, rotation or both.", "both"),
    input_error: list[str] | None = option(
        "NAME=VALUE,...",
        "Standard deviations of the inputs: load (of a balance), force, moment (of a sensor), angle, length "
        "(of joint readings), hold_angle, hold_length (of drives that move between the two readings). They "
        "add to the noise.",
    ),
    folds: int = option("N", "Number of cross-validation folds for the held-out gap; 0 for none.", 5),
    bootstrap: int = option(
        "N", "Number of bootstrap fits (to resampled poses) for the intervals; 0 for none.", 0
    ),
    seed: int = option("N", "Seed of the random numbers.", 0),
    evaluations: int = option(
        "N", "Largest number of evaluations; it matters mostly for the global methods.", 20_000
    ),
    population: int | None = option("N", "Population of a global method; default: the method's own."),
    searches: int = option(
        "N", "Number of searches by a global method, with seeds from --seed on; the best is kept.", 1
    ),
    processes: Processes = 1,
    scheduler: Scheduler = None,
    assembly: Assembly = None,
    out: str | None = option(
        "FILE", "Write the robot with the identified stiffness: YAML, or .urdf, .sdf, .xml."
    ),
    model: str | None = option(
        "KIND",
        "Also fit a model of elasticity (fuzzy, grid, gray-box, gaussian-process). --out contains it, and "
        "deflect, map, diagnose, verify and compensate use it.",
    ),
    cube: str | None = option(
        "LENGTH",
        "With --model grid: side length of the cubes, such as 300mm; default: a third of the workspace.",
    ),
    separate: bool = flag(
        "--separate",
        "As published: fit each cube to its own rows only, and give each fuzzy term its own sets.",
    ),
    positions: str | None = option(
        "CSV",
        "With --model grid: absolute positions of the unloaded TCP, to fit kinematic parameters in each "
        "cube.",
    ),
    reduce: str | None = option(
        "FILE",
        "Write the reduced robot as YAML: springs identifiable only in combination become one, springs "
        "that cannot be identified are removed.",
    ),
    pareto: int = option(
        "N", "Number of points on the Pareto front of position error against rotation error; 0 for none.", 0
    ),
    front: str | None = option("FILE", "Draw the Pareto front (.png, .svg or .pdf)."),
    figure: str | None = option(
        "FILE", "Draw the residuals before and after over load and posture (.png, .svg or .pdf)."
    ),
    html: Html = None,
) -> None:
    """Identify joint stiffness from measured displacements.

    DATA holds displacements dx dy dz (rx ry rz), loaded minus unloaded, in the base frame. The
    fit is weighted least squares and starts at the robot's present values. Rotations are used if the
    table states sigma_rotation. The uncertainty is one standard deviation; a stiffness that the data
    do not bound from above gets a lower bound instead. Springs that are identifiable only in
    combination are listed with their known sum and the measurement that distinguishes them. Ctrl-C
    stops and keeps the best values so far.

    \b
    Examples:
      beamstiff identify ir663 examples/data/ir663_compliance_xx.csv
      beamstiff identify robot.yaml one.csv two.csv --parameters J1.torsional,J2.torsional \\
          --json found.json --out identified.yaml --figure fit.png
      beamstiff identify kr500 data.csv --model grid --cube 300mm --out gridded.yaml
      beamstiff identify robot.yaml data.csv --pareto 11 --front front.png
      beamstiff identify robot.yaml data.csv --method genetic --seed 3 --bound J1.radial=1e7:1e10
      beamstiff identify robot.yaml data.csv --method crs2 --searches 8 --processes 4
      beamstiff identify robot.yaml data.csv --loss huber --bootstrap 1000 --reduce small.yaml
    """
    from beamstiff.functions.checks import whole
    from beamstiff.functions.identify import identify as run
    from beamstiff.functions.robots import as_robot
    from beamstiff.measure.coerce import as_tables
    from beamstiff.report.identification import identification_told
    from beamstiff.report.residuals import front_figure, residual_figure

    whole("evaluations", evaluations, 1)  # before the bar counts them
    if front is not None and not pareto:
        raise BeamstiffError("--front: found no points to draw, expected --pareto N")
    machine = as_robot(robot, assembly=assembly)
    said: dict[str, Any] = {
        "parameters": parse_names(parameters),
        "fixed": parse_names(fix, "--fix") or [],
        "ties": parse_ties(tie),
        "bounds": parse_bounds(machine, bound),
        "priors": parse_known(machine, prior),
        "errors": parse_errors(input_error),
    }
    file = robot_file(robot)
    wanted: dict[str, Any] = {"out": out, "reduce": reduce, "figure": figure, "front": front, "html": html}
    outputs = Outputs([file, *data, *([positions] if positions else [])], seed=seed, **wanted)
    most = evaluations * searches
    with (
        working("identifying", still=True),
        progress("identifying", EVALUATED, "TimeElapsedColumn", total=most, cost=float("inf")) as bar,
    ):
        found = run(
            machine,
            as_tables(data, machine),
            method=method,
            loss=cast("Loss", loss),
            components=cast("Components", use),
            folds=folds,
            bootstrap=bootstrap,
            reduce=reduce is not None,
            seed=seed,
            evaluations=evaluations,
            population=population,
            searches=searches,
            processes=processes,
            scheduler=scheduler,
            model=model,
            cube=side_of(cube),
            separate=separate,
            positions=positions,
            pareto=pareto,
            progress=None if bar is None else lambda count, cost: bar(completed=count, cost=cost),
            **said,
        )
    fitted = found.rows
    assert fitted is not None
    outputs.result(found.notes, identification_told(found, folds, [robot, *data]), found.to_dict())
    if out is not None:
        write_robot(out, found.robot, file, found.conditional_std, _head(found, data))
    if reduce is not None and found.reduced is not None:
        head = _reduced_head(found.reduced, found, data)
        write_robot(reduce, found.reduced.robot, file, {}, head)
    outputs.draw("figure", lambda: residual_figure(found, fitted, machine.name))
    if (points := found.front) is not None:
        outputs.draw("front", lambda: front_figure(points, machine.name))
    outputs.page("identification", found, machine, fitted, folds=folds, files=[robot, *data])
    if found.interrupted:
        raise typer.Exit(INTERRUPTED)


def _head(found: Identification, data: Sequence[str]) -> str:
    names = ", ".join(item.name for item in found.parameters)
    head = f"# Stiffness of {names} identified by beamstiff from {file_names(data)}.\n"
    if unbounded := [item.name for item in found.parameters if not (item.identifiable or item.silent)]:
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
